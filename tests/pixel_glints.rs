//! Lights whose images in mirrors and glass are smaller than a pixel: they are foreseen, get samples
//! that make them sure, and the picture's mean stays what it is.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::render::plain_pixels;
use common::{add_quad, add_sphere, camera, glass, lambert, lamp, mirror};
use dualight::color::Rgb;
use dualight::control::Control;
use dualight::film::Image;
use dualight::materials::MaterialDesc;
use dualight::math::DVec3;
use dualight::pipeline::{PixelSampling, render};
use dualight::plugins::Registry;
use dualight::scene::{Scene, SceneBuilder};
use rayon::prelude::*;

const SIDE: u32 = 16;
const SPP: u32 = 16;
const SEEDS: u64 = 384;

/// Seeds that are rendered at a time.
const AT_ONCE: usize = 96;

/// Radiance of the lamp.
const RADIANCE: f64 = 2000.0;

/// Where the camera looks from, along -z; at the origin the image is 2 wide.
const EYE: DVec3 = DVec3::new(0.0, 0.0, 4.0);

/// With a lamp that is not seen straight.
fn view(mut b: SceneBuilder, at: DVec3, radius: f64) -> Scene {
    let spark = b.add_material(&lamp(Rgb::splat(RADIANCE))).unwrap();
    add_sphere(&mut b, "spark", spark, at, radius);
    b.add_camera(camera(EYE, 2.0 * (0.25_f64).atan().to_degrees()));
    b.finish().unwrap()
}

/// A mirror that fills the image, in the plane z = 0.
fn flat(at: DVec3, radius: f64) -> Scene {
    let mut b = SceneBuilder::default();
    let m = b.add_material(&mirror()).unwrap();
    let corner = DVec3::new(-3.0, -3.0, 0.0);
    add_quad(&mut b, "mirror", m, corner, DVec3::X * 6.0, DVec3::Y * 6.0);
    view(b, at, radius)
}

/// A ball before a grey wall, with the lamp beside the camera.
fn ball(material: &MaterialDesc) -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    let corner = DVec3::new(-6.0, -6.0, -3.0);
    add_quad(
        &mut b,
        "wall",
        grey,
        corner,
        DVec3::X * 12.0,
        DVec3::Y * 12.0,
    );
    let m = b.add_material(material).unwrap();
    add_sphere(&mut b, "ball", m, DVec3::ZERO, 0.8);
    view(b, DVec3::new(1.3, 1.1, 3.0), 0.05)
}

fn image(scene: &Scene, pixel_sampling: PixelSampling, seed: u64) -> Image {
    let settings = plain_pixels([SIDE, SPP], pixel_sampling, seed);
    let registry = Registry::builtin();
    let rendering = render(scene, &settings, &registry, &Control::default()).unwrap();
    rendering.film.develop()
}

/// Mean and variance over seeds of the picture's mean, and the mean relative squared error.
fn statistics(scene: &Scene, sampling: PixelSampling, offset: u64) -> [f64; 3] {
    let run = |seed: &u64| -> Vec<f64> {
        let image = image(scene, sampling, *seed);
        let rgb = image.rgb("").unwrap();
        rgb.iter().map(|p| f64::from(p[1])).collect()
    };
    let seeds: Vec<u64> = (offset..offset + SEEDS).collect();
    let runs: Vec<Vec<f64>> = seeds
        .chunks(AT_ONCE)
        .flat_map(|seeds| seeds.par_iter().map(run).collect::<Vec<_>>())
        .collect();
    let (n, pixels) = (SEEDS as f64, f64::from(SIDE * SIDE));
    let moments = |of: &dyn Fn(&Vec<f64>) -> f64| {
        let m = runs.iter().map(of).sum::<f64>() / n;
        let v = runs.iter().map(|r| (of(r) - m).powi(2)).sum::<f64>() / (n - 1.0);
        (m, v)
    };
    let (mean, variance) = moments(&|r| r.iter().sum::<f64>() / pixels);
    let error = (0..runs[0].len()).map(|k| {
        let (m, v) = moments(&|r| r[k]);
        v / (m * m + 0.01)
    });
    [mean, variance / n, error.sum::<f64>() / pixels]
}

#[test]
fn the_image_in_a_flat_mirror_is_as_bright_as_it_must_be() {
    let (at, radius) = (DVec3::new(0.93, -0.71, 2.0), 0.01);
    let scene = flat(at, radius);
    // The lamp mirrored at z = 0, seen from the eye: an ellipse, to the second order of its size
    // a disc stretched by the slant, projected onto the image plane at the origin.
    let there = DVec3::new(at.x, at.y, -at.z) - EYE;
    let (distance, ahead) = (there.length(), -there.z);
    let solid_angle = std::f64::consts::PI * (radius / distance).powi(2);
    let cos = ahead / distance;
    let area = solid_angle * EYE.z.powi(2) / cos.powi(3);
    let expected = RADIANCE * area / 4.0;
    for (sampling, offset) in [(PixelSampling::Uniform, 0), (PixelSampling::Adaptive, 1000)] {
        let [mean, variance, error] = statistics(&scene, sampling, offset);
        let z = (mean - expected) / variance.sqrt();
        println!(
            "{sampling:?}: {mean:.5} ± {:.5} of {expected:.5}, relative error {error:.4}",
            variance.sqrt()
        );
        // Two tests of 1 in 15 000.
        assert!(z.abs() < 4.0, "{z}");
    }
    // The pixel that shows it, and no other, has most of the samples that it may have.
    let image = image(&scene, PixelSampling::Adaptive, 0);
    let samples = image.channel("pixels", "samples").unwrap();
    let to_pixel = |x: f64| (x + 1.0) * f64::from(SIDE) / 2.0;
    let on_plane = there * (EYE.z / ahead);
    let (x, y) = (
        to_pixel(on_plane.x) as usize,
        to_pixel(-on_plane.y) as usize,
    );
    for (i, n) in samples.iter().enumerate() {
        let away = |a: usize, b: usize| a.abs_diff(b);
        let near = away(i % SIDE as usize, x).max(away(i / SIDE as usize, y));
        match near {
            0 => assert!(*n > 16.0 * SPP as f32, "{n} in {x}, {y}"),
            1 => {}
            _ => assert!(*n < SPP as f32, "{n} in pixel {i}"),
        }
    }
}

#[test]
fn images_in_balls_are_foreseen() {
    for (name, material) in [("mirror", mirror()), ("glass", glass(1.5))] {
        let scene = ball(&material);
        let [a, va, even] = statistics(&scene, PixelSampling::Uniform, 0);
        let [b, vb, adaptive] = statistics(&scene, PixelSampling::Adaptive, 1000);
        let (z, gain) = ((a - b) / (va + vb).sqrt(), even / adaptive);
        println!("{name}: {z:.2} sigma, error {even:.4} and {adaptive:.4}: {gain:.1} times less");
        // Two tests of 1 in 15 000.
        assert!(z.abs() < 4.0, "{name}: {z}");
        assert!(gain > 6.0, "{name}: {gain}");
    }
}
