//! How noisy the components of a picture are by an integrator, found by a few samples of it.

use arrayvec::ArrayVec;
use rayon::prelude::*;

use super::camera_pass::View;
use super::{BATCH, Integrator, Sample, Scratch, Spacing};
use crate::cameras::Camera;
use crate::film::{Component, PixelSample};

/// Added to the squared mean, as in the relative errors of reports.
const EPSILON: f64 = 0.01;

/// Relative variance of a sample's luminance in each [`Component`], over the squared luminance of
/// the picture, in the mean of all pixels of a picture of this size, by so many samples a pixel.
pub fn noise(
    integrator: &dyn Integrator,
    camera: &dyn Camera,
    (spacing, differentials): (&Spacing, bool),
    seed: u64,
    size: [u32; 2],
    samples: u32,
) -> [f64; 4] {
    let view = View {
        camera,
        seed,
        spacing,
        differentials,
        width: size[0],
    };
    let pixels: Vec<(f64, [f64; 4])> = (0..size[0] * size[1])
        .into_par_iter()
        .map(|i| pixel(&view, integrator, [i % size[0], i / size[0]], samples))
        .collect();
    let (width, height) = (size[0] as usize, size[1] as usize);
    // The mean of a pixel's few samples is too uncertain to divide by.
    let around = |i: usize| {
        let near = |k: usize, end: usize| k.saturating_sub(1)..(k + 2).min(end);
        let rows = near(i / width, height);
        mean(
            rows.flat_map(|y| near(i % width, width).map(move |x| y * width + x))
                .map(|k| pixels[k].0),
        )
    };
    let mut sum = [0.0; 4];
    for (i, (_, variances)) in pixels.iter().enumerate() {
        let weight = 1.0 / (around(i).powi(2) + EPSILON);
        for (sum, variance) in sum.iter_mut().zip(variances) {
            *sum += variance * weight;
        }
    }
    sum.map(|s| s / pixels.len().max(1) as f64)
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
    sum / f64::max(n, 1.0)
}

/// Mean luminance of a pixel, and the variance of a sample by component.
fn pixel(
    view: &View<'_>,
    integrator: &dyn Integrator,
    at: [u32; 2],
    samples: u32,
) -> (f64, [f64; 4]) {
    let own = view.pixel(at);
    let mut sums = vec![PixelSample::default(); samples as usize];
    let mut scratch = Scratch::default();
    let mut batch = ArrayVec::<Sample, BATCH>::new();
    for s in 0..samples {
        batch.push(own.sample(s, s as usize));
        if batch.is_full() || s + 1 == samples {
            integrator.sample(&mut batch, &mut sums, &mut scratch);
            batch.clear();
        }
    }
    let variance = |c: Component| {
        let of = |s: &PixelSample| s.radiance[c as usize].luminance();
        let m = mean(sums.iter().map(of));
        let squares: f64 = sums.iter().map(|s| (of(s) - m).powi(2)).sum();
        squares / f64::from(samples.saturating_sub(1).max(1))
    };
    let luminance = mean(sums.iter().map(|s| s.beauty().luminance()));
    (luminance, Component::ALL.map(variance))
}
