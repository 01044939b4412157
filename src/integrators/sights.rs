//! Where the camera looks, for whoever emits photons: points of diffuse surfaces that a few paths
//! meet.

use rayon::prelude::*;

use super::Spacing;
use super::trials::{SIGHTS, follow};
use crate::accel::Accelerator;
use crate::cameras::Camera;
use crate::geometry::SurfacePoint;
use crate::photons::Sights;
use crate::sampling::{Sampler, stream};
use crate::scene::Scene;

/// Most surfaces of a path.
const SURFACES: u32 = 12;

/// Points that one path has met: those that the camera sees, and those that are seen from there.
type Met = [Vec<SurfacePoint>; 2];

/// Follows paths through all parts of the image, whatever part is rendered: so many along each edge.
pub fn sights(
    scene: &Scene,
    accel: &dyn Accelerator,
    camera: &dyn Camera,
    spacing: &Spacing,
    seed: u64,
    views: u32,
) -> Sights {
    let paths: Vec<Met> = (0..views * views)
        .into_par_iter()
        .map(|i| {
            let mut sampler = Sampler::new(seed, stream::TRIALS, SIGHTS, u64::from(i));
            let [jx, jy] = sampler.next_2d();
            let at = |i: u32, j: f64, size: f64| (f64::from(i) + j) / f64::from(views) * size;
            let px = at(i % views, jx, spacing.image[0]);
            let py = at(i / views, jy, spacing.image[1]);
            let lens = match camera.has_lens() {
                true => sampler.next_2d(),
                false => [0.5; 2],
            };
            let ray = spacing.camera_ray(camera, px, py, lens, false).ray;
            let mut points = Met::default();
            let _: bool = follow(
                scene,
                accel,
                ray,
                &mut sampler,
                SURFACES,
                |sp, bsdf, bounces| {
                    if bsdf.has_diffuse() {
                        points[bounces as usize].push(*sp);
                    }
                },
            );
            points
        })
        .collect();
    let [seen, gathered] = [0, 1].map(|k| {
        paths
            .iter()
            .flat_map(|m| &m[k])
            .copied()
            .collect::<Vec<_>>()
    });
    Sights::new(scene, &seen, &gathered)
}
