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
        match self.curve {
            SpotCurve::Gltf => t * t,
            SpotCurve::Cycles => t * t * (3.0 - 2.0 * t),
        }
    }

    /// `∫ falloff dω`.
    pub(super) fn integral(&self) -> f64 {
        // 2π [(1 − cos_outer) − ramp · (1 − ∫ of the curve over 0..1)].
        let lost = match self.curve {
            SpotCurve::Gltf => 2.0 / 3.0,
            SpotCurve::Cycles => 0.5,
        };
        2.0 * PI * (1.0 - self.cos_outer - self.ramp * lost)
    }

    /// A direction in the cone, and its density.
    pub(super) fn sample(&self, u: [f64; 2]) -> (DVec3, f64) {
        let complement = 1.0 - self.cos_outer;
        let local = warp::cone_from_complement(u, complement);
        (self.frame.to_world(local), warp::cone_pdf(complement))
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
