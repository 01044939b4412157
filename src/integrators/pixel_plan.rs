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
use super::pixel_glints::{Glint, Glints};
use super::{BATCH, Integrator, RenderContext, Sample, Scratch, Spacing};
use crate::cameras::Camera;
use crate::control::Control;
use crate::film::{Component, Film, PixelSample};
use crate::sampling::{hash2, stream};
use crate::stats::RayCounts;
use arrayvec::ArrayVec;

/// Share of the samples that all pixels get alike: whatever nothing foresees is met with it. With
/// a quarter, wires that few samples meet were starved, and cost more than edges gained.
const EVEN: f64 = 0.5;

/// Most samples of a pixel, over the mean.
const MOST: f64 = 8.0;

/// The same where the forecast tells of a light that most samples miss.
const MOST_FORESEEN: f64 = 64.0;

/// Neighbours that a pixel is judged by lie at most so many pixels away.
const AROUND: usize = 2;

/// Least relative deviation, over the mean of the image: what few samples say is uncertain.
const LEAST: f64 = 0.2;

/// Share of the gather rays in pixels whose indirect light is interpolated: they make the light of
/// many pixels. In the box a quarter or all of them take longer to the same error.
const GATHERING: f64 = 0.5;

/// Added to the squared mean, as in the relative errors of reports.
const EPSILON: f64 = 0.01;

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

/// What the even samples of a pixel say.
#[derive(Clone, Copy, Debug, Default)]
struct Spread {
    mean: f64,
    variance: f64,
}

impl PixelPlan {
    /// Takes `samples` in each pixel, at least two, and plans by what they bring. They are numbered
    /// from 0, added to the film and count for the picture.
    #[expect(clippy::too_many_arguments, reason = "plain input, each used once")]
    pub(super) fn make(
        context: &RenderContext<'_>,
        view: &View<'_>,
        integrator: &dyn Integrator,
        samples: u32,
        region: Region,
        interpolated: bool,
        film: &mut Film,
        rays: &mut RayCounts,
        control: &Control,
    ) -> Self {
        let size = [film.width(), film.height()];
        let finder = Finder::new(context.scene, context.accel, view.camera, size);
        let (edges, traced) = finder.find(region);
        rays.check += traced;
        let (glints, traced) = Glints::new(context, view.camera, size).find(region);
        rays.check += traced;
        let demand = |edge: &bool| Demand {
            samples,
            interpolated: interpolated && !edge,
        };
        let demands: Vec<Demand> = edges.iter().map(demand).collect();
        let spreads = take(view, integrator, region, &demands, film, rays, control);
        let width = (region.x1 - region.x0) as usize;
        let mut deviations: Vec<f64> = (0..edges.len())
            .into_par_iter()
            .map(|i| deviation(&spreads, &edges, &glints, width, i))
            .collect();
        let mean = |kept: &dyn Fn(usize) -> bool| {
            let own = (0..edges.len()).filter(|i| kept(*i));
            let (sum, n) = own.fold((0.0, 0.0), |(s, n), i| (s + deviations[i], n + 1.0));
            sum / f64::max(n, 1.0)
        };
        // An edge that nothing around it tells of may be the only sign of something small.
        let (least, least_edge) = (LEAST * mean(&|_| true), mean(&|i| edges[i]));
        for (d, edge) in deviations.iter_mut().zip(&edges) {
            *d = d.max(if *edge { least_edge } else { least });
        }
        Self {
            region,
            share: shares(&deviations, &glints),
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
    pub(super) fn even(samples: u32) -> u32 {
        ((EVEN * f64::from(samples)) as u32).max(2).min(samples)
    }

    /// Takes what is planned for a pass of `samples` in the mean, but `taken` in each pixel.
    pub(super) fn sample(
        &self,
        view: &View<'_>,
        integrator: &dyn Integrator,
        [samples, taken]: [u32; 2],
        film: &mut Film,
        rays: &mut RayCounts,
        control: &Control,
    ) {
        let demand = |(i, edge): (usize, &bool)| Demand {
            samples: self
                .count(i, view.seed, f64::from(samples))
                .saturating_sub(taken),
            interpolated: self.interpolated && !edge,
        };
        let demands: Vec<Demand> = self.edges.iter().enumerate().map(demand).collect();
        take(view, integrator, self.region, &demands, film, rays, control);
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
    let mut rays = RayCounts::default();
    let mut taken = 0;
    let plan = match plan {
        Some(plan) => plan,
        None => {
            taken = PixelPlan::even(samples);
            plan.insert(PixelPlan::make(
                context,
                &view,
                integrator,
                taken,
                region,
                interpolated,
                film,
                &mut rays,
                control,
            ))
        }
    };
    plan.sample(
        &view,
        integrator,
        [samples, taken],
        film,
        &mut rays,
        control,
    );
    rays
}

/// Takes what is asked of each pixel of the region, numbered on from the samples that it has.
fn take(
    view: &View<'_>,
    integrator: &dyn Integrator,
    region: Region,
    demands: &[Demand],
    film: &mut Film,
    rays: &mut RayCounts,
    control: &Control,
) -> Vec<Spread> {
    let total = demands.iter().map(|d| u64::from(d.samples)).sum();
    let stage = control.stage("pixels", "samples", total);
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
            .map(|&[px, py]| {
                let i = ((py - region.y0) * width + (px - region.x0)) as usize;
                let Demand {
                    samples: n,
                    interpolated,
                } = demands[i];
                if n == 0 || control.stopped().is_some() {
                    return None;
                }
                let at = py as usize * view.width as usize + px as usize;
                let first = seen.samples()[at];
                let mut scratch = Scratch::default();
                let mut sums = vec![PixelSample::default(); n as usize];
                let mut batch = ArrayVec::<Sample, BATCH>::new();
                let own = view.pixel([px, py]);
                let gathering = if interpolated { GATHERING } else { 1.0 };
                for s in 0..n {
                    batch.push(Sample {
                        gathering,
                        ..own.sample(first + s, s as usize)
                    });
                    if batch.is_full() || s + 1 == n {
                        integrator.sample(&mut batch, &mut sums, &mut scratch);
                        batch.clear();
                    }
                }
                stage.advance(u64::from(n));
                let spread = Spread::of(&sums, interpolated);
                let mut halves = [(PixelSample::default(), 0); 2];
                for (s, number) in sums.iter().zip(first..) {
                    let (sum, n) = &mut halves[(number % 2) as usize];
                    sum.merge(s);
                    *n += 1;
                }
                Some((i, spread, [px, py], halves, scratch.rays))
            })
            .collect();
        for (i, spread, at, halves, traced) in taken.into_iter().flatten() {
            out[i] = spread;
            rays.add(&traced);
            film.add_halves(at, halves);
        }
    }
    out
}

impl Spread {
    /// Of the samples of a pixel. Noise of indirect light that will be interpolated calls for no
    /// samples.
    fn of(samples: &[PixelSample], interpolated: bool) -> Self {
        let n = samples.len() as f64;
        let noisy = |s: &PixelSample| {
            let rest = match interpolated {
                true => s.beauty() - s.radiance[Component::Indirect as usize],
                false => s.beauty(),
            };
            rest.luminance()
        };
        let around = samples.iter().map(noisy).sum::<f64>() / n;
        let squares: f64 = samples.iter().map(|s| (noisy(s) - around).powi(2)).sum();
        let mean = samples.iter().map(|s| s.beauty().luminance()).sum::<f64>() / n;
        Self {
            mean,
            variance: squares / (n - 1.0).max(1.0),
        }
    }
}

/// Relative deviation of a sample of pixel `i`, by what is foreseen in it and by its neighbours:
/// those with an edge if it has one, otherwise those without. If an edge has none beside it, by
/// the step from one neighbour to the other.
fn deviation(spreads: &[Spread], edges: &[bool], glints: &[Glint], width: usize, i: usize) -> f64 {
    let (x, y, height) = (i % width, i / width, spreads.len() / width);
    let around = |k: usize, end: usize| k.saturating_sub(AROUND)..(k + AROUND + 1).min(end);
    // A light that is seldom met is foreseen: what samples say of it must not call them to pixels
    // beside it, and away from its own, just when they have met it.
    let others = || {
        around(y, height)
            .flat_map(|y| around(x, width).map(move |x| y * width + x))
            .filter(|k| *k != i && glints[*k].variance == 0.0)
    };
    let alike = others().any(|k| edges[k] == edges[i]);
    let judges = || others().filter(|k| !alike || edges[*k] == edges[i]);
    let n = judges().count().max(1) as f64;
    let mean = judges().map(|k| spreads[k].mean).sum::<f64>() / n;
    let within = judges().map(|k| spreads[k].variance).sum::<f64>() / n;
    let between = || {
        let squares = judges().map(|k| (spreads[k].mean - mean).powi(2));
        squares.sum::<f64>() / n
    };
    let variance = within + if edges[i] && !alike { between() } else { 0.0 };
    let foreseen = |g: &Glint| g.variance / ((mean + g.mean).powi(2) + EPSILON);
    let relative = variance / (mean * mean + EPSILON) + foreseen(&glints[i]);
    if relative.is_finite() {
        relative.sqrt()
    } else {
        0.0
    }
}

/// In proportion to the deviations, but from [`EVEN`] to [`MOST`], with a mean of one.
fn shares(deviations: &[f64], glints: &[Glint]) -> Vec<f32> {
    let n = deviations.len() as f64;
    let largest = deviations.iter().copied().fold(0.0, f64::max);
    if !(largest > 0.0) {
        return vec![1.0; deviations.len()];
    }
    let share = |i: usize, scale: f64| {
        let foreseen = glints[i].variance > 0.0;
        let most = if foreseen { MOST_FORESEEN } else { MOST };
        (deviations[i] * scale).clamp(EVEN, most)
    };
    let all = 0..deviations.len();
    let mean = |scale: f64| all.clone().map(|i| share(i, scale)).sum::<f64>() / n;
    let mut high = 1.0 / largest;
    // Where a few pixels alone vary, their bound keeps them from taking all that others leave.
    for _ in 0..64 {
        if mean(high) < 1.0 {
            high *= 2.0;
        }
    }
    let mut low = 0.0;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if mean(middle) < 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    all.clone().map(|i| share(i, high) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_have_a_mean_of_one_within_their_bounds() {
        for deviations in [
            vec![1.0; 7],
            vec![0.0; 5],
            (0..1000).map(|i| f64::from(i).powi(3)).collect(),
            [vec![0.0; 999], vec![1.0]].concat(),
        ] {
            let s = shares(&deviations, &vec![Glint::default(); deviations.len()]);
            let mean = s.iter().map(|x| f64::from(*x)).sum::<f64>() / s.len() as f64;
            let bounds = s.iter().all(|x| (EVEN as f32..=8.0).contains(x));
            // One pixel alone cannot take what all others leave.
            let all = deviations.iter().filter(|d| **d > 0.0).count() != 1;
            assert!(bounds && (!all || (mean - 1.0).abs() < 1e-5), "{mean}");
        }
    }

    #[test]
    fn a_pixel_has_no_say_in_its_own_deviation() {
        let quiet = vec![
            Spread {
                mean: 1.0,
                variance: 0.1
            };
            25
        ];
        let none = [Glint::default(); 25];
        let mut loud = quiet.clone();
        loud[12] = Spread {
            mean: 50.0,
            variance: 900.0,
        };
        for edge in [false, true] {
            let edges = [edge; 25];
            let [a, b] = [&quiet, &loud].map(|s| deviation(s, &edges, &none, 5, 12));
            assert_eq!(a, b);
            assert!(deviation(&loud, &edges, &none, 5, 11) > 2.0 * a);
        }
        // Like is judged by like, and an edge alone by the step across it.
        let mut edges = [false; 25];
        edges[12] = true;
        assert!(
            deviation(&loud, &edges, &none, 5, 11) == deviation(&quiet, &[false; 25], &none, 5, 11)
        );
        let step: Vec<Spread> = (0..25)
            .map(|i| Spread {
                mean: f64::from(u8::from(i % 5 > 2)),
                variance: 0.0,
            })
            .collect();
        assert_eq!(deviation(&step, &[false; 25], &none, 5, 12), 0.0);
        assert!(deviation(&step, &edges, &none, 5, 12) > 0.5);
    }
}
