//! `point`: the same intensity in every direction; with a radius, a ball.

use std::f64::consts::PI;

use super::ball::Ball;
use super::{EmissionOrigin, LiSample, Light, LightEntry, range_window};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::DVec3;
use crate::sampling::warp;

struct PointLight {
    position: DVec3,
    intensity: Rgb,
    range: f64,
}

/// The direct sample of a light without extent of the given intensity toward `p`.
pub(super) fn sample_point(
    position: DVec3,
    p: DVec3,
    intensity: Rgb,
    range: f64,
) -> Option<LiSample> {
    let to = position - p;
    let d2 = to.length_squared();
    if !(d2 > 0.0) || intensity.is_black() {
        return None;
    }
    let d = d2.sqrt();
    Some(LiSample {
        wi: to / d,
        target: Some(position),
        radiance: intensity * (range_window(d, range) / d2),
        pdf: 1.0,
        delta: true,
    })
}

/// The origin of photons of a light without extent.
pub(super) fn point_origin(p: DVec3) -> EmissionOrigin {
    EmissionOrigin {
        p,
        ng: None,
        offset: 0.0,
        pdf_area: 1.0,
        radiance: Rgb::ZERO,
    }
}

impl Light for PointLight {
    fn power(&self) -> Rgb {
        self.intensity * (4.0 * PI)
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn importance(&self, p: DVec3) -> f64 {
        self.intensity.luminance() / (p - self.position).length_squared()
    }

    fn sample_li(&self, p: DVec3, _u: [f64; 2]) -> Option<LiSample> {
        sample_point(self.position, p, self.intensity, self.range)
    }

    fn range(&self) -> f64 {
        self.range
    }

    fn pdf_li(&self, _p: DVec3, _on: &SurfacePoint) -> f64 {
        0.0
    }

    fn radiance(&self, _on: &Surface<'_>) -> Rgb {
        Rgb::ZERO
    }

    fn sample_origin(&self, _u: [f64; 2]) -> Option<EmissionOrigin> {
        Some(point_origin(self.position))
    }

    fn sample_direction(&self, _from: &EmissionOrigin, u: [f64; 2]) -> (DVec3, f64) {
        (warp::sphere(u), 1.0 / (4.0 * PI))
    }

    fn emitted(&self, _from: &EmissionOrigin, _dir: DVec3) -> Rgb {
        self.intensity
    }
}

/// The registry's line.
pub(super) const ENTRY: LightEntry = LightEntry {
    name: "point",
    doc: "a point or a ball that shines equally in every direction",
    build: |d| {
        if d.radius > 0.0 {
            return Ok(Box::new(Ball::new(d, None)?));
        }
        Ok(Box::new(PointLight {
            position: d.position,
            intensity: d.strength,
            range: d.range,
        }))
    },
};
