//! A few paths from the camera before rendering, to find out what a scene is like.

use rayon::prelude::*;

use super::Spacing;
use crate::accel::Accelerator;
use crate::cameras::Camera;
use crate::geometry::{Ray, SurfacePoint};
use crate::materials::{Bsdf, LobeClass, TransportMode};
use crate::math::Frame;
use crate::sampling::{Sampler, stream, warp};
use crate::scene::Scene;

/// Points of the image through which trials start, along each edge.
const VIEWS: u32 = 48;

/// Who draws numbers of [`stream::TRIALS`] beside [`walk`].
pub(super) const SIGHTS: u64 = 1;
const PILOT: u64 = 2;

/// Surfaces of a trial: the one seen, and those that diffuse bounces reach from there.
const BOUNCES: u32 = 3;

/// Largest share of rays that may leave a scene for them to be asked about twice more: together
/// they then take 1 % of all questions.
const LEAVING: f64 = 0.005;

/// Tells `met` what each ray of each trial met, `None` for one that left the scene.
pub(super) fn walk(
    scene: &Scene,
    accel: &dyn Accelerator,
    camera: &dyn Camera,
    spacing: &Spacing,
    seed: u64,
    mut met: impl FnMut(Option<&SurfacePoint>, &mut Sampler),
) {
    for y in 0..VIEWS {
        for x in 0..VIEWS {
            let index = u64::from(y * VIEWS + x);
            let mut sampler = Sampler::new(seed, stream::TRIALS, 0, index);
            let [jx, jy] = sampler.next_2d();
            let at = |i: u32, j: f64, size: f64| (f64::from(i) + j) / f64::from(VIEWS) * size;
            let (px, py) = (at(x, jx, spacing.image[0]), at(y, jy, spacing.image[1]));
            let mut ray = spacing.camera_ray(camera, px, py, [0.5; 2], false).ray;
            for _ in 0..BOUNCES {
                let Some(hit) = accel.intersect(&ray) else {
                    met(None, &mut sampler);
                    break;
                };
                let sp = scene.surface_point(&ray, &hit);
                met(Some(&sp), &mut sampler);
                ray = bounce(&sp, sampler.next_2d());
            }
        }
    }
}

/// A diffuse bounce on the side that was met, whatever the surface is made of.
fn bounce(sp: &SurfacePoint, u: [f64; 2]) -> Ray {
    let n = if sp.front { sp.ng } else { -sp.ng };
    sp.spawn(Frame::from_normal(n).to_world(warp::cosine_hemisphere(u)))
}

/// Whether hardly any of the rays that a rendering traces from the camera on leaves the scene.
pub fn enclosed(
    scene: &Scene,
    accel: &dyn Accelerator,
    camera: &dyn Camera,
    spacing: &Spacing,
    seed: u64,
) -> bool {
    let (mut rays, mut left) = (0u32, 0u32);
    walk(scene, accel, camera, spacing, seed, |met, _| {
        rays += 1;
        left += match met {
            None => 1,
            // What lies behind glass is not walked to: what could leave there counts as leaving.
            Some(sp) if scene.material(sp.material).traits().transmits => {
                let through = accel.intersect(&sp.spawn(-sp.wo));
                u32::from(through.is_none())
            }
            Some(_) => 0,
        };
    });
    f64::from(left) <= LEAVING * f64::from(rays)
}

/// Follows a path from the camera from surface to surface as their BSDFs lead it, and tells `met` of
/// each, with the diffuse bounces before. It ends where it leaves the scene or is absorbed, with the
/// second diffuse bounce, or after so many surfaces: whether it was led on for so long.
pub(super) fn follow(
    scene: &Scene,
    accel: &dyn Accelerator,
    mut ray: Ray,
    sampler: &mut Sampler,
    surfaces: u32,
    mut met: impl FnMut(&SurfacePoint, &Bsdf, u32),
) -> bool {
    let mut inside = scene.enclosing(ray.origin());
    let mut bounces = 0;
    for _ in 0..surfaces {
        let Some(hit) = accel.intersect(&ray) else {
            return false;
        };
        let sp = scene.surface_point(&ray, &hit);
        let crossing = scene.crossing(inside, &sp);
        let mut bsdf = scene.bsdf(&sp, None, TransportMode::Radiance);
        crossing.apply(&mut bsdf);
        met(&sp, &bsdf, bounces);
        let u = sampler.next_2d();
        let Some(s) = bsdf.sample(sampler.next_1d(), u) else {
            return false;
        };
        if s.class == LobeClass::Diffuse {
            if bounces > 0 {
                return false;
            }
            bounces += 1;
        }
        ray = sp.spawn(s.wi);
        inside = crossing.beyond(s.transmitted);
    }
    true
}

/// Paths of a search for light that surfaces pass on. If none of so many finds a way for it, less
/// than 3 in 131 072 do, by 95 %.
const PATHS: u64 = 1 << 17;

/// The first of them, which find it in nearly every scene. All are followed, so that what they count
/// does not depend on the threads.
const FIRST_PATHS: u64 = 64;

/// Surfaces that such a path may be led on by before it counts as found.
const LED_ON: u32 = 16;

/// Whether there is no light to be seen that one surface passes to another: follows paths from all
/// over the image until a diffuse bounce meets a surface that scatters; their number if none does. Where
/// there is such light, one of the first few finds it.
pub fn none_meets_another(
    scene: &Scene,
    accel: &dyn Accelerator,
    camera: &dyn Camera,
    spacing: &Spacing,
    seed: u64,
) -> Option<u64> {
    let [w, h] = spacing.image;
    let found = |index: u64| {
        let mut sampler = Sampler::new(seed, stream::TRIALS, PILOT, index);
        let ([x, y], lens) = (sampler.next_2d(), sampler.next_2d());
        let ray = spacing.camera_ray(camera, x * w, y * h, lens, false).ray;
        let mut found = false;
        let led_on = follow(scene, accel, ray, &mut sampler, LED_ON, |sp, _, bounces| {
            let traits = scene.material(sp.material).traits();
            let scatters = traits.diffuse > 0.0 || traits.reflects || traits.transmits;
            found |= bounces > 0 && scatters;
        });
        found || led_on
    };
    let (mut from, mut to) = (0, FIRST_PATHS);
    while from < PATHS {
        let ways: usize = (from..to)
            .into_par_iter()
            .map(|i| usize::from(found(i)))
            .sum();
        if ways > 0 {
            return None;
        }
        (from, to) = (to, (4 * to).min(PATHS));
    }
    Some(PATHS)
}
