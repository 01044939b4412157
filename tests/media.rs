//! Bodies that touch or lie in one another: light crosses from medium to medium as closed forms
//! say, in both directions, however the bodies are modelled.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::render::{DIRECT_MAP, Mode, PATH, Size, mean, render, rendering, settings};
use common::{add_quad, add_room, add_sphere, camera, glass, lambert, lamp, light, look_at};
use dualight::accel::{ACCELERATORS, Accelerator};
use dualight::color::Rgb;
use dualight::control::Control;
use dualight::effects::EffectSet;
use dualight::geometry::{MaterialId, Ray, TriangleMesh};
use dualight::lights::LightDesc;
use dualight::materials::{Bsdf, MaterialDesc, TransportMode};
use dualight::math::{DAffine3, DVec3};
use dualight::photons::{EMISSIONS, PhotonClass, PhotonMaps, PhotonSettings, trace_photons};
use dualight::scene::{Inside, MeshPlacement, Scene, SceneBuilder};

const GLASS: f64 = 1.5;
const WATER: f64 = 1.33;

fn scene(f: impl FnOnce(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::default();
    f(&mut b);
    b.finish().unwrap()
}

/// Share of light that passes plane borders between these media, all echoes among them counted.
fn passes(indices: &[f64]) -> f64 {
    let lost: f64 = indices
        .windows(2)
        .map(|n| ((n[0] - n[1]) / (n[0] + n[1])).powi(2))
        .map(|r| r / (1.0 - r))
        .sum();
    1.0 / (1.0 + lost)
}

fn put(b: &mut SceneBuilder, name: &str, material: MaterialId, mesh: TriangleMesh) {
    let shape = b.add_mesh(mesh, name);
    b.place(MeshPlacement {
        shape,
        material,
        world_from_object: DAffine3::IDENTITY,
        name: name.into(),
    });
}

/// A closed block, fronts outward.
fn block(lo: DVec3, hi: DVec3) -> TriangleMesh {
    let mut m = TriangleMesh::default();
    for k in 0..8u32 {
        let pick = |i: usize| if k >> i & 1 == 0 { lo[i] } else { hi[i] };
        m.positions
            .push([pick(0), pick(1), pick(2)].map(|x| x as f32));
    }
    for [a, b, c, d] in [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ] {
        m.indices.extend([[a, b, c], [a, c, d]]);
    }
    m
}

/// A layer of a pile, 4 m wide, between two heights.
fn layer(from: f64, to: f64) -> TriangleMesh {
    block(DVec3::new(-2.0, from, -2.0), DVec3::new(2.0, to, 2.0))
}

/// A closed ball of triangles; inside out if `inward`.
fn ball(n: u32, r: f64, inward: bool) -> TriangleMesh {
    let sectors = 2 * n;
    let mut mesh = TriangleMesh::default();
    for i in 0..=n {
        for j in 0..sectors {
            let t = std::f64::consts::PI * f64::from(i) / f64::from(n);
            let a = std::f64::consts::TAU * f64::from(j) / f64::from(sectors);
            let sin = if i == 0 || i == n { 0.0 } else { t.sin() };
            let p = DVec3::new(sin * a.cos(), t.cos(), -sin * a.sin()) * r;
            mesh.positions.push(p.as_vec3().into());
        }
    }
    for i in 0..n {
        for j in 0..sectors {
            let k = |i: u32, j: u32| i * sectors + j % sectors;
            mesh.indices.push([k(i, j), k(i + 1, j), k(i, j + 1)]);
            mesh.indices
                .push([k(i, j + 1), k(i + 1, j), k(i + 1, j + 1)]);
        }
    }
    if inward {
        mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
    }
    mesh
}

fn joined(mut a: TriangleMesh, b: &TriangleMesh) -> TriangleMesh {
    let n = a.positions.len() as u32;
    a.positions.extend(&b.positions);
    a.indices.extend(b.indices.iter().map(|t| t.map(|i| i + n)));
    a
}

/// Ways to model a layer of water between two of glass, 0.3 + 0.2 + 0.3 m.
fn piles() -> Vec<(&'static str, Vec<(f64, TriangleMesh)>)> {
    let eps = 0.01;
    vec![
        (
            "three that touch",
            vec![
                (GLASS, layer(0.5, 0.8)),
                (WATER, layer(0.3, 0.5)),
                (GLASS, layer(0.0, 0.3)),
            ],
        ),
        (
            "water first in the file",
            vec![
                (WATER, layer(0.3, 0.5)),
                (GLASS, layer(0.0, 0.3)),
                (GLASS, layer(0.5, 0.8)),
            ],
        ),
        (
            "water in glass",
            vec![
                (GLASS, layer(0.0, 0.8)),
                (
                    WATER,
                    block(DVec3::new(-1.9, 0.3, -1.9), DVec3::new(1.9, 0.5, 1.9)),
                ),
            ],
        ),
        (
            "water that reaches into the glass",
            vec![
                (GLASS, layer(0.5, 0.8)),
                (GLASS, layer(0.0, 0.3)),
                (
                    WATER,
                    block(
                        DVec3::new(-1.9, 0.3 - eps, -1.9),
                        DVec3::new(1.9, 0.5 + eps, 1.9),
                    ),
                ),
            ],
        ),
    ]
}

fn pile(b: &mut SceneBuilder, layers: Vec<(f64, TriangleMesh)>) {
    for (ior, mesh) in layers {
        let m = b.add_material(&glass(ior)).unwrap();
        put(b, "layer", m, mesh);
    }
}

fn maps(scene: &Scene, accel: &dyn Accelerator, photons: u64) -> PhotonMaps {
    let settings = PhotonSettings {
        seed: 1,
        global: photons,
        caustic: photons,
        nearest: 50,
        max_depth: None,
        roulette: true,
        guidance: dualight::photons::Guidance::Off,
    };
    let (all, control) = (EffectSet::all(), Control::default());
    trace_photons(scene, accel, &EMISSIONS[0], all, &settings, false, &control)
}

#[test]
fn photons_cross_a_pile_as_its_borders_say() {
    let want = passes(&[1.0, GLASS, WATER, GLASS, 1.0]);
    for (name, layers) in piles() {
        let scene = scene(|b| {
            let black = b.add_material(&lambert("black", Rgb::splat(1e-3))).unwrap();
            let (x, z) = (DVec3::X * 4.0, DVec3::Z * 4.0);
            add_quad(b, "floor", black, DVec3::new(-2.0, -1.0, -2.0), z, x);
            pile(b, layers);
            b.add_light(LightDesc {
                inner_cone: 0.04,
                outer_cone: 0.05,
                ..light("spot", DVec3::Y * 2.0, DVec3::NEG_Y, 1.0)
            });
        });
        for backend in ACCELERATORS {
            let accel = (backend.build)(&scene.geometry, 2).unwrap();
            let maps = maps(&scene, &*accel, 60_000);
            let c = &maps.global_counts;
            let spent = c.flux_absorbed + c.flux_escaped + c.flux_cut;
            assert!((c.flux_emitted - spent).abs() < 1e-9 * c.flux_emitted);
            let map = maps.global.as_ref().unwrap();
            let through = map
                .photons()
                .iter()
                .filter(|p| p.class == PhotonClass::Caustic);
            let flux: f64 = through.map(|p| p.power()).map(|c| c.r + c.g + c.b).sum();
            let share = flux / c.flux_emitted;
            println!("{name}, {}: {share:.4}, want {want:.4}", backend.name);
            assert!(
                (share / want - 1.0).abs() < 5e-3,
                "{name}, {}: {share}",
                backend.name
            );
        }
    }
}

#[test]
fn cameras_see_through_a_pile_as_its_borders_say() {
    let want = passes(&[1.0, GLASS, WATER, GLASS, 1.0]);
    let size = Size {
        pixels: 8,
        spp: 256,
        photons: 100,
    };
    for (name, layers) in piles() {
        let scene = scene(|b| {
            let shine = b.add_material(&lamp(Rgb::ONE)).unwrap();
            let (x, z) = (DVec3::X * 4.0, DVec3::Z * 4.0);
            add_quad(b, "floor", shine, DVec3::new(-2.0, -1.0, -2.0), z, x);
            pile(b, layers);
            let eye = DVec3::Y * 3.0;
            b.add_camera(look_at("perspective", eye, DVec3::ZERO, 0.05));
        });
        for mode in [PATH, DIRECT_MAP] {
            let found = mean(&render(&scene, mode, size, 0), "");
            println!("{name}, {}: {found:.4}, want {want:.4}", mode.name);
            assert!(
                (found / want - 1.0).abs() < 5e-3,
                "{name}, {}: {found}",
                mode.name
            );
        }
    }
}

/// Follows the refracted part of a ray to where it leaves the scene: its direction, and the
/// product of the transmittances.
fn refracted(scene: &Scene, accel: &dyn Accelerator, mut ray: Ray) -> (DVec3, f64, Vec<Inside>) {
    let mut inside = scene.enclosing(ray.origin());
    let (mut beta, mut way) = (1.0, vec![inside]);
    while let Some(hit) = accel.intersect(&ray) {
        let sp = scene.surface_point(&ray, &hit);
        let crossing = scene.crossing(inside, &sp);
        let mut bsdf = Bsdf::new(&sp, TransportMode::Importance);
        scene.scatter(&sp, None, &mut bsdf);
        crossing.apply(&mut bsdf);
        let branches = bsdf.branches().unwrap();
        let Some(s) = branches.iter().find(|s| s.transmitted) else {
            return (DVec3::ZERO, 0.0, way);
        };
        beta *= s.weight.r;
        inside = crossing.beyond(true);
        way.push(inside);
        ray = sp.spawn(s.wi);
        assert!(way.len() < 20, "a path without end");
    }
    (ray.direction().normalize(), beta, way)
}

/// The direction in which a ray along `-y` with impact parameter `b` leaves concentric balls of
/// these radii and indices, from the outer one inward.
fn deflected(b: f64, balls: &[(f64, f64)]) -> f64 {
    let mut outside = 1.0;
    balls
        .iter()
        .map(|&(r, n)| {
            let bend = (b / (outside * r)).asin() - (b / (n * r)).asin();
            outside = n;
            2.0 * bend
        })
        .sum()
}

#[test]
fn balls_in_balls_bend_light_as_their_borders_say() {
    let indices = [
        ("glass, water", GLASS, WATER),
        ("water, glass", WATER, GLASS),
        ("bubble", WATER, 1.0),
        ("the same", GLASS, GLASS),
    ];
    for (name, outer, inner) in indices {
        for swap in [false, true] {
            let scene = scene(|b| {
                let mut balls = [("outer", outer, 1.0), ("inner", inner, 0.8)];
                if swap {
                    balls.reverse();
                }
                for (name, n, r) in balls {
                    let m = b.add_material(&glass(n)).unwrap();
                    add_sphere(b, name, m, DVec3::ZERO, r);
                }
            });
            for backend in ACCELERATORS {
                let accel = (backend.build)(&scene.geometry, 1).unwrap();
                for k in 0..60 {
                    let b = 0.01 * f64::from(k);
                    let ray = Ray::new(DVec3::new(b, 3.0, 0.0), DVec3::NEG_Y);
                    let (d, beta, way) = refracted(&scene, &*accel, ray);
                    let b = ray.origin().x;
                    let want = deflected(b, &[(1.0, outer), (f64::from(0.8f32), inner)]);
                    assert_eq!(way.len(), 5, "{name} {b}");
                    assert_eq!(way[0], way[4], "{name} {b}: out again");
                    let found = (-d.x).atan2(-d.y);
                    // A spawned ray is rounded to single precision at every step.
                    assert!((found - want).abs() < 4e-6, "{name} {b}: {found} {want}");
                    if k == 0 {
                        let r = |m: f64, n: f64| 1.0 - ((m - n) / (m + n)).powi(2);
                        let once = (r(1.0, outer) * r(outer, inner)).powi(2);
                        assert!((beta - once).abs() < 1e-6, "{name}: {beta} {once}");
                    }
                }
            }
        }
    }
}

/// A glass vessel, or a ball of glass, with water in it; a room with a lamp, and a camera.
fn vessel(hollow: bool, water_first: bool) -> Scene {
    scene(|b| {
        let grey = b.add_material(&lambert("grey", Rgb::splat(0.7))).unwrap();
        let shine = b.add_material(&lamp(Rgb::splat(20.0))).unwrap();
        let clear = b.add_material(&glass(GLASS)).unwrap();
        let water = b.add_material(&MaterialDesc {
            attenuation_distance: 1.0,
            attenuation_color: Rgb::new(0.3, 0.6, 0.9),
            ..glass(WATER)
        });
        let water = water.unwrap();
        add_room(b, grey, 2.0);
        let x = DVec3::X;
        add_quad(b, "lamp", shine, DVec3::new(-0.5, 1.9, -0.5), x, DVec3::Z);
        let cup = ball(12, 1.0, false);
        let cup = if hollow {
            joined(cup, &ball(12, 0.8, true))
        } else {
            cup
        };
        let mut both = [("cup", clear, cup), ("water", water, ball(12, 0.8, false))];
        if water_first {
            both.reverse();
        }
        for (name, m, mesh) in both {
            put(b, name, m, mesh);
        }
        b.add_camera(camera(DVec3::Z * 1.95, 70.0));
    })
}

#[test]
fn water_that_touches_its_vessel_looks_like_water_in_glass() {
    let size = Size {
        pixels: 8,
        spp: 64,
        photons: 20_000,
    };
    let run = |hollow, first, mode: Mode| {
        let scene = vessel(hollow, first);
        let means: Vec<f64> = (0..4)
            .map(|seed| {
                // One backend for all.
                let mut s = settings(mode, size, 0);
                s.integrator_settings.seed = seed;
                mean(&rendering(&scene, &s).film.develop(), "")
            })
            .collect();
        let m = means.iter().sum::<f64>() / 4.0;
        let v = means.iter().map(|x| (x - m).powi(2)).sum::<f64>() / 12.0;
        println!(
            "hollow {hollow}, water first {first}, {}: {m:.4} ± {:.4}",
            mode.name,
            v.sqrt()
        );
        (m, v)
    };
    let (want, v0) = run(false, false, PATH);
    for (hollow, first, mode) in [
        (true, false, PATH),
        (true, true, PATH),
        (true, false, DIRECT_MAP),
    ] {
        let (found, v) = run(hollow, first, mode);
        let error = (v + v0).sqrt();
        // Kernels blur: 1.5 % beside the noise for the maps.
        let bias = if mode.name == PATH.name { 0.003 } else { 0.015 };
        assert!(
            (found - want).abs() < 4.0 * error + bias * want,
            "{found} {want} ± {error}"
        );
    }
}

#[test]
fn priorities_decide_who_fills_what_bodies_share() {
    // The larger body wins if it is told to; what it covers is then not there at all.
    let share = |priority: f64| {
        let scene = scene(|b| {
            let outer = b.add_material(&MaterialDesc {
                extras: serde_json::json!({ "dualight": { "priority": priority } }),
                ..glass(GLASS)
            });
            let (outer, inner) = (outer.unwrap(), b.add_material(&glass(2.0)).unwrap());
            put(b, "outer", outer, layer(0.0, 1.0));
            let (lo, hi) = (DVec3::new(-1.0, 0.3, -1.0), DVec3::new(1.0, 0.6, 1.0));
            put(b, "inner", inner, block(lo, hi));
        });
        let accel = (ACCELERATORS[0].build)(&scene.geometry, 1).unwrap();
        refracted(
            &scene,
            &*accel,
            Ray::new(DVec3::new(0.1, 3.0, 0.2), DVec3::NEG_Y),
        )
        .1
    };
    let t = |m: f64, n: f64| 1.0 - ((m - n) / (m + n)).powi(2);
    assert!((share(0.0) - (t(1.0, GLASS) * t(GLASS, 2.0)).powi(2)).abs() < 1e-9);
    assert!((share(1.0) - t(1.0, GLASS).powi(2)).abs() < 1e-9);
}

#[test]
fn points_know_the_bodies_that_they_lie_in() {
    let scene = vessel(true, false);
    let at = |r: f64| scene.enclosing(DVec3::new(0.3, 0.5, 0.7).normalize() * r);
    let (out, wall, water) = (at(1.5), at(0.9), at(0.5));
    assert_eq!(out, Inside::default());
    assert!(wall != out && water != out && wall != water);
    // Bodies apart from each other need no order.
    assert!(vessel(true, false).media.is_some());
    let apart = self::scene(|b| {
        let m = b.add_material(&glass(GLASS)).unwrap();
        add_sphere(b, "one", m, DVec3::X * 2.0, 1.0);
        add_sphere(b, "other", m, DVec3::X * -2.0, 1.0);
    });
    assert!(apart.media.is_none());
}

#[test]
fn what_is_not_closed_lies_in_air_as_ever() {
    let scene = scene(|b| {
        let m = b.add_material(&glass(GLASS)).unwrap();
        put(b, "block", m, layer(0.0, 1.0));
        add_quad(b, "sheet", m, DVec3::Y * 0.5, DVec3::Z, DVec3::X);
    });
    assert!(scene.media.is_none());
}

#[test]
fn a_priority_must_be_a_number() {
    let mut b = SceneBuilder::default();
    let bad = b.add_material(&MaterialDesc {
        extras: serde_json::json!({ "dualight": { "priority": "high" } }),
        ..glass(GLASS)
    });
    let text = bad.unwrap_err().to_string();
    assert!(
        text.contains("'glass'") && text.contains("extras.dualight.priority"),
        "{text}"
    );
}
