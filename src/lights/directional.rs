//! `directional`: light from infinity, parallel or from a small disc of the sky, emitted as
//! photons over the scene's disc.

use std::f64::consts::PI;

use super::point::point_origin;
use super::{Distant, EmissionOrigin, LiSample, Light, LightDesc, LightEntry};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::{BoundingSphere, DVec3, Frame};
use crate::sampling::warp;

struct DirectionalLight {
    /// Around the direction in which light travels.
    frame: Frame,
    /// At normal incidence.
    irradiance: Rgb,
    scene: BoundingSphere,
    seen_by_camera: bool,
    disc: Option<Disc>,
}

/// A sun with extent.
struct Disc {
    /// `1 − cos` of its angular radius.
    complement: f64,
    radiance: Rgb,
}

impl DirectionalLight {
    /// The direction in which light travels that `u` chooses, and its density.
    fn sample(&self, disc: &Disc, u: [f64; 2]) -> (DVec3, f64) {
        let local = warp::cone_from_complement(u, disc.complement);
        (self.frame.to_world(local), warp::cone_pdf(disc.complement))
    }

    /// Whether the disc is seen along `dir`.
    fn sees(&self, disc: &Disc, dir: DVec3) -> bool {
        // For a small angle 1 − cos is half the squared chord: no digits are lost.
        0.5 * (dir + self.frame.z).length_squared() <= disc.complement
    }
}

impl Light for DirectionalLight {
    fn power(&self) -> Rgb {
        // Through the disc beside the scene, beam by beam: ∫ L dω, a little more than what meets
        // a surface across the middle of a wide sun.
        let fluence = match &self.disc {
            None => self.irradiance,
            Some(disc) => disc.radiance / warp::cone_pdf(disc.complement),
        };
        fluence * self.scene.beam_area()
    }

    fn is_delta(&self) -> bool {
        self.disc.is_none()
    }

    fn importance(&self, _p: DVec3) -> f64 {
        self.irradiance.luminance()
    }

    fn sample_li(&self, _p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        let (travel, radiance, pdf) = match &self.disc {
            None => (self.frame.z, self.irradiance, 1.0),
            Some(disc) => {
                let (d, pdf) = self.sample(disc, u);
                (d, disc.radiance, pdf)
            }
        };
        Some(LiSample {
            wi: -travel,
            target: None,
            radiance,
            pdf,
            delta: self.disc.is_none(),
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
        self.disc.is_some()
    }

    fn escaped(&self, dir: DVec3) -> Rgb {
        match &self.disc {
            Some(disc) if self.sees(disc, dir) => disc.radiance,
            _ => Rgb::ZERO,
        }
    }

    fn pdf_escaped(&self, dir: DVec3) -> f64 {
        match &self.disc {
            Some(disc) if self.sees(disc, dir) => warp::cone_pdf(disc.complement),
            _ => 0.0,
        }
    }

    fn sample_distant(&self, u: [f64; 2]) -> Option<Distant> {
        Some(match &self.disc {
            None => Distant {
                direction: self.frame.z,
                irradiance: self.irradiance,
            },
            Some(disc) => {
                let (direction, pdf) = self.sample(disc, u);
                Distant {
                    direction,
                    irradiance: disc.radiance / pdf,
                }
            }
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
    let angle = d.angular_radius;
    if !(0.0..0.5 * PI).contains(&angle) {
        return Err(format!(
            "its angular radius {angle} is not between 0 and π/2"
        ));
    }
    let disc = (angle > 0.0).then(|| {
        let half = (0.5 * angle).sin();
        Disc {
            complement: 2.0 * half * half,
            // E = ∫ L cos dω = π L sin² over the disc.
            radiance: d.strength / (PI * angle.sin().powi(2)),
        }
    });
    Ok(Box::new(DirectionalLight {
        frame: Frame::from_normal(direction),
        irradiance: d.strength,
        scene: d.scene,
        seen_by_camera: d.seen_by_camera,
        disc,
    }))
}

/// The registry's line.
pub(super) const ENTRY: LightEntry = LightEntry {
    name: "directional",
    doc: "light from infinity, parallel or from a small disc of the sky",
    build,
};
