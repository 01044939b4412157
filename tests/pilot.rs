//! Light that surfaces pass to one another is left out where a pilot finds no way for it.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::render::{GATHER, PATH, Size, mean, rendering, settings};
use common::{add_quad, add_sphere, glass, lambert, lamp, light, look_at, mirror};
use dualight::color::Rgb;
use dualight::math::DVec3;
use dualight::pipeline::Rendering;
use dualight::scene::{Scene, SceneBuilder};

const SIZE: Size = Size {
    pixels: 24,
    spp: 16,
    photons: 20_000,
};

/// A grey ball of radius 1 under a lamp of no extent; `more` adds to it.
fn ball(more: impl FnOnce(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.8))).unwrap();
    add_sphere(&mut b, "ball", grey, DVec3::ZERO, 1.0);
    let from = DVec3::new(2.0, 2.0, 3.0);
    b.add_light(light("point", from, -from, 20.0));
    more(&mut b);
    let eye = DVec3::new(0.0, 1.0, 4.0);
    b.add_camera(look_at("perspective", eye, DVec3::ZERO, 0.8));
    b.finish().unwrap()
}

/// Adds a lamp that is a surface, above the ball.
fn panel(b: &mut SceneBuilder) {
    let lamp = b.add_material(&lamp(Rgb::splat(5.0))).unwrap();
    let corner = DVec3::new(-0.5, 3.0, -0.5);
    add_quad(b, "lamp", lamp, corner, DVec3::X, DVec3::Z);
}

fn is_on(rendering: &Rendering, name: &str) -> bool {
    rendering.effects.iter().any(|d| d.name == name && d.on)
}

#[test]
fn a_lone_convex_body_has_no_indirect_light_and_pays_for_none() {
    for (scene, has_panel) in [(ball(|_| {}), false), (ball(panel), true)] {
        for mode in [PATH, GATHER] {
            let found = rendering(&scene, &settings(mode, SIZE, 1));
            assert!(!is_on(&found, "indirect") && !is_on(&found, "caustics"));
            let why = found.effects.iter().find(|d| d.name == "indirect").unwrap();
            assert!(why.reason.contains("none met"), "{}", why.reason);

            let mut forced = settings(mode, SIZE, 1);
            forced.effects = "+indirect".into();
            let forced = rendering(&scene, &forced);
            assert!(is_on(&forced, "indirect"));
            let [few, many] = [&found, &forced].map(|r| r.statistics.rays);
            assert_eq!((few.gather, few.photon), (0, 0));
            // Only rays that may meet a lamp are traced for the sake of direct light.
            assert!(few.bounce <= many.bounce, "{few:?} {many:?}");
            assert_eq!(
                few.bounce > 0,
                has_panel && mode.name == PATH.name,
                "{few:?}"
            );

            let [found, forced] = [found, forced].map(|r| r.film.develop());
            assert_eq!(mean(&forced, "indirect"), 0.0);
            let all = |image| mean(image, "direct");
            // 24² pixels of 16 samples each: 2 % are more than four standard errors.
            assert!((all(&found) / all(&forced) - 1.0).abs() < 0.02);
        }
    }
}

#[test]
fn light_that_one_surface_in_a_hundred_passes_on_is_kept() {
    type More = fn(&mut SceneBuilder);
    let far: More = |b| {
        let grey = b.add_material(&lambert("far", Rgb::splat(0.5))).unwrap();
        add_sphere(b, "far", grey, DVec3::new(30.0, 0.0, 0.0), 1.0);
    };
    let floor: More = |b| {
        let grey = b.add_material(&lambert("floor", Rgb::splat(0.5))).unwrap();
        let (x, z) = (DVec3::X * 8.0, DVec3::Z * 8.0);
        add_quad(b, "floor", grey, DVec3::new(-4.0, -1.0, -4.0), z, x);
    };
    let glass: More = |b| {
        let glass = b.add_material(&glass(1.5)).unwrap();
        add_sphere(b, "glass", glass, DVec3::new(5.0, 5.0, 0.0), 0.5);
    };
    // The camera sees the two that face each other in a mirror only.
    let mirrored: More = |b| {
        let glass = b.add_material(&mirror()).unwrap();
        let (x, y) = (DVec3::X * 0.4, DVec3::Y * 0.4);
        add_quad(b, "mirror", glass, DVec3::new(-0.2, 0.9, 1.5), x, y);
        let grey = b.add_material(&lambert("behind", Rgb::splat(0.5))).unwrap();
        for x in [-2.0, 2.0] {
            add_sphere(b, "behind", grey, DVec3::new(x, 1.0, 12.0), 1.5);
        }
    };
    for more in [far, floor, glass, mirrored] {
        let found = rendering(&ball(more), &settings(PATH, SIZE, 1));
        assert!(is_on(&found, "indirect"));
    }
}
