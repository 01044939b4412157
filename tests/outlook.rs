//! Which integrator suits a scene, by a trial of its light.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{add_quad, add_room, add_sphere, box_scene, glass, lambert, lamp, look_at};
use dualight::color::Rgb;
use dualight::control::Control;
use dualight::effects;
use dualight::integrators::{Outlook, Trial, suited};
use dualight::math::DVec3;
use dualight::pipeline::{PixelSampling, RenderSettings, prepare};
use dualight::plugins::Registry;
use dualight::scene::{Scene, SceneBuilder};

fn outlook(scene: &Scene, seed: u64) -> (Trial, &'static str, String) {
    let registry = Registry::builtin();
    let mut settings = RenderSettings {
        width: 96,
        height: 96,
        pixel_sampling: PixelSampling::Adaptive,
        accelerator: Some("bvh".into()),
        ..RenderSettings::default()
    };
    settings.integrator_settings.seed = seed;
    let control = Control::default();
    let mut prepared = prepare(scene, &settings, &registry, &control).unwrap();
    let mut trial = || {
        prepared
            .try_out(scene, &settings, &registry, &control)
            .unwrap()
    };
    let told = trial();
    assert_eq!(told, trial(), "the same settings tell the same");
    let effects = effects::survey(scene, "auto", &registry.effects).unwrap();
    let mut outlook = Outlook::new(scene, effects.set);
    outlook.trial = Some(told);
    let (entry, why) = suited(&registry.integrators, &outlook).unwrap();
    (told, entry.name, why)
}

/// A floor under a lamp, in the open; `ball` stands on it.
fn floor(ball: Option<(f64, f64)>) -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.6))).unwrap();
    let lamp = b.add_material(&lamp(Rgb::splat(5.0))).unwrap();
    let (x, z) = (DVec3::X * 4.0, DVec3::Z * 4.0);
    add_quad(&mut b, "floor", grey, DVec3::new(-2.0, 0.0, -2.0), z, x);
    let corner = DVec3::new(-0.5, 3.0, -0.5);
    add_quad(&mut b, "lamp", lamp, corner, DVec3::X, DVec3::Z);
    if let Some((radius, ior)) = ball {
        let glass = b.add_material(&glass(ior)).unwrap();
        add_sphere(&mut b, "ball", glass, DVec3::Y * (radius + 0.2), radius);
    }
    let eye = DVec3::new(0.0, 2.0, 4.0);
    b.add_camera(look_at("perspective", eye, DVec3::ZERO, 1.0));
    b.finish().unwrap()
}

/// A closed white room whose lamp shines at the ceiling.
fn room() -> Scene {
    let mut b = SceneBuilder::default();
    let white = b.add_material(&lambert("white", Rgb::splat(0.8))).unwrap();
    let lamp = b.add_material(&lamp(Rgb::splat(50.0))).unwrap();
    add_room(&mut b, white, 1.0);
    let corner = DVec3::new(-0.1, 0.8, -0.1);
    let (x, z) = (DVec3::X * 0.2, DVec3::Z * 0.2);
    add_quad(&mut b, "lamp", lamp, corner, z, x);
    let eye = DVec3::new(0.0, 0.0, 0.9);
    b.add_camera(look_at("perspective", eye, DVec3::new(0.0, -0.5, 0.0), 1.2));
    b.finish().unwrap()
}

#[test]
fn photons_are_taken_where_they_pay() {
    for seed in 0..4 {
        let (trial, name, why) = outlook(&floor(None), seed);
        assert!(name == "path" && why.contains("but 0 %"), "{name}: {why}");
        assert_eq!(trial.caustics, 0.0);

        let (trial, name, why) = outlook(&floor(Some((0.5, 1.5))), seed);
        assert!(
            name == "photon" && why.contains("throw caustics"),
            "{name}: {why}"
        );
        // A ball hides the disc behind it, and nearly all of that light goes through.
        assert!((0.02..0.5).contains(&trial.caustics), "{trial:?}");

        // A hundredth as wide, it redirects a ten-thousandth of that.
        let (trial, name, why) = outlook(&floor(Some((0.005, 1.5))), seed);
        assert!(name == "path" && trial.caustics < 2e-3, "{name}: {why}");

        let (trial, name, why) = outlook(&room(), seed);
        assert!(
            name == "photon" && why.contains("indirect light"),
            "{name}: {why}"
        );
        assert_eq!(trial.caustics, 0.0);

        let (_, name, why) = outlook(&box_scene(), seed);
        assert!(
            name == "photon" && why.contains("throw caustics"),
            "{name}: {why}"
        );
    }
}
