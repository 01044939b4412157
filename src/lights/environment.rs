//! `environment`: light from all around, from an image of the sky or of one colour.

use std::f64::consts::PI;

use super::sky::Sky;
use super::{Distant, EmissionOrigin, LiSample, Light, LightDesc, LightEntry};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::{BoundingSphere, DQuat, DVec3};
use crate::sampling::warp;
use crate::stats::tally::{self, Event, Part};

struct Environment {
    /// None for one colour.
    sky: Option<Sky>,
    strength: Rgb,
    /// World from the sky's directions.
    rotation: DQuat,
    scene: BoundingSphere,
    seen_by_camera: bool,
}

impl Environment {
    /// `∫ L dω`, W/m².
    fn fluence(&self) -> Rgb {
        let total = self
            .sky
            .as_ref()
            .map_or(Rgb::splat(4.0 * PI), |sky| sky.total);
        self.strength * total
    }

    /// Radiance from a direction.
    fn toward(&self, dir: DVec3) -> Rgb {
        let sky = match &self.sky {
            None => Rgb::ONE,
            Some(sky) => sky.radiance(self.rotation.inverse() * dir),
        };
        self.strength * sky
    }

    /// A direction toward the sky, and its density.
    fn sample(&self, u: [f64; 2]) -> Option<(DVec3, f64)> {
        match &self.sky {
            None => Some((warp::sphere(u), 1.0 / (4.0 * PI))),
            Some(sky) => {
                let (d, pdf) = sky.sample(u)?;
                Some((self.rotation * d, pdf))
            }
        }
    }
}

impl Light for Environment {
    fn power(&self) -> Rgb {
        self.fluence() * self.scene.beam_area()
    }

    fn importance(&self, _p: DVec3) -> f64 {
        // A surface sees half of the sky, at a cosine of one half in the mean.
        0.25 * self.fluence().luminance()
    }

    fn sample_li(&self, _p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        let _scope = tally::enter(Part::Environment);
        tally::count(Event::SkySamples);
        let (wi, pdf) = self.sample(u)?;
        Some(LiSample {
            wi,
            target: None,
            radiance: self.toward(wi),
            pdf,
            delta: false,
        })
    }

    fn pdf_li(&self, _p: DVec3, _on: &SurfacePoint) -> f64 {
        0.0
    }

    fn radiance(&self, _on: &Surface<'_>) -> Rgb {
        Rgb::ZERO
    }

    fn seen_by_camera(&self) -> bool {
        self.seen_by_camera
    }

    fn is_infinite(&self) -> bool {
        true
    }

    fn escaped(&self, dir: DVec3) -> Rgb {
        let _scope = tally::enter(Part::Environment);
        tally::count(Event::SkyLookups);
        self.toward(dir)
    }

    fn pdf_escaped(&self, dir: DVec3) -> f64 {
        match &self.sky {
            None => 1.0 / (4.0 * PI),
            Some(sky) => sky.pdf(self.rotation.inverse() * dir),
        }
    }

    fn sample_distant(&self, u: [f64; 2]) -> Option<Distant> {
        let _scope = tally::enter(Part::Environment);
        tally::count(Event::SkySamples);
        let (toward, pdf) = self.sample(u)?;
        Some(Distant {
            direction: -toward,
            irradiance: self.toward(toward) / pdf,
        })
    }

    fn sample_origin(&self, _u: [f64; 2]) -> Option<EmissionOrigin> {
        None
    }

    fn sample_direction(&self, _from: &EmissionOrigin, u: [f64; 2]) -> (DVec3, f64) {
        (warp::sphere(u), 1.0 / (4.0 * PI))
    }

    fn emitted(&self, _from: &EmissionOrigin, _dir: DVec3) -> Rgb {
        Rgb::ZERO
    }
}

fn build(d: &LightDesc) -> Result<Box<dyn Light>, String> {
    Ok(Box::new(Environment {
        sky: d.sky.clone().map(Sky::new),
        strength: d.strength,
        rotation: d.rotation,
        scene: d.scene,
        seen_by_camera: d.seen_by_camera,
    }))
}

/// The registry's line.
pub(super) const ENTRY: LightEntry = LightEntry {
    name: "environment",
    doc: "light from all around: an image of the sky, or one colour",
    build,
};
