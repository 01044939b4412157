//! Our dual numbers against the library `num-dual` on the kernels that use them, and against the
//! plain scalar: nanoseconds each, side by side; the ratios within one run count.
//!
//! Run with `cargo bench --bench dual`; a number as argument sets the repeats (9).

#![allow(
    clippy::unwrap_used,
    reason = "a benchmark may stop at the first surprise"
)]

use std::hint::black_box;
use std::time::Instant;

use dualight::accel::ACCELERATORS;
use dualight::ad::{Dual, Real, V3};
use dualight::geometry::forecast::{
    Moves, Order, SphereForecast, TriangleForecast, edge_functions,
};
use dualight::geometry::{Geometry, MaterialId, Object, Ray, Shape, ShapeId, SphereSet};
use dualight::geometry::{sphere::line_sphere, triangle::plane_hit};
use dualight::math::DVec3;
use dualight::sampling::Rng;

#[path = "../tests/common/oracle.rs"]
#[allow(dead_code, unreachable_pub, reason = "shared with the tests")]
mod oracle;

use oracle::{Checked, Oracle};

type Input = (DVec3, DVec3);

const N: usize = 4096;

/// Median nanoseconds per input, each contestant once per round.
fn race(repeats: usize, inputs: &[Input], fs: &[(&str, &dyn Fn(&Input) -> f64)]) -> Vec<f64> {
    let mut times = vec![Vec::new(); fs.len()];
    for _ in 0..repeats {
        for (k, (_, f)) in fs.iter().enumerate() {
            let start = Instant::now();
            let mut sum = 0.0;
            for x in inputs {
                sum += f(black_box(x));
            }
            black_box(sum);
            times[k].push(start.elapsed().as_secs_f64() * 1e9 / inputs.len() as f64);
        }
    }
    let median = |t: &mut Vec<f64>| {
        t.sort_by(f64::total_cmp);
        t[t.len() / 2]
    };
    let out: Vec<f64> = times.iter_mut().map(median).collect();
    for ((name, _), ns) in fs.iter().zip(&out) {
        println!("  {name:<34} {ns:7.2} ns  {:5.2}", ns / out[0]);
    }
    out
}

fn gradient_sum(d: Dual<f64, 3>) -> f64 {
    d.gradient().map_or(0.0, |g| g[0] + g[1] + g[2])
}

fn checked_sum(c: Checked) -> f64 {
    c.gradient().map_or(0.0, |g| g.iter().sum())
}

fn sphere<R: Real>(d: V3<R>, o: DVec3, sum: impl Fn(R) -> f64) -> f64 {
    let line = line_sphere(V3::constant(o), d, DVec3::ZERO, 1.0);
    let t = line.roots().map_or(0.0, |t| sum(t[0]));
    sum(line.discriminant) + t
}

fn triangle<R: Real>(d: V3<R>, o: DVec3, v: [DVec3; 3], sum: impl Fn(R) -> f64) -> f64 {
    let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
    let hit = plane_hit(V3::constant(o), d, v[0], e1, e2, e1.cross(e2));
    hit.map_or(0.0, |h| sum(h.t) + sum(h.b1) + sum(h.b2))
}

fn main() {
    let repeats = std::env::args().filter_map(|a| a.parse().ok()).next();
    let repeats = repeats.unwrap_or(201);
    let mut rng = Rng::new(1);
    let mut x = || rng.next_1d() - 0.5;
    let inputs: Vec<Input> = (0..N)
        .map(|_| {
            let o = DVec3::new(x(), x(), -5.0);
            (o, DVec3::new(x(), x(), 0.0) * 1.6 - o)
        })
        .collect();
    let v = [DVec3::new(-1.0, -1.0, 0.1), DVec3::X, DVec3::Y];

    println!("sphere: discriminant and near root with three derivatives");
    let s = race(
        repeats,
        &inputs,
        &[
            ("f64", &|i| sphere(V3::<f64>::constant(i.1), i.0, |r| r)),
            ("ad::Dual<f64, 3>", &|i| {
                sphere(V3::variable(i.1), i.0, gradient_sum)
            }),
            ("num_dual::DualSVec64<3>", &|i| {
                sphere(Oracle::inputs(i.1), i.0, |r| r.gradient().iter().sum())
            }),
            ("the same with an invalid state", &|i| {
                sphere(Checked::inputs(i.1), i.0, checked_sum)
            }),
        ],
    );
    println!("triangle: distance and barycentrics with three derivatives");
    let t = race(
        repeats,
        &inputs,
        &[
            ("f64", &|i| {
                triangle(V3::<f64>::constant(i.1), i.0, v, |r| r)
            }),
            ("ad::Dual<f64, 3>", &|i| {
                triangle(V3::variable(i.1), i.0, v, gradient_sum)
            }),
            ("num_dual::DualSVec64<3>", &|i| {
                triangle(Oracle::inputs(i.1), i.0, v, |r| r.gradient().iter().sum())
            }),
            ("the same with an invalid state", &|i| {
                triangle(Checked::inputs(i.1), i.0, v, checked_sum)
            }),
        ],
    );
    println!(
        "the library with an invalid state takes {:.2} times as long on the sphere, {:.2} on the triangle",
        s[3] / s[1],
        t[3] / t[1]
    );

    println!("a check of four corners: forecast against tracing");
    let mut g = Geometry::default();
    g.shapes.push(Shape::Spheres(SphereSet {
        spheres: vec![[0.0, 0.0, 0.0, 1.0]],
    }));
    g.objects.push(Object {
        shape: ShapeId(0),
        placement: None,
        material: MaterialId(0),
        light: None,
        name: "ball".into(),
        coverage: None,
    });
    let accel = (ACCELERATORS[0].build)(&std::sync::Arc::new(g), 1).unwrap();
    let corners =
        [(0.1, 0.1), (-0.1, 0.1), (0.1, -0.1), (-0.1, -0.1)].map(|(x, y)| DVec3::new(x, y, 0.0));
    race(
        repeats,
        &inputs,
        &[
            ("closest-hit call of the backend", &|i| {
                let hit = accel.intersect(&Ray::new(i.0, i.1));
                hit.map_or(0.0, |h| f64::from(h.t))
            }),
            ("sphere: dual forecast, 4 corners", &|i| {
                let f = SphereForecast::new(i.0, i.1, DVec3::ZERO, 1.0, Moves::Target).unwrap();
                corners.iter().map(|&h| f.at(h, Order::Quadratic)).sum()
            }),
            ("sphere: anew at 4 corners", &|i| {
                let at = |h: DVec3| {
                    let d = V3::<f64>::constant(i.1 + h);
                    line_sphere(V3::constant(i.0), d, DVec3::ZERO, 1.0).discriminant
                };
                corners.iter().map(|&h| at(h)).sum()
            }),
            ("triangle: dual forecast, 4 corners", &|i| {
                let f = TriangleForecast::new(i.0, i.1, v, Moves::Target).unwrap();
                corners.iter().map(|&h| f.at(h).iter().sum::<f64>()).sum()
            }),
            ("triangle: anew at 4 corners", &|i| {
                let at = |h: DVec3| {
                    let d = V3::<f64>::constant(i.1 + h);
                    edge_functions(V3::constant(i.0), d, v).iter().sum::<f64>()
                };
                corners.iter().map(|&h| at(h)).sum()
            }),
            ("4 rays traced", &|i| {
                let at = |h: DVec3| accel.intersect(&Ray::new(i.0, i.1 + h));
                corners
                    .iter()
                    .map(|&h| at(h).map_or(0.0, |h| f64::from(h.t)))
                    .sum()
            }),
        ],
    );
}
