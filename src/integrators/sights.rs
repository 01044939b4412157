//! Where the camera looks, for whoever emits photons: points of diffuse surfaces that a few paths
//! meet.

use rayon::prelude::*;

use super::Spacing;
use crate::accel::Accelerator;
use crate::cameras::Camera;
use crate::geometry::SurfacePoint;
use crate::materials::{Bsdf, LobeClass, TransportMode};
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
            // Numbers of their own: those of trials begin at the same seed.
            let mut sampler = Sampler::new(seed, stream::TRIALS, 1, u64::from(i));
            let [jx, jy] = sampler.next_2d();
            let at = |i: u32, j: f64, size: f64| (f64::from(i) + j) / f64::from(views) * size;
            let px = at(i % views, jx, spacing.image[0]);
            let py = at(i / views, jy, spacing.image[1]);
            let lens = match camera.has_lens() {
                true => sampler.next_2d(),
                false => [0.5; 2],
            };
            let ray = spacing.camera_ray(camera, px, py, lens, false).ray;
            path(scene, accel, ray, &mut sampler)
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

/// A path that goes on from one diffuse surface and ends at the second.
fn path(
    scene: &Scene,
    accel: &dyn Accelerator,
    mut ray: crate::geometry::Ray,
    sampler: &mut Sampler,
) -> Met {
    let mut met = Met::default();
    let mut inside = scene.enclosing(ray.origin());
    let mut gathering = false;
    for _ in 0..SURFACES {
        let Some(hit) = accel.intersect(&ray) else {
            break;
        };
        let sp = scene.surface_point(&ray, &hit);
        let crossing = scene.crossing(inside, &sp);
        let mut bsdf = Bsdf::new(&sp, TransportMode::Radiance);
        scene.scatter(&sp, None, &mut bsdf);
        crossing.apply(&mut bsdf);
        if bsdf.has_diffuse() {
            met[usize::from(gathering)].push(sp);
        }
        let u = sampler.next_2d();
        let Some(s) = bsdf.sample(sampler.next_1d(), u) else {
            break;
        };
        if s.class == LobeClass::Diffuse && std::mem::replace(&mut gathering, true) {
            break;
        }
        ray = sp.spawn(s.wi);
        inside = crossing.beyond(s.transmitted);
    }
    met
}
