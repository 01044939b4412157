//! `area`: emissive triangles, uniform over their area, with cosine emission.

use std::f64::consts::PI;

use super::{EmissionOrigin, LiSample, Light, LightDesc, LightEntry};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::{DVec3, Frame, max_abs, robust};
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
    choose: Discrete,
}

impl AreaLight {
    #[inline]
    fn area(&self) -> f64 {
        self.choose.total()
    }

    /// A uniform point over all triangles.
    #[inline]
    fn point(&self, u: [f64; 2]) -> Option<(&Triangle, DVec3)> {
        let (i, _, rest) = self.choose.sample(u[0])?;
        let tri = &self.triangles[i];
        let [b1, b2] = warp::triangle([rest, u[1]]);
        Some((tri, tri.v0 + tri.e1 * b1 + tri.e2 * b2))
    }
}

impl Light for AreaLight {
    fn power(&self) -> Rgb {
        let sides = if self.double_sided { 2.0 } else { 1.0 };
        self.radiance * (PI * self.area() * sides)
    }

    #[inline]
    fn sample_li(&self, p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        let (tri, q) = self.point(u)?;
        let to = q - p;
        let d2 = to.length_squared();
        if !(d2 > 0.0) {
            return None;
        }
        let wi = to * (1.0 / d2.sqrt());
        let cos = -wi.dot(tri.ng);
        if cos == 0.0 || (cos < 0.0 && !self.double_sided) {
            return None;
        }
        Some(LiSample {
            wi,
            target: Some(q + tri.ng * tri.offset.copysign(cos)),
            radiance: self.radiance,
            pdf: d2 / (cos.abs() * self.area()),
            delta: false,
        })
    }

    #[inline]
    fn pdf_li(&self, p: DVec3, on: &SurfacePoint) -> f64 {
        let cos = on.wo.dot(on.ng).abs();
        if cos == 0.0 {
            return 0.0;
        }
        (on.p - p).length_squared() / (cos * self.area())
    }

    #[inline]
    fn radiance(&self, on: &Surface<'_>) -> Rgb {
        if on.sp.front || self.double_sided {
            self.radiance
        } else {
            Rgb::ZERO
        }
    }

    #[inline]
    fn sample_origin(&self, u: [f64; 2]) -> Option<EmissionOrigin> {
        let (tri, p) = self.point(u)?;
        Some(EmissionOrigin {
            p,
            ng: Some(tri.ng),
            offset: tri.offset,
            pdf_area: 1.0 / self.area(),
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
        self.radiance * cos.abs()
    }
}

fn build(d: &LightDesc) -> Result<Box<dyn Light>, String> {
    let mut areas = Vec::with_capacity(d.triangles.len());
    let triangles = d
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
                offset: robust::spawn_offset(DVec3::ZERO, far),
            }
        })
        .collect();
    let choose = Discrete::new(areas);
    if choose.is_empty() {
        return Err("its triangles have no area".into());
    }
    Ok(Box::new(AreaLight {
        radiance: d.strength,
        double_sided: d.double_sided,
        triangles,
        choose,
    }))
}

/// The registry's line.
pub(super) const ENTRY: LightEntry = LightEntry {
    name: "area",
    doc: "emissive triangles, uniform over their area, with cosine emission",
    build,
};
