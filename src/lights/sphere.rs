//! `sphere`: emissive spheres, sampled by the cone they fill.

use std::f64::consts::PI;

use super::{EmissionOrigin, LiSample, Light, LightDesc, LightEntry, surface_importance};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::{Aabb, BoundingSphere, DVec3, Frame, max_abs, robust};
use crate::sampling::{Discrete, warp};

struct SphereLight {
    radiance: Rgb,
    spheres: Vec<BoundingSphere>,
    choose: Discrete,
    around: BoundingSphere,
}

/// `1 − cos θ_max` of the cone that `s` fills seen from outside at squared distance `d2`.
#[inline]
fn cone_complement(s: &BoundingSphere, d2: f64) -> f64 {
    let sin2 = s.radius * s.radius / d2;
    // sin² / (1 + cos) does not cancel for a far sphere.
    sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())
}

impl SphereLight {
    fn offset(s: &BoundingSphere) -> f64 {
        robust::spawn_offset(max_abs(s.center) + s.radius)
    }

    /// Density of [`Light::sample_li`] once sphere `s` is chosen, for `cos` at the light.
    #[inline]
    fn pdf_on(s: &BoundingSphere, p: DVec3, q: DVec3, cos: f64) -> f64 {
        let d2 = (s.center - p).length_squared();
        if d2 > s.radius * s.radius * (1.0 + 1e-9) {
            return warp::cone_pdf(cone_complement(s, d2));
        }
        let area = 4.0 * PI * s.radius * s.radius;
        if cos == 0.0 {
            0.0
        } else {
            (q - p).length_squared() / (cos.abs() * area)
        }
    }
}

impl Light for SphereLight {
    fn power(&self) -> Rgb {
        self.radiance * (PI * self.choose.total())
    }

    fn importance(&self, p: DVec3) -> f64 {
        surface_importance(self.power().luminance(), &self.around, p)
    }

    fn sample_li(&self, p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        let (i, p_choose, rest) = self.choose.sample(u[0])?;
        let s = &self.spheres[i];
        let u = [rest, u[1]];
        let to_center = s.center - p;
        let d2 = to_center.length_squared();
        let r2 = s.radius * s.radius;
        let n = if d2 > r2 * (1.0 + 1e-9) {
            // Uniform in the cone; the point is where the direction first meets the sphere.
            let dist = d2.sqrt();
            let local = warp::cone_from_complement(u, cone_complement(s, d2));
            let sin2 = 1.0 - local.z * local.z;
            let along = dist * local.z - (r2 - d2 * sin2).max(0.0).sqrt();
            let wi = Frame::from_normal(to_center / dist).to_world(local);
            (p + wi * along - s.center).try_normalize()?
        } else {
            warp::sphere(u)
        };
        let q = s.center + n * s.radius;
        let to = q - p;
        let wi = to.try_normalize()?;
        let cos = -wi.dot(n);
        if cos <= 0.0 {
            // Seen from inside the light's back: a sphere emits outward only.
            return None;
        }
        Some(LiSample {
            wi,
            target: Some(q + n * Self::offset(s)),
            radiance: self.radiance,
            pdf: Self::pdf_on(s, p, q, cos) * p_choose,
            delta: false,
        })
    }

    fn pdf_li(&self, p: DVec3, on: &SurfacePoint) -> f64 {
        let i = on.prim as usize;
        let Some(s) = self.spheres.get(i) else {
            return 0.0;
        };
        Self::pdf_on(s, p, on.p, on.wo.dot(on.ng)) * self.choose.probability(i)
    }

    fn radiance(&self, on: &Surface<'_>) -> Rgb {
        if on.sp.front {
            self.radiance
        } else {
            Rgb::ZERO
        }
    }

    fn sample_origin(&self, u: [f64; 2]) -> Option<EmissionOrigin> {
        let (i, _, rest) = self.choose.sample(u[0])?;
        let s = &self.spheres[i];
        let n = warp::sphere([rest, u[1]]);
        Some(EmissionOrigin {
            p: s.center + n * s.radius,
            ng: Some(n),
            offset: Self::offset(s),
            pdf_area: 1.0 / self.choose.total(),
            radiance: self.radiance,
        })
    }

    fn sample_direction(&self, from: &EmissionOrigin, u: [f64; 2]) -> (DVec3, f64) {
        let local = warp::cosine_hemisphere(u);
        let frame = Frame::from_normal(from.ng.unwrap_or(DVec3::Z));
        (frame.to_world(local), warp::cosine_hemisphere_pdf(local.z))
    }

    fn emitted(&self, from: &EmissionOrigin, dir: DVec3) -> Rgb {
        self.radiance * from.ng.map_or(0.0, |n| n.dot(dir)).max(0.0)
    }
}

fn build(d: &LightDesc) -> Result<Box<dyn Light>, String> {
    let choose = Discrete::new(d.spheres.iter().map(|s| 4.0 * PI * s.radius * s.radius));
    if choose.is_empty() {
        return Err("its spheres have no area".into());
    }
    let mut around = Aabb::EMPTY;
    for s in &d.spheres {
        around = around.union(Aabb {
            min: s.center - s.radius,
            max: s.center + s.radius,
        });
    }
    Ok(Box::new(SphereLight {
        around: around.bounding_sphere(),
        radiance: d.strength,
        spheres: d.spheres.clone(),
        choose,
    }))
}

/// The registry's line.
pub(super) const ENTRY: LightEntry = LightEntry {
    name: "sphere",
    doc: "emissive spheres, sampled by the cone they fill",
    build,
};
