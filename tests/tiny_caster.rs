//! A glass ball of a millionth of a steradian: how many photons leave the lamp until a thousand of
//! them have passed the ball and landed in the caustic map.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::f64::consts::PI;

use common::render::bvh;
use common::{add_quad, add_room, add_sphere, glass, lambert, light};
use dualight::accel::Accelerator;
use dualight::color::Rgb;
use dualight::control::Control;
use dualight::effects::EffectSet;
use dualight::geometry::sphere;
use dualight::math::DVec3;
use dualight::photons::{
    EMISSIONS, EmissionContext, PhotonSettings, PhotonSource, Purpose, follow_photons,
};
use dualight::scene::{Scene, SceneBuilder};
use dualight::stats::cpu_seconds;

/// Photons that are to land.
const WANTED: usize = 1000;

/// Where the lamp is, and the ball.
const LAMP: DVec3 = DVec3::new(0.0, 1.8, 0.0);
const BALL: DVec3 = DVec3::new(0.31, 0.4, -0.17);

/// The radius under which the lamp sees the ball with this solid angle.
fn radius(solid_angle: f64) -> f64 {
    let cos = 1.0 - solid_angle / (2.0 * PI);
    let sin = (1.0 - cos * cos).sqrt();
    f64::from(((BALL - LAMP).length() * sin) as f32)
}

/// The ball below a lamp that is a point, above a floor; within a room, or with nothing else.
fn scene(solid_angle: f64, room: bool) -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    let clear = b.add_material(&glass(1.5)).unwrap();
    add_sphere(&mut b, "ball", clear, BALL, radius(solid_angle));
    if room {
        add_room(&mut b, grey, 2.0);
    } else {
        let (x, z) = (DVec3::X * 2.0, DVec3::Z * 2.0);
        add_quad(&mut b, "floor", grey, DVec3::new(-1.0, 0.0, -1.0), z, x);
    }
    b.add_light(light("point", LAMP, DVec3::NEG_Y, 1.0));
    b.finish().unwrap()
}

fn with_source<R>(
    name: &str,
    (scene, accel): (&Scene, &dyn Accelerator),
    (seed, purpose, count): (u64, Purpose, u64),
    f: impl FnOnce(&dyn PhotonSource) -> R,
) -> R {
    let entry = EMISSIONS.iter().find(|e| e.name == name).unwrap();
    f(&*(entry.build)(&EmissionContext {
        scene,
        accel,
        seed,
        purpose,
        count,
        guide: None,
    }))
}

/// What a pass cost and brought.
#[derive(Debug)]
struct Pass {
    /// Photons emitted, and check rays.
    rays: u64,
    /// Photons in the caustic map.
    landed: usize,
    seconds: f64,
}

/// Emits so many photons toward the caustic map.
fn caustic_pass(name: &str, scene: &Scene, seed: u64, count: u64) -> Pass {
    let accel = bvh(&scene.geometry);
    let settings = PhotonSettings {
        seed,
        global: 0,
        caustic: count,
        nearest: 50,
        max_depth: None,
        roulette: true,
        guidance: dualight::photons::Guidance::Off,
    };
    let start = cpu_seconds().unwrap_or(0.0);
    let told = (seed, Purpose::Caustic, count);
    with_source(name, (scene, &*accel), told, |source| {
        let (effects, control) = (EffectSet::all(), Control::default());
        let found = follow_photons(
            scene,
            &*accel,
            source,
            Purpose::Caustic,
            effects,
            &settings,
            &control,
        );
        Pass {
            rays: source.len() + source.checks(),
            landed: found.photons.len(),
            seconds: cpu_seconds().unwrap_or(0.0) - start,
        }
    })
}

/// The pass of the fewest photons, about, of which enough land.
fn until_enough(name: &str, scene: &Scene, seed: u64) -> Pass {
    let mut count = WANTED as u64;
    loop {
        let pass = caustic_pass(name, scene, seed, count);
        if pass.landed >= WANTED {
            return pass;
        }
        assert!(count < 1_000_000, "{name}: {pass:?}");
        count = (count as f64 * 1.02 * WANTED as f64 / pass.landed.max(1) as f64) as u64 + 1;
    }
}

/// Of photons that go everywhere, the share that meets the ball is its share of the sphere of
/// directions: measured where that is feasible, on a ball a hundred times as large.
#[test]
fn photons_that_are_not_aimed_meet_the_ball_as_often_as_its_solid_angle_says() {
    let solid_angle = 1e-4;
    let scene = scene(solid_angle, false);
    let accel = bvh(&scene.geometry);
    let count = 4_000_000;
    let told = (5, Purpose::Global, count);
    let (hits, seconds) = with_source("uniform", (&scene, &*accel), told, |source| {
        let start = cpu_seconds().unwrap_or(0.0);
        let meets = |i: &u64| {
            source.emit(*i).is_some_and(|p| {
                let (o, d) = (p.ray.origin(), p.ray.direction());
                sphere::intersect(o, d, BALL, radius(solid_angle), 0.0, f64::INFINITY).is_some()
            })
        };
        let hits = (0..source.len()).filter(meets).count() as f64;
        (hits, cpu_seconds().unwrap_or(0.0) - start)
    });
    let expected = count as f64 * solid_angle / (4.0 * PI);
    println!(
        "{hits} of {count} photons met a ball of 1e-4 sr, {expected:.1} by its solid angle; {:.2e} s \
         each, untraced",
        seconds / count as f64
    );
    // Four standard deviations of independent photons; stratified ones vary less.
    assert!((hits - expected).abs() < 4.0 * expected.sqrt());
}

#[test]
fn a_thousand_times_fewer_photons_fill_the_caustic_map() {
    for room in [false, true] {
        let tiny = scene(1e-6, room);
        for seed in [1, 2, 3] {
            let [adaptive, uniform] =
                ["adaptive", "uniform"].map(|name| until_enough(name, &tiny, seed));
            // Unaimed photons meet the ball by its solid angle, and land as often as aimed ones
            // that met it do: nearly all that `uniform` sends meet it.
            let landing = uniform.landed as f64 / uniform.rays as f64;
            let unaimed = WANTED as f64 / landing * 4.0 * PI / 1e-6;
            println!(
                "room {room}, seed {seed}: {} and {} landed of {} rays in {:.1} ms by adaptive and of {} \
                 in {:.1} ms by uniform; unaimed {unaimed:.2e} photons",
                adaptive.landed,
                uniform.landed,
                adaptive.rays,
                1e3 * adaptive.seconds,
                uniform.rays,
                1e3 * uniform.seconds
            );
            assert!(adaptive.rays as f64 * 1000.0 < unaimed);
            // Glass of index 1.5 lets through nine tenths; what it reflects leaves the scene
            // unless there is a room. The ball is no lottery for either emission.
            assert!(landing > 0.8 && landing < 1.3, "{landing}");
            // Check rays are all that it costs beside photons that are aimed alone.
            assert!((adaptive.rays as f64) < 3.0 * uniform.rays as f64);
        }
    }
}

/// No cone tells the global photons of the ball, and no check ray of the first cells meets it: what
/// finds it is the forecast of rays that meet something else, or nothing (equation 9). The edges of
/// the floor and of the room, which could use up all cells, must not keep it from being found.
#[test]
fn misses_forecast_the_ball() {
    for room in [false, true] {
        let tiny = scene(1e-6, room);
        let accel = bvh(&tiny.geometry);
        let count = 20_000;
        let mut met = [0; 2];
        for (name, met) in ["adaptive", "uniform"].into_iter().zip(&mut met) {
            for seed in 0..4 {
                let told = (seed, Purpose::Global, count);
                *met += with_source(name, (&tiny, &*accel), told, |source| {
                    let rays = (0..source.len()).filter_map(|i| source.emit(i));
                    let ball = |o: DVec3, d: DVec3| {
                        sphere::intersect(o, d, BALL, radius(1e-6), 0.0, f64::INFINITY)
                    };
                    let meets = |ray: &dualight::geometry::Ray| {
                        ball(ray.origin(), ray.direction()).is_some()
                    };
                    rays.filter(|p| meets(&p.ray)).count()
                });
            }
        }
        let expected = 4.0 * count as f64 * 1e-6 / (4.0 * PI);
        println!(
            "room {room}: of 80000 photons, {} of adaptive and {} of uniform met the ball; evenly \
             {expected:.4}",
            met[0], met[1]
        );
        assert!(met[0] as f64 > 1000.0 * expected);
    }
}
