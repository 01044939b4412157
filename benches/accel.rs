//! Rays per second and thread of every backend, side by side: the ratios within one run count,
//! the absolute numbers depend on the machine and on its load.
//!
//! Run with `cargo bench --bench accel`; a number as argument sets the repeats (5).

#![allow(
    clippy::unwrap_used,
    reason = "a benchmark may stop at the first surprise"
)]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use dualight::accel::{ACCELERATORS, Accelerator};
use dualight::geometry::{
    Geometry, MaterialId, Object, Ray, Shape, ShapeId, SphereSet, TriangleMesh,
};
use dualight::math::DVec3;
use dualight::sampling::Rng;

fn add(geometry: &mut Geometry, shape: Shape) {
    geometry.shapes.push(shape);
    geometry.objects.push(Object {
        shape: ShapeId(geometry.shapes.len() as u32 - 1),
        placement: None,
        material: MaterialId(0),
        light: None,
        coverage: None,
        name: Arc::from("object"),
    });
}

/// Six walls of two triangles, three spheres.
fn box_scene() -> Geometry {
    let mut g = Geometry::default();
    let p = |k: usize| [0, 1, 2].map(|i| if k >> i & 1 == 0 { -1.0 } else { 1.0f32 });
    for quad in [
        [0, 1, 3, 2],
        [4, 6, 7, 5],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 5, 7, 3],
    ] {
        add(
            &mut g,
            Shape::Mesh(TriangleMesh {
                positions: quad.map(p).to_vec(),
                indices: vec![[0, 1, 2], [0, 2, 3]],
                ..Default::default()
            }),
        );
    }
    for s in [
        [-0.45, -0.65, 0.2, 0.35],
        [0.4, -0.7, -0.3, 0.3],
        [0.3, 0.3, 0.3, 0.2],
    ] {
        add(&mut g, Shape::Spheres(SphereSet { spheres: vec![s] }));
    }
    g
}

/// About `4n²` triangles: a bumpy closed sphere inside the box's extent.
fn bumpy(n: u32) -> Geometry {
    let mut mesh = TriangleMesh::default();
    for j in 0..=n {
        for i in 0..=2 * n {
            let (phi, theta) = (
                f64::from(i) / f64::from(n) * std::f64::consts::PI,
                f64::from(j) / f64::from(n) * std::f64::consts::PI,
            );
            let r = 0.8 + 0.15 * (phi * 9.0).sin() * (theta * 11.0).sin();
            mesh.positions.push([
                (r * theta.sin() * phi.cos()) as f32,
                (r * theta.cos()) as f32,
                (r * theta.sin() * phi.sin()) as f32,
            ]);
        }
    }
    let w = 2 * n + 1;
    for j in 0..n {
        for i in 0..2 * n {
            let a = j * w + i;
            mesh.indices.push([a, a + 1, a + w + 1]);
            mesh.indices.push([a, a + w + 1, a + w]);
        }
    }
    mesh.drop_invalid();
    let mut g = Geometry::default();
    add(&mut g, Shape::Mesh(mesh));
    g
}

fn rays(n: usize, seed: u64) -> Vec<Ray> {
    let mut rng = Rng::new(seed);
    let mut cube = || DVec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) * 2.0 - 1.0;
    (0..n)
        .map(|_| {
            let o = cube() * 0.99;
            let d = loop {
                let d = cube();
                if d.length_squared() <= 1.0 && d.length_squared() > 0.01 {
                    break d.normalize();
                }
            };
            Ray::new(o, d)
        })
        .collect()
}

fn median(mut v: Vec<f64>) -> f64 {
    v.sort_by(f64::total_cmp);
    v[v.len() / 2]
}

fn main() {
    let repeats = std::env::args()
        .find_map(|a| a.parse().ok())
        .unwrap_or(5usize);
    println!(
        "{:<8} {:<8} {:>10} {:>9} {:>10} {:>10} {:>9}",
        "scene", "backend", "triangles", "build s", "closest/s", "any/s", "bytes"
    );
    for (name, geometry) in [
        ("box", box_scene()),
        ("mesh", bumpy(50)),
        ("mesh", bumpy(500)),
    ] {
        let geometry = Arc::new(geometry);
        let rays = rays(200_000, 7);
        let built: Vec<(&str, Box<dyn Accelerator>)> = ACCELERATORS
            .iter()
            .filter(|e| e.name != "linear" || name == "box")
            .map(|e| (e.name, (e.build)(&geometry, 2).unwrap()))
            .collect();
        // Backends take turns, so that a noisy neighbour disturbs all of them alike.
        let mut times = vec![(Vec::new(), Vec::new()); built.len()];
        for _ in 0..repeats {
            for ((_, own), (closest, any)) in built.iter().zip(&mut times) {
                let start = Instant::now();
                let hits = rays.iter().filter(|r| own.intersect(r).is_some()).count();
                closest.push(start.elapsed().as_secs_f64());
                black_box(hits);
                let start = Instant::now();
                let hits = rays.iter().filter(|r| own.occluded(r)).count();
                any.push(start.elapsed().as_secs_f64());
                black_box(hits);
            }
        }
        for ((backend, own), (closest, any)) in built.iter().zip(times) {
            let stats = own.stats();
            println!(
                "{name:<8} {backend:<8} {:>10} {:>9.3} {:>8.2} M {:>8.2} M {:>6} MB",
                stats.primitives,
                stats.seconds,
                rays.len() as f64 / median(closest) * 1e-6,
                rays.len() as f64 / median(any) * 1e-6,
                stats.bytes >> 20,
            );
        }
    }
}
