//! Lights that a pixel shows smaller than itself: in a mirror, through glass, or far away.
//!
//! A lamp's image of a hundredth of a pixel is missed by most of the pixel's samples and a hundred
//! times too bright in the rest: neither neighbours nor a few samples tell of it. But the chain of
//! mirrors and glass behind a pixel's ray, followed with derivatives, tells where in the picture
//! the lamp that it passes by would be met, how large that image is and how bright: so what the
//! pixel's samples will vary by is known before any is taken.

use arrayvec::ArrayVec;
use rayon::prelude::*;

use super::footprint::Trail;
use super::{Region, RenderContext, Spacing};
use crate::cameras::Camera;
use crate::color::Rgb;
use crate::geometry::{Differential, LightId, Ray};
use crate::materials::{Bsdf, TransportMode};
use crate::scene::Inside;

/// Chains that start in a pixel, along each edge: behind curved surfaces, derivatives reach less
/// far than a pixel.
const CHAINS: u32 = 2;

/// How far a light may be from the middle of a pixel to be foreseen in it, in pixels, and how far
/// from there a chain that started in the pixel is believed.
const REACH: f64 = 1.0;

/// Scattering events up to which a chain is followed.
const DEPTH: u32 = 6;

/// Chains that may wait: their fainter branches are dropped beyond it.
const WAITING: usize = 16;

/// Throughput below which a chain ends.
const FAINT: f64 = 1e-3;

/// Scattering events up to which integrators follow every branch; after that one of them.
const SPLIT_DEPTH: u32 = 3;

/// Most lights that are looked for, the brightest.
const LIGHTS: usize = 64;

/// What samples of a pixel bring by lights that they seldom meet.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Glint {
    /// Expected luminance.
    pub(super) mean: f64,
    /// Variance of a sample's luminance.
    pub(super) variance: f64,
}

/// A light that a chain passes by.
#[derive(Clone, Copy)]
struct Sighting {
    /// Where in the image it would be met, in pixels.
    at: [f64; 2],
    /// How far from there it may be seen.
    reach: f64,
    glint: Glint,
}

/// What is looked for, and through what.
pub(super) struct Glints<'a> {
    context: &'a RenderContext<'a>,
    camera: &'a dyn Camera,
    spacing: Spacing,
    lights: Vec<LightId>,
}

/// A chain at its next segment.
struct Chain {
    ray: Ray,
    differential: Differential,
    inside: Inside,
    beta: Rgb,
    /// Throughput up to where branches are chosen by chance.
    certain: f64,
    depth: u32,
}

impl<'a> Glints<'a> {
    pub(super) fn new(
        context: &'a RenderContext<'a>,
        camera: &'a dyn Camera,
        [width, height]: [u32; 2],
    ) -> Self {
        let scene = context.scene;
        let middle = scene.bounds.bounding_sphere().center;
        let mut lights: Vec<(LightId, f64)> = (0..scene.lights.len() as u32)
            .map(LightId)
            .filter_map(|id| {
                let light = scene.light(id);
                let small = !light.is_delta() && !light.is_infinite();
                // As bright as its side toward the middle of the scene, which may be black.
                let li = light.sample_li(middle, [0.5; 2]);
                small.then(|| (id, li.map_or(0.0, |li| li.radiance.luminance())))
            })
            .collect();
        lights.sort_by(|a, b| b.1.total_cmp(&a.1));
        lights.truncate(LIGHTS);
        Self {
            context,
            camera,
            spacing: Spacing::new(width, height, 1),
            lights: lights.into_iter().map(|(id, _)| id).collect(),
        }
    }

    /// What is foreseen in each pixel of the region, row by row, and the rays traced. Nothing
    /// without lights that have extent, nor behind a lens, which spreads their images.
    pub(super) fn find(&self, region: Region) -> (Vec<Glint>, u64) {
        let width = (region.x1 - region.x0) as usize;
        let count = width * (region.y1 - region.y0) as usize;
        if self.lights.is_empty() || self.camera.has_lens() {
            return (vec![Glint::default(); count], 0);
        }
        let sighted: Vec<(Vec<Sighting>, u64)> = (0..count)
            .into_par_iter()
            .map(|i| {
                let x = f64::from(region.x0) + (i % width) as f64;
                let y = f64::from(region.y0) + (i / width) as f64;
                self.pixel([x, y])
            })
            .collect();
        let rays = sighted.iter().map(|(_, rays)| rays).sum();
        // What a chain tells of may lie in the next pixel, whose own chains go elsewhere.
        let around = |k: usize, end: usize| k.saturating_sub(1)..(k + 2).min(end);
        let found = (0..count)
            .into_par_iter()
            .map(|i| {
                let (x, y) = (i % width, i / width);
                let middle = [
                    f64::from(region.x0) + x as f64 + 0.5,
                    f64::from(region.y0) + y as f64 + 0.5,
                ];
                around(y, count / width)
                    .flat_map(|y| around(x, width).map(move |x| y * width + x))
                    .flat_map(|k| &sighted[k].0)
                    .filter(|s| s.near(middle))
                    .map(|s| s.glint)
                    .fold(Glint::default(), |a, b| {
                        if b.variance > a.variance { b } else { a }
                    })
            })
            .collect();
        (found, rays)
    }

    /// What the chains of a pixel pass by, and the rays traced.
    fn pixel(&self, [x, y]: [f64; 2]) -> (Vec<Sighting>, u64) {
        let mut sighted = Vec::new();
        let mut rays = 0;
        for k in 0..CHAINS * CHAINS {
            let at = |k: u32| (f64::from(k) + 0.5) / f64::from(CHAINS);
            let from = [x + at(k % CHAINS), y + at(k / CHAINS)];
            self.follow(from, [x + 0.5, y + 0.5], &mut sighted, &mut rays);
        }
        (sighted, rays)
    }

    /// Follows the chain through a point of the image, in a pixel around `middle`.
    fn follow(
        &self,
        from: [f64; 2],
        middle: [f64; 2],
        sighted: &mut Vec<Sighting>,
        rays: &mut u64,
    ) {
        let cx = self.context;
        let [x, y] = from;
        let start = self.spacing.camera_ray(self.camera, x, y, [0.5; 2], true);
        let mut waiting = ArrayVec::<Chain, WAITING>::new();
        let Some(differential) = start.differential else {
            return;
        };
        waiting.push(Chain {
            ray: start.ray,
            differential,
            inside: cx.scene.enclosing(start.ray.origin()),
            beta: Rgb::ONE,
            certain: 1.0,
            depth: 0,
        });
        while let Some(chain) = waiting.pop() {
            self.look(&chain, from, middle, sighted, rays);
            *rays += 1;
            let Some(hit) = cx.accel.intersect(&chain.ray) else {
                continue;
            };
            let sp = cx.scene.surface_point(&chain.ray, &hit);
            if chain.depth >= DEPTH || cx.scene.matte(&sp).is_some() {
                continue;
            }
            let differential = &chain.differential;
            let trail = Trail::land_to_plan(differential, chain.inside, cx.scene, &chain.ray, &sp);
            let through = cx.scene.transmittance(&sp, trail.crossing());
            let mut bsdf = Bsdf::new(&sp, TransportMode::Radiance);
            cx.scene.scatter(&sp, trail.footprint(), &mut bsdf);
            trail.crossing().apply(&mut bsdf);
            bsdf.keep_specular();
            for b in bsdf.branches().unwrap_or_default() {
                let beta = chain.beta * through.unwrap_or(Rgb::ONE) * b.weight;
                let Some(differential) = trail.leave(&sp, &b) else {
                    continue;
                };
                if beta.max_channel() < FAINT
                    || !cx.effects.allows(cx.scene, &sp, b.class, b.transmitted)
                {
                    continue;
                }
                // Where too many wait, what is left out is not foreseen.
                let _ = waiting.try_push(Chain {
                    ray: sp.spawn(b.wi),
                    differential,
                    inside: trail.beyond(&b),
                    beta,
                    certain: if chain.depth < SPLIT_DEPTH {
                        beta.luminance()
                    } else {
                        chain.certain
                    },
                    depth: chain.depth + 1,
                });
            }
        }
    }

    /// Adds the lights that a segment of a chain may meet from elsewhere in its pixel.
    fn look(
        &self,
        chain: &Chain,
        from: [f64; 2],
        middle: [f64; 2],
        sighted: &mut Vec<Sighting>,
        rays: &mut u64,
    ) {
        let cx = self.context;
        let o = chain.ray.origin();
        let d = chain.ray.direction().normalize();
        for id in &self.lights {
            let light = cx.scene.light(*id);
            if chain.depth == 0 && !light.seen_by_camera() {
                continue;
            }
            let Some(li) = light.sample_li(o, [0.5; 2]) else {
                continue;
            };
            let Some(target) = li.target else {
                continue;
            };
            // Where in the picture the ray would meet it: to first order, in a plane across.
            let to = target - o;
            let ahead = to.dot(d);
            if !(ahead > 0.0) {
                continue;
            }
            let [right, down] = [0, 1].map(|i| {
                let c = chain.differential.origin[i] + chain.differential.direction[i] * ahead;
                c - d * c.dot(d)
            });
            let side = to - d * ahead;
            let area = right.cross(down).dot(d);
            // Pixels that its image covers, if the chain maps it evenly.
            let image = to.length_squared() / (li.pdf * area.abs());
            if !(image > 0.0 && image < 1.0) {
                continue;
            }
            let (x, y) = (side.cross(down).dot(d), right.cross(side).dot(d));
            let sighting = Sighting {
                at: [from[0] + x / area, from[1] + y / area],
                reach: REACH + 0.5 * image.sqrt(),
                glint: {
                    let seen = (chain.beta * li.radiance).luminance();
                    // One sample in so many meets it, and carries by so much more where chance chose.
                    let carried = seen * chain.certain * li.radiance.luminance();
                    Glint {
                        mean: seen * image,
                        variance: carried * image * (1.0 - image),
                    }
                },
            };
            if !sighting.near(middle) {
                continue;
            }
            *rays += 1;
            let mut way = Ray::new(o, to);
            way.tmax = 1.0;
            if cx.accel.occluded(&way) {
                continue;
            }
            sighted.push(sighting);
        }
    }
}

impl Sighting {
    fn near(&self, middle: [f64; 2]) -> bool {
        let off = |i: usize| (self.at[i] - middle[i]).abs();
        off(0) <= self.reach && off(1) <= self.reach
    }
}
