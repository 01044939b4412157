//! Light through glass and off mirrors, against closed forms: by camera paths through the whole
//! pipeline, and by photons.
//!
//! A camera of parallel rays is a parallel light seen backward, so both must give the same
//! numbers. Sources: Fresnel's equations with incoherent multiple reflection (Hecht, *Optics*);
//! geometrical optics of the sphere (impact parameters are conserved; van de Hulst, *Light
//! Scattering by Small Particles*, 12); Lambert–Beer.

mod common;

use std::f64::consts::PI;

use common::photons::caustic_photons;
use common::render::{DIRECT_MAP, Mode, PATH, Size, mean, render};
use common::stats::Samples;
use common::{add_disc, add_quad, add_sphere, glass, lambert, lamp, light, look_at, mirror};
use dualight::accel::ACCELERATORS;
use dualight::color::Rgb;
use dualight::materials::{MaterialDesc, TransportMode, fresnel};
use dualight::math::DVec3;
use dualight::photons::Photon;
use dualight::sampling::{Rng, hash2};
use dualight::scene::{Scene, SceneBuilder};

/// Specular chains are followed by both integrators, each with code of its own.
const INTEGRATORS: [Mode; 2] = [PATH, DIRECT_MAP];

const SIZE: Size = Size {
    pixels: 16,
    spp: 32,
    photons: 1000,
};

fn scene(make: impl FnOnce(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::default();
    make(&mut b);
    b.finish().expect("valid")
}

/// A pane 2 m wide with its front at `y = 0`, as two faces.
fn add_pane(b: &mut SceneBuilder, desc: &MaterialDesc, thickness: f64) {
    let m = b.add_material(desc).expect("valid");
    let (x, z, w) = (DVec3::X, DVec3::Z, 2.0);
    let corner = -0.5 * w * (x + z);
    add_quad(b, "above", m, corner, z * w, x * w);
    add_quad(b, "below", m, corner - DVec3::Y * thickness, x * w, z * w);
}

/// Reflectance and transmittance of a pane between all of its reflections, `t` being what
/// survives one passage.
fn pane(cos: f64, ior: f64, t: f64) -> (f64, f64) {
    let r = fresnel::dielectric(cos, ior).reflectance;
    let through = (1.0 - r).powi(2) * t / (1.0 - (r * t).powi(2));
    (r + r * t * through, through)
}

#[test]
fn a_pane_divides_light_by_fresnel_and_beer() {
    let clear = glass(1.5);
    let (d, passed) = (0.02, 0.5f64);
    let dark = MaterialDesc {
        attenuation_distance: 0.02,
        attenuation_color: Rgb::splat(passed),
        ..clear.clone()
    };
    let air = MaterialDesc {
        ior: 1.0,
        ..dark.clone()
    };
    assert!((pane(1.0, 1.5, 1.0).1 - 0.923_077).abs() < 1e-6);
    assert!((pane(0.5f64.sqrt(), 1.5, 1.0).1 - 0.904_327).abs() < 1e-6);
    for (name, glass, ior, absorbs) in [
        ("clear glass", clear, 1.5, 1.0),
        ("dark glass", dark, 1.5, passed),
        ("dark air", air, 1.0, passed),
    ] {
        for degrees in [0.0f64, 45.0, 80.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let inside = (1.0 - (sin / ior).powi(2)).sqrt();
            let (r, t) = pane(cos, ior, absorbs.powf(1.0 / inside));
            for (side, expected) in [("through", t), ("off", r)] {
                if expected < 1e-3 {
                    continue;
                }
                let scene = scene(|b| {
                    add_pane(b, &glass, d);
                    let lamp = b.add_material(&lamp(Rgb::ONE)).expect("a lamp");
                    let (p, e1, e2) = (DVec3::new(-90.0, 0.0, -90.0), DVec3::X, DVec3::Z);
                    // Far above (reflection) or below; so wide that every ray meets it.
                    let (y, e1, e2) = if side == "off" {
                        (4.0, e1, e2)
                    } else {
                        (-4.0, e2, e1)
                    };
                    add_quad(b, "lamp", lamp, p + DVec3::Y * y, e1 * 180.0, e2 * 180.0);
                    let to = DVec3::new(sin, cos, 0.0);
                    b.add_camera(look_at("orthographic", to * 3.0, DVec3::ZERO, 0.05));
                });
                for mode in INTEGRATORS {
                    let seen = Samples::over_seeds(16, |s| {
                        mean(&render(&scene, mode, SIZE, s), "specular")
                    });
                    let what = format!("{} {side} {name} at {degrees}°", mode.name);
                    // Rays start 16 u |P| off the surface, here 2 m from the origin: by so much is
                    // their way inside too short.
                    let depth = -absorbs.ln() / (d * inside);
                    let bias = depth * 2.1 * 16.0 * 2f64.powi(-24);
                    seen.assert_mean_with_bias(&what, expected, 0.02, bias);
                }
            }
            // Photons: what passes lights the floor evenly, far from the pane's rim.
            let lit = scene(|b| {
                add_pane(b, &glass, d);
                let floor = b
                    .add_material(&lambert("floor", Rgb::splat(0.5)))
                    .expect("valid");
                add_quad(
                    b,
                    "floor",
                    floor,
                    DVec3::new(-2.0, -0.1, -2.0),
                    DVec3::Z * 4.0,
                    DVec3::X * 4.0,
                );
                b.add_light(light(
                    "directional",
                    DVec3::ZERO,
                    -DVec3::new(sin, cos, 0.0),
                    1.0,
                ));
            });
            if degrees < 60.0 {
                let passed = Samples::over_seeds(16, |seed| {
                    let (photons, _) = caustic_photons(&lit, seed, 20_000);
                    let half = 0.5f32;
                    let within = |p: &&Photon| p.p[0].abs() < half && p.p[2].abs() < half;
                    photons
                        .iter()
                        .filter(within)
                        .map(|p| p.power().r)
                        .sum::<f64>()
                        / cos
                });
                let what = format!("photons through {name} at {degrees}°");
                passed.assert_mean(&what, t, 0.02);
            }
        }
    }
}

/// What becomes of parallel light on a glass sphere of radius 1: for `bounces` internal
/// reflections, the share of πR² that leaves, by quadrature over the impact parameter, and the
/// share that meets the plane `z` behind the sphere within `r` of the axis.
fn sphere_order(bounces: i32, z: f64, r: f64) -> (f64, f64) {
    let n = 200_000;
    let (mut all, mut near) = (0.0, 0.0);
    for k in 0..n {
        let b = (f64::from(k) + 0.5) / f64::from(n);
        let (ti, tt) = (b.asin(), (b / 1.5).asin());
        let f = fresnel::dielectric(ti.cos(), 1.5);
        let share = 2.0 * b / f64::from(n);
        let share = share * f.transmittance.powi(2) * f.reflectance.powi(bounces);
        all += share;
        // In the plane of the ray (axis, height): it enters at angle π − θi and goes on.
        let turn = 2.0 * (ti - tt) + f64::from(bounces) * (PI - 2.0 * tt);
        let exit = PI - ti - f64::from(bounces + 1) * (PI - 2.0 * tt);
        let (sx, sy) = (exit.cos(), exit.sin());
        let (dx, dy) = (turn.cos(), -turn.sin());
        let y = sy + (z - sx) / dx * dy;
        if dx > 0.0 && y.abs() < r {
            near += share;
        }
    }
    (all, near)
}

#[test]
fn a_glass_sphere_divides_parallel_light() {
    let orders: Vec<f64> = (0..3).map(|k| sphere_order(k, 1.5, 1.0).0).collect();
    assert!((orders[0] - 0.835_544_4).abs() < 1e-6 && (orders[1] - 0.061_183_2).abs() < 1e-6);
    let ball = scene(|b| {
        let m = b.add_material(&glass(1.5)).expect("valid");
        add_sphere(b, "ball", m, DVec3::ZERO, 1.0);
    });
    for backend in ACCELERATORS {
        let accel = (backend.build)(&ball.geometry, 1).expect("built");
        // Follows rays with the scene's own parts, counting how often they are reflected inside.
        let shares: Vec<[f64; 4]> = (0..16)
            .map(|seed| {
                let mut rng = Rng::new(hash2(seed, 1));
                let n = 20_000;
                let mut share = [0.0; 4];
                for _ in 0..n {
                    let [x, y] = dualight::sampling::warp::disc(rng.next_2d());
                    let mut ray = dualight::geometry::Ray::new(DVec3::new(x, y, 4.0), -DVec3::Z);
                    let (mut events, mut weight) = (0, 1.0);
                    while let Some(hit) = accel.intersect(&ray) {
                        let sp = ball.surface_point(&ray, &hit);
                        let bsdf = ball.bsdf(&sp, None, TransportMode::Importance);
                        let s = bsdf.sample(rng.next_1d(), rng.next_2d()).expect("glass");
                        weight *= s.weight.r;
                        events += 1;
                        ray = sp.spawn(s.wi);
                    }
                    // No event is a ray that slips by the rim.
                    if events > 0 {
                        share[(events - 1).min(3)] += weight / f64::from(n);
                    }
                }
                share
            })
            .collect();
        let of = |k: usize| Samples(shares.iter().map(|s| s[k]).collect());
        let name = |what| format!("{}, {what}", backend.name);
        of(0).assert_mean(&name("reflected outside"), 0.091_778_0, 0.006);
        of(1).assert_mean(&name("straight through"), orders[0], 0.001);
        of(2).assert_mean(&name("reflected inside once"), orders[1], 0.008);
    }
}

#[test]
fn a_glass_sphere_focuses_parallel_light() {
    assert!((sphere_order(0, 1.5, 0.1).1 - 0.373_117).abs() < 1e-4);
    assert!((sphere_order(0, 1.5, 0.05).1 - 0.255_483).abs() < 1e-4);
    assert!((sphere_order(0, 2.0, 0.1).1 - 0.068_069).abs() < 1e-4);
    for (z, r, teeth) in [(1.5, 0.1, 0.004), (1.5, 0.05, 0.004), (2.0, 0.1, 0.01)] {
        // Twice reflected light that comes forward belongs there too.
        let expected: f64 = (0..8).map(|k| sphere_order(k, z, r).1).sum();
        let lit = scene(|b| {
            let m = b.add_material(&glass(1.5)).expect("valid");
            add_sphere(b, "ball", m, DVec3::ZERO, 1.0);
            let floor = b
                .add_material(&lambert("floor", Rgb::splat(0.5)))
                .expect("valid");
            let e = 4.0;
            add_quad(
                b,
                "floor",
                floor,
                DVec3::new(-e, -z, -e),
                DVec3::Z * 2.0 * e,
                DVec3::X * 2.0 * e,
            );
            b.add_light(light("directional", DVec3::ZERO, DVec3::NEG_Y, 1.0));
        });
        let photons = Samples::over_seeds(16, |seed| {
            let (photons, aimed) = caustic_photons(&lit, seed, 20_000);
            assert!(
                (aimed / PI - 1.0).abs() < 1e-3,
                "aimed at the ball alone: {aimed}"
            );
            let near = |p: &&Photon| p.p[0].hypot(p.p[2]) < r as f32;
            photons
                .iter()
                .filter(near)
                .map(|p| p.power().r)
                .sum::<f64>()
                / PI
        });
        photons.assert_mean(&format!("photons within {r} at {z}"), expected, teeth);

        // The same backward: parallel view rays, and a small lamp where the light would go.
        let seen = scene(|b| {
            let m = b.add_material(&glass(1.5)).expect("valid");
            add_sphere(b, "ball", m, DVec3::ZERO, 1.0);
            let lamp = b.add_material(&lamp(Rgb::ONE)).expect("a lamp");
            add_disc(b, "lamp", lamp, DVec3::NEG_Y * z, DVec3::Y, r);
            b.add_camera(look_at("orthographic", DVec3::Y * 3.0, DVec3::ZERO, 1.0));
        });
        for mode in INTEGRATORS {
            let share = Samples::over_seeds(16, |s| {
                mean(&render(&seen, mode, SIZE, s), "specular") * 4.0 / PI
            });
            share.assert_mean(
                &format!("{} within {r} at {z}", mode.name),
                expected,
                2.0 * teeth,
            );
        }
    }
}

#[test]
fn a_mirror_sphere_scatters_parallel_light_evenly() {
    // A room so large that the ball is a point, with a hole in the ceiling for the light.
    let (h, hole) = (200.0, 2.0);
    let room = scene(|b| {
        let m = b.add_material(&mirror()).expect("valid");
        add_sphere(b, "ball", m, DVec3::ZERO, 1.0);
        let wall = b
            .add_material(&lambert("wall", Rgb::splat(0.5)))
            .expect("valid");
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        for (side, e1, e2) in [(x, y, z), (-x, z, y), (z, x, y), (-z, y, x), (-y, z, x)] {
            let corner = (side - e1 - e2) * h;
            add_quad(b, "wall", wall, corner, e1 * (2.0 * h), e2 * (2.0 * h));
        }
        for k in 0..4 {
            // Four strips around the hole, each beginning where the last one ends.
            let (along, across) = [(x, z), (-z, x), (-x, -z), (z, -x)][k];
            let corner = y * h - along * h + across * hole;
            add_quad(
                b,
                "ceiling",
                wall,
                corner,
                along * (h + hole),
                across * (h - hole),
            );
        }
        b.add_light(light("directional", DVec3::ZERO, DVec3::NEG_Y, 1.0));
    });
    let bins: Vec<[f64; 8]> = (0..16)
        .map(|seed| {
            let (photons, aimed) = caustic_photons(&room, seed, 20_000);
            let mut bins = [0.0; 8];
            for p in &photons {
                // A photon keeps where it came from: the direction of travel is the opposite.
                let cos = -p.wi().y;
                bins[((0.5 * (1.0 + cos) * 8.0) as usize).min(7)] += p.power().r / aimed;
            }
            bins
        })
        .collect();
    for k in 0..8 {
        let share = Samples(bins.iter().map(|b| b[k]).collect());
        // The hole takes (2 hole)²/h² of 4π; packed directions are exact to 1e-4.
        share.assert_mean_with_bias(
            &format!("bin {k}"),
            0.125,
            0.006,
            8.0 * 4e-4 / (4.0 * PI) + 2e-4,
        );
    }
    // Backward: of parallel view rays that meet the ball, a sixth sees each side of a cube.
    let cube = scene(|b| {
        let m = b.add_material(&mirror()).expect("valid");
        add_sphere(b, "ball", m, DVec3::ZERO, 1.0);
        let lamp = b.add_material(&lamp(Rgb::ONE)).expect("a lamp");
        let h = 1000.0;
        let corner = (DVec3::NEG_X - DVec3::Y - DVec3::Z) * h;
        add_quad(
            b,
            "side",
            lamp,
            corner,
            DVec3::Y * 2.0 * h,
            DVec3::Z * 2.0 * h,
        );
        b.add_camera(look_at("orthographic", DVec3::Z * 10.0, DVec3::ZERO, 1.0));
    });
    for mode in INTEGRATORS {
        let seen = Samples::over_seeds(16, |s| mean(&render(&cube, mode, SIZE, s), "specular"));
        // The ball is a thousandth of the cube: so much may the shares be off.
        let what = format!("{}: a sixth", mode.name);
        seen.assert_mean_with_bias(&what, PI / 4.0 / 6.0, 0.006, 1e-3);
    }
}

/// A ball of glass with this dispersion in front of squares of light.
fn prism_ball(dispersion: f64) -> Scene {
    scene(|b| {
        let ball = MaterialDesc {
            dispersion,
            ..glass(1.5)
        };
        let ball = b.add_material(&ball).expect("glass");
        let grey = b
            .add_material(&lambert("grey", Rgb::splat(0.7)))
            .expect("grey");
        let white = b.add_material(&lamp(Rgb::ONE)).expect("lamp");
        add_sphere(b, "ball", ball, DVec3::ZERO, 1.0);
        for i in -2..=2 {
            let p = DVec3::new(f64::from(i) - 0.25, -2.0, -3.0);
            let m = if i % 2 == 0 { white } else { grey };
            add_quad(b, "square", m, p, DVec3::X * 0.5, DVec3::Y * 4.0);
        }
        b.add_camera(common::camera(DVec3::Z * 4.0, 30.0));
    })
}

/// Mean squared difference of the specular layers of two seeds, of their squared mean.
fn specular_noise(dispersion: f64) -> f64 {
    let scene = prism_ball(dispersion);
    let size = Size {
        pixels: 32,
        spp: 4,
        photons: 1000,
    };
    let of = |seed: u64| {
        let image = render(&scene, DIRECT_MAP, size, 2 * seed);
        image.rgb("specular").expect("a layer")
    };
    let (a, b) = (of(1), of(2));
    let both = || a.iter().flatten().zip(b.iter().flatten());
    let square: f64 = both().map(|(x, y)| f64::from(x - y).powi(2)).sum();
    let mean: f64 = both().map(|(x, y)| f64::from(x + y).powi(2) / 4.0).sum();
    square / mean
}

#[test]
fn dispersion_costs_no_noise() {
    let plain = specular_noise(0.0);
    assert!(plain > 0.0);
    // Where colours part, each sees edges of its own; where they hardly do, nothing may change.
    let [little, much] = [1e-6, 1.0].map(|d| specular_noise(d) / plain);
    println!("{plain:.2e}, times {little:.3} and {much:.3}");
    assert!(little < 1.05, "{little}");
    assert!(much < 2.0, "{much}");
}
