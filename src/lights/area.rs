//! `area`: emissive triangles with cosine emission. Photons leave them uniformly over their area;
//! for a point, triangles that face it are sampled.

use std::f64::consts::PI;

use super::facets::{FEWEST, Facet, Facets};
use super::parallelogram::{Face, Parallelogram};
use super::{
    EmissionMap, EmissionOrigin, LiSample, Light, LightDesc, LightEntry, surface_importance,
};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::{Aabb, BoundingSphere, DVec3, Frame, max_abs, robust};
use crate::sampling::{Discrete, warp};

struct Triangle {
    v0: DVec3,
    e1: DVec3,
    e2: DVec3,
    ng: DVec3,
    offset: f64,
}

struct AreaLight {
    radiance: Rgb,
    double_sided: bool,
    triangles: Vec<Triangle>,
    /// In proportion to area, or to flux where a map varies it.
    choose: Discrete,
    /// The two triangles in one, if they are the halves of a parallelogram of even radiance: the
    /// commonest lamp, whose points need no choice and are stratified as a whole.
    panel: Option<Parallelogram>,
    /// For the light that arrives at a point, if there are many.
    facets: Option<Facets>,
    areas: Vec<f64>,
    area: f64,
    /// Density in area of uniform points, 1/m².
    pdf_area: f64,
    map: Option<Mapped>,
    around: BoundingSphere,
    /// Luminance of the flux of one side.
    flux: f64,
}

/// What a light with a map needs beside it.
struct Mapped {
    map: EmissionMap,
    /// Density in area of points on each triangle, 1/m².
    pdf_area: Vec<f64>,
    /// Mean of the map over the surface.
    mean: Rgb,
}

/// A point on the light.
struct Point<'a> {
    triangle: &'a Triangle,
    p: DVec3,
    radiance: Rgb,
    pdf_area: f64,
}

impl AreaLight {
    /// A random point.
    #[inline]
    fn point(&self, u: [f64; 2]) -> Option<Point<'_>> {
        let (i, _, rest) = self.choose.sample(u[0])?;
        Some(self.point_on(i, self.pdf_area(i), [rest, u[1]]))
    }

    /// A random point for the light that arrives at `p`.
    fn point_for(&self, p: DVec3, u: [f64; 2]) -> Option<Point<'_>> {
        let Some(facets) = &self.facets else {
            return self.point(u);
        };
        let (i, pdf, rest) = facets.sample(p, u[0])?;
        Some(self.point_on(i, pdf / self.areas[i], [rest, u[1]]))
    }

    /// A random point of triangle `i`; `pdf_area` is what makes its density.
    #[inline]
    fn point_on(&self, i: usize, pdf_area: f64, u: [f64; 2]) -> Point<'_> {
        let triangle = &self.triangles[i];
        let b = warp::triangle(u);
        Point {
            triangle,
            p: triangle.v0 + triangle.e1 * b[0] + triangle.e2 * b[1],
            radiance: match &self.map {
                None => self.radiance,
                Some(m) => self.radiance * m.map.at(i as u32, b),
            },
            pdf_area,
        }
    }

    /// Density in area of points on triangle `i`, 1/m².
    #[inline]
    fn pdf_area(&self, i: usize) -> f64 {
        match &self.map {
            None => self.pdf_area,
            Some(m) => m.pdf_area[i],
        }
    }
}

impl Light for AreaLight {
    fn power(&self) -> Rgb {
        let sides = if self.double_sided { 2.0 } else { 1.0 };
        let mean = self.map.as_ref().map_or(Rgb::ONE, |m| m.mean);
        self.radiance * mean * (PI * self.area * sides)
    }

    fn importance(&self, p: DVec3) -> f64 {
        surface_importance(self.flux, &self.around, p)
    }

    fn sample_li(&self, p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        if let Some(panel) = &self.panel {
            return panel.sample_li(p, u);
        }
        let on = self.point_for(p, u)?;
        let face = Face {
            ng: on.triangle.ng,
            offset: on.triangle.offset,
            radiance: on.radiance,
            pdf_area: on.pdf_area,
            double_sided: self.double_sided,
        };
        face.li(p, on.p)
    }

    fn parallelogram(&self) -> Option<Parallelogram> {
        self.panel
    }

    #[inline]
    fn pdf_li(&self, p: DVec3, on: &SurfacePoint) -> f64 {
        let cos = on.wo.dot(on.ng).abs();
        if cos == 0.0 {
            return 0.0;
        }
        let i = on.prim as usize;
        let pdf_area = match &self.facets {
            None => self.pdf_area(i),
            Some(facets) => facets.probability(p, i) / self.areas[i],
        };
        (on.p - p).length_squared() * pdf_area / cos
    }

    #[inline]
    fn radiance(&self, on: &Surface<'_>) -> Rgb {
        if !on.sp.front && !self.double_sided {
            return Rgb::ZERO;
        }
        match self.map.as_ref().and_then(|m| m.map.texture.as_ref()) {
            None => self.radiance,
            // What alpha takes away the ray did not hit.
            Some(texture) => {
                let [r, g, b, _] = texture.sample(on);
                self.radiance * Rgb::new(r, g, b)
            }
        }
    }

    #[inline]
    fn sample_origin(&self, u: [f64; 2]) -> Option<EmissionOrigin> {
        let on = self.point(u)?;
        Some(EmissionOrigin {
            p: on.p,
            ng: Some(on.triangle.ng),
            offset: on.triangle.offset,
            pdf_area: on.pdf_area,
            radiance: on.radiance,
        })
    }

    #[inline]
    fn sample_direction(&self, from: &EmissionOrigin, mut u: [f64; 2]) -> (DVec3, f64) {
        let mut n = from.ng.unwrap_or(DVec3::Z);
        let mut share = 1.0;
        if self.double_sided {
            share = 0.5;
            if u[0] < 0.5 {
                u[0] *= 2.0;
            } else {
                u[0] = 2.0 * u[0] - 1.0;
                n = -n;
            }
        }
        let local = warp::cosine_hemisphere(u);
        let dir = Frame::from_normal(n).to_world(local);
        (dir, warp::cosine_hemisphere_pdf(local.z) * share)
    }

    #[inline]
    fn emitted(&self, from: &EmissionOrigin, dir: DVec3) -> Rgb {
        let cos = from.ng.map_or(0.0, |n| n.dot(dir));
        if cos <= 0.0 && !self.double_sided {
            return Rgb::ZERO;
        }
        from.radiance * cos.abs()
    }
}

/// Points at which a map is looked up in all, to tell triangles apart.
const PROBES: usize = 1 << 14;

/// Least density of points on a triangle, over that of uniform points: the probes may have
/// missed what is bright.
const LEAST_DENSITY: f64 = 0.1;

/// Mean of the map over each triangle, by points on a lattice.
fn means(map: &EmissionMap, triangles: usize) -> Vec<Rgb> {
    let side = ((PROBES / triangles.max(1)) as f64).sqrt().clamp(2.0, 32.0) as u32;
    let x = |i: u32| (f64::from(i) + 0.5) / f64::from(side);
    (0..triangles as u32)
        .map(|prim| {
            let sum: Rgb = (0..side)
                .flat_map(|i| (0..side).map(move |j| [x(i), x(j)]))
                .map(|u| map.at(prim, warp::triangle(u)))
                .sum();
            sum / f64::from(side * side)
        })
        .collect()
}

/// The parallelogram that two triangles with a common edge make, if they do up to a fraction of
/// the offset of shadow rays: its first corner and its edges.
fn parallelogram(triangles: &[Triangle], corners: &[[DVec3; 3]]) -> Option<[DVec3; 3]> {
    let ([a, b], [p, q]) = (triangles, corners) else {
        return None;
    };
    let slack = 0.25 * a.offset.min(b.offset);
    let near = |x: DVec3, y: DVec3| (x - y).length() <= slack;
    (0..3).find_map(|i| {
        // The edge that the halves share lies opposite corner `i`.
        let (v0, v1, v2) = (p[i], p[(i + 1) % 3], p[(i + 2) % 3]);
        let shared = |c: &&DVec3| near(**c, v1) || near(**c, v2);
        let far = q.iter().find(|c| !shared(c))?;
        let whole = q.iter().filter(shared).count() == 2 && near(*far, v1 + v2 - v0);
        (whole && a.ng.dot(b.ng) > 0.0).then(|| [v0, v1 - v0, v2 - v0])
    })
}

fn build(d: &LightDesc) -> Result<Box<dyn Light>, String> {
    let mut areas = Vec::with_capacity(d.triangles.len());
    let triangles: Vec<Triangle> = d
        .triangles
        .iter()
        .map(|&[a, b, c]| {
            let (e1, e2) = (b - a, c - a);
            let cross = e1.cross(e2);
            areas.push(0.5 * cross.length());
            let far = max_abs(a).max(max_abs(b)).max(max_abs(c));
            Triangle {
                v0: a,
                e1,
                e2,
                ng: cross.normalize_or_zero(),
                offset: robust::spawn_offset(far),
            }
        })
        .collect();
    let area: f64 = areas.iter().sum();
    if !(area > 0.0) {
        return Err("its triangles have no area".into());
    }
    let mut choose = Discrete::new(areas.iter().copied());
    let map = d.map.as_ref().map(|map| {
        let means = means(map, triangles.len());
        let mean: Rgb = means.iter().zip(&areas).map(|(m, a)| *m * *a).sum::<Rgb>() / area;
        let flux = means.iter().zip(&areas).map(|(m, a)| m.luminance() * a);
        let bright = Discrete::new(flux);
        let weight = |i: usize| {
            let uniform = areas[i] / area;
            if bright.is_empty() {
                uniform
            } else {
                LEAST_DENSITY * uniform + (1.0 - LEAST_DENSITY) * bright.probability(i)
            }
        };
        choose = Discrete::new((0..areas.len()).map(weight));
        let pdf_area = (0..areas.len())
            .map(|i| {
                if areas[i] > 0.0 {
                    choose.probability(i) / areas[i]
                } else {
                    0.0
                }
            })
            .collect();
        Mapped {
            map: map.clone(),
            pdf_area,
            mean,
        }
    });
    let facets = (triangles.len() >= FEWEST).then(|| {
        let facet = |(i, corners): (usize, &[DVec3; 3])| {
            let mut bounds = Aabb::EMPTY;
            corners.iter().for_each(|&p| bounds.grow(p));
            Facet {
                around: bounds.bounding_sphere(),
                ng: triangles[i].ng,
                flux: choose.probability(i),
            }
        };
        let facets: Vec<Facet> = d.triangles.iter().enumerate().map(facet).collect();
        Facets::new(&facets, d.double_sided)
    });
    let panel = parallelogram(&triangles, &d.triangles)
        .filter(|_| map.is_none())
        .map(|[v0, e1, e2]| Parallelogram {
            v0,
            e1,
            e2,
            face: Face {
                ng: triangles[0].ng,
                offset: triangles[0].offset.max(triangles[1].offset),
                radiance: d.strength,
                pdf_area: 1.0 / area,
                double_sided: d.double_sided,
            },
        });
    let mut around = Aabb::EMPTY;
    for p in d.triangles.iter().flatten() {
        around.grow(*p);
    }
    let mean = map.as_ref().map_or(Rgb::ONE, |m: &Mapped| m.mean);
    Ok(Box::new(AreaLight {
        around: around.bounding_sphere(),
        flux: (d.strength * mean).luminance() * PI * area,
        radiance: d.strength,
        double_sided: d.double_sided,
        triangles,
        choose,
        panel,
        facets,
        areas,
        area,
        pdf_area: 1.0 / area,
        map,
    }))
}

/// The registry's line.
pub(super) const ENTRY: LightEntry = LightEntry {
    name: "area",
    doc: "emissive triangles, uniform over their area, with cosine emission",
    build,
};

#[cfg(test)]
mod tests {
    use super::*;

    fn light(triangles: [[DVec3; 3]; 2]) -> Box<dyn Light> {
        let built = build(&LightDesc {
            strength: Rgb::ONE,
            triangles: triangles.to_vec(),
            ..LightDesc::default()
        });
        built.expect("an area")
    }

    #[test]
    fn two_halves_of_a_parallelogram_are_one_however_they_are_listed() {
        let (o, e1, e2) = (
            DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(0.5, 0.1, 0.0),
            DVec3::new(0.2, 0.0, 0.7),
        );
        let [a, b, c, d] = [o, o + e1, o + e1 + e2, o + e2];
        let turned = |t: [DVec3; 3], by: usize| [t[by % 3], t[(by + 1) % 3], t[(by + 2) % 3]];
        for k in 0..9 {
            let whole = light([turned([a, b, c], k % 3), turned([a, c, d], k / 3)]);
            let q = whole.parallelogram().expect("a parallelogram");
            // The same density as the surface has, and points all over it.
            let from = DVec3::new(1.3, 3.0, 3.2);
            let mut mean = DVec3::ZERO;
            for i in 0..64 {
                let u = [
                    (f64::from(i % 8) + 0.5) / 8.0,
                    (f64::from(i / 8) + 0.5) / 8.0,
                ];
                let seen = from + DVec3::Y * if q.face.ng.y > 0.0 { 0.0 } else { -3.0 };
                let s = whole.sample_li(seen, u).expect("in front");
                let on = s.target.expect("near") - q.face.ng * q.face.offset;
                let cos = s.wi.dot(q.face.ng).abs();
                let pdf = (on - seen).length_squared() / (cos * e1.cross(e2).length());
                assert!((s.pdf / pdf - 1.0).abs() < 1e-6);
                mean += on / 64.0;
            }
            assert!((mean - (o + (e1 + e2) * 0.5)).length() < 1e-6);
        }
        // A kite, two that are folded, and two that face apart are none.
        let far = c + e2 * 0.01;
        assert!(light([[a, b, far], [a, far, d]]).parallelogram().is_none());
        let up = c + e1.cross(e2) * 1e-3;
        assert!(light([[a, b, up], [a, up, d]]).parallelogram().is_none());
        assert!(light([[a, b, c], [a, d, c]]).parallelogram().is_none());
    }
}
