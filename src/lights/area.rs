//! `area`: emissive triangles with cosine emission. Photons leave them uniformly over their area;
//! for a point, triangles that face it are sampled.

use std::f64::consts::PI;

use super::facets::{FEWEST, Facet, Facets};
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
    #[inline(always)]
    fn point(&self, u: [f64; 2]) -> Option<Point<'_>> {
        let (i, _, rest) = self.choose.sample(u[0])?;
        Some(self.point_on(i, self.pdf_area(i), [rest, u[1]]))
    }

    /// A random point for the light that arrives at `p`.
    #[inline(always)]
    fn point_for(&self, p: DVec3, u: [f64; 2]) -> Option<Point<'_>> {
        let Some(facets) = &self.facets else {
            return self.point(u);
        };
        let (i, pdf, rest) = facets.sample(p, u[0])?;
        Some(self.point_on(i, pdf / self.areas[i], [rest, u[1]]))
    }

    /// A random point of triangle `i`; `pdf_area` is what makes its density.
    #[inline(always)]
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

    #[inline]
    fn sample_li(&self, p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        let on = self.point_for(p, u)?;
        let to = on.p - p;
        let d2 = to.length_squared();
        if !(d2 >= f64::MIN_POSITIVE) {
            return None;
        }
        let (d, ng) = (d2.sqrt(), on.triangle.ng);
        // The division does not wait for the root,
        let wi = to * (d * (1.0 / d2));
        // nor does the cosine times the distance.
        let cos = -to.dot(ng);
        if cos == 0.0 || (cos < 0.0 && !self.double_sided) {
            return None;
        }
        Some(LiSample {
            wi,
            target: Some(on.p + ng * on.triangle.offset.copysign(cos)),
            radiance: on.radiance,
            pdf: d * (d2 * on.pdf_area / cos.abs()),
            delta: false,
        })
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
