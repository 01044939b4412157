//! Camera samples where the picture changes: how many each pixel gets.
//!
//! Half of the samples goes to all pixels alike. The rest is shared out by Neyman's rule, in
//! proportion to the relative deviation of a sample, so that the relative mean squared error is
//! least. What a pixel's own samples say must not decide how many more there will be: where dark
//! ones end the work and bright ones call for more, the mean comes out too dark (Kirk and Arvo,
//! *Unbiased Sampling Techniques for Image Synthesis*, 1991). So a pixel is judged by its
//! neighbours, and by the forecast of edges in it, which holds no chance. The plan is made once
//! and kept, so that every pass over the image, with photons of its own, counts alike in every
//! pixel. The picture's mean is therefore that of uniform samples.

use rayon::prelude::*;

use super::Region;
use super::camera_pass::View;
use super::pixel_edges::Finder;
use super::pixel_glints::Glints;
use super::pixel_shares::{EVEN, Spread, shares_by};
use super::{BATCH, Integrator, RenderContext, Sample, Scratch, Spacing};
use crate::cameras::Camera;
use crate::control::{Control, Stage};
use crate::film::{Film, PixelSample};
use crate::sampling::{hash2, stream};
use crate::stats::RayCounts;
use arrayvec::ArrayVec;

/// Share of the gather rays in pixels whose indirect light is interpolated: they make the light of
/// many pixels. In the box a quarter or all of them take longer to the same error.
const GATHERING: f64 = 0.5;

/// How many samples each pixel of a region gets, over the mean.
#[derive(Clone, Debug)]
pub struct PixelPlan {
    region: Region,
    share: Vec<f32>,
    edges: Vec<bool>,
    /// Whether indirect light is interpolated in pixels without an edge.
    interpolated: bool,
}

/// What is asked of a pixel.
#[derive(Clone, Copy, Debug)]
struct Demand {
    samples: u32,
    /// Whether its indirect light will be interpolated.
    interpolated: bool,
}

/// One pass over a region.
struct Pass<'a> {
    view: &'a View<'a>,
    integrator: &'a dyn Integrator,
    region: Region,
    control: &'a Control,
    stage: Stage<'a>,
}

impl PixelPlan {
    /// Takes `samples` in each pixel, at least two, and plans by what they bring. They are numbered
    /// from 0, added to the film and count for the picture. They are taken in rounds over the whole
    /// image, which grow, so that it exists early whenever the run is stopped.
    fn make(
        context: &RenderContext<'_>,
        pass: &Pass<'_>,
        samples: u32,
        interpolated: bool,
        film: &mut Film,
        rays: &mut RayCounts,
    ) -> Self {
        let Pass { view, region, .. } = *pass;
        let size = [film.width(), film.height()];
        let finder = Finder::new(context.scene, context.accel, view.camera, size);
        let (edges, traced) = finder.find(region);
        rays.check += traced;
        let (glints, traced) = Glints::new(context, view.camera, size).find(region);
        rays.check += traced;
        let mut spreads = vec![Spread::default(); edges.len()];
        let mut taken = 0;
        while taken < samples {
            let round = taken.max(2).min(samples - taken);
            let demand = |edge: &bool| Demand {
                samples: round,
                interpolated: interpolated && !edge,
            };
            let demands: Vec<Demand> = edges.iter().map(demand).collect();
            for (all, own) in spreads.iter_mut().zip(pass.take(&demands, film, rays)) {
                all.merge(&own);
            }
            taken += round;
        }
        let width = (region.x1 - region.x0) as usize;
        Self {
            region,
            share: shares_by(&spreads, &edges, &glints, width),
            edges,
            interpolated,
        }
    }

    /// Samples that pixel `i` of the region gets out of `mean` in the mean of all. Rounded by
    /// chance, with the pixel's own random number.
    fn count(&self, i: usize, seed: u64, mean: f64) -> u32 {
        let random = hash2(hash2(seed, stream::CAMERA), !(i as u64)) >> 11;
        let u = random as f64 / (1_u64 << 53) as f64;
        (f64::from(self.share[i]) * mean + u) as u32
    }

    /// Samples that all pixels of a first pass of `samples` get alike.
    fn even(samples: u32) -> u32 {
        ((EVEN * f64::from(samples)) as u32).max(2).min(samples)
    }

    /// Takes what is planned for a pass of `samples` in the mean, but `taken` in each pixel.
    fn sample(
        &self,
        pass: &Pass<'_>,
        [samples, taken]: [u32; 2],
        film: &mut Film,
        rays: &mut RayCounts,
    ) {
        let demand = |(i, edge): (usize, &bool)| Demand {
            samples: self
                .count(i, pass.view.seed, f64::from(samples))
                .saturating_sub(taken),
            interpolated: self.interpolated && !edge,
        };
        let demands: Vec<Demand> = self.edges.iter().enumerate().map(demand).collect();
        pass.take(&demands, film, rays);
    }

    /// Whether each pixel of the image was forecast to hold an edge, row by row.
    pub fn edges(&self, film: &Film) -> Vec<bool> {
        let mut out = vec![false; film.samples().len()];
        let width = (self.region.x1 - self.region.x0) as usize;
        for (i, _) in self.edges.iter().enumerate().filter(|(_, e)| **e) {
            let (x, y) = (i % width, i / width);
            let row = (self.region.y0 as usize + y) * film.width() as usize;
            out[row + self.region.x0 as usize + x] = true;
        }
        out
    }
}

/// One pass over the image by a plan; the first makes it. `samples` is the mean of all pixels.
#[expect(clippy::too_many_arguments, reason = "plain input, each used once")]
pub fn planned_camera_pass(
    plan: &mut Option<PixelPlan>,
    context: &RenderContext<'_>,
    camera: &dyn Camera,
    integrator: &dyn Integrator,
    samples: u32,
    (spacing, differentials): (&Spacing, bool),
    region: Region,
    interpolated: bool,
    film: &mut Film,
    control: &Control,
) -> RayCounts {
    let view = View {
        camera,
        seed: context.settings.seed,
        spacing,
        differentials,
        width: film.width(),
    };
    let pixels = u64::from(region.x1 - region.x0) * u64::from(region.y1 - region.y0);
    let pass = Pass {
        view: &view,
        integrator,
        region,
        control,
        stage: control.stage("pixels", "samples", pixels * u64::from(samples)),
    };
    let mut rays = RayCounts::default();
    let mut taken = 0;
    let plan = match plan {
        Some(plan) => plan,
        None => {
            taken = PixelPlan::even(samples);
            let made = PixelPlan::make(context, &pass, taken, interpolated, film, &mut rays);
            plan.insert(made)
        }
    };
    plan.sample(&pass, [samples, taken], film, &mut rays);
    rays
}

impl Pass<'_> {
    /// Takes what is asked of each pixel of the region, numbered on from the samples that it has.
    fn take(&self, demands: &[Demand], film: &mut Film, rays: &mut RayCounts) -> Vec<Spread> {
        let region = self.region;
        let width = region.x1 - region.x0;
        let mut out = vec![Spread::default(); demands.len()];
        // Only as many pixels are held at a time as keep the threads busy.
        for group in region.tiles().chunks(64) {
            let seen = &*film;
            let pixels = |&(x, y, w, h): &(u32, u32, u32, u32)| {
                (y..y + h).flat_map(move |py| (x..x + w).map(move |px| [px, py]))
            };
            let places: Vec<[u32; 2]> = group.iter().flat_map(pixels).collect();
            let taken: Vec<_> = places
                .par_iter()
                .filter_map(|&[px, py]| {
                    let i = ((py - region.y0) * width + (px - region.x0)) as usize;
                    let at = py as usize * self.view.width as usize + px as usize;
                    let stopped = demands[i].samples == 0 || self.control.stopped().is_some();
                    let first = seen.samples()[at];
                    (!stopped).then(|| (i, [px, py], self.pixel([px, py], first, demands[i])))
                })
                .collect();
            for (i, at, (spread, halves, traced)) in taken {
                out[i] = spread;
                rays.add(&traced);
                film.add_halves(at, halves);
            }
        }
        out
    }

    /// Takes the samples of a pixel from number `first`: what they say, and the sums of those of
    /// even and of odd numbers.
    fn pixel(
        &self,
        at: [u32; 2],
        first: u32,
        demand: Demand,
    ) -> (Spread, [(PixelSample, u32); 2], RayCounts) {
        let Demand {
            samples,
            interpolated,
        } = demand;
        let mut scratch = Scratch::default();
        let mut sums = vec![PixelSample::default(); samples as usize];
        let mut batch = ArrayVec::<Sample, BATCH>::new();
        let own = self.view.pixel(at);
        let gathering = if interpolated { GATHERING } else { 1.0 };
        for s in 0..samples {
            batch.push(Sample {
                gathering,
                ..own.sample(first + s, s as usize)
            });
            if batch.is_full() || s + 1 == samples {
                self.integrator.sample(&mut batch, &mut sums, &mut scratch);
                batch.clear();
            }
        }
        self.stage.advance(u64::from(samples));
        let mut halves = [(PixelSample::default(), 0); 2];
        for (s, number) in sums.iter().zip(first..) {
            let (sum, n) = &mut halves[(number % 2) as usize];
            sum.merge(s);
            *n += 1;
        }
        (Spread::of(&sums, interpolated), halves, scratch.rays)
    }
}
