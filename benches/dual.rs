//! Our dual numbers against the library `num-dual` on the kernels that use them, and against the
//! plain scalar; and what a forecast costs beside the hit that it starts from and the rays that it
//! saves: nanoseconds each, side by side; the ratios within one run count.
//!
//! Run with `cargo bench --bench dual`; a number as argument sets the repeats (201).

#![allow(
    clippy::unwrap_used,
    reason = "a benchmark may stop at the first surprise"
)]

use std::f64::consts::PI;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use dualight::accel::{ACCELERATORS, Accelerator};
use dualight::ad::{Dual, Real, V3};
use dualight::geometry::forecast::{Moves, Order, SphereForecast, edge_functions};
use dualight::geometry::{
    Geometry, Hit, MaterialId, Object, Ray, ScenePatches, Shape, ShapeId, TriangleMesh, Walk,
};
use dualight::geometry::{sphere::line_sphere, triangle::plane_hit};
use dualight::import::{self, ImportOptions};
use dualight::math::{DVec3, Frame};
use dualight::sampling::{Rng, warp};
use dualight::scene::ScenePlugins;

#[path = "../tests/common/oracle.rs"]
#[allow(dead_code, unreachable_pub, reason = "shared with the tests")]
mod oracle;

use oracle::{Checked, Oracle};

type Input = (DVec3, DVec3);

const N: usize = 4096;

/// Nanoseconds per input, each contestant once per round; prints the medians.
fn race<T>(repeats: usize, inputs: &[T], fs: &[(&str, &dyn Fn(&T) -> f64)]) -> Vec<Vec<f64>> {
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
    for ((name, _), t) in fs.iter().zip(&times) {
        let (ns, first) = (quartiles(t.clone())[1], quartiles(times[0].clone())[1]);
        println!("  {name:<34} {ns:7.2} ns  {:5.2}", ns / first);
    }
    times
}

/// Lower quartile, median and upper quartile.
fn quartiles(mut x: Vec<f64>) -> [f64; 3] {
    x.sort_by(f64::total_cmp);
    [1, 2, 3].map(|q| x[x.len() * q / 4])
}

/// How many times as long one contestant takes as another, round by round.
fn ratio(slow: &[f64], fast: &[f64]) -> String {
    let [lo, mid, hi] = quartiles(slow.iter().zip(fast).map(|(a, b)| a / b).collect());
    format!("{mid:.2} [{lo:.2}, {hi:.2}]")
}

fn gradient_sum(d: Dual<f64, 3>) -> f64 {
    d.gradient().map_or(0.0, |g| g[0] + g[1] + g[2])
}

fn checked_sum(c: Checked) -> f64 {
    c.gradient().map_or(0.0, |g| g.iter().sum())
}

// Inlined as the renderer has them.
#[inline(always)]
fn sphere<R: Real>(d: V3<R>, o: DVec3, c: DVec3, r: f64, sum: impl Fn(R) -> f64) -> f64 {
    let line = line_sphere(V3::constant(o), d, c, r);
    let t = line.roots().map_or(0.0, |t| sum(t[0]));
    sum(line.discriminant) + t
}

#[inline(always)]
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

    let c = DVec3::ZERO;
    println!("sphere: discriminant and near root with three derivatives");
    let s = race(
        repeats,
        &inputs,
        &[
            ("f64", &|i| {
                sphere(V3::<f64>::constant(i.1), i.0, c, 1.0, |r| r)
            }),
            ("ad::Dual<f64, 3>", &|i| {
                sphere(V3::variable(i.1), i.0, c, 1.0, gradient_sum)
            }),
            ("num_dual::DualSVec64<3>", &|i| {
                sphere(Oracle::inputs(i.1), i.0, c, 1.0, |r| {
                    r.gradient().iter().sum()
                })
            }),
            ("the same with an invalid state", &|i| {
                sphere(Checked::inputs(i.1), i.0, c, 1.0, checked_sum)
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
    for (name, times) in [("sphere", &s), ("triangle", &t)] {
        println!("{name}, in times of ours, median [quartiles]:");
        println!("  the plain scalar     {}", ratio(&times[0], &times[1]));
        println!("  the library          {}", ratio(&times[2], &times[1]));
        println!("  with an invalid state {}", ratio(&times[3], &times[1]));
    }

    for (name, geometry, from) in [
        ("scenes/box.gltf", box_scene(), DVec3::new(0.1, 0.9, 0.05)),
        (
            "a ball of 100,000 triangles",
            ball(),
            DVec3::new(0.4, 2.5, 0.3),
        ),
    ] {
        let rays = checks(&geometry, from, &mut rng);
        costs(repeats, name, &geometry, &rays);
    }
}

/// The box of the repository.
fn box_scene() -> Arc<Geometry> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/box.gltf");
    let scene = import::load(&path, &ImportOptions::default(), ScenePlugins::default()).unwrap();
    Arc::clone(&scene.geometry)
}

/// A smooth ball of radius 1.
fn ball() -> Arc<Geometry> {
    let (rings, sectors) = (200u32, 250u32);
    let mut mesh = TriangleMesh::default();
    for j in 0..=rings {
        for i in 0..=sectors {
            let theta = f64::from(j) / f64::from(rings) * PI;
            let phi = f64::from(i % sectors) / f64::from(sectors) * 2.0 * PI;
            let ring = if j % rings == 0 { 0.0 } else { theta.sin() };
            let n = DVec3::new(ring * phi.cos(), theta.cos(), -ring * phi.sin());
            mesh.positions.push(n.as_vec3().into());
            mesh.normals.push(n.as_vec3().into());
        }
    }
    let w = sectors + 1;
    for a in (0..rings).flat_map(|j| (0..sectors).map(move |i| j * w + i)) {
        mesh.indices.push([a, a + w + 1, a + 1]);
        mesh.indices.push([a, a + w, a + w + 1]);
    }
    let mut g = Geometry::default();
    g.shapes.push(Shape::Mesh(mesh));
    g.objects.push(Object {
        shape: ShapeId(0),
        placement: None,
        material: MaterialId(0),
        light: None,
        name: "ball".into(),
        coverage: None,
    });
    Arc::new(g)
}

/// A check ray that has hit a triangle, and where the corners of its cell lie.
struct Check {
    ray: Ray,
    hit: Hit,
    /// Corners of the triangle.
    v: [DVec3; 3],
    corners: [DVec3; 4],
}

/// Half width of a cell, over the distance of where its rays are aimed: the first cells of a lamp
/// are about twice as wide, the last much narrower.
const REACH: f64 = 0.05;

/// Rays from a point to anywhere in the unit ball, as far as they hit triangles.
fn checks(geometry: &Arc<Geometry>, from: DVec3, rng: &mut Rng) -> Vec<Check> {
    let accel = (ACCELERATORS[0].build)(geometry, 1).unwrap();
    let mut out = Vec::new();
    while out.len() < N {
        let to = warp::sphere(rng.next_2d()) * rng.next_1d().cbrt();
        let ray = Ray::new(from, to - from);
        let Some(hit) = accel.intersect(&ray) else {
            continue;
        };
        let object = geometry.object(hit.object);
        let (Shape::Mesh(mesh), None) = (geometry.shape(object.shape), &object.placement) else {
            continue;
        };
        let frame = Frame::from_normal(ray.direction().normalize());
        let side = REACH * ray.direction().length();
        let corner = |x: f64, y: f64| frame.x * (x * side) + frame.y * (y * side);
        out.push(Check {
            ray,
            hit,
            v: mesh.corners(hit.prim),
            corners: [
                corner(1.0, 1.0),
                corner(-1.0, 1.0),
                corner(1.0, -1.0),
                corner(-1.0, -1.0),
            ],
        });
    }
    out
}

/// What a forecast costs, beside the hit that it starts from and the rays that it saves.
fn costs(repeats: usize, name: &str, geometry: &Arc<Geometry>, checks: &[Check]) {
    let built: Vec<(String, Box<dyn Accelerator>)> = ACCELERATORS
        .iter()
        .filter(|e| e.name != "linear")
        .map(|e| (e.name.into(), (e.build)(geometry, 1).unwrap()))
        .collect();
    let patches = ScenePatches::new(geometry);
    let closest = |accel: &dyn Accelerator, ray: &Ray| {
        let hit = accel.intersect(ray);
        hit.map_or(0.0, |h| f64::from(h.t))
    };
    // A sphere beside the way of most rays, as most that a cell is asked about are.
    let (c, r) = (DVec3::new(0.2, -0.3, 0.1), 0.3);
    let calls: Vec<(String, Box<dyn Fn(&Check) -> f64 + '_>)> = built
        .iter()
        .map(
            |(name, accel)| -> (String, Box<dyn Fn(&Check) -> f64 + '_>) {
                (
                    format!("closest-hit call of {name}"),
                    Box::new(|i: &Check| closest(&**accel, &i.ray)),
                )
            },
        )
        .collect();
    let first = &*built[0].1;
    let own: [(&str, &dyn Fn(&Check) -> f64); 10] = [
        ("surface point of that hit", &|i| {
            geometry.surface_point(&i.ray, &i.hit).distance
        }),
        ("sphere: hit", &|i| {
            sphere(
                V3::<f64>::constant(i.ray.direction()),
                i.ray.origin(),
                c,
                r,
                |x| x,
            )
        }),
        ("sphere: dual hit", &|i| {
            sphere(
                V3::variable(i.ray.direction()),
                i.ray.origin(),
                c,
                r,
                gradient_sum,
            )
        }),
        ("sphere: forecast, both sides", &|i| {
            let (o, d) = (i.ray.origin(), i.ray.direction());
            let f = SphereForecast::new(o, d, c, r, Moves::Target).unwrap();
            f.at(i.corners[0], Order::Quadratic) + f.at(i.corners[3], Order::Quadratic)
        }),
        ("triangle: hit", &|i| {
            triangle(
                V3::<f64>::constant(i.ray.direction()),
                i.ray.origin(),
                i.v,
                |x| x,
            )
        }),
        ("triangle: dual hit", &|i| {
            triangle(
                V3::variable(i.ray.direction()),
                i.ray.origin(),
                i.v,
                gradient_sum,
            )
        }),
        ("triangle: edges at 4 corners", &|i| {
            let at = |h: DVec3| {
                let d = V3::<f64>::constant(i.ray.direction() + h);
                edge_functions(V3::constant(i.ray.origin()), d, i.v)
            };
            i.corners.iter().map(|&h| at(h).iter().sum::<f64>()).sum()
        }),
        ("the same by value and gradient", &|i| {
            let (o, d) = (i.ray.origin(), i.ray.direction());
            let e: [Dual<f64, 3>; 3] = edge_functions(V3::constant(o), V3::variable(d), i.v);
            let e = e.map(|e| (e.value(), DVec3::from_array(e.gradient().unwrap())));
            let at = |h: DVec3| e.iter().map(|e| e.0 + e.1.dot(h)).sum::<f64>();
            i.corners.iter().map(|&h| at(h)).sum()
        }),
        ("mesh: forecast, 4 corners", &|i| {
            let (o, d) = (i.ray.origin(), i.ray.direction());
            let mesh = patches.mesh(geometry, &i.hit).unwrap();
            let stops = |h: DVec3| {
                let walk = mesh.walk(i.hit.prim, [o, d, h], Moves::Target);
                matches!(walk, Walk::Stopped(..))
            };
            f64::from(u8::from(i.corners.iter().any(|&h| stops(h))))
        }),
        ("4 closest-hit calls at the corners", &|i| {
            let (o, d) = (i.ray.origin(), i.ray.direction());
            let at = |h: DVec3| closest(first, &Ray::new(o, d + h));
            i.corners.iter().map(|&h| at(h)).sum()
        }),
    ];
    let all: Vec<(&str, &dyn Fn(&Check) -> f64)> = (calls.iter().map(|(n, f)| (&n[..], &**f)))
        .chain(own)
        .collect();
    println!("{name}: check rays and what their hits forecast");
    race(repeats, checks, &all);
}
