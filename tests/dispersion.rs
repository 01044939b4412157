//! Glass that disperses: colours part by the angles of geometrical optics, none is lost or
//! preferred on the way, and where they hardly part, glass is as without dispersion.
//!
//! Sources: for the prism at its least deviation, Hecht, *Optics*, 5.5.1; for the rainbow, van de
//! Hulst, *Light Scattering by Small Particles*, 13.2.

mod common;

use std::f64::consts::{FRAC_PI_3, PI};

use common::photons::caustic_photons;
use common::render::{DIRECT_MAP, GATHER, Mode, PATH, Size, render};
use common::stats::Samples;
use common::{add_quad, add_sphere, glass, lambert, lamp};
use dualight::accel::ACCELERATORS;
use dualight::color::Rgb;
use dualight::film::Image;
use dualight::geometry::Ray;
use dualight::materials::{Bsdf, BsdfSample, MaterialDesc, TransportMode, fresnel};
use dualight::math::DVec3;
use dualight::photons::Photon;
use dualight::scene::{Scene, SceneBuilder};

/// Names of the channels.
const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// Glass whose indices of red and blue are these; that of green lies in the middle.
fn dispersive(red: f64, blue: f64) -> MaterialDesc {
    let ior = 0.5 * (red + blue);
    MaterialDesc {
        dispersion: 0.5 * (blue - red) / (0.025 * (ior - 1.0)),
        ..glass(ior)
    }
}

/// Where light of a channel goes that enters glass along a ray and is transmitted or reflected as
/// told at the surfaces that it meets, and the part of it that does.
fn follow(scene: &Scene, mut ray: Ray, channel: usize, transmitted: &[bool]) -> (DVec3, f64) {
    let accel = (ACCELERATORS[0].build)(&scene.geometry, 1).expect("built");
    let (mut inside, mut part) = (scene.enclosing(ray.origin()), 1.0);
    let mut out = DVec3::ZERO;
    for &through in transmitted {
        let hit = accel.intersect(&ray).expect("glass");
        let sp = scene.surface_point(&ray, &hit);
        let crossing = scene.crossing(inside, &sp);
        let mut bsdf = Bsdf::new(&sp, TransportMode::Importance);
        scene.scatter(&sp, None, &mut bsdf);
        crossing.apply(&mut bsdf);
        assert!(bsdf.disperses());
        let branches = bsdf.branches().expect("smooth");
        let weight = |b: &BsdfSample| [b.weight.r, b.weight.g, b.weight.b][channel];
        let way = branches
            .iter()
            .find(|b| b.transmitted == through && weight(b) > 0.0);
        let way = way.expect("light goes there");
        part *= weight(way);
        // Sampled by channels it is the same, and has no other colour.
        let carried = Rgb::from([0, 1, 2].map(|k| f32::from(u8::from(k == channel))));
        let any = (0..64).find_map(|i| {
            let samples = bsdf.sample_channels(carried, f64::from(i) / 64.0, [0.5; 2]);
            assert_eq!(samples.len(), 1);
            (samples[0].wi == way.wi).then_some(samples[0])
        });
        assert!((weight(&any.expect("found")) - 1.0).abs() < 1e-12);
        out = way.wi;
        ray = sp.spawn(way.wi);
        inside = crossing.beyond(through);
    }
    (out, part)
}

/// The least of a function of one extremum between two points (golden sections).
fn least(mut lo: f64, mut hi: f64, f: impl Fn(f64) -> f64) -> f64 {
    const PART: f64 = 0.618_033_988_749_894_8;
    while hi - lo > 1e-5 {
        let (a, b) = (hi - PART * (hi - lo), lo + PART * (hi - lo));
        if f(a) < f(b) { hi = b } else { lo = a }
    }
    f(0.5 * (lo + hi))
}

#[test]
fn a_prism_deviates_colours_as_snell_says() {
    let (v, sin) = (DVec3::new, FRAC_PI_3.sin());
    let mut b = SceneBuilder::default();
    let prism = b.add_material(&dispersive(1.51, 1.53)).expect("glass");
    let (long, back) = (DVec3::Z * 0.5, DVec3::Z * 0.25);
    let [left, right, top] = [v(-0.5, 0.0, 0.0), v(0.5, 0.0, 0.0), v(0.0, sin, 0.0)];
    add_quad(&mut b, "left", prism, left - back, long, top - left);
    add_quad(&mut b, "right", prism, top - back, long, right - top);
    add_quad(&mut b, "base", prism, right - back, long, left - right);
    let scene = b.finish().expect("valid");
    // Rays that meet the left face in its middle, at angles around that of least deviation.
    let middle = 0.5 * (left + top);
    let through = |k: usize, turn: f64| {
        let d = v(turn.cos(), turn.sin(), 0.0);
        let (out, part) = follow(&scene, Ray::new(middle - d, d), k, &[true, true]);
        (out.dot(d).acos().to_degrees(), part)
    };
    for (k, n, expected) in [
        (0, 1.51_f64, 38.0507),
        (1, 1.52, f64::NAN),
        (2, 1.53, 39.8140),
    ] {
        let outside = (0.5 * n).asin();
        let closed = (2.0 * outside - FRAC_PI_3).to_degrees();
        let found = least(0.1, 0.6, |turn| through(k, turn).0);
        let passes = 1.0 - fresnel::dielectric(outside.cos(), n).reflectance;
        let part = through(k, outside - PI / 6.0).1;
        println!("{}: {found:.5} degrees, {closed:.5} expected", CHANNELS[k]);
        assert!((found - closed).abs() < 2e-4, "{found} {closed}");
        assert!(
            k == 1 || (found - expected).abs() < 2e-4,
            "{found} {expected}"
        );
        assert!((part - passes * passes).abs() < 1e-5, "{part}");
    }
}

#[test]
fn a_drop_throws_the_rainbow_where_descartes_found_it() {
    let mut b = SceneBuilder::default();
    let water = b.add_material(&dispersive(1.331, 1.343)).expect("water");
    add_sphere(&mut b, "drop", water, DVec3::ZERO, 1.0);
    let scene = b.finish().expect("valid");
    for (k, bow) in [(0, 42.370), (2, 40.646)] {
        // The bow is where light turns least.
        let angle = |height: f64| {
            let from = DVec3::new(-2.0, height, 0.0);
            let way = [true, false, true];
            let (out, _) = follow(&scene, Ray::new(from, DVec3::X), k, &way);
            -(-out.x).acos().to_degrees()
        };
        let found = -least(0.7, 0.98, angle);
        println!("{}: {found:.5} degrees, {bow} expected", CHANNELS[k]);
        assert!((found - bow).abs() < 1e-3, "{found} {bow}");
    }
}

/// A ball of glass over a floor, under a square lamp of this half width.
fn ball_on_floor(dispersion: f64, roughness: f64, h: f64) -> Scene {
    let mut b = SceneBuilder::default();
    let ball = MaterialDesc {
        dispersion,
        roughness,
        ..glass(1.5)
    };
    let ball = b.add_material(&ball).expect("glass");
    let floor = b
        .add_material(&lambert("floor", Rgb::splat(0.5)))
        .expect("grey");
    let white = b.add_material(&lamp(Rgb::splat(8.0))).expect("lamp");
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    add_sphere(&mut b, "ball", ball, y * 0.1, 0.5);
    add_quad(&mut b, "floor", floor, -y - (x + z) * 1.5, z * 3.0, x * 3.0);
    add_quad(
        &mut b,
        "lamp",
        white,
        y * 3.0 - (x + z) * h,
        x * (2.0 * h),
        z * (2.0 * h),
    );
    b.add_camera(common::camera(z * 4.0, 50.0));
    b.finish().expect("valid")
}

#[test]
fn photons_of_glass_that_hardly_disperses_are_those_of_clear_glass() {
    for roughness in [0.0, 0.3] {
        let flux = |dispersion| {
            let scene = ball_on_floor(dispersion, roughness, 0.2);
            let (photons, _) = caustic_photons(&scene, 3, 20_000);
            photons.iter().map(Photon::power).sum::<Rgb>()
        };
        let (clear, little) = (flux(0.0), flux(1e-7));
        println!("{clear:?} {little:?}");
        let off = (clear - little).map(f64::abs).max_channel() / clear.max_channel();
        assert!(off < 1e-3, "{roughness}: {off}");
    }
}

const SMALL: Size = Size {
    pixels: 24,
    spp: 16,
    photons: 20_000,
};

/// Mean of a channel over the picture.
fn channel_mean(image: &Image, channel: usize) -> f64 {
    let pixels = image.rgb("").expect("a layer");
    pixels.iter().map(|p| f64::from(p[channel])).sum::<f64>() / pixels.len() as f64
}

#[test]
fn no_tint_is_left_as_dispersion_tends_to_none() {
    for roughness in [0.0, 0.3] {
        for mode in [PATH, DIRECT_MAP, GATHER] {
            let of = |dispersion: f64, seeds: u64| {
                let scene = ball_on_floor(dispersion, roughness, 1.0);
                let n = if mode.integrator == "path" { 24 } else { 12 };
                let images: Vec<Image> = (0..n)
                    .map(|s| render(&scene, mode, SMALL, seeds + s))
                    .collect();
                [0, 1, 2].map(|k| Samples(images.iter().map(|i| channel_mean(i, k)).collect()))
            };
            let (clear, little) = (of(0.0, 0), of(1e-5, 1000));
            for k in 0..3 {
                let what = format!("{}, roughness {roughness}, {}", mode.name, CHANNELS[k]);
                clear[k].assert_agrees(&little[k], &what, 0.02, 0.0);
            }
        }
    }
}

/// Mean squared difference of a layer of two seeds in a channel, of its squared mean.
fn noise(scene: &Scene, mode: Mode, layer: &str) -> f64 {
    let of = |seed: u64| {
        render(scene, mode, SMALL, 2 * seed)
            .rgb(layer)
            .expect("a layer")
    };
    let mut parts = [0.0; 2];
    for seed in 0..12 {
        let (a, b) = (of(2 * seed), of(2 * seed + 1));
        for (x, y) in a.iter().flatten().zip(b.iter().flatten()) {
            parts[0] += f64::from(x - y).powi(2);
            parts[1] += f64::from(x + y).powi(2) / 4.0;
        }
    }
    (parts[0] / parts[1]).sqrt()
}

#[test]
fn dispersion_adds_little_noise() {
    // A photon goes on in all channels, a path in one of them.
    for (mode, layer, h, bounds) in [
        (DIRECT_MAP, "caustics", 0.2, [1.1, 1.3]),
        (PATH, "specular", 1.0, [1.25, 1.25]),
    ] {
        let of = |dispersion| noise(&ball_on_floor(dispersion, 0.0, h), mode, layer);
        let clear = of(0.0);
        let times = [1e-5, 1.0].map(|d| of(d) / clear);
        println!("{} {layer}: {clear:.3}, times {times:.3?}", mode.name);
        assert!(times[0] < bounds[0] && times[1] < bounds[1], "{times:?}");
    }
}
