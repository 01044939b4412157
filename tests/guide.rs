//! Guided emission: fifty lamps do not starve the one that makes the caustic, no flux is lost or won,
//! and the photons of an animation do not depend on where its camera is.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::fs;
use std::sync::Arc;

use common::render::with_photons;
use common::stats::Samples;
use common::{add_quad, add_room, add_sphere, glass, lambert, light, look_at};
use dualight::accel::ACCELERATORS;
use dualight::color::Rgb;
use dualight::control::Control;
use dualight::effects::EffectSet;
use dualight::integrators::{Spacing, sights};
use dualight::math::DVec3;
use dualight::photons::{
    EMISSIONS, EmissionEntry, Guidance, GuideBy, PhotonClass, PhotonMaps, PhotonSettings,
    trace_photons,
};
use dualight::pipeline::{self, PhotonFile, RenderSettings, Session};
use dualight::plugins::Registry;
use dualight::scene::{Scene, SceneBuilder};

/// Lamps that make no caustic in sight.
#[derive(Clone, Copy, Debug)]
enum Others {
    None,
    /// Behind a wall and far off.
    Hidden,
    /// Behind a wall, over glass balls of their own.
    Busy,
}

/// A lamp of `strength` W/sr over a ball of glass on a floor, and 49 of 1 W/sr elsewhere.
fn lamps(strength: f64, others: Others) -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.6))).unwrap();
    let glass = b.add_material(&glass(1.5)).unwrap();
    let v = DVec3::new;
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    add_quad(&mut b, "floor", grey, v(-2.0, 0.0, -2.0), 4.0 * z, 4.0 * x);
    // Beyond its focus light spreads again, over many pixels.
    add_sphere(&mut b, "ball", glass, v(0.0, 1.4, 0.0), 0.3);
    // A wall on one side, and a hall behind it.
    add_quad(&mut b, "wall", grey, v(2.0, 0.0, -9.0), 18.0 * z, 9.0 * y);
    add_quad(&mut b, "hall", grey, v(2.0, 0.0, -9.0), 18.0 * z, 18.0 * x);
    b.add_light(light("point", v(0.3, 2.8, 0.2), -y, strength));
    for i in 0..49 {
        let (row, column) = (f64::from(i / 7), f64::from(i % 7));
        let hidden = v(4.0 + 2.0 * row, 2.0, 2.0 * column - 6.0);
        match others {
            Others::None => continue,
            Others::Hidden if i % 2 == 1 => {
                let away = v(-30.0 - row, 20.0, 3.0 * column);
                b.add_light(light("point", away, -y, 1.0));
            }
            Others::Hidden => {
                b.add_light(light("point", hidden, -y, 1.0));
            }
            Others::Busy => {
                b.add_light(light("point", hidden, -y, 1.0));
                let ball = hidden - 1.4 * y;
                add_sphere(&mut b, "ball", glass, ball, 0.3);
            }
        }
    }
    let eye = v(-1.0, 1.0, 3.0);
    b.add_camera(look_at("perspective", eye, v(0.0, 0.0, 0.0), 0.7));
    b.finish().unwrap()
}

const SIDE: u32 = 32;

fn settings(guide: GuideBy, photons: u64, seed: u64) -> RenderSettings {
    let mut out = RenderSettings {
        integrator: Some("photon".into()),
        effects: "-indirect".into(),
        width: SIDE,
        height: SIDE,
        spp: 16,
        ..RenderSettings::default()
    };
    out.integrator_settings.seed = seed;
    out.integrator_settings.guide = guide;
    out.integrator_settings.caustic_photons = photons;
    out
}

fn render(scene: &Scene, settings: &RenderSettings, photons: Option<PhotonFile>) -> Vec<[f32; 3]> {
    let done = with_photons(scene, settings, photons).unwrap();
    done.film.develop().rgb("caustics").unwrap()
}

/// Mean of pictures.
fn mean(pictures: &[Vec<[f32; 3]>]) -> Vec<f64> {
    let n = pictures.len() as f64;
    let sum = |k: usize| pictures.iter().map(|p| f64::from(p[k][1])).sum::<f64>();
    (0..pictures[0].len()).map(|k| sum(k) / n).collect()
}

/// Relative mean squared error of a picture; what is darker than the mean counts as if it were that.
fn error(picture: &[[f32; 3]], truth: &[f64]) -> f64 {
    let n = truth.len() as f64;
    let mean = truth.iter().sum::<f64>() / n;
    let pairs = picture.iter().zip(truth);
    let off = |(p, t): (&[f32; 3], &f64)| (f64::from(p[1]) - t).powi(2) / (t * t + mean * mean);
    pairs.map(off).sum::<f64>() / n
}

/// Photons of a picture whose error is measured, and seeds that it is measured by.
const PHOTONS: u64 = 20_000;
const SEEDS: u64 = 6;

/// Relative error (root of the mean square) of the caustic by each guidance.
fn errors(scene: &Scene, guides: &[GuideBy]) -> Vec<f64> {
    let truth = (100..102).map(|seed| {
        let told = settings(GuideBy::View, 20 * PHOTONS, seed);
        render(scene, &told, None)
    });
    let truth = mean(&truth.collect::<Vec<_>>());
    let of = |&guide: &GuideBy| {
        let errors = (0..SEEDS).map(|seed| {
            let told = settings(guide, PHOTONS, seed);
            error(&render(scene, &told, None), &truth)
        });
        (errors.sum::<f64>() / SEEDS as f64).sqrt()
    };
    guides.iter().map(of).collect()
}

/// Seeds are fixed; over others the ratios spread by some 5 %.
#[test]
fn fifty_lamps_do_not_starve_the_one_that_makes_the_caustic() {
    use GuideBy::{Light, Off, View};
    println!("lamp: error alone; in the crowd unguided, by light, by view; over alone");
    for strength in [0.05, 1.0, 20.0] {
        let alone = errors(&lamps(strength, Others::None), &[Off])[0];
        let crowd = errors(&lamps(strength, Others::Hidden), &[Off, Light, View]);
        let over: Vec<f64> = crowd.iter().map(|e| e / alone).collect();
        println!("{strength}: {alone:.4}; {crowd:.4?}; {over:.2?}");
        // The weak lamp is starved by far.
        assert!(
            strength > 1.0 || over[0] > 3.0,
            "{strength}: nothing to gain"
        );
        assert!(over[1] < 1.5, "{strength}: by light {over:?}");
        assert!(over[2] < 1.5, "{strength}: by view {over:?}");
    }
}

fn maps(scene: &Scene, emission: &EmissionEntry, guide: GuideBy, seed: u64) -> PhotonMaps {
    let accel = (ACCELERATORS[0].build)(&scene.geometry, 1).unwrap();
    let registry = Registry::builtin();
    let told = RenderSettings::default();
    let camera = pipeline::choose_camera(scene, &told, &registry).unwrap();
    let guidance = match guide {
        GuideBy::Off => Guidance::Off,
        GuideBy::Light => Guidance::Light,
        GuideBy::View => {
            let spacing = Spacing::new(SIDE, SIDE, 4);
            Guidance::View(Arc::new(sights(
                scene, &*accel, &*camera, &spacing, seed, 48,
            )))
        }
    };
    let settings = PhotonSettings {
        seed,
        global: 4000,
        caustic: 4000,
        nearest: 50,
        max_depth: None,
        roulette: true,
        guidance,
    };
    let (all, control) = (EffectSet::all(), Control::default());
    trace_photons(scene, &*accel, emission, all, &settings, true, &control)
}

/// Flux of stored photons in parts of the scene, by which paths they came.
fn fluxes(maps: &PhotonMaps) -> Vec<(&'static str, f64)> {
    let sum = |map: &Option<dualight::photons::PhotonMap>, keep: &dyn Fn(f32) -> bool, class| {
        let photons = map.iter().flat_map(|m| m.photons());
        photons
            .filter(|p| keep(p.p[0]) && p.class == class)
            .map(|p| p.power().g)
            .sum::<f64>()
    };
    let (here, hall) = (|x: f32| x < 1.99, |x: f32| x > 1.99);
    vec![
        ("caustic", sum(&maps.caustic, &here, PhotonClass::Caustic)),
        (
            "caustic, hall",
            sum(&maps.caustic, &hall, PhotonClass::Caustic),
        ),
        ("direct", sum(&maps.global, &here, PhotonClass::Direct)),
        (
            "direct, hall",
            sum(&maps.global, &hall, PhotonClass::Direct),
        ),
        ("indirect", sum(&maps.global, &here, PhotonClass::Indirect)),
        (
            "indirect, hall",
            sum(&maps.global, &hall, PhotonClass::Indirect),
        ),
    ]
}

/// Four standard errors of the difference: one false alarm in 16 000 of each of the 48 comparisons.
#[test]
fn guidance_moves_photons_and_no_flux() {
    let scene = lamps(20.0, Others::Hidden);
    for emission in &EMISSIONS[..2] {
        let by = |guide| -> Vec<(&'static str, Samples)> {
            let mut out: Vec<(&'static str, Samples)> = Vec::new();
            for seed in 0..64 {
                for (k, (name, flux)) in fluxes(&maps(&scene, emission, guide, seed))
                    .into_iter()
                    .enumerate()
                {
                    if seed == 0 {
                        out.push((name, Samples::default()));
                    }
                    out[k].1.0.push(flux);
                }
            }
            out
        };
        let plain = by(GuideBy::Off);
        for guide in [GuideBy::Light, GuideBy::View] {
            for ((name, a), (_, b)) in plain.iter().zip(by(guide)) {
                let what = format!("{}, {guide:?}, {name}", emission.name);
                a.assert_agrees(&b, &what, 0.1, 0.0);
            }
        }
    }
}

/// The light that one map has is what the other leaves out: paths belong to one of them.
#[test]
fn the_caustic_map_holds_what_irradiance_leaves_out() {
    let scene = lamps(1.0, Others::Busy);
    for guide in [GuideBy::Off, GuideBy::View] {
        let [mut held, mut left_out] = [Samples::default(), Samples::default()];
        for seed in 0..64 {
            let maps = maps(&scene, &EMISSIONS[0], guide, seed);
            let sum = |map: &Option<dualight::photons::PhotonMap>| {
                let photons = map.iter().flat_map(|m| m.photons());
                let caustic = photons.filter(|p| p.class == PhotonClass::Caustic);
                caustic.map(|p| p.power().g).sum::<f64>()
            };
            held.0.push(sum(&maps.caustic));
            left_out.0.push(sum(&maps.global));
        }
        held.assert_agrees(&left_out, &format!("caustic flux, {guide:?}"), 0.03, 0.0);
    }
}

/// What all of a light's photons carry together is its flux, guided or not.
#[test]
fn guided_photons_carry_the_flux_of_their_lamps() {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    add_room(&mut b, grey, 1.0);
    b.add_light(light("point", DVec3::new(0.9, -0.3, 0.1), DVec3::Y, 1.0));
    b.add_light(light("point", DVec3::new(4.0, 0.0, 0.0), DVec3::Y, 3.0));
    b.add_camera(look_at("perspective", DVec3::ZERO, DVec3::X, 1.0));
    let scene = b.finish().unwrap();
    let flux = 16.0 * std::f64::consts::PI;
    for emission in &EMISSIONS[..2] {
        for guide in [GuideBy::Light, GuideBy::View] {
            let carried = Samples::over_seeds(64, |seed| {
                maps(&scene, emission, guide, seed)
                    .global_counts
                    .flux_emitted
                    / 3.0
            });
            let name = emission.name;
            carried.assert_mean(&format!("{name}, {guide:?}"), flux, 0.01);
        }
    }
}

/// The ball over its floor, from straight above; a camera that is moved by whole pixels sees the same
/// points of the floor each time.
fn frame(number: u32) -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.6))).unwrap();
    let glass = b.add_material(&glass(1.5)).unwrap();
    let v = DVec3::new;
    let (x, z) = (DVec3::X, DVec3::Z);
    add_quad(&mut b, "floor", grey, v(-4.0, 0.0, -4.0), 8.0 * z, 8.0 * x);
    add_sphere(&mut b, "ball", glass, v(0.0, 1.0, 0.0), 0.3);
    b.add_light(light("point", v(-1.5, 2.2, 0.0), -DVec3::Y, 1.0));
    let step = f64::from(number) * WIDTH / f64::from(SIDE);
    // To the right of the picture is −x.
    let at = v(step - 0.25, 5.0, 0.0);
    b.add_camera(look_at("orthographic", at, v(at.x, 0.0, 0.0), WIDTH / 2.0));
    b.finish().unwrap()
}

/// Metres that a frame shows.
const WIDTH: f64 = 4.0;

const FRAMES: u32 = 24;

/// Variance over the frames of what each point of the floor looks like, over the mean square, and the
/// mean squared error of the frames, over the same. `picture` makes a frame.
fn flicker(truth: &[Vec<f64>], picture: impl Fn(u32) -> Vec<[f32; 3]>) -> [f64; 2] {
    let pictures: Vec<_> = (0..FRAMES).map(picture).collect();
    // The part that all frames see.
    let place = |i: u32, x: u32, y: u32| (y * SIDE + x + i) as usize;
    let (mut variance, mut square, mut wrong) = (0.0, 0.0, 0.0);
    for y in 0..SIDE {
        for x in 0..SIDE - FRAMES {
            let seen: Vec<f64> = (0..FRAMES)
                .map(|i| f64::from(pictures[i as usize][place(i, x, y)][1]))
                .collect();
            let n = f64::from(FRAMES);
            let mean = seen.iter().sum::<f64>() / n;
            variance += seen.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
            for (i, s) in (0..FRAMES).zip(&seen) {
                let t = truth[i as usize][place(i, x, y)];
                wrong += (s - t).powi(2) / n;
                square += t * t / n;
            }
        }
    }
    [variance / square, wrong / square]
}

#[test]
fn a_caustic_does_not_flicker_while_the_camera_moves() {
    let frames: Vec<Scene> = (0..FRAMES).map(frame).collect();
    let truth: Vec<Vec<f64>> = frames
        .iter()
        .map(|f| mean(&[render(f, &settings(GuideBy::Light, 100_000, 77), None)]))
        .collect();
    let shot = |guide, seed: &dyn Fn(u32) -> u64| {
        flicker(&truth, |i| {
            let told = settings(guide, 4000, seed(i));
            render(&frames[i as usize], &told, None)
        })
    };
    let still = shot(GuideBy::Light, &|_| 5);
    let looking = shot(GuideBy::View, &|_| 5);
    let noise = shot(GuideBy::Light, &|i| 100 + u64::from(i));
    println!(
        "variance over frames, error: one seed {still:.5?}, guided by the view {looking:.5?}, \
         a seed for each frame {noise:.5?}"
    );
    assert!(noise[0] > 1e-4, "nothing to see");
    // The errors are alike, one being that of a single map.
    assert!(
        (still[1] / noise[1]).ln().abs() < 0.7,
        "{still:?} {noise:?}"
    );
    // What is left is the jitter of samples within pixels.
    assert!(still[0] < 0.5 * noise[0], "{still:?} {noise:?}");
    assert!(looking[0] < 1.1 * noise[0], "{looking:?} {noise:?}");
}

#[test]
fn with_one_seed_the_photon_map_is_the_same_in_every_frame() {
    let directory = tempfile::tempdir().unwrap();
    let kept = |i: u32| {
        let path = directory.path().join(format!("{i}"));
        let told = settings(GuideBy::Light, 3000, 7);
        render(&frame(i), &told, Some(PhotonFile::Save(path.clone())));
        fs::read(path).unwrap()
    };
    let first = kept(0);
    for i in 1..FRAMES {
        assert!(first == kept(i), "frame {i}");
    }
}

#[test]
fn photons_in_a_file_are_not_guided_by_the_view() {
    let directory = tempfile::tempdir().unwrap();
    let session = Session {
        film: None,
        seconds: 0.0,
        watch: &mut |_, _| {},
        photons: Some(PhotonFile::Save(directory.path().join("a"))),
        prepared: None,
    };
    let (registry, control) = (Registry::builtin(), Control::default());
    let told = settings(GuideBy::View, 100, 0);
    let done = pipeline::render_session(&frame(0), &told, &registry, &control, session);
    assert!(done.unwrap_err().to_string().contains("camera"));
}
