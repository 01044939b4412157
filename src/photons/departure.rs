//! How a photon leaves a light, from two points of the unit square: the same for all emissions.

use super::{EmittedPhoton, Targets};
use crate::geometry::Ray;
use crate::lights::Light;
use crate::math::{DVec3, Frame};
use crate::sampling::warp;
use crate::scene::Scene;

/// A photon of a light that emits one photon only; toward specular objects only, if `targets` are
/// given. `first` is for the origin of what has one and for the direction of light from infinity,
/// `second` for the other. `None` if the light sends nothing there.
#[inline]
pub(super) fn leave(
    light: &dyn Light,
    scene: &Scene,
    targets: Option<&Targets>,
    first: [f64; 2],
    second: [f64; 2],
) -> Option<EmittedPhoton> {
    if let Some(distant) = light.sample_distant(first) {
        let around = scene.bounds.bounding_sphere();
        let (p, area) = match targets {
            // Beside the scene, on the disc that its shadow fills.
            None => {
                let radius = around.radius;
                let frame = Frame::from_normal(distant.direction);
                let [x, y] = warp::disc(second);
                let p = around.center + (frame.x * x + frame.y * y - frame.z) * radius;
                (p, around.beam_area())
            }
            // From beside the target back out of the scene.
            Some(targets) => {
                let (p, pdf) = targets.sample_disc(distant.direction, second)?;
                let depth = (p - around.center).dot(distant.direction) + around.radius;
                (p - distant.direction * depth.max(0.0), 1.0 / pdf)
            }
        };
        return Some(EmittedPhoton {
            ray: Ray::new(p, distant.direction),
            power: distant.irradiance * area,
            range: f64::INFINITY,
        });
    }
    let from = light.sample_origin(first)?;
    let (dir, pdf): (DVec3, f64) = match targets {
        None => light.sample_direction(&from, second),
        Some(targets) => targets.sample_direction(from.p, second)?,
    };
    let power = light.emitted(&from, dir) / (from.pdf_area * pdf);
    (!power.is_black()).then(|| EmittedPhoton {
        ray: from.ray(dir),
        power,
        range: light.range(),
    })
}
