//! Point and spot lights with a radius: glowing balls that nothing can hit. Rays and photons pass
//! through them, as they do in Cycles.

use std::f64::consts::PI;

use super::spot::Cone;
use super::{Crossing, EmissionOrigin, LiSample, Light, LightDesc, range_window};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::{BoundingSphere, DVec3, Frame};
use crate::sampling::warp;

pub(super) struct Ball {
    sphere: BoundingSphere,
    /// On the axis.
    radiance: Rgb,
    /// W/sr, on the axis, from afar.
    intensity: Rgb,
    /// Of a spot.
    cone: Option<Cone>,
    range: f64,
    seen_by_camera: bool,
}

impl Ball {
    /// The ball that has the intensity of the point or spot `d`, if `d` has a radius.
    pub(super) fn new(d: &LightDesc, cone: Option<Cone>) -> Result<Self, String> {
        let area = PI * d.radius * d.radius;
        let radiance = d.strength / area;
        if !(area > 0.0 && area.is_finite() && radiance.max_channel().is_finite()) {
            return Err(format!("its radius {} is not a usable length", d.radius));
        }
        Ok(Self {
            sphere: BoundingSphere {
                center: d.position,
                radius: d.radius,
            },
            radiance,
            intensity: d.strength,
            cone,
            range: d.range,
            seen_by_camera: d.seen_by_camera,
        })
    }

    /// Radiance that leaves along `dir` and has gone `distance`.
    fn toward(&self, dir: DVec3, distance: f64) -> Rgb {
        let share = self.cone.as_ref().map_or(1.0, |c| c.falloff(dir));
        self.radiance * (share * range_window(distance, self.range))
    }

    /// `1 − cos` of the half angle under which `p` sees it; `None` from within.
    fn complement(&self, d2: f64) -> Option<f64> {
        let r2 = self.sphere.radius * self.sphere.radius;
        if !(d2 > r2 * (1.0 + 1e-9)) {
            return None;
        }
        let sin2 = r2 / d2;
        // sin² / (1 + cos) does not cancel for a far ball.
        Some(sin2 / (1.0 + (1.0 - sin2).sqrt()))
    }
}

impl Light for Ball {
    fn power(&self) -> Rgb {
        // ∫∫ L cos dA dω: every direction sees the disc π r².
        let solid_angle = self.cone.as_ref().map_or(4.0 * PI, Cone::integral);
        self.intensity * solid_angle
    }

    fn importance(&self, p: DVec3) -> f64 {
        let r2 = self.sphere.radius * self.sphere.radius;
        self.intensity.luminance() / (p - self.sphere.center).length_squared().max(r2)
    }

    fn sample_li(&self, p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        let to = self.sphere.center - p;
        let d2 = to.length_squared();
        // Seen from within it is dark: it shines outward.
        let complement = self.complement(d2)?;
        let distance = d2.sqrt();
        let local = warp::cone_from_complement(u, complement);
        let wi = Frame::from_normal(to / distance).to_world(local);
        let sin2 = 1.0 - local.z * local.z;
        let half = (self.sphere.radius * self.sphere.radius - d2 * sin2)
            .max(0.0)
            .sqrt();
        let along = (distance * local.z - half).max(0.0);
        let radiance = self.toward(-wi, along);
        if radiance.is_black() {
            return None;
        }
        Some(LiSample {
            wi,
            target: Some(p + wi * along),
            radiance,
            pdf: warp::cone_pdf(complement),
            delta: false,
        })
    }

    fn pdf_li(&self, _p: DVec3, _on: &SurfacePoint) -> f64 {
        0.0
    }

    fn range(&self) -> f64 {
        self.range
    }

    fn radiance(&self, _on: &Surface<'_>) -> Rgb {
        Rgb::ZERO
    }

    fn is_bodiless(&self) -> bool {
        true
    }

    fn seen_by_camera(&self) -> bool {
        self.seen_by_camera
    }

    fn crossed(&self, from: DVec3, dir: DVec3, reach: f64) -> Option<Crossing> {
        let to = self.sphere.center - from;
        let complement = self.complement(to.length_squared())?;
        let middle = to.dot(dir);
        // The distance from the line, not a difference of squares: a far ball keeps its rim.
        let off = (to - dir * middle).length_squared();
        let half = self.sphere.radius * self.sphere.radius - off;
        if middle <= 0.0 || half <= 0.0 {
            return None;
        }
        let along = middle - half.sqrt();
        (along < reach).then(|| Crossing {
            radiance: self.toward(-dir, along),
            pdf: warp::cone_pdf(complement),
        })
    }

    fn sample_origin(&self, u: [f64; 2]) -> Option<EmissionOrigin> {
        let n = warp::sphere(u);
        let r = self.sphere.radius;
        Some(EmissionOrigin {
            p: self.sphere.center + n * r,
            ng: Some(n),
            offset: 0.0,
            pdf_area: 1.0 / (4.0 * PI * r * r),
            radiance: self.radiance,
        })
    }

    fn sample_direction(&self, from: &EmissionOrigin, u: [f64; 2]) -> (DVec3, f64) {
        match &self.cone {
            // A narrow cone would rarely be met from the hemisphere of a point.
            Some(cone) => cone.sample(u),
            None => {
                let local = warp::cosine_hemisphere(u);
                let frame = Frame::from_normal(from.ng.unwrap_or(DVec3::Z));
                (frame.to_world(local), warp::cosine_hemisphere_pdf(local.z))
            }
        }
    }

    fn emitted(&self, from: &EmissionOrigin, dir: DVec3) -> Rgb {
        let cos = from.ng.map_or(0.0, |n| n.dot(dir)).max(0.0);
        let share = self.cone.as_ref().map_or(1.0, |c| c.falloff(dir));
        self.radiance * (cos * share)
    }
}
