//! `directional`: parallel light from infinity, emitted as photons over the scene's disc.

use std::f64::consts::PI;

use super::point::point_origin;
use super::{Distant, EmissionOrigin, LiSample, Light, LightDesc, LightEntry};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::{BoundingSphere, DVec3, Frame};
use crate::sampling::warp;

struct DirectionalLight {
    frame: Frame,
    irradiance: Rgb,
    scene: BoundingSphere,
}

impl Light for DirectionalLight {
    fn power(&self) -> Rgb {
        self.irradiance * (PI * self.scene.radius * self.scene.radius)
    }

    fn importance(&self, _p: DVec3) -> f64 {
        self.irradiance.luminance()
    }

    fn sample_li(&self, _p: DVec3, _u: [f64; 2]) -> Option<LiSample> {
        Some(LiSample {
            wi: -self.frame.z,
            target: None,
            radiance: self.irradiance,
            pdf: 1.0,
            delta: true,
        })
    }

    fn pdf_li(&self, _p: DVec3, _on: &SurfacePoint) -> f64 {
        0.0
    }

    fn radiance(&self, _on: &Surface<'_>) -> Rgb {
        Rgb::ZERO
    }

    fn distant(&self) -> Option<Distant> {
        Some(Distant {
            direction: self.frame.z,
            irradiance: self.irradiance,
        })
    }

    fn sample_origin(&self, u: [f64; 2]) -> Option<EmissionOrigin> {
        let [x, y] = warp::disc(u);
        let r = self.scene.radius;
        let p = self.scene.center + (self.frame.x * x + self.frame.y * y - self.frame.z) * r;
        Some(EmissionOrigin {
            pdf_area: 1.0 / (PI * r * r),
            radiance: Rgb::ZERO,
            ..point_origin(p)
        })
    }

    fn sample_direction(&self, _from: &EmissionOrigin, _u: [f64; 2]) -> (DVec3, f64) {
        (self.frame.z, 1.0)
    }

    fn emitted(&self, _from: &EmissionOrigin, _dir: DVec3) -> Rgb {
        self.irradiance
    }
}

fn build(d: &LightDesc) -> Result<Box<dyn Light>, String> {
    let direction = d
        .direction
        .try_normalize()
        .ok_or("its direction has no length")?;
    Ok(Box::new(DirectionalLight {
        frame: Frame::from_normal(direction),
        irradiance: d.strength,
        scene: d.scene,
    }))
}

/// The registry's line.
pub(super) const ENTRY: LightEntry = LightEntry {
    name: "directional",
    doc: "parallel light from infinity",
    build,
};
