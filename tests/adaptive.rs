//! The adaptive emission: as bright as the uniform one everywhere, its flux exact, its cells only
//! where something changes, and its variance what theory promises.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;
#[path = "hardcases/report.rs"]
mod report;

use common::render::bvh;
use common::{add_quad, add_room, add_sphere, glass, lambert, lamp, light};
use dualight::accel::Accelerator;
use dualight::color::Rgb;
use dualight::geometry::{TriangleMesh, sphere};
use dualight::lights::LightDesc;
use dualight::math::{DAffine3, DVec3};
use dualight::photons::{EMISSIONS, EmissionContext, EmittedPhoton, PhotonSource, Purpose};
use dualight::sampling::{Rng, warp};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};
use rayon::prelude::*;
use report::{Meter, Row, rows};

fn scene(f: impl FnOnce(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::default();
    f(&mut b);
    b.finish().unwrap()
}

/// Calls `f` with the named emission.
fn with_source<R>(
    name: &str,
    scene: &Scene,
    accel: &dyn Accelerator,
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

fn photons(source: &dyn PhotonSource) -> impl Iterator<Item = EmittedPhoton> + '_ {
    (0..source.len()).filter_map(|i| source.emit(i))
}

/// A smooth ball of `4 n²` triangles.
fn ball_mesh(n: u32, c: DVec3, r: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let w = 2 * n + 1;
    for j in 0..=n {
        for i in 0..w {
            let phi = f64::from(i % (2 * n)) / f64::from(n) * std::f64::consts::PI;
            let theta = f64::from(j) / f64::from(n) * std::f64::consts::PI;
            let ring = if j == 0 || j == n { 0.0 } else { theta.sin() };
            let p = DVec3::new(ring * phi.cos(), theta.cos(), -ring * phi.sin());
            mesh.positions.push((c + p * r).as_vec3().into());
            mesh.normals.push(p.as_vec3().into());
        }
    }
    for j in 0..n {
        for i in 0..2 * n {
            let a = j * w + i;
            mesh.indices.push([a, a + w + 1, a + 1]);
            mesh.indices.push([a, a + w, a + w + 1]);
        }
    }
    mesh
}

fn add_mesh(b: &mut SceneBuilder, mesh: TriangleMesh, desc: &dualight::materials::MaterialDesc) {
    let material = b.add_material(desc).unwrap();
    let shape = b.add_mesh(mesh, "mesh");
    b.place(MeshPlacement {
        shape,
        material,
        world_from_object: DAffine3::IDENTITY,
        name: "mesh".into(),
    });
}

/// The light kinds of the tests.
const KINDS: [&str; 5] = ["point", "spot", "directional", "area", "sphere"];

/// A light of a kind above the scene.
fn add_light(b: &mut SceneBuilder, kind: &'static str) {
    let at = DVec3::new(0.1, 1.6, -0.2);
    match kind {
        "area" => {
            let m = b.add_material(&lamp(Rgb::new(3.0, 2.0, 1.0))).unwrap();
            let corner = at - DVec3::new(0.15, 0.0, 0.15);
            add_quad(b, "lamp", m, corner, DVec3::X * 0.3, DVec3::Z * 0.3);
        }
        "sphere" => {
            let m = b.add_material(&lamp(Rgb::new(3.0, 2.0, 1.0))).unwrap();
            add_sphere(b, "lamp", m, at, 0.15);
        }
        _ => b.add_light(LightDesc {
            inner_cone: 0.4,
            outer_cone: 0.8,
            ..light(kind, at, DVec3::new(-0.05, -1.0, 0.1), 2.0)
        }),
    }
}

/// A floor with a ball of glass or of triangles above it, and a diffuse one.
fn balls(kind: &'static str, mesh: bool) -> Scene {
    scene(|b| {
        let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
        let (x, z) = (DVec3::X * 2.0, DVec3::Z * 2.0);
        add_quad(b, "floor", grey, DVec3::new(-1.0, 0.0, -1.0), z, x);
        let c = DVec3::new(0.3, 0.6, 0.1);
        if mesh {
            add_mesh(b, ball_mesh(16, c, 0.3), &glass(1.5));
            let d = DVec3::new(-0.5, 0.4, 0.2);
            add_mesh(b, ball_mesh(12, d, 0.2), &lambert("ball", Rgb::splat(0.7)));
        } else {
            let g = b.add_material(&glass(1.5)).unwrap();
            add_sphere(b, "glass", g, c, 0.3);
            add_sphere(b, "ball", grey, DVec3::new(-0.5, 0.4, 0.2), 0.2);
        }
        add_light(b, kind);
    })
}

#[test]
fn the_flux_of_every_light_is_exact() {
    for kind in KINDS {
        for mesh in [false, true] {
            let scene = balls(kind, mesh);
            let accel = bvh(&scene.geometry);
            let told = (3, Purpose::Global, 20_000);
            let cells = ["adaptive", "adaptive-linear"].map(|name| {
                let (sum, n, cells) = with_source(name, &scene, &*accel, told, |s| {
                    let sum: Rgb = photons(s).map(|p| p.power).sum();
                    (sum, s.len(), s.cells())
                });
                let flux = scene.flux();
                let off = (sum - flux).map(f64::abs).max_channel() / flux.max_channel();
                println!(
                    "{name}, {kind}, mesh {mesh}: {n} photons, {cells} cells, flux off by {off:.1e}"
                );
                assert!(off < 1e-9, "{off}");
                // One photon per cell at least, and yet no more than were asked for.
                assert!((19_999..=20_001).contains(&n), "{n}");
                cells
            });
            // A forecast that sees fewer edges splits fewer cells.
            assert!(cells[1] <= cells[0], "{cells:?}");
        }
    }
}

const PATCHES: usize = 32;

/// Flux per patch: of the floor for global photons, of the glass (by direction from its middle)
/// for caustic ones.
fn patches(
    scene: &Scene,
    accel: &dyn Accelerator,
    name: &str,
    told: (u64, Purpose, u64),
) -> Vec<f64> {
    let mut out = vec![0.0; PATCHES * PATCHES];
    with_source(name, scene, accel, told, |s| {
        for photon in photons(s) {
            let Some(hit) = accel.intersect(&photon.ray) else {
                continue;
            };
            let sp = scene.surface_point(&photon.ray, &hit);
            let floor = hit.object.0 == 0;
            let u = match told.1 {
                Purpose::Global if floor => [0.5 + 0.5 * sp.p.x, 0.5 + 0.5 * sp.p.z],
                Purpose::Caustic if hit.object.0 == 1 => {
                    let n = (sp.p - DVec3::new(0.3, 0.6, 0.1)).normalize();
                    let phi = n.z.atan2(n.x) / std::f64::consts::TAU + 0.5;
                    [phi, 0.5 * (n.y + 1.0)]
                }
                _ => continue,
            };
            let k = u.map(|x| ((x * PATCHES as f64) as usize).min(PATCHES - 1));
            out[k[1] * PATCHES + k[0]] += photon.power.luminance();
        }
    });
    out
}

/// P2: adaptive and uniform emission light every patch alike.
fn alike(row: &mut Row) {
    const SEEDS: u64 = 64;
    const COUNT: u64 = 3000;
    let mut all = Vec::new();
    for purpose in [Purpose::Global, Purpose::Caustic] {
        for kind in KINDS {
            for mesh in [false, true] {
                let scene = balls(kind, mesh);
                let accel = bvh(&scene.geometry);
                let run = |name: &'static str, offset: u64| -> Vec<Vec<f64>> {
                    (0..SEEDS)
                        .into_par_iter()
                        .map(|seed| patches(&scene, &*accel, name, (seed + offset, purpose, COUNT)))
                        .collect()
                };
                let (a, b) = (run("uniform", 0), run("adaptive", 1000));
                let moments = |runs: &[Vec<f64>], k: usize| {
                    let n = SEEDS as f64;
                    let m = runs.iter().map(|r| r[k]).sum::<f64>() / n;
                    let v = runs.iter().map(|r| (r[k] - m).powi(2)).sum::<f64>() / (n * (n - 1.0));
                    (m, v)
                };
                let mean = |runs: &[Vec<f64>]| {
                    runs.iter().flatten().sum::<f64>() / (SEEDS as usize * PATCHES * PATCHES) as f64
                };
                let typical = mean(&a);
                // Flux of one uniform photon.
                let sent = match purpose {
                    Purpose::Global => scene.flux().luminance(),
                    Purpose::Caustic => typical * (PATCHES * PATCHES) as f64,
                };
                let one = sent / COUNT as f64;
                let totals = [&a, &b].map(|runs| {
                    let sums: Vec<f64> = runs.iter().map(|r| r.iter().sum()).collect();
                    (
                        sums.iter().sum::<f64>() / SEEDS as f64,
                        variance(&sums) / SEEDS as f64,
                    )
                });
                // Where both are exact, rounding is all that differs.
                let rounding = (1e-7 * totals[0].0).powi(2);
                let total =
                    (totals[0].0 - totals[1].0) / (totals[0].1 + totals[1].1 + rounding).sqrt();
                let (mut zs, mut faint, mut va, mut vb) = (Vec::new(), Vec::new(), 0.0, 0.0);
                for k in 0..PATCHES * PATCHES {
                    let ((ma, sa), (mb, sb)) = (moments(&a, k), moments(&b, k));
                    // What a handful of photons meet in all runs is not normal: such patches, the
                    // shadows among them, are tested as one.
                    let met = 0.5 * (ma + mb) * SEEDS as f64 / one;
                    if met > 16.0 && sa > 0.0 && sb > 0.0 {
                        zs.push((ma - mb) / (sa + sb).sqrt());
                        va += sa;
                        vb += sb;
                    } else {
                        faint.push(k);
                    }
                }
                let dark = [&a, &b].map(|runs| {
                    let sums: Vec<f64> = runs
                        .iter()
                        .map(|r| faint.iter().map(|&k| r[k]).sum())
                        .collect();
                    let mean = sums.iter().sum::<f64>() / SEEDS as f64;
                    (mean, variance(&sums) / SEEDS as f64)
                });
                if dark[0].1 + dark[1].1 > 0.0 {
                    zs.push((dark[0].0 - dark[1].0) / (dark[0].1 + dark[1].1).sqrt());
                }
                let n = zs.len() as f64;
                let worst = zs.iter().fold(0.0f64, |m, z| m.max(z.abs()));
                // Student's distribution of 126 degrees has the variance 126/124.
                let pooled = zs.iter().map(|z| z * z).sum::<f64>() * 124.0 / 126.0;
                let sigma = (pooled - n) / (2.0 * n).sqrt();
                println!(
                    "{purpose:?} {kind}, mesh {mesh}: {n} patches, worst {worst:.2} sigma, χ² \
                     {sigma:+.2} sigma, total {:+.3} % = {total:+.2} sigma, variance {:.2} of uniform's, \
                     one run's total ± {:.2} and {:.2} %",
                    100.0 * (mean(&b) / typical - 1.0),
                    vb / va,
                    100.0 * (totals[0].1 * SEEDS as f64).sqrt() / totals[0].0,
                    100.0 * (totals[1].1 * SEEDS as f64).sqrt() / totals[1].0,
                );
                all.push((n, worst, sigma, total));
            }
        }
    }
    let [mut patch, mut pooled, mut whole] = [Meter::default(); 3];
    for (n, worst, sigma, total) in all {
        patch.see(if n > 100.0 { worst } else { f64::INFINITY });
        pooled.see(sigma);
        whole.see(f64::abs(total));
    }
    let path = "photons";
    row.tried("32² patches, 64 seeds, five lights, two balls, both purposes");
    row.line(path, "worst patch of each, in standard errors", patch, 4.8);
    row.line(path, "pooled χ², in deviations", pooled, 3.1);
    row.line(
        path,
        "difference of the sums, in standard errors",
        whole,
        4.0,
    );
    row.note(
        "32² patches, 64 seeds, five kinds of light, balls of glass and of triangles, photons of both \
         purposes. Of 20 000 patches one beyond four standard errors is expected; 4.8 has a chance of 1 in \
         20. A pooled χ² beyond three deviations has a chance below one in a thousand",
    );
}

/// Slope of `ln y` against `ln x`.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let (sx, sy) = logs.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
    let (mut xy, mut xx) = (0.0, 0.0);
    for (x, y) in logs {
        xy += (x - sx / n) * (y - sy / n);
        xx += (x - sx / n).powi(2);
    }
    xy / xx
}

fn variance(v: &[f64]) -> f64 {
    let (n, m) = (v.len() as f64, v.iter().sum::<f64>() / v.len() as f64);
    v.iter().map(|x| (x - m).powi(2)).sum::<f64>() / (n - 1.0)
}

#[test]
fn the_variance_of_the_flux_through_a_silhouette_falls_with_the_third_power() {
    let (c, r) = (DVec3::new(0.2, -1.0, 0.3), 0.5);
    let meets = |d: DVec3| sphere::intersect(DVec3::ZERO, d, c, r, 0.0, f64::INFINITY).is_some();
    let ball = scene(|b| {
        let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
        add_sphere(b, "ball", grey, c, r);
        b.add_light(light("point", DVec3::ZERO, DVec3::Y, 1.0));
    });
    let accel = bvh(&ball.geometry);
    let total = ball.flux().luminance();
    let seeds = |n: u64, f: &(dyn Fn(u64) -> f64 + Sync)| -> f64 {
        variance(&(0..n).into_par_iter().map(f).collect::<Vec<_>>())
    };
    let share = |name: &str, seed: u64, n: u64| {
        with_source(name, &ball, &*accel, (seed, Purpose::Global, n), |s| {
            photons(s)
                .filter(|p| meets(p.ray.direction()))
                .map(|p| p.power.luminance())
                .sum::<f64>()
                / total
        })
    };
    let sizes = [11, 12, 13, 14, 15].map(|k| 1 << k);
    let (mut random, mut stratified, mut uniform, mut adaptive) = (vec![], vec![], vec![], vec![]);
    for n in sizes {
        let x = n as f64;
        random.push((
            x,
            seeds(256, &|s| {
                let mut rng = Rng::new(s + 77);
                (0..n)
                    .filter(|_| meets(warp::sphere(rng.next_2d())))
                    .count() as f64
                    / x
            }),
        ));
        stratified.push((
            x,
            seeds(256, &|s| {
                let mut rng = Rng::new(s + 99);
                let side = x.sqrt() as u64;
                (0..side * side)
                    .filter(|i| {
                        let [u, v] = rng.next_2d();
                        let cell = [(i % side) as f64 + u, (i / side) as f64 + v];
                        meets(warp::sphere(cell.map(|c| c / side as f64)))
                    })
                    .count() as f64
                    / (side * side) as f64
            }),
        ));
        uniform.push((x, seeds(64, &|s| share("uniform", s, n as u64))));
        let real = with_source(
            "adaptive",
            &ball,
            &*accel,
            (0, Purpose::Global, n as u64),
            |s| s.len(),
        );
        adaptive.push((real as f64, seeds(64, &|s| share("adaptive", s, n as u64))));
    }
    let found = [&random, &stratified, &uniform, &adaptive].map(|v| slope(v));
    for (name, v) in [
        ("random", &random),
        ("stratified", &stratified),
        ("uniform", &uniform),
        ("adaptive", &adaptive),
    ] {
        let line: Vec<String> = v.iter().map(|(n, v)| format!("{n}: {v:.1e}")).collect();
        println!("{name:10} slope {:+.2}  {}", slope(v), line.join("  "));
    }
    assert!((found[0] + 1.0).abs() < 0.1, "random {}", found[0]);
    assert!((found[1] + 1.5).abs() < 0.15, "stratified {}", found[1]);
    assert!((found[3] + 3.0).abs() < 0.3, "adaptive {}", found[3]);
}

/// Cells of an adaptive emission.
fn cells(scene: &Scene, purpose: Purpose, count: u64) -> u64 {
    let accel = bvh(&scene.geometry);
    with_source("adaptive", scene, &*accel, (0, purpose, count), |s| {
        s.cells()
    })
}

/// D8: flat meshes are not refined, and smooth ones at their outline only.
fn flat_and_smooth(row: &mut Row) {
    // A grid of 100×100 squares all around the light: no edge that matters.
    let n = 100u32;
    let mut grid = TriangleMesh::default();
    for j in 0..=n {
        for i in 0..=n {
            let x = |k: u32| 200.0 * (k as f32 / n as f32 - 0.5);
            grid.positions.push([x(i), 0.0, x(j)]);
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            grid.indices.push([a, a + n + 1, a + 1]);
            grid.indices.push([a + 1, a + n + 1, a + n + 2]);
        }
    }
    let spot = |b: &mut SceneBuilder| {
        b.add_light(LightDesc {
            inner_cone: 0.6,
            outer_cone: 0.7,
            ..light("spot", DVec3::Y * 3.0, DVec3::NEG_Y, 1.0)
        });
    };
    let grey = lambert("grey", Rgb::splat(0.5));
    let flat = scene(|b| {
        add_mesh(b, grid, &grey);
        spot(b);
    });
    let mut refined = Meter::default();
    refined.see(cells(&flat, Purpose::Global, 100_000) as f64 - 64.0);
    row.tried("100² squares around a spot, 1e5 photons");
    row.line("photons", "cells refined on a flat grid", refined, 0.0);
    row.tried("a ball of 39600 triangles and a sphere under a spot");
    // A ball of triangles is refined as the ball itself is: at its outline.
    let outline = |mesh: bool| {
        scene(|b| {
            if mesh {
                add_mesh(b, ball_mesh(100, DVec3::ZERO, 1.0), &grey);
            } else {
                let m = b.add_material(&grey).unwrap();
                add_sphere(b, "ball", m, DVec3::ZERO, 1.0);
            }
            spot(b);
        })
    };
    let [smooth, sphere] = [outline(true), outline(false)].map(|s| {
        let accel = bvh(&s.geometry);
        with_source("adaptive", &s, &*accel, (0, Purpose::Global, 40_000), |s| {
            // Where the photons of small cells go, seen from the light's axis.
            let mean = photons(s).map(|p| p.power.r).fold(0.0f64, f64::max);
            photons(s)
                .filter(|p| p.power.r < 0.02 * mean)
                .map(|p| (-p.ray.direction().normalize().y).acos())
                .collect::<Vec<_>>()
        })
    });
    // The outline of a unit ball three units away.
    let edge = (1.0f64 / 3.0).asin();
    for (name, angles) in [("photons, mesh", smooth), ("photons, sphere", sphere)] {
        let near = angles.iter().filter(|a| (*a - edge).abs() < 0.02).count();
        assert!(angles.len() > 2000, "{name}");
        let mut off = Meter::default();
        off.see(1.0 - near as f64 / angles.len() as f64);
        row.line(name, "share of fine cells off the outline", off, 0.03);
    }
}

#[test]
fn a_tiny_caster_is_found_without_being_hit() {
    // A glass ball of 1e-6 sr, seen from the lamp.
    let at = DVec3::new(0.31, 0.27, 0.83).normalize() * 2.0;
    let r = 2.0 * (1e-6 / std::f64::consts::PI).sqrt();
    for with_room in [false, true] {
        let tiny = scene(|b| {
            let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
            let g = b.add_material(&glass(1.5)).unwrap();
            add_sphere(b, "ball", g, at, r);
            if with_room {
                add_room(b, grey, 3.0);
            }
            b.add_light(light("point", DVec3::ZERO, DVec3::Y, 1.0));
        });
        let accel = bvh(&tiny.geometry);
        let told = (0, Purpose::Caustic, 1200);
        let (n, hits, checks) = with_source("adaptive", &tiny, &*accel, told, |s| {
            let hits =
                photons(s).filter(|p| accel.intersect(&p.ray).is_some_and(|h| h.object.0 == 0));
            (s.len(), hits.count(), s.checks())
        });
        println!("{hits} of {n} photons met the ball, {checks} check rays");
        let evenly = 1000.0 * 4.0 * std::f64::consts::PI / 1e-6;
        println!("1000 photons would need {evenly:.1e} in all directions");
        assert!(hits >= 1000 && (n + checks) as f64 * 1000.0 < evenly);
    }
}

#[test]
fn photons_do_not_depend_on_threads() {
    let scene = balls("area", true);
    let accel = bvh(&scene.geometry);
    let all = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            with_source(
                "adaptive",
                &scene,
                &*accel,
                (5, Purpose::Global, 30_000),
                |s| photons(s).map(|p| (p.ray, p.power)).collect::<Vec<_>>(),
            )
        })
    };
    let (one, three) = (all(1), all(3));
    assert_eq!(one.len(), three.len());
    assert!(one == three);
}

#[test]
fn every_light_emits_whatever_the_budget() {
    let many = scene(|b| {
        let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
        add_room(b, grey, 2.0);
        for i in 0..300 {
            let x = f64::from(i) / 300.0 - 0.5;
            b.add_light(light("point", DVec3::new(x, 0.0, 0.0), DVec3::Y, 1.0));
        }
    });
    let accel = bvh(&many.geometry);
    for count in [1, 10, 1000, 30_000] {
        with_source(
            "adaptive",
            &many,
            &*accel,
            (0, Purpose::Global, count),
            |s| {
                let sum: f64 = photons(s).map(|p| p.power.r).sum();
                println!("{count}: {} photons, {} check rays", s.len(), s.checks());
                assert!((sum / many.flux().r - 1.0).abs() < 1e-9);
                assert!(s.len() >= 300 && s.len() <= count.max(300) + 1);
            },
        );
    }
    with_source(
        "adaptive",
        &many,
        &*accel,
        (0, Purpose::Caustic, 1000),
        |s| {
            assert!(s.is_empty(), "nothing to aim at");
        },
    );
}

/// D7: a small ball before the middle of a big one, whose discriminant keeps its sign all around:
/// what tells the edge is that the check rays meet different objects.
fn occluder(row: &mut Row) {
    let r = 0.05;
    let both = |small: bool| {
        scene(|b| {
            let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
            add_sphere(b, "big", grey, DVec3::ZERO, 1.0);
            if small {
                add_sphere(b, "small", grey, DVec3::Y * 1.5, r);
            }
            b.add_light(LightDesc {
                inner_cone: 0.1,
                outer_cone: 0.12,
                ..light("spot", DVec3::Y * 3.0, DVec3::NEG_Y, 1.0)
            });
        })
    };
    let mut m = Meter::default();
    m.must(cells(&both(false), Purpose::Global, 40_000) == 64);
    let lit = both(true);
    let accel = bvh(&lit.geometry);
    let told = (0, Purpose::Global, 40_000);
    let angles: Vec<f64> = with_source("adaptive", &lit, &*accel, told, |s| {
        let most = photons(s).map(|p| p.power.r).fold(0.0f64, f64::max);
        let fine = photons(s).filter(|p| p.power.r < 0.02 * most);
        fine.map(|p| (-p.ray.direction().normalize().y).acos())
            .collect()
    });
    let edge = (r / 1.5f64).asin();
    let near = angles.iter().filter(|a| (*a - edge).abs() < 0.01).count();
    m.must(angles.len() > 1000);
    row.tried("a ball of 0.05 before one of 1, the spot wider than either, 4e4 photons");
    row.line(
        "photons",
        "refined without an edge, or not refined at one",
        m,
        0.0,
    );
    let mut off = Meter::default();
    off.see(1.0 - near as f64 / angles.len().max(1) as f64);
    row.line("photons", "share of fine cells off the outline", off, 0.03);
}

mod emission {
    pub(crate) use super::{alike as p2, flat_and_smooth as d8, occluder as d7};
}

rows! { "adaptive";
    d7: "occluder in front" in emission;
    d8: "edges inside a mesh" in emission;
    p2: "adaptive against uniform" in emission;
}
