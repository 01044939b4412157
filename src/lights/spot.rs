//! `spot`: a point with a cone, with the falloff that `KHR_lights_punctual` recommends.

use std::f64::consts::PI;

use super::ball::Ball;
use super::point::{point_origin, sample_point};
use super::{EmissionOrigin, LiSample, Light, LightDesc, LightEntry, SpotCurve};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::{DVec3, Frame};
use crate::sampling::warp;

/// Where a spot shines.
pub(super) struct Cone {
    frame: Frame,
    cos_outer: f64,
    /// Width of the falloff in the cosine.
    ramp: f64,
    curve: SpotCurve,
}

impl SpotCurve {
    /// Relative intensity at `t` of the way from the outer to the inner cone.
    #[inline]
    fn value(self, t: f64) -> f64 {
        match self {
            Self::Gltf => t * t,
            Self::Cycles => t * t * (3.0 - 2.0 * t),
        }
    }

    /// Its integral from 0 to `t`.
    #[inline]
    fn integral(self, t: f64) -> f64 {
        match self {
            Self::Gltf => t * t * t / 3.0,
            Self::Cycles => t * t * t * (1.0 - 0.5 * t),
        }
    }

    /// Where the integral has the value `i`.
    #[inline]
    fn inverse_integral(self, i: f64) -> f64 {
        match self {
            Self::Gltf => (3.0 * i).cbrt(),
            Self::Cycles => {
                // Newton's method from below, where the integral is convex enough to converge
                // from: t³ = i + t⁴/2 > i.
                let mut t = i.cbrt();
                for _ in 0..8 {
                    let slope = self.value(t);
                    if slope > 0.0 {
                        t = (t - (self.integral(t) - i) / slope).clamp(0.0, 1.0);
                    }
                }
                t
            }
        }
    }
}

impl Cone {
    fn new(d: &LightDesc) -> Result<Self, String> {
        let direction = d
            .direction
            .try_normalize()
            .ok_or("its direction has no length")?;
        if !(d.outer_cone > 0.0 && d.outer_cone <= PI && d.inner_cone >= 0.0) {
            return Err(format!(
                "cone angles {} and {} are not between 0 and π",
                d.inner_cone, d.outer_cone
            ));
        }
        let cos_outer = d.outer_cone.cos();
        let inner = d.inner_cone.min(d.outer_cone);
        Ok(Self {
            frame: Frame::from_normal(direction),
            cos_outer,
            ramp: match d.spot_curve {
                SpotCurve::Gltf => inner.cos() - cos_outer,
                SpotCurve::Cycles => (1.0 - cos_outer) * (1.0 - inner / d.outer_cone),
            },
            curve: d.spot_curve,
        })
    }

    /// Relative intensity along the unit direction `dir`.
    #[inline]
    pub(super) fn falloff(&self, dir: DVec3) -> f64 {
        let cos = dir.dot(self.frame.z);
        if cos <= self.cos_outer {
            return 0.0;
        }
        // A hard edge has no ramp to divide by.
        let t = if self.ramp > 0.0 {
            ((cos - self.cos_outer) / self.ramp).min(1.0)
        } else {
            1.0
        };
        self.curve.value(t)
    }

    /// Solid angle over 2π of a cone without falloff and of the same flux.
    #[inline]
    fn solid_angle(&self) -> f64 {
        1.0 - self.cos_outer - self.ramp * (1.0 - self.curve.integral(1.0))
    }

    /// `∫ falloff dω`.
    pub(super) fn integral(&self) -> f64 {
        2.0 * PI * self.solid_angle()
    }

    /// A direction in the cone, in proportion to the falloff, and its density.
    pub(super) fn sample(&self, u: [f64; 2]) -> (DVec3, f64) {
        // So all photons carry the same flux.
        let [x, y] = warp::disc(u);
        let r2 = x * x + y * y;
        let total = self.solid_angle();
        // Uniform: the share of the flux at greater angles.
        let beyond = (1.0 - r2).max(f64::MIN_POSITIVE) * total;
        let (height, falloff) = if beyond >= self.ramp * self.curve.integral(1.0) {
            (r2 * total, 1.0)
        } else {
            let t = self.curve.inverse_integral(beyond / self.ramp);
            (1.0 - self.cos_outer - self.ramp * t, self.curve.value(t))
        };
        // Dividing by r² leaves a form that does not cancel in a narrow cone.
        let scale = if r2 > 0.0 {
            (height * (2.0 - height) / r2).max(0.0).sqrt()
        } else {
            0.0
        };
        let local = DVec3::new(x * scale, y * scale, 1.0 - height);
        (self.frame.to_world(local), falloff / (2.0 * PI * total))
    }
}

struct SpotLight {
    position: DVec3,
    cone: Cone,
    intensity: Rgb,
    range: f64,
}

impl SpotLight {
    #[inline]
    fn toward(&self, dir: DVec3) -> Rgb {
        self.intensity * self.cone.falloff(dir)
    }
}

impl Light for SpotLight {
    fn power(&self) -> Rgb {
        self.intensity * self.cone.integral()
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn importance(&self, p: DVec3) -> f64 {
        let to = p - self.position;
        let dir = to.normalize_or_zero();
        self.toward(dir).luminance() / to.length_squared()
    }

    fn sample_li(&self, p: DVec3, _u: [f64; 2]) -> Option<LiSample> {
        let dir = (p - self.position).try_normalize()?;
        sample_point(self.position, p, self.toward(dir), self.range)
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
        self.cone.sample(u)
    }

    fn emitted(&self, _from: &EmissionOrigin, dir: DVec3) -> Rgb {
        self.toward(dir)
    }
}

fn build(d: &LightDesc) -> Result<Box<dyn Light>, String> {
    let cone = Cone::new(d)?;
    if d.radius > 0.0 {
        return Ok(Box::new(Ball::new(d, Some(cone))?));
    }
    Ok(Box::new(SpotLight {
        position: d.position,
        cone,
        intensity: d.strength,
        range: d.range,
    }))
}

/// The registry's line.
pub(super) const ENTRY: LightEntry = LightEntry {
    name: "spot",
    doc: "a point that shines into a cone",
    build,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrals_are_those_of_the_curves_and_are_inverted() {
        for curve in [SpotCurve::Gltf, SpotCurve::Cycles] {
            let mut sum = 0.0;
            for k in 0..10_000 {
                let t = f64::from(k) * 1e-4;
                sum += curve.value(t + 0.5e-4) * 1e-4;
                assert!((curve.integral(t + 1e-4) - sum).abs() < 1e-8);
                let back = curve.inverse_integral(curve.integral(t));
                assert!(
                    (back - t).abs() < 1e-9 + 1e-4 * f64::from(k == 0),
                    "{t} {back}"
                );
            }
        }
    }
}
