//! What stability costs, each part alone: Embree's robust traversal, the refinement of hits in
//! double precision, and the guard that asks again about rays that hit nothing, which rendering
//! puts on where hardly any do. Ratios within one run count.
//!
//! Run with `cargo bench --bench stability`; a number as argument sets the repeats (9).

#![allow(
    clippy::unwrap_used,
    reason = "a benchmark may stop at the first surprise"
)]

#[cfg(feature = "embree")]
mod measured {
    use std::hint::black_box;
    use std::sync::Arc;
    use std::time::Instant;

    use dualight::accel::{ACCELERATORS, Accelerator, EMBREE_FAST, Guarded};
    use dualight::geometry::{
        Geometry, MaterialId, Object, Ray, Shape, ShapeId, SphereSet, TriangleMesh,
    };
    use dualight::math::DVec3;
    use dualight::sampling::Rng;

    fn alone(shape: Shape) -> Arc<Geometry> {
        Arc::new(Geometry {
            shapes: vec![shape],
            objects: vec![Object {
                shape: ShapeId(0),
                placement: None,
                material: MaterialId(0),
                light: None,
                coverage: None,
                name: Arc::from("object"),
            }],
        })
    }

    fn direction(rng: &mut Rng) -> DVec3 {
        loop {
            let v = DVec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) * 2.0 - 1.0;
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    /// A height field of `2 n²` triangles over a square.
    fn hills(n: u32) -> Shape {
        let mut mesh = TriangleMesh::default();
        for j in 0..=n {
            for i in 0..=n {
                let [x, z] = [i, j].map(|k| 2.0 * (k as f32 / n as f32) - 1.0);
                mesh.positions
                    .push([x, 0.1 * (20.0 * x).sin() * (17.0 * z).cos(), z]);
            }
        }
        for j in 0..n {
            for i in 0..n {
                let a = j * (n + 1) + i;
                mesh.indices.push([a, a + n + 1, a + 1]);
                mesh.indices.push([a + 1, a + n + 1, a + n + 2]);
            }
        }
        Shape::Mesh(mesh)
    }

    fn cloud(n: u32) -> Shape {
        let mut rng = Rng::new(5);
        let spheres = (0..n)
            .map(|_| {
                let p = direction(&mut rng) * rng.next_1d();
                [p.x as f32, p.y as f32, p.z as f32, 0.01]
            })
            .collect();
        Shape::Spheres(SphereSet { spheres })
    }

    /// A closed ball with bumps, of `4 n²` triangles.
    fn room(n: u32) -> Shape {
        let mut mesh = TriangleMesh::default();
        for j in 0..=n {
            for i in 0..2 * n {
                let t = std::f64::consts::PI * f64::from(j) / f64::from(n);
                let a = std::f64::consts::PI * f64::from(i) / f64::from(n);
                let r = 2.0 + 0.1 * (20.0 * a).sin() * (17.0 * t).sin() * t.sin();
                let s = if j == 0 || j == n { 0.0 } else { t.sin() };
                let p = DVec3::new(s * a.cos(), t.cos(), -s * a.sin()) * r;
                mesh.positions.push(p.as_vec3().into());
            }
        }
        for j in 0..n {
            for i in 0..2 * n {
                let at = |i: u32, j: u32| j * 2 * n + i % (2 * n);
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
                mesh.indices.extend([[a, c, b], [b, c, d]]);
            }
        }
        mesh.drop_invalid();
        Shape::Mesh(mesh)
    }

    /// Rays from a distance, at a scene of size 1 and past it.
    fn rays(n: usize, from: f64) -> Vec<Ray> {
        let mut rng = Rng::new(7);
        (0..n)
            .map(|_| {
                let o = direction(&mut rng) * from;
                Ray::new(o, direction(&mut rng) * 0.9 - o)
            })
            .collect()
    }

    fn seconds(rays: &[Ray], f: impl Fn(&Ray)) -> f64 {
        let start = Instant::now();
        rays.iter().for_each(f);
        start.elapsed().as_secs_f64()
    }

    pub(crate) fn run(repeats: usize) {
        println!("| scene | rays that miss | robust traversal | refinement | guard |");
        println!("|---|---:|---:|---:|---:|");
        for (name, shape, from) in [
            ("closed ball from inside, 1 M triangles", room(500), 0.5),
            ("hills, 1 M triangles", hills(700), 2.0),
            ("20 000 spheres", cloud(20_000), 2.0),
        ] {
            let rays = rays(200_000, from);
            let g = alone(shape);
            let build = |b: fn(&Arc<Geometry>, usize) -> _| -> Box<dyn Accelerator> {
                let built: dualight::error::Result<_> = b(&g, 2);
                built.unwrap()
            };
            let (fast, robust) = (build(EMBREE_FAST.build), build(ACCELERATORS[0].build));
            let missed = rays
                .iter()
                .filter(|r| robust.intersect(r).is_none())
                .count();
            let plain = |r: &Ray| {
                black_box(robust.intersect(r));
            };
            let refined = |r: &Ray| {
                if let Some(hit) = robust.intersect(r) {
                    black_box(g.surface_point(r, &hit));
                }
            };
            let guard: Box<dyn Accelerator> = Box::new(Guarded::new(build(ACCELERATORS[0].build)));
            let guarded = |r: &Ray| {
                black_box(guard.intersect(r));
            };
            let mut ratios = [const { Vec::new() }; 3];
            for _ in 0..repeats {
                // One after the other in every round, so that load strikes all alike.
                let base = seconds(&rays, plain);
                let without = seconds(&rays, |r| {
                    black_box(fast.intersect(r));
                });
                ratios[0].push(base / without);
                ratios[1].push(seconds(&rays, refined) / base);
                ratios[2].push(seconds(&rays, guarded) / base);
            }
            let [a, b, c] = ratios.map(|mut r| {
                r.sort_by(f64::total_cmp);
                r[r.len() / 2]
            });
            let missed = 100.0 * missed as f64 / rays.len() as f64;
            println!("| {name} | {missed:.0} % | {a:.2} | {b:.2} | {c:.2} |");
        }
    }
}

fn main() {
    let repeats: Option<usize> = std::env::args().skip(1).find_map(|a| a.parse().ok());
    #[cfg(feature = "embree")]
    measured::run(repeats.unwrap_or(9));
    #[cfg(not(feature = "embree"))]
    println!("built without Embree: nothing to measure ({repeats:?})");
}
