//! The photon pass keeps its books: flux that leaves the lights is absorbed, escapes or is cut,
//! and density estimates of it are unbiased where light is uniform.
//!
//! Sources: Jensen 1996; the factor `(k − 1)/k` of nearest-neighbour estimates is that of the
//! order statistics of a Poisson process (Silverman, *Density Estimation*, 1986, 5.2).

mod common;

use std::f64::consts::PI;
use std::sync::Arc;

use common::stats::Samples;
use common::{add_quad, add_room, add_sphere, box_scene, glass, lambert, lamp, light, mirror};
use dualight::accel::ACCELERATORS;
use dualight::color::Rgb;
use dualight::control::Control;
use dualight::effects::EffectSet;
use dualight::lights::LightDesc;
use dualight::math::DVec3;
use dualight::photons::map::{Estimate, Nearest, Pilot, Site, Surroundings};
use dualight::photons::{
    EMISSIONS, IrradianceMap, Photon, PhotonClass, PhotonMap, PhotonMaps, PhotonSettings,
    trace_photons,
};
use dualight::sampling::{Rng, hash2};
use dualight::scene::{Scene, SceneBuilder};
use dualight::stats::PhotonCounts;

fn settings(seed: u64, photons: u64) -> PhotonSettings {
    PhotonSettings {
        seed,
        global: photons,
        caustic: photons,
        nearest: 50,
        max_depth: None,
        roulette: true,
        guidance: dualight::photons::Guidance::Off,
    }
}

fn trace(scene: &Scene, settings: &PhotonSettings) -> PhotonMaps {
    let backend = &ACCELERATORS[settings.seed as usize % ACCELERATORS.len()];
    let accel = (backend.build)(&scene.geometry, 2).expect("built");
    let control = Control::default();
    let all = EffectSet::all();
    trace_photons(
        scene,
        &*accel,
        &EMISSIONS[0],
        all,
        settings,
        false,
        &control,
    )
}

fn scene(make: impl FnOnce(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::default();
    make(&mut b);
    b.finish().expect("valid")
}

fn quad(b: &mut SceneBuilder, desc: &dualight::materials::MaterialDesc, p: DVec3, size: f64) {
    let m = b.add_material(desc).expect("valid");
    let (e1, e2) = (DVec3::Z * size, DVec3::X * size);
    add_quad(b, &desc.name, m, p - 0.5 * (e1 + e2), e1, e2);
}

/// Nothing diffuse: coloured, absorbing glass around a lamp, and a mirror.
fn glass_only() -> Scene {
    scene(|b| {
        let tinted = dualight::materials::MaterialDesc {
            attenuation_distance: 0.5,
            attenuation_color: Rgb::new(0.9, 0.5, 0.1),
            ..glass(1.5)
        };
        let tinted = b.add_material(&tinted).expect("valid");
        let mirror = b.add_material(&mirror()).expect("valid");
        add_sphere(b, "glass", tinted, DVec3::ZERO, 1.0);
        add_sphere(b, "mirror", mirror, DVec3::X * 2.5, 1.0);
        b.add_light(light("point", DVec3::new(0.5, 0.3, 0.0), DVec3::Y, 1.0));
        b.add_light(light("point", DVec3::new(-3.0, 0.3, 1.0), DVec3::Y, 2.0));
    })
}

/// Lights of several kinds over a floor, most of their light going elsewhere.
fn open() -> Scene {
    scene(|b| {
        quad(
            b,
            &lambert("floor", Rgb::new(0.8, 0.5, 0.2)),
            DVec3::ZERO,
            4.0,
        );
        quad(b, &lamp(Rgb::new(1.0, 2.0, 3.0)), DVec3::Y * 2.0, 0.5);
        let ball = b.add_material(&lamp(Rgb::ONE)).expect("a lamp");
        add_sphere(b, "ball", ball, DVec3::new(1.0, 1.0, 0.0), 0.2);
        b.add_light(LightDesc {
            inner_cone: 0.1,
            ..light("spot", DVec3::Y * 3.0, DVec3::NEG_Y, 4.0)
        });
        b.add_light(light("directional", DVec3::ZERO, DVec3::NEG_Y, 0.5));
        b.add_light(light("point", DVec3::new(-1.0, 0.5, 0.5), DVec3::Y, 1.0));
    })
}

/// What is not accounted for, relative to what was emitted.
fn imbalance(c: &PhotonCounts) -> f64 {
    let spent = c.flux_absorbed + c.flux_escaped + c.flux_cut;
    (c.flux_emitted - spent).abs() / c.flux_emitted
}

#[test]
fn flux_is_absorbed_escapes_or_is_cut() {
    for (name, scene) in [
        ("box", box_scene()),
        ("glass", glass_only()),
        ("open", open()),
    ] {
        for seed in 0..2 {
            for (roulette, max_depth) in [(true, None), (false, Some(6)), (true, Some(2))] {
                let told = PhotonSettings {
                    roulette,
                    max_depth,
                    ..settings(seed, 30_000)
                };
                let maps = trace(&scene, &told);
                for (map, c) in [
                    ("global", maps.global_counts),
                    ("caustic", maps.caustic_counts),
                ] {
                    let nothing_to_aim_at = name == "open" && map == "caustic";
                    assert_eq!(c.emitted == 0, nothing_to_aim_at);
                    if c.emitted > 0 {
                        let off = imbalance(&c);
                        assert!(off < 1e-9, "{name}, {map}: {off:e} of {c:?}");
                    }
                    assert!(c.stored == 0 || name != "glass");
                }
                if max_depth.is_none() {
                    assert_eq!(maps.global_counts.flux_cut, 0.0, "{name}");
                }
            }
        }
    }
}

#[test]
fn photons_carry_the_flux_of_the_scene() {
    for (name, scene) in [
        ("box", box_scene()),
        ("glass", glass_only()),
        ("open", open()),
    ] {
        let flux = scene.flux();
        let sum = flux.r + flux.g + flux.b;
        let emitted = Samples::over_seeds(16, |seed| {
            trace(&scene, &settings(seed, 20_000))
                .global_counts
                .flux_emitted
        });
        emitted.assert_mean(&format!("flux in {name}"), sum, 0.002);
    }
}

#[test]
fn what_meets_a_surface_first_and_what_escapes_is_the_flux() {
    // Powers of two, so that storing them in single precision loses nothing.
    let n = 1 << 16;
    let flat = scene(|b| {
        quad(b, &lambert("floor", Rgb::splat(0.7)), DVec3::ZERO, 4.0);
        quad(
            b,
            &lambert("shelf", Rgb::splat(0.2)),
            DVec3::new(0.5, 0.5, 0.0),
            1.0,
        );
        b.add_light(light("point", DVec3::Y, DVec3::Y, 1.0 / (4.0 * PI)));
    });
    let maps = trace(&flat, &settings(3, n));
    let one = trace(
        &flat,
        &PhotonSettings {
            max_depth: Some(1),
            ..settings(3, n)
        },
    );
    let direct: f64 = maps
        .global
        .iter()
        .flat_map(|m| m.photons())
        .filter(|p| p.class == PhotonClass::Direct)
        .map(|p| p.power().r)
        .sum();
    let escaped = one.global_counts.flux_escaped / 3.0;
    println!("stored {direct}, escaped {escaped}");
    assert!((direct + escaped - 1.0).abs() < 1e-9);
    assert!((one.global_counts.flux_cut / 3.0 - direct).abs() < 1e-9);
}

/// Share of a sphere of directions under which the rectangle `x0..x1` by `z0..z1` at the depth
/// `h` is seen.
fn solid_angle_share(x: [f64; 2], z: [f64; 2], h: f64) -> f64 {
    let corner = |x: f64, z: f64| (x * z / (h * (x * x + z * z + h * h).sqrt())).atan();
    (corner(x[1], z[1]) - corner(x[0], z[1]) - corner(x[1], z[0]) + corner(x[0], z[0])) / (4.0 * PI)
}

#[test]
fn photons_meet_every_patch_as_often_as_they_should() {
    const PATCHES: usize = 8;
    let (n, h) = (40_000, 0.7);
    let floor = scene(|b| {
        quad(b, &lambert("floor", Rgb::splat(0.5)), DVec3::ZERO, 2.0);
        b.add_light(light("point", DVec3::Y * h, DVec3::Y, 1.0));
    });
    let counts: Vec<[[f64; PATCHES]; PATCHES]> = (0..32)
        .map(|seed| {
            let told = PhotonSettings {
                max_depth: Some(1),
                ..settings(seed, n)
            };
            let maps = trace(&floor, &told);
            let mut count = [[0.0; PATCHES]; PATCHES];
            for p in maps.global.iter().flat_map(|m| m.photons()) {
                let cell = |x: f32| (((f64::from(x) + 1.0) * 0.5 * PATCHES as f64) as usize).min(7);
                count[cell(p.p[0])][cell(p.p[2])] += 1.0 / n as f64;
            }
            count
        })
        .collect();
    let edge = |i: usize| 2.0 * i as f64 / PATCHES as f64 - 1.0;
    let (mut worst, mut pooled) = (0.0f64, 0.0);
    for i in 0..PATCHES {
        for j in 0..PATCHES {
            let expected = solid_angle_share([edge(i), edge(i + 1)], [edge(j), edge(j + 1)], h);
            let s = Samples(counts.iter().map(|c| c[i][j]).collect());
            let z = (s.mean() - expected) / s.sigma();
            assert!(s.sigma() < 0.01 * expected, "no teeth at {i}, {j}");
            worst = worst.max(z.abs());
            pooled += z * z;
        }
    }
    println!(
        "64 patches: largest deviation {worst:.2} sigma, mean square {:.2}",
        pooled / 64.0
    );
    // 4.5 sigma of Student's distribution of 31 degrees: a false alarm in 150. The mean square
    // has the deviation √(2/64) and the mean 31/29.
    assert!(worst < 4.5 && (pooled / 64.0 - 31.0 / 29.0).abs() < 4.0 * (2.0f64 / 64.0).sqrt());
}

/// `n` photons of unit power evenly over `x0..1` by `−1..1` of the floor.
fn even(n: usize, x0: f64, seed: u64) -> Vec<Photon> {
    let mut rng = Rng::new(hash2(seed, 9));
    (0..n)
        .map(|_| {
            let [a, b] = rng.next_2d();
            let p = DVec3::new(x0 + (1.0 - x0) * a, 0.0, 2.0 * b - 1.0);
            Photon::new(p, DVec3::Y, DVec3::Y, Rgb::ONE, PhotonClass::Direct)
        })
        .collect()
}

fn estimate(map: &PhotonMap, p: DVec3, ng: DVec3) -> Estimate {
    let mut found = Nearest::new();
    map.estimate_nearest(&Site::new(p, ng), &mut found, |_| true, |_| Rgb::ONE)
}

#[test]
fn density_estimates_are_unbiased_on_uniform_light() {
    let n = 20_000;
    for k in [10, 50] {
        // Sites so far apart that they share no photons.
        let mean = |area: f64| {
            Samples::over_seeds(64, |seed| {
                let map = PhotonMap::build(even(n, -1.0, seed), k, area);
                let at = |i: i32| 0.18 * f64::from(i % 9 - 4);
                let sites = (0..81).map(|i| DVec3::new(at(i), 0.0, at(i / 9)));
                sites
                    .map(|p| estimate(&map, p, DVec3::Y).value.r)
                    .sum::<f64>()
                    / 81.0
            })
        };
        let uniform = n as f64 / 4.0;
        let inside = mean(4.0);
        inside.assert_mean(&format!("{k} nearest"), uniform, 0.006);
        let wrong = inside.mean() * k as f64 / (k - 1) as f64;
        let off = (wrong - uniform) / inside.sigma();
        println!("with the k-th photon counted it would be off by {off:.1} sigma");
        assert!(off > 4.0, "this test could not tell k from k − 1");
        // A search radius that holds a quarter of k: all photons within it count.
        if k == 50 {
            mean(4.0 / 64.0).assert_mean("fixed radius", uniform, 0.006);
        }
    }
}

#[test]
fn half_a_plane_of_light_gives_half_at_its_border() {
    let n = 20_000;
    let half = Samples::over_seeds(64, |seed| {
        let map = PhotonMap::build(even(n, 0.0, seed), 50, 2.0);
        let sites = (-4..=4).map(|i| DVec3::Z * 0.18 * f64::from(i));
        sites
            .map(|p| estimate(&map, p, DVec3::Y).value.r)
            .sum::<f64>()
            / 9.0
    });
    // The light covers two square metres here; at its border half of the kernel is empty.
    half.assert_mean("half plane", n as f64 / 2.0 / 2.0, 0.01);
}

#[test]
fn kernels_do_not_reach_through_a_wall() {
    // Photons on one face of a wall a millimetre thick, and on a floor at its foot.
    let mut photons = even(5000, -1.0, 1);
    photons.extend(even(5000, 0.0, 2).iter().map(|p| {
        let [x, _, z] = p.p.map(f64::from);
        Photon::new(
            DVec3::new(0.0, x, z),
            DVec3::X,
            DVec3::X,
            Rgb::ONE,
            PhotonClass::Direct,
        )
    }));
    let map = PhotonMap::build(photons, 100, 100.0);
    let dark = estimate(&map, DVec3::new(-1e-3, 0.5, 0.0), -DVec3::X);
    assert_eq!((dark.value, dark.density), (Rgb::ZERO, 0.0));
    // The lit face sees its own photons only, also at the foot.
    let lit = estimate(&map, DVec3::new(0.0, 0.5, 0.0), DVec3::X).value.r;
    assert!((lit / 2500.0 - 1.0).abs() < 0.5, "{lit}");
    // From below, the floor is dark.
    assert_eq!(
        estimate(&map, DVec3::new(0.5, -1e-3, 0.0), -DVec3::Y).value,
        Rgb::ZERO
    );
}

#[test]
fn extremes_of_gathering_are_defined() {
    let one = |p: DVec3| Photon::new(p, DVec3::Y, DVec3::Y, Rgb::ONE, PhotonClass::Direct);
    let empty = scene(|_| ());
    let accel = (ACCELERATORS[0].build)(&empty.geometry, 1).expect("built");
    let cases: [(&str, Vec<Photon>); 4] = [
        ("none", vec![]),
        ("one", vec![one(DVec3::ZERO)]),
        ("fewer than k", even(20, -1.0, 1)),
        ("coincident", vec![one(DVec3::ZERO); 100_000]),
    ];
    for (name, photons) in cases {
        for k in [1, 2, 50, 200_000] {
            for area in [0.0, 4.0] {
                let map = PhotonMap::build(photons.clone(), k, area);
                for x in [0.0, 1e-20, 1e-3, 0.5, 1e6] {
                    let e = estimate(&map, DVec3::X * x, DVec3::Y);
                    let fine = e.value.is_finite() && e.density.is_finite() && e.radius.is_finite();
                    assert!(fine && e.value.r >= 0.0, "{name}, {k}, {x}: {e:?}");
                    if photons.is_empty() {
                        assert_eq!(e.value, Rgb::ZERO);
                    }
                }
                if k > 50 {
                    continue; // Irradiance at every fourth photon from all of them takes long.
                }
                let deciding = Pilot {
                    around: Surroundings {
                        scene: &empty,
                        accel: &*accel,
                    },
                    nearest: k,
                    ratio: 1.0,
                };
                let control = Control::default();
                let kernels = deciding.kernels(photons.clone(), area, |_| true, &control);
                let irradiance = IrradianceMap::build(&map, Arc::new(kernels), |_| true, &control);
                let site = Site::new(DVec3::ZERO, DVec3::Y);
                let near = irradiance.nearest(&site);
                assert!(
                    near.is_none_or(|s| s.irradiance().is_finite()),
                    "{name}, {k}"
                );
            }
        }
    }
}

#[test]
fn a_closed_room_absorbs_all_of_its_light() {
    let room = scene(|b| {
        let grey = b
            .add_material(&lambert("grey", Rgb::new(0.9, 0.5, 0.0)))
            .expect("valid");
        add_room(b, grey, 1.0);
        b.add_light(light("point", DVec3::new(0.9, -0.3, 0.1), DVec3::Y, 1.0));
    });
    let stored = Samples::over_seeds(16, |seed| {
        let maps = trace(&room, &settings(seed, 20_000));
        let c = maps.global_counts;
        assert_eq!(c.flux_escaped, 0.0, "the room leaks");
        let power: f64 = maps
            .global
            .iter()
            .flat_map(|m| m.photons())
            .map(|p| p.power().g)
            .sum();
        power / (4.0 * PI)
    });
    // Each photon is stored at every surface that it meets: Σ ρ^k = 1/(1 − ρ).
    stored.assert_mean("power stored over flux", 2.0, 0.005);
}
