//! The share of the samples that each pixel gets, by its neighbours and by what is foreseen in it.

use rayon::prelude::*;

use super::pixel_glints::Glint;
use crate::film::{Component, PixelSample};

/// Share of the samples that all pixels get alike: whatever nothing foresees is met with it. With
/// a quarter, wires that few samples meet were starved, and cost more than edges gained.
pub(super) const EVEN: f64 = 0.5;

/// Most samples of a pixel, over the mean.
const MOST: f64 = 8.0;

/// The same where the forecast tells of a light that most samples miss.
const MOST_FORESEEN: f64 = 64.0;

/// Neighbours that a pixel is judged by lie at most so many pixels away.
const AROUND: usize = 2;

/// Least relative deviation, over the mean of the image: what few samples say is uncertain.
const LEAST: f64 = 0.2;

/// Added to the squared mean, as in the relative errors of reports.
const EPSILON: f64 = 0.01;

/// What the even samples of a pixel say, as sums that can be merged.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    count: f64,
    mean: f64,
    /// Mean of that part of the luminance whose noise calls for samples.
    noisy: f64,
    /// Its squared deviations from that mean, summed.
    squares: f64,
}

impl Spread {
    /// Of the samples of a pixel. Noise of indirect light that will be interpolated calls for no
    /// samples.
    pub(super) fn of(samples: &[PixelSample], interpolated: bool) -> Self {
        let count = samples.len() as f64;
        let noisy = |s: &PixelSample| {
            let rest = match interpolated {
                true => s.beauty() - s.radiance[Component::Indirect as usize],
                false => s.beauty(),
            };
            rest.luminance()
        };
        let around = samples.iter().map(noisy).sum::<f64>() / count;
        Self {
            count,
            mean: samples.iter().map(|s| s.beauty().luminance()).sum::<f64>() / count,
            noisy: around,
            squares: samples.iter().map(|s| (noisy(s) - around).powi(2)).sum(),
        }
    }

    /// Adds other samples of the pixel (Chan, Golub and LeVeque, *Updating Formulae and a Pairwise
    /// Algorithm for Computing Sample Variances*, 1979).
    pub(super) fn merge(&mut self, other: &Self) {
        let count = self.count + other.count;
        if count == 0.0 {
            return;
        }
        let (part, step) = (other.count / count, other.noisy - self.noisy);
        self.squares += other.squares + self.count * part * step * step;
        self.noisy += part * step;
        self.mean += part * (other.mean - self.mean);
        self.count = count;
    }

    /// Variance of a sample, where it calls for more.
    fn variance(&self) -> f64 {
        self.squares / (self.count - 1.0).max(1.0)
    }
}

/// Samples of each pixel of a region so many wide, over the mean of all.
pub(super) fn shares_by(
    spreads: &[Spread],
    edges: &[bool],
    glints: &[Glint],
    width: usize,
) -> Vec<f32> {
    let mut deviations: Vec<f64> = (0..edges.len())
        .into_par_iter()
        .map(|i| deviation(spreads, edges, glints, width, i))
        .collect();
    let mean = |kept: &dyn Fn(usize) -> bool| {
        let own = (0..edges.len()).filter(|i| kept(*i));
        let (sum, n) = own.fold((0.0, 0.0), |(s, n), i| (s + deviations[i], n + 1.0));
        sum / f64::max(n, 1.0)
    };
    // An edge that nothing around it tells of may be the only sign of something small.
    let (least, least_edge) = (LEAST * mean(&|_| true), mean(&|i| edges[i]));
    for (d, edge) in deviations.iter_mut().zip(edges) {
        *d = d.max(if *edge { least_edge } else { least });
    }
    shares(&deviations, glints)
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
    let within = judges().map(|k| spreads[k].variance()).sum::<f64>() / n;
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
    use crate::color::Rgb;

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
    fn rounds_tell_what_all_of_their_samples_do() {
        let samples: Vec<PixelSample> = (0..13)
            .map(|i| {
                let mut s = PixelSample::default();
                s.radiance[Component::Direct as usize] = Rgb::splat(f64::from(i * i % 7));
                s.radiance[Component::Indirect as usize] = Rgb::splat(f64::from(i * 5 % 11));
                s
            })
            .collect();
        for interpolated in [false, true] {
            let whole = Spread::of(&samples, interpolated);
            let mut merged = Spread::default();
            for part in [
                &samples[..2],
                &samples[2..4],
                &samples[4..12],
                &samples[12..],
            ] {
                merged.merge(&Spread::of(part, interpolated));
            }
            let close = |a: f64, b: f64| (a - b).abs() < 1e-12 * a.abs().max(1.0);
            assert_eq!(merged.count, 13.0);
            assert!(close(merged.mean, whole.mean) && close(merged.noisy, whole.noisy));
            assert!(close(merged.variance(), whole.variance()) && whole.variance() > 1.0);
        }
    }

    #[test]
    fn a_pixel_has_no_say_in_its_own_deviation() {
        let spread = |mean, variance| Spread {
            count: 2.0,
            mean,
            noisy: mean,
            squares: variance,
        };
        let quiet = vec![spread(1.0, 0.1); 25];
        let none = [Glint::default(); 25];
        let mut loud = quiet.clone();
        loud[12] = spread(50.0, 900.0);
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
            .map(|i| spread(f64::from(u8::from(i % 5 > 2)), 0.0))
            .collect();
        assert_eq!(deviation(&step, &[false; 25], &none, 5, 12), 0.0);
        assert!(deviation(&step, &edges, &none, 5, 12) > 0.5);
    }
}
