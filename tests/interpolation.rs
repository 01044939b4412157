//! Indirect light interpolated in pixels without an edge: less error, nothing moved, and nothing
//! but indirect light touched.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::render::{PATH, Size, mean, rendering, settings};
use dualight::film::Image;
use dualight::pipeline::PixelSampling;
use dualight::scene::Scene;

const SIDE: u32 = 40;

fn image(scene: &Scene, spp: u32, seed: u64, interpolation: bool) -> Image {
    let size = Size {
        pixels: SIDE,
        spp,
        photons: 0,
    };
    let mut s = settings(PATH, size, seed);
    s.pixel_sampling = PixelSampling::Adaptive;
    s.interpolation = interpolation;
    let done = rendering(scene, &s);
    assert_eq!(done.film.reach().is_some(), interpolation);
    done.film.develop()
}

fn reference(scene: &Scene) -> Image {
    let size = Size {
        pixels: SIDE,
        spp: 1024,
        photons: 0,
    };
    rendering(scene, &settings(PATH, size, 77)).film.develop()
}

/// Mean squared error of a layer, of the reference's squares.
fn relative(layer: &str, image: &Image, reference: &Image) -> f64 {
    let (a, b) = (image.rgb(layer).unwrap(), reference.rgb(layer).unwrap());
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    let one = |(x, y): (&f32, &f32)| f64::from(x - y).powi(2) / (f64::from(*y).powi(2) + 0.01);
    pairs.map(one).sum::<f64>() / (3 * a.len()) as f64
}

#[test]
fn indirect_light_has_a_third_of_the_error() {
    let scene = common::box_scene();
    let reference = reference(&scene);
    let [mut own, mut interpolated, mut off] = [0.0; 3];
    let layers = ["direct", "specular", "caustics", "indirect"];
    let mut whole = [0.0; 2];
    for seed in 0..2 {
        let pair = [false, true].map(|on| image(&scene, 8, seed, on));
        let [a, b] = &pair;
        own += relative("indirect", a, &reference);
        interpolated += relative("indirect", b, &reference);
        off += (mean(b, "indirect") / mean(a, "indirect") - 1.0) / 2.0;
        for (sum, image) in whole.iter_mut().zip(&pair) {
            *sum += relative("", image, &reference);
        }
        // The beauty stays the sum of its parts.
        let parts = layers.map(|l| b.rgb(l).unwrap());
        for (i, all) in b.rgb("").unwrap().iter().enumerate() {
            for c in 0..3 {
                let sum: f32 = parts.iter().map(|p| p[i][c]).sum();
                assert!((sum - all[c]).abs() <= 1e-5 * all[c].abs().max(1.0));
            }
        }
    }
    println!("{interpolated} of {own}, mean {off}, whole {whole:?}");
    assert!(interpolated < own / 3.0, "{interpolated} of {own}");
    // Two pictures of different samples: the mean of one is good to some tenths of a percent.
    assert!(off.abs() < 0.01, "{off}");
    // Samples that indirect light no longer calls for serve the rest.
    assert!(whole[1] < 0.6 * whole[0], "{whole:?}");
}

#[test]
fn more_samples_leave_less_error() {
    let scene = common::box_scene();
    let reference = reference(&scene);
    let of = |spp, interpolation| {
        let error = |seed| {
            relative(
                "indirect",
                &image(&scene, spp, seed, interpolation),
                &reference,
            )
        };
        (0..2).map(error).sum::<f64>() / 2.0
    };
    let [few, many] = [4, 64].map(|spp| of(spp, true));
    let own = of(64, false);
    // Bias that did not vanish would stop this. Planes in windows that fit the noise converge with
    // the power 2/3 of the samples at best: 6 times less error, of a few pictures about half of that.
    println!("{few} to {many}, own {own}");
    assert!(
        many < few / 2.0 && many < own / 3.0,
        "{few} to {many}, own {own}"
    );
}
