//! Adaptive pixel sampling: the same picture as by even samples, nothing thin lost, and less error
//! where edges are.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::render::plain_pixels;
use common::{add_quad, add_sphere, camera, lambert, lamp, light};
use dualight::color::Rgb;
use dualight::control::Control;
use dualight::film::Image;
use dualight::math::DVec3;
use dualight::pipeline::{PixelSampling, Progressive, RenderSettings, render};
use dualight::plugins::Registry;
use dualight::scene::{Scene, SceneBuilder};
use rayon::prelude::*;

const SIDE: u32 = 32;
const SPP: u32 = 16;

/// A grey wall with a bright disc before it, a wire a tenth of a pixel wide, and in the upper
/// right a ball that is a hundredth of a pixel large, both so bright that the image shows them.
fn thin() -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    let white = b.add_material(&lambert("white", Rgb::splat(0.9))).unwrap();
    let wire = b.add_material(&lamp(Rgb::new(4.0, 2.0, 1.0))).unwrap();
    let spark = b.add_material(&lamp(Rgb::splat(20.0))).unwrap();
    let corner = DVec3::new(-2.0, -2.0, -1.0);
    add_quad(&mut b, "wall", grey, corner, DVec3::X * 4.0, DVec3::Y * 4.0);
    add_sphere(&mut b, "ball", white, DVec3::new(-0.3, -0.3, 0.0), 0.35);
    // The image plane at the origin is 2 wide: a pixel is 1/16.
    let along = DVec3::new(1.1, 0.13, 0.0);
    let from = DVec3::new(-0.6, 0.52, 0.0);
    add_quad(&mut b, "wire", wire, from, along, DVec3::Y * 0.00625);
    add_sphere(&mut b, "spark", spark, DVec3::new(0.61, 0.79, 0.0), 3e-3);
    b.add_light(light(
        "directional",
        DVec3::ZERO,
        DVec3::new(0.3, -0.5, -1.0),
        2.0,
    ));
    let eye = DVec3::new(0.0, 0.0, 4.0);
    b.add_camera(camera(eye, 2.0 * (0.25_f64).atan().to_degrees()));
    b.finish().unwrap()
}

fn settings(pixel_sampling: PixelSampling, seed: u64) -> RenderSettings {
    RenderSettings {
        // Direct light alone.
        effects: "-indirect,-caustics,-specular,-refraction".into(),
        ..plain_pixels([SIDE, SPP], pixel_sampling, seed)
    }
}

fn image(scene: &Scene, settings: &RenderSettings) -> Image {
    let registry = Registry::builtin();
    let rendering = render(scene, settings, &registry, &Control::default()).unwrap();
    rendering.film.develop()
}

/// Means over the channels of each pixel.
fn pixels(image: &Image) -> Vec<f64> {
    let rgb = image.rgb("").unwrap();
    rgb.iter()
        .map(|p| f64::from(p.iter().sum::<f32>()) / 3.0)
        .collect()
}

/// Means over blocks of 4×4 pixels.
fn blocks(pixels: &[f64]) -> Vec<f64> {
    let side = SIDE as usize / 4;
    let mut out = vec![0.0; side * side];
    for (i, v) in pixels.iter().enumerate() {
        let (x, y) = (i % SIDE as usize / 4, i / SIDE as usize / 4);
        out[y * side + x] += v / 16.0;
    }
    out
}

#[test]
fn the_mean_is_that_of_even_samples() {
    const SEEDS: u64 = 120;
    let scene = thin();
    let run = |sampling, offset| -> Vec<Vec<f64>> {
        (0..SEEDS)
            .into_par_iter()
            .map(|s| pixels(&image(&scene, &settings(sampling, s + offset))))
            .collect()
    };
    let (a, b) = (
        run(PixelSampling::Uniform, 0),
        run(PixelSampling::Adaptive, 10_000),
    );
    let moments = |runs: &[Vec<f64>], k: usize| {
        let n = SEEDS as f64;
        let m = runs.iter().map(|r| r[k]).sum::<f64>() / n;
        let v = runs.iter().map(|r| (r[k] - m).powi(2)).sum::<f64>() / (n * (n - 1.0));
        (m, v)
    };
    // The relative mean squared error, over all pixels.
    let error = |runs: &[Vec<f64>]| -> f64 {
        let of = |k| {
            let (m, v) = moments(runs, k);
            v * SEEDS as f64 / (m * m + 0.01)
        };
        (0..runs[0].len()).map(of).sum::<f64>() / runs[0].len() as f64
    };
    let (even, adaptive) = (error(&a), error(&b));
    let [a, b] = [a, b].map(|runs| runs.iter().map(|r| blocks(r)).collect::<Vec<_>>());
    let mut zs = Vec::new();
    for k in 0..a[0].len() {
        let ((ma, va), (mb, vb)) = (moments(&a, k), moments(&b, k));
        // Where both are exact, rounding is all that differs.
        zs.push((ma - mb) / (va + vb + (1e-5 * ma).powi(2) + 1e-15).sqrt());
    }
    let worst = zs.iter().fold(0.0f64, |m, z| m.max(z.abs()));
    let pooled = zs.iter().map(|z| z * z).sum::<f64>();
    let (n, gain) = (zs.len() as f64, even / adaptive);
    println!(
        "worst block {worst:.2} sigma, χ² {pooled:.1} of {n}, error {even:.4} and {adaptive:.4}"
    );
    // One of 64 blocks beyond 4 has a chance of 1 in 250; a χ² beyond 3.1 deviations 1 in 1000.
    assert!(worst < 4.0 && (pooled - n) < 3.1 * (2.0 * n).sqrt());
    // As many samples, and less error.
    assert!(gain > 1.0, "{gain}");
}

#[test]
fn edges_are_forecast_and_get_more_samples() {
    let scene = thin();
    let image = image(&scene, &settings(PixelSampling::Adaptive, 1));
    let edges = image.channel("pixels", "edges").unwrap();
    let samples = image.channel("pixels", "samples").unwrap();
    let at = |x: f64, y: f64| {
        let pixel = |v: f64| (f64::from(SIDE) * 0.5 * (1.0 + v)) as usize;
        pixel(-y) * SIDE as usize + pixel(x)
    };
    // The outline of the ball, and the spark that no ray has met.
    let spark = at(0.61, 0.79);
    assert_eq!(edges[spark], 1.0);
    for i in 0..64 {
        let (s, c) = (f64::from(i) / 64.0 * std::f64::consts::TAU).sin_cos();
        // A little wider than its radius, in perspective.
        let r = 0.35 / (1.0 - (0.35_f64 / 4.0).powi(2)).sqrt();
        let (x, y) = (-0.3 + r * c, -0.3 + r * s);
        let near = [-1.0, 0.0, 1.0].map(|d| at(x + d * c / 16.0, y + d * s / 16.0));
        assert!(near.iter().any(|k| edges[*k] == 1.0), "{x} {y}");
    }
    // Inside the ball and on the wall nothing changes.
    for (x, y) in [(-0.3, -0.3), (0.5, -0.5), (-0.8, 0.8)] {
        assert_eq!(edges[at(x, y)], 0.0, "{x} {y}");
    }
    let mean = samples.iter().sum::<f32>() / samples.len() as f32;
    let least = samples.iter().copied().fold(f32::INFINITY, f32::min);
    let of = |edge: f32| {
        let own = samples.iter().zip(edges).filter(|(_, e)| **e == edge);
        let n = own.clone().count() as f32;
        own.map(|(n, _)| n).sum::<f32>() / n
    };
    println!(
        "{mean} in the mean, {least} at least, {} at edges, {} elsewhere",
        of(1.0),
        of(0.0)
    );
    // Nowhere fewer than half: what nothing foresees is met all the same.
    assert!((mean / SPP as f32 - 1.0).abs() < 0.05 && least >= SPP as f32 / 2.0);
    assert!(of(1.0) > 1.5 * of(0.0));
}

#[test]
fn threads_and_crops_change_nothing_they_should_not() {
    let scene = thin();
    let mut told = settings(PixelSampling::Adaptive, 5);
    // Several passes, of which the first makes the plan.
    told.spp = 40;
    let one = image(&scene, &told);
    told.threads = Some(3);
    assert_eq!(one, image(&scene, &told));
    let samples = one.channel("pixels", "samples").unwrap();
    let mean = samples.iter().sum::<f32>() / samples.len() as f32;
    assert!((mean / 40.0 - 1.0).abs() < 0.05, "{mean}");
    told.crop = Some([3, 4, 21, 30]);
    let part = image(&scene, &told);
    let (edges, whole) = [&part, &one]
        .map(|i| i.channel("pixels", "edges").unwrap())
        .into();
    for (i, (a, b)) in edges.iter().zip(whole).enumerate() {
        let (x, y) = (i % SIDE as usize, i / SIDE as usize);
        let inside = (3..21).contains(&x) && (4..30).contains(&y);
        assert_eq!(*a, if inside { *b } else { 0.0 }, "{x} {y}");
    }
}

#[test]
fn passes_kept_apart_are_refused() {
    let mut told = settings(PixelSampling::Adaptive, 0);
    told.progressive = Some(Progressive::default());
    let registry = Registry::builtin();
    let refused = render(&thin(), &told, &registry, &Control::default());
    assert!(refused.unwrap_err().to_string().contains("exclude"));
}
