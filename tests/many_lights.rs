//! Lights that are out of sight take hardly a shadow ray, and none of the light of the others.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::render::{GATHER, Mode, PATH, Size, mean, render};
use common::{add_quad, add_room, camera, lambert, light};
use dualight::color::Rgb;
use dualight::math::DVec3;
use dualight::scene::{Scene, SceneBuilder};

const SIZE: Size = Size {
    pixels: 16,
    spp: 16,
    photons: 20_000,
};

/// A lamp in a room, and around it as many lamps as there are strengths, of which a hole in the
/// wall lets a little in.
fn room(outside: &[f64]) -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    add_room(&mut b, grey, 1.0);
    // A shelter around the room; its front is not asked for.
    add_quad(
        &mut b,
        "lid",
        grey,
        DVec3::new(-2.0, 1.5, -2.0),
        DVec3::X * 4.0,
        DVec3::Z * 4.0,
    );
    b.add_light(light("point", DVec3::new(0.3, 0.6, 0.2), DVec3::NEG_Y, 1.0));
    for (i, &strength) in outside.iter().enumerate() {
        let at = DVec3::new(3.0 + i as f64, 2.0, 0.5);
        b.add_light(light("point", at, DVec3::NEG_Y, strength));
    }
    b.add_camera(camera(DVec3::new(0.0, 0.0, 0.9), 60.0));
    b.finish().unwrap()
}

/// Mean of the direct light, and how far pixels are from those of `truth`, over the mean.
fn direct(scene: &Scene, mode: Mode, truth: Option<&[[f32; 3]]>) -> (f64, f64, Vec<[f32; 3]>) {
    let image = render(scene, mode, SIZE, 0);
    let pixels = image.rgb("direct").unwrap();
    let mean = mean(&image, "direct");
    let square: f64 = truth.map_or(0.0, |truth| {
        let pairs = pixels.iter().flatten().zip(truth.iter().flatten());
        let sum: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
        sum / (3 * pixels.len()) as f64
    });
    (mean, square.sqrt() / mean, pixels)
}

#[test]
fn lamps_that_walls_keep_out_add_neither_light_nor_noise() {
    for mode in [PATH, GATHER] {
        let (alone, _, truth) = direct(&room(&[]), mode, None);
        // By what they would shed if there were no wall, they would take 99 % of all shadow rays,
        // and pixels would be off by half of their value.
        let crowd = room(&[1000.0, 2000.0, 500.0]);
        let (mean, noise, _) = direct(&crowd, mode, Some(&truth));
        eprintln!(
            "{}: {alone:.5} alone, {mean:.5} ± {noise:.3} in a crowd",
            mode.name
        );
        assert!((mean / alone - 1.0).abs() < 0.02, "{}", mode.name);
        assert!(noise < 0.2, "{}: {noise}", mode.name);
    }
}
