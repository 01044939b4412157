//! Light transport against closed forms, and the integrators against each other.
//!
//! Every statistical statement fixes its seeds and says what deviation it allows. The closed
//! forms: a furnace (`L = Le/(1−ρ)`), a point light in a diffuse sphere (indirect irradiance
//! `Φ/(4πR²)·ρ/(1−ρ)` everywhere, wherever the light is), energies of a glass slab and sphere,
//! and the flux of a sphere's caustic, computed from Snell's and Fresnel's laws.

mod common;

use std::f64::consts::PI;

use common::{add_quad, add_room, add_sphere, camera, glass, lambert, light};
use dualight::color::Rgb;
use dualight::control::Control;
use dualight::film::{Component, Image};
use dualight::geometry::Ray;
use dualight::lights::LightDesc;
use dualight::materials::TransportMode;
use dualight::math::DVec3;
use dualight::photons::{PhotonClass, PhotonMaps, PhotonSettings, trace_photons};
use dualight::pipeline::{RenderSettings, render};
use dualight::plugins::Registry;
use dualight::sampling::{Sampler, stream, warp};
use dualight::scene::{Scene, SceneBuilder};

fn settings(integrator: &str, size: u32, spp: u32, photons: u64) -> RenderSettings {
    let mut s = RenderSettings {
        integrator: Some(integrator.into()),
        width: size,
        height: size,
        spp,
        ..Default::default()
    };
    s.integrator_settings.photons = photons;
    s.integrator_settings.caustic_photons = photons;
    s
}

fn image(scene: &Scene, s: &RenderSettings) -> Image {
    let r = render(scene, s, &Registry::builtin(), &Control::default()).unwrap();
    assert_eq!(r.statistics.rejected_pixels, 0, "a sample was not finite");
    r.film.develop()
}

fn mean(image: &Image, layer: &str) -> f64 {
    let rgb = image.rgb(layer).unwrap();
    rgb.iter().flatten().map(|&x| f64::from(x)).sum::<f64>() / (3 * rgb.len()) as f64
}

fn maps(scene: &Scene, photons: u64, seed: u64) -> PhotonMaps {
    let registry = Registry::builtin();
    let accel = (registry.accelerators.choose(None).unwrap().build)(&scene.geometry, 1).unwrap();
    let effects = dualight::effects::survey(scene, "auto", &registry.effects).unwrap();
    let settings = PhotonSettings {
        seed,
        global: photons,
        caustic: photons,
        nearest: 50,
        max_depth: None,
        roulette: true,
        guidance: dualight::photons::Guidance::Off,
    };
    let emission = registry.emissions.choose(None).unwrap();
    trace_photons(
        scene,
        &*accel,
        emission,
        effects.set,
        &settings,
        true,
        &Control::default(),
    )
}

/// A closed box whose walls emit 1 and reflect half: radiance 2 everywhere.
fn furnace() -> Scene {
    let mut b = SceneBuilder::default();
    let mut desc = lambert("wall", Rgb::splat(0.5));
    desc.emission = Rgb::ONE;
    let m = b.add_material(&desc).unwrap();
    let (lo, hi) = (DVec3::splat(-1.0), DVec3::splat(1.0));
    let (x, y, z) = (DVec3::X * 2.0, DVec3::Y * 2.0, DVec3::Z * 2.0);
    for (p, e1, e2) in [
        (lo, z, x),
        (lo, x, y),
        (lo, y, z),
        (hi, -x, -z),
        (hi, -y, -x),
        (hi, -z, -y),
    ] {
        add_quad(&mut b, "wall", m, p, e1, e2);
    }
    b.add_camera(camera(DVec3::new(0.1, 0.2, 0.3), 90.0));
    b.finish().unwrap()
}

#[test]
fn furnace_has_the_radiance_of_the_geometric_series() {
    let scene = furnace();
    let path = mean(&image(&scene, &settings("path", 16, 256, 0)), "");
    assert!((path / 2.0 - 1.0).abs() < 0.005, "path: {path}");
    // Kernels at the edges of the walls lose what lies beyond: within 2 % at this count.
    let photon = mean(&image(&scene, &settings("photon", 16, 64, 300_000)), "");
    assert!((photon / 2.0 - 1.0).abs() < 0.02, "photon: {photon}");
}

#[test]
fn a_point_light_in_a_diffuse_sphere_lights_it_evenly_wherever_it_is() {
    for position in [
        DVec3::ZERO,
        DVec3::new(0.3, 0.2, -0.1),
        DVec3::new(0.0, -0.5, 0.0),
    ] {
        let mut b = SceneBuilder::default();
        let m = b.add_material(&lambert("inside", Rgb::splat(0.5))).unwrap();
        add_sphere(&mut b, "sphere", m, DVec3::ZERO, 1.0);
        b.add_light(LightDesc {
            kind: "point",
            position,
            strength: Rgb::ONE,
            ..Default::default()
        });
        b.add_camera(camera(DVec3::new(0.0, 0.0, 0.5), 90.0));
        let scene = b.finish().unwrap();
        // Φ = 4π W, R = 1, ρ = ½: E = 1 W/m², L = ρE/π.
        let expected = 0.5 / PI;
        let mut photon_direct = settings("photon", 16, 4, 300_000);
        photon_direct.integrator_settings.gather_rays = 0;
        for (what, s, tolerance) in [
            ("path", settings("path", 16, 256, 0), 0.01),
            ("photon", settings("photon", 16, 64, 200_000), 0.01),
            ("photon without gather", photon_direct, 0.015),
        ] {
            let l = mean(&image(&scene, &s), "indirect");
            assert!(
                (l / expected - 1.0).abs() < tolerance,
                "{what} at {position}: {l} {expected}"
            );
        }
    }
}

#[test]
fn flux_is_accounted_for_to_nine_digits() {
    let scene = common::box_scene();
    let maps = maps(&scene, 100_000, 3);
    for c in [maps.global_counts, maps.caustic_counts] {
        let sum = c.flux_absorbed + c.flux_escaped + c.flux_cut;
        assert!((sum / c.flux_emitted - 1.0).abs() < 1e-9, "{c:?}");
        assert!(c.stored > 0 && c.emitted == 100_000, "{c:?}");
    }
    // π L A per channel: cosine emission of a flat lamp gives every photon the same power.
    let power = 3.0 * PI * 15.0 * 0.25;
    assert!((maps.global_counts.flux_emitted / power - 1.0).abs() < 1e-6);
}

#[test]
fn a_point_light_over_a_plane_lights_a_disc_with_its_share() {
    let mut b = SceneBuilder::default();
    let m = b.add_material(&lambert("plane", Rgb::splat(0.5))).unwrap();
    let corner = DVec3::new(-50.0, 0.0, -50.0);
    add_quad(
        &mut b,
        "plane",
        m,
        corner,
        DVec3::Z * 100.0,
        DVec3::X * 100.0,
    );
    b.add_light(LightDesc {
        position: DVec3::Y,
        ..Default::default()
    });
    let scene = b.finish().unwrap();
    let n = 200_000;
    let maps = maps(&scene, n, 1);
    let inside = maps
        .global
        .unwrap()
        .photons()
        .iter()
        .filter(|p| {
            let q = DVec3::new(f64::from(p.p[0]), 0.0, f64::from(p.p[2]));
            q.length() < 1.0
        })
        .count();
    // Half of (1 − cos 45°); binomial, 4σ.
    let p = 0.5 * (1.0 - 0.5f64.sqrt());
    let sigma = (p * (1.0 - p) / n as f64).sqrt();
    let share = inside as f64 / n as f64;
    assert!((share - p).abs() < 4.0 * sigma, "{share} {p} ± {sigma}");
}

/// Follows every branch of a ray through smooth dielectrics and sums what leaves, by direction
/// and by the number of internal reflections.
fn leaving(scene: &Scene, ray: Ray, mut out: impl FnMut(DVec3, u32, f64)) {
    let registry = Registry::builtin();
    let accel = (registry.accelerators.choose(None).unwrap().build)(&scene.geometry, 1).unwrap();
    let mut stack = vec![(ray, 1.0, 0u32)];
    while let Some((ray, weight, depth)) = stack.pop() {
        if weight < 1e-10 {
            continue;
        }
        let Some(hit) = accel.intersect(&ray) else {
            out(ray.direction(), depth, weight);
            continue;
        };
        let sp = scene.surface_point(&ray, &hit);
        let bsdf = scene.bsdf(&sp, None, TransportMode::Importance);
        for b in bsdf.branches().unwrap() {
            stack.push((sp.spawn(b.wi), weight * b.weight.r, depth + 1));
        }
    }
}

#[test]
fn a_glass_slab_passes_what_incoherent_reflections_leave() {
    for thickness in [1.0, 1e-2, 1e-4] {
        let mut b = SceneBuilder::default();
        let m = b.add_material(&glass(1.5)).unwrap();
        // Rays start off a surface by what its corners' coordinates round to: the slab must be
        // thicker than that.
        let (s, t) = (1e3 * thickness, DVec3::Z * thickness);
        let corner = DVec3::new(-s, -s, 0.0);
        add_quad(
            &mut b,
            "front",
            m,
            corner,
            DVec3::Y * (2.0 * s),
            DVec3::X * (2.0 * s),
        );
        add_quad(
            &mut b,
            "back",
            m,
            corner + t,
            DVec3::X * (2.0 * s),
            DVec3::Y * (2.0 * s),
        );
        let scene = b.finish().unwrap();
        for (degrees, expected) in [(0.0f64, 0.923_077), (45.0, 0.904_327), (80.0, 0.441_229)] {
            let a = degrees.to_radians();
            let d = DVec3::new(a.sin(), 0.0, a.cos());
            let (mut through, mut back) = (0.0, 0.0);
            leaving(&scene, Ray::new(d * -20.0, d), |dir, _, w| {
                if dir.z > 0.0 { through += w } else { back += w }
            });
            assert!(
                (through - expected).abs() < 1e-5,
                "{degrees}°, {thickness}: {through}"
            );
            assert!(
                (through + back - 1.0).abs() < 1e-6,
                "{degrees}°: {through} + {back}"
            );
        }
    }
}

#[test]
fn a_glass_sphere_splits_parallel_light_as_fresnel_says() {
    let mut b = SceneBuilder::default();
    let m = b.add_material(&glass(1.5)).unwrap();
    add_sphere(&mut b, "ball", m, DVec3::ZERO, 1.0);
    let scene = b.finish().unwrap();
    let n = 4096;
    let mut share = [0.0; 4];
    for i in 0..n {
        let [x, y] = warp::disc(Sampler::new(1, stream::TOOL, 1, i).next_2d());
        let ray = Ray::new(DVec3::new(x, y, -3.0), DVec3::Z);
        leaving(&scene, ray, |_, events, w| {
            share[events.min(3) as usize] += w / n as f64
        });
    }
    // Reflected at once, straight through, once reflected inside; stratified, so far below 1e-3.
    for (events, expected) in [
        (1, 0.091_778),
        (2, 0.835_544_4),
        (3, 0.061_183_2 + 0.011_494_4),
    ] {
        let got = share[events];
        assert!(
            (got - expected).abs() < 1e-3,
            "{events} events: {got} {expected}"
        );
    }
    assert!((share.iter().sum::<f64>() - 1.0).abs() < 1e-6, "{share:?}");
}

#[test]
fn the_caustic_of_a_glass_sphere_carries_the_flux_of_snells_law() {
    for (distance, radius, expected) in [
        (1.5, 0.1, 0.373_117),
        (1.5, 0.05, 0.255_483),
        (2.0, 0.1, 0.068_069),
    ] {
        let mut b = SceneBuilder::default();
        let m = b.add_material(&glass(1.5)).unwrap();
        add_sphere(&mut b, "ball", m, DVec3::ZERO, 1.0);
        let grey = b.add_material(&lambert("screen", Rgb::splat(0.5))).unwrap();
        let corner = DVec3::new(-40.0, -distance, -40.0);
        add_quad(
            &mut b,
            "screen",
            grey,
            corner,
            DVec3::Z * 80.0,
            DVec3::X * 80.0,
        );
        b.add_light(LightDesc {
            kind: "directional",
            direction: -DVec3::Y,
            strength: Rgb::ONE,
            ..Default::default()
        });
        let scene = b.finish().unwrap();
        let seeds = 16;
        let shares: Vec<f64> = (0..seeds)
            .map(|seed| {
                let maps = maps(&scene, 20_000, seed);
                let map = maps.caustic.unwrap();
                let center = -scene.center;
                map.photons()
                    .iter()
                    .filter(|p| {
                        assert_eq!(p.class, PhotonClass::Caustic);
                        let (x, z) = (f64::from(p.p[0]) - center.x, f64::from(p.p[2]) - center.z);
                        x.hypot(z) < radius
                    })
                    .map(|p| f64::from(p.power[0]))
                    .sum::<f64>()
                    / PI
            })
            .collect();
        let m = shares.iter().sum::<f64>() / seeds as f64;
        let var = shares.iter().map(|s| (s - m).powi(2)).sum::<f64>() / (seeds - 1) as f64;
        let sigma = (var / seeds as f64).sqrt();
        assert!(sigma < 0.005, "no teeth: {sigma}");
        // 4σ, and the few that were reflected inside, which the formula leaves out.
        assert!(
            (m - expected).abs() < 4.0 * sigma + 5e-4,
            "z {distance}: {m} {expected} ± {sigma}"
        );
    }
}

#[test]
fn integrators_agree_on_every_component() {
    let scene = common::box_scene();
    let runs = |integrator: &str, spp, photons| -> Vec<[f64; 4]> {
        (0..6)
            .map(|seed| {
                let mut s = settings(integrator, 48, spp, photons);
                s.integrator_settings.seed = seed;
                let image = image(&scene, &s);
                Component::ALL.map(|c| mean(&image, c.name()))
            })
            .collect()
    };
    let path = runs("path", 128, 0);
    let others = [
        ("photon", runs("photon", 8, 200_000)),
        ("hybrid", runs("hybrid", 32, 200_000)),
    ];
    for (k, c) in Component::ALL.into_iter().enumerate() {
        let stats = |runs: &[[f64; 4]]| {
            let n = runs.len() as f64;
            let m = runs.iter().map(|r| r[k]).sum::<f64>() / n;
            let var = runs.iter().map(|r| (r[k] - m).powi(2)).sum::<f64>() / (n - 1.0);
            (m, (var / n).sqrt())
        };
        let (a, sa) = stats(&path);
        for (name, other) in &others {
            let (b, sb) = stats(other);
            println!("{}: path {a} ± {sa}, {name} {b} ± {sb}", c.name());
            // 4σ of the difference, and 2 % for what kernels lose at the edges at this count.
            let allowed = 4.0 * sa.hypot(sb) + 0.02 * a;
            assert!(
                (a - b).abs() < allowed,
                "{}: path {a} ± {sa}, {name} {b} ± {sb}",
                c.name()
            );
        }
    }
}

#[test]
fn without_caustics_the_hybrid_is_path_tracing_to_the_bit() {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    add_room(&mut b, grey, 2.0);
    b.add_light(light("point", DVec3::new(0.3, 0.2, 0.1), DVec3::Y, 1.0));
    b.add_camera(camera(DVec3::new(0.0, 0.0, 1.5), 60.0));
    let scene = b.finish().unwrap();
    let of = |integrator| image(&scene, &settings(integrator, 24, 8, 10_000));
    assert!(of("path") == of("hybrid"));
}

/// A glass ball under a lamp without extent: no path from the camera finds its caustic.
#[test]
fn the_hybrid_finds_what_lamps_without_extent_make_of_glass() {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    let clear = b.add_material(&glass(1.5)).unwrap();
    add_room(&mut b, grey, 2.0);
    add_sphere(&mut b, "ball", clear, DVec3::new(0.0, -0.5, 0.0), 0.5);
    b.add_light(light("point", DVec3::new(0.3, 1.6, 0.1), DVec3::Y, 1.0));
    b.add_camera(camera(DVec3::new(0.0, 0.0, 1.9), 80.0));
    let scene = b.finish().unwrap();
    let of = |integrator, spp| image(&scene, &settings(integrator, 32, spp, 200_000));
    let (path, photon, hybrid) = (of("path", 16), of("photon", 16), of("hybrid", 64));
    let layers = ["caustics", "specular", "indirect"];
    for layer in layers {
        let [a, b, c] = [&path, &photon, &hybrid].map(|i| mean(i, layer));
        println!("{layer}: path {a}, photon {b}, hybrid {c}");
        // Noise of one picture each, and kernels of two sizes; path tracing lacks far more.
        assert!(
            (b / c - 1.0).abs() < 0.05,
            "{layer}: photon {b}, hybrid {c}"
        );
    }
    assert_eq!(mean(&path, "caustics"), 0.0);
    assert!(mean(&hybrid, "caustics") > 0.0);
}

#[test]
fn an_image_depends_on_the_seed_alone_not_on_threads() {
    let scene = common::box_scene();
    for integrator in ["path", "photon", "hybrid"] {
        let with = |threads, seed| {
            let mut s = settings(integrator, 24, 5, 20_000);
            s.threads = Some(threads);
            s.integrator_settings.seed = seed;
            image(&scene, &s)
        };
        let one = with(1, 7);
        assert!(one == with(2, 7), "{integrator}: two threads");
        assert!(one == with(3, 7), "{integrator}: three threads");
        assert!(one != with(1, 8), "{integrator}: another seed");
    }
}

#[test]
fn both_backends_render_the_same_picture() {
    let scene = common::box_scene();
    let with = |accel: &str| {
        let mut s = settings("path", 32, 16, 0);
        s.accelerator = Some(accel.into());
        image(&scene, &s).rgb("").unwrap()
    };
    let first = with(Registry::builtin().accelerators.entries()[0].name);
    let second = with("bvh");
    // The same rays and refinement: pixels differ only where a ray grazes an edge.
    let same = first
        .iter()
        .zip(&second)
        .filter(|(a, b)| {
            a.iter()
                .zip(b.iter())
                .all(|(x, y)| (x - y).abs() <= 1e-4 * x.abs().max(0.01))
        })
        .count();
    assert!(
        same * 100 >= first.len() * 97,
        "{same} of {} pixels agree",
        first.len()
    );
}

#[test]
fn what_a_scene_does_not_hold_is_not_traced() {
    let mut b = SceneBuilder::default();
    let m = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    let corner = DVec3::new(-1.0, -1.0, -1.0);
    add_quad(&mut b, "floor", m, corner, DVec3::Z * 2.0, DVec3::X * 2.0);
    b.add_camera(camera(DVec3::new(0.0, 0.0, 3.0), 40.0));
    let scene = b.finish().unwrap();
    let s = settings("photon", 8, 4, 1000);
    let r = render(&scene, &s, &Registry::builtin(), &Control::default()).unwrap();
    assert!(
        r.effects.iter().all(|d| !d.on && !d.reason.is_empty()),
        "{:?}",
        r.effects
    );
    let n = &r.statistics;
    assert_eq!((n.rays.photon, n.rays.gather, n.rays.shadow), (0, 0, 0));
    assert_eq!(mean(&r.film.develop(), ""), 0.0);
}
