//! The rays whose rates are measured: coherent, after a diffuse bounce, and random.

use rayon::prelude::*;

use crate::accel::Accelerator;
use crate::cameras::Camera;
use crate::geometry::Ray;
use crate::math::{DVec3, Frame};
use crate::sampling::{Rng, hash2, stream, warp};
use crate::scene::Scene;

/// Rays that one task traces.
const BATCH: usize = 4096;

/// Kinds of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// From the camera, pixel by pixel.
    Coherent,
    /// From where such rays end, in directions spread by the cosine.
    Bounced,
    /// From anywhere to anywhere.
    Random,
}

impl Order {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Coherent, Self::Bounced, Self::Random];

    /// Name of the rate at which nearest hits are found, then of that at which any are.
    pub fn metrics(self) -> [&'static str; 2] {
        match self {
            Self::Coherent => ["closest coherent", "occluded coherent"],
            Self::Bounced => ["closest bounced", "occluded bounced"],
            Self::Random => ["closest random", "occluded random"],
        }
    }
}

/// About `count` rays of an order; `accel` tells where camera rays end.
pub(super) fn rays(
    order: Order,
    count: usize,
    seed: u64,
    scene: &Scene,
    camera: &dyn Camera,
    accel: &dyn Accelerator,
) -> Vec<Ray> {
    let side = (count as f64).sqrt().ceil() as usize;
    let key = hash2(hash2(seed, stream::TOOL), order as u64);
    let around = scene.bounds.bounding_sphere();
    let from_camera = |i: usize, rng: &mut Rng| {
        let [jx, jy] = rng.next_2d();
        let (x, y) = ((i % side) as f64 + jx, (i / side) as f64 + jy);
        let (o, d) = camera.ray(x / side as f64, y / side as f64, [0.5; 2]);
        Ray::new(o, d)
    };
    let one = |i: usize| -> Option<Ray> {
        let mut rng = Rng::new(hash2(key, i as u64));
        match order {
            Order::Coherent => Some(from_camera(i, &mut rng)),
            Order::Bounced => {
                // In any order over the picture, as paths of many threads come.
                let ray = from_camera((rng.next_u64() % count as u64) as usize, &mut rng);
                let sp = scene.surface_point(&ray, &accel.intersect(&ray)?);
                let up = if sp.front { sp.n } else { -sp.n };
                let local = warp::cosine_hemisphere(rng.next_2d());
                Some(sp.spawn(Frame::from_normal(up).to_world(local)))
            }
            Order::Random => {
                let mut point = || {
                    let r = around.radius * rng.next_1d().cbrt();
                    around.center + warp::sphere(rng.next_2d()) * r
                };
                let (a, b): (DVec3, DVec3) = (point(), point());
                Some(Ray::new(a, b - a))
            }
        }
    };
    (0..count)
        .into_par_iter()
        .filter_map(one)
        .filter(Ray::is_valid)
        .collect()
}

/// Traces them all on all threads; returns how many hit something.
pub(super) fn trace(accel: &dyn Accelerator, rays: &[Ray], any: bool) -> usize {
    rays.par_chunks(BATCH)
        .map(|part| {
            let hits = |r: &&Ray| match any {
                true => accel.occluded(r),
                false => accel.intersect(r).is_some(),
            };
            part.iter().filter(hits).count()
        })
        .sum()
}
