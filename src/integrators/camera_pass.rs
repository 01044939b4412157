//! The camera pass: rays through pixels, in tiles, in passes over the whole image.
//!
//! Passes grow (1, 1, 2, 4, … samples), so that an image exists early whenever the run is
//! stopped; a sample's random numbers depend on pixel and number alone, so the finished image
//! does not depend on passes, tiles or threads.

use arrayvec::ArrayVec;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use super::{BATCH, Integrator, Sample, Scratch, Spacing};
use crate::cameras::Camera;
use crate::control::Control;
use crate::film::{Film, PixelSample, Tile};
use crate::sampling::{Sequence, stream};
use crate::stats::RayCounts;
use crate::stats::tally::{self, Event};

/// Edge of a tile in pixels.
const TILE: u32 = 16;

/// Samples of a tile that one task takes at most, so that a stop is heeded soon.
const MAX_PASS: u32 = 64;

/// The part of the image that is rendered: left, top, right, bottom in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Left edge.
    pub x0: u32,
    /// Upper edge.
    pub y0: u32,
    /// Right edge, exclusive.
    pub x1: u32,
    /// Lower edge, exclusive.
    pub y1: u32,
}

/// Where camera samples begin.
pub(super) struct View<'a> {
    pub(super) camera: &'a dyn Camera,
    pub(super) seed: u64,
    pub(super) spacing: &'a Spacing,
    /// Whether rays carry differentials.
    pub(super) differentials: bool,
    /// Width of the image in pixels.
    pub(super) width: u32,
}

/// A pixel whose samples are taken.
pub(super) struct Pixel<'a> {
    view: &'a View<'a>,
    corner: [f64; 2],
    sequence: Sequence,
}

impl View<'_> {
    pub(super) fn pixel(&self, [px, py]: [u32; 2]) -> Pixel<'_> {
        let key = u64::from(py) * u64::from(self.width) + u64::from(px);
        Pixel {
            view: self,
            corner: [f64::from(px), f64::from(py)],
            sequence: Sequence::new(self.seed, stream::CAMERA, key),
        }
    }
}

impl Pixel<'_> {
    /// Its sample `number`, to be added to sum `sum`.
    #[inline(always)]
    pub(super) fn sample(&self, number: u32, sum: usize) -> Sample {
        let view = self.view;
        let mut sampler = self.sequence.point(u64::from(number));
        let [jx, jy] = sampler.next_2d();
        let (x, y) = (self.corner[0] + jx, self.corner[1] + jy);
        let lens = if !cfg!(dualight_without = "lens") && view.camera.has_lens() {
            tally::count(Event::LensPoints);
            sampler.next_2d()
        } else {
            [0.5; 2]
        };
        Sample {
            camera: view
                .spacing
                .camera_ray(view.camera, x, y, lens, view.differentials),
            sampler,
            pixel: sum,
            gathering: 1.0,
        }
    }
}

impl Region {
    pub(super) fn tiles(&self) -> Vec<(u32, u32, u32, u32)> {
        let mut out = Vec::new();
        for y in (self.y0..self.y1).step_by(TILE as usize) {
            for x in (self.x0..self.x1).step_by(TILE as usize) {
                out.push((x, y, TILE.min(self.x1 - x), TILE.min(self.y1 - y)));
            }
        }
        out
    }
}

/// Takes the samples of these numbers in every pixel of `region` and adds them to the film, until
/// done or stopped. Samples of this pass that a pixel has already, of a run that was interrupted,
/// are not taken again. Rays carry differentials if `differentials` are wanted; `watch` sees the
/// film now and then. Returns the rays traced.
#[expect(clippy::too_many_arguments, reason = "plain input, each used once")]
pub fn camera_pass(
    camera: &dyn Camera,
    integrator: &dyn Integrator,
    seed: u64,
    samples: Range<u32>,
    spacing: &Spacing,
    differentials: bool,
    region: Region,
    film: &mut Film,
    watch: &mut dyn FnMut(&Film),
    control: &Control,
) -> RayCounts {
    let pixels = u64::from(region.x1 - region.x0) * u64::from(region.y1 - region.y0);
    let stage = control.stage("pixels", "samples", pixels * samples.len() as u64);
    let tiles = region.tiles();
    let view = View {
        camera,
        seed,
        spacing,
        differentials,
        width: film.width(),
    };
    let mut rays = RayCounts::default();
    let Range { start, end } = samples;
    let mut done = start;
    while done < end && control.stopped().is_none() {
        let samples = done.clamp(1, MAX_PASS).min(end - done);
        for group in tiles.chunks(1024) {
            // A tile is added by the thread that took it, and held no longer: tiles share no pixel,
            // so their order does not matter.
            let shared = Mutex::new(&mut *film);
            let film = || shared.lock().unwrap_or_else(PoisonError::into_inner);
            let counts = group.par_iter().map(|&(x, y, w, h)| {
                if control.stopped().is_some() {
                    return RayCounts::default();
                }
                let taken = {
                    let film = film();
                    let own = |i: u32| film.samples_of_pass(x + i % w, y + i / w);
                    (0..w * h).map(own).max().unwrap_or(0)
                };
                let first = done.max(start + taken);
                let Some(samples) = (done + samples).checked_sub(first).filter(|n| *n > 0) else {
                    return RayCounts::default();
                };
                let mut scratch = Scratch::default();
                let mut sums = vec![PixelSample::default(); (w * h) as usize];
                let mut batch = ArrayVec::<Sample, BATCH>::new();
                let mut take = |batch: &mut ArrayVec<Sample, BATCH>| {
                    integrator.sample(batch, &mut sums, &mut scratch);
                    batch.clear();
                };
                let pixels = (y..y + h).flat_map(|py| (x..x + w).map(move |px| (px, py)));
                for (pixel, (px, py)) in pixels.enumerate() {
                    // Which samples of a pixel go together must not depend on its neighbours,
                    // or the rounding of its sum would.
                    if batch.len() + samples as usize > BATCH {
                        take(&mut batch);
                    }
                    let own = view.pixel([px, py]);
                    for s in first..first + samples {
                        batch.push(own.sample(s, pixel));
                        if batch.is_full() {
                            take(&mut batch);
                        }
                    }
                }
                take(&mut batch);
                stage.advance(u64::from(w * h) * u64::from(samples));
                film().add(&Tile {
                    x,
                    y,
                    width: w,
                    height: h,
                    sums,
                    samples,
                });
                scratch.rays
            });
            rays.add(&counts.reduce(RayCounts::default, RayCounts::plus));
            watch(shared.into_inner().unwrap_or_else(PoisonError::into_inner));
        }
        done += samples;
    }
    rays
}
