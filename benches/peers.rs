//! Our structures against those of other libraries, on the same data and the same questions: the
//! photon map's tree against `kiddo` and a hash grid, the hierarchy against Embree and `obvhs`.
//! The contestants take turns; the ratios within one run count.
//!
//! Run with `cargo bench --bench peers`; a number as argument sets the repeats (9).

#![allow(
    clippy::unwrap_used,
    reason = "a benchmark may stop at the first surprise"
)]

use std::hint::black_box;
use std::num::NonZero;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use dualight::accel::{ACCELERATORS, Accelerator};
use dualight::control::Control;
use dualight::effects::EffectSet;
use dualight::geometry::triangle::Watertight;
use dualight::geometry::{Geometry, MaterialId, Object, Ray, Shape, ShapeId, TriangleMesh};
use dualight::import::{self, ImportOptions};
use dualight::math::{DVec3, Frame, Vec3};
use dualight::photons::map::{KdTree, Nearest, Within};
use dualight::photons::{EMISSIONS, EmissionContext, PhotonSettings, Purpose, follow_photons};
use dualight::sampling::{Rng, warp};
use dualight::scene::ScenePlugins;
use glam::Vec3A;
use kiddo::SquaredEuclidean;
use kiddo::immutable::float::kdtree::ImmutableKdTree;
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::RayHit;

/// A contestant: its name, and what it does once; the number that comes back checks its answer.
type Contestant<'a> = (&'a str, Box<dyn Fn() -> f64 + 'a>);

/// Median seconds, each contestant once per round; beside them the ratio to the first, and what
/// each answered.
fn race(title: &str, items: usize, repeats: usize, all: &[Contestant<'_>]) {
    println!("{title}");
    let mut times = vec![Vec::new(); all.len()];
    let mut answers = vec![0.0; all.len()];
    for _ in 0..repeats {
        for (k, (_, f)) in all.iter().enumerate() {
            let start = Instant::now();
            answers[k] = black_box(f());
            times[k].push(start.elapsed().as_secs_f64());
        }
    }
    let median = |t: &mut Vec<f64>| {
        t.sort_by(f64::total_cmp);
        t[t.len() / 2]
    };
    let medians: Vec<f64> = times.iter_mut().map(median).collect();
    for (((name, _), t), answer) in all.iter().zip(&medians).zip(&answers) {
        let each = t * 1e9 / items as f64;
        let ratio = t / medians[0];
        println!("  {name:<34} {each:9.1} ns each {ratio:6.2}   answer {answer:.6e}");
    }
}

// ---- photon maps ----

/// Positions of the photons of the box.
fn photons(count: u64) -> Vec<[f32; 3]> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/box.gltf");
    let scene = import::load(&path, &ImportOptions::default(), ScenePlugins::default()).unwrap();
    let accel = (ACCELERATORS[0].build)(&scene.geometry, 1).unwrap();
    let emission = EMISSIONS.iter().find(|e| e.name == "uniform").unwrap();
    let source = (emission.build)(&EmissionContext {
        scene: &scene,
        accel: &*accel,
        seed: 1,
        purpose: Purpose::Global,
        count,
        guide: None,
    });
    let settings = PhotonSettings {
        seed: 1,
        global: count,
        caustic: 0,
        nearest: 50,
        max_depth: None,
        roulette: true,
        guidance: dualight::photons::Guidance::Off,
    };
    let (effects, control) = (EffectSet::all(), Control::default());
    let found = follow_photons(
        &scene,
        &*accel,
        &*source,
        Purpose::Global,
        effects,
        &settings,
        &control,
    );
    found.photons.iter().map(|p| p.p).collect()
}

/// Items in cells of a table without chains: what falls into one slot lies together.
struct HashGrid {
    cell: f32,
    mask: u32,
    first: Vec<u32>,
    items: Vec<(u32, Vec3)>,
}

impl HashGrid {
    fn slot(mask: u32, [x, y, z]: [i32; 3]) -> u32 {
        let mixed = (x as u32).wrapping_mul(73_856_093)
            ^ (y as u32).wrapping_mul(19_349_663)
            ^ (z as u32).wrapping_mul(83_492_791);
        mixed & mask
    }

    fn at(cell: f32, p: Vec3) -> [i32; 3] {
        (p / cell).floor().as_ivec3().to_array()
    }

    fn build(points: &[[f32; 3]], cell: f32) -> Self {
        let mask = (points.len() as u32).next_power_of_two() - 1;
        let slot = |p: &[f32; 3]| Self::slot(mask, Self::at(cell, Vec3::from(*p))) as usize;
        let mut first = vec![0u32; mask as usize + 2];
        for p in points {
            first[slot(p) + 1] += 1;
        }
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut next = first.clone();
        let mut items = vec![(0, Vec3::ZERO); points.len()];
        for (i, p) in points.iter().enumerate() {
            let at = &mut next[slot(p)];
            items[*at as usize] = (i as u32, Vec3::from(*p));
            *at += 1;
        }
        Self {
            cell,
            mask,
            first,
            items,
        }
    }

    /// Everything within a radius of at most a cell.
    fn within(&self, p: Vec3, r2: f32, mut f: impl FnMut(u32, f32)) {
        let [x, y, z] = Self::at(self.cell, p);
        let r = r2.sqrt();
        let near = |a: i32, x: f32| {
            let lo = a as f32 * self.cell;
            let below = i32::from(x - r < lo);
            let above = i32::from(x + r >= lo + self.cell);
            a - below..=a + above
        };
        for i in near(x, p.x) {
            for j in near(y, p.y) {
                for k in near(z, p.z) {
                    let slot = Self::slot(self.mask, [i, j, k]) as usize;
                    let range = self.first[slot] as usize..self.first[slot + 1] as usize;
                    for &(item, q) in &self.items[range] {
                        let d2 = q.distance_squared(p);
                        // Of cells that share a slot, each takes its own.
                        if d2 < r2 && Self::at(self.cell, q) == [i, j, k] {
                            f(item, d2);
                        }
                    }
                }
            }
        }
    }
}

/// A bounded heap of squared distances, for the grid.
fn offer(heap: &mut Vec<f32>, k: usize, d2: f32) {
    if heap.len() < k {
        heap.push(d2);
        if heap.len() == k {
            heap.sort_unstable_by(|a, b| b.total_cmp(a));
        }
    } else if d2 < heap[0] {
        let mut at = 0;
        loop {
            let mut child = 2 * at + 1;
            if child >= k {
                break;
            }
            if child + 1 < k && heap[child + 1] > heap[child] {
                child += 1;
            }
            if heap[child] <= d2 {
                break;
            }
            heap[at] = heap[child];
            at = child;
        }
        heap[at] = d2;
    }
}

fn photon_maps(repeats: usize) {
    const K: usize = 50;
    let points = photons(300_000);
    let n = points.len();
    println!("photons of scenes/box.gltf: {n} in the map");
    let mut rng = Rng::new(3);
    let queries: Vec<[f32; 3]> = (0..20_000)
        .map(|_| points[(rng.next_u64() % n as u64) as usize])
        .collect();
    // Surfaces of 4 m² each: the disc that holds K photons if they lie evenly, and twice that.
    let even = (K as f32 * 24.0 / (n as f32 * std::f32::consts::PI)).sqrt();
    let reach = 2.0 * even;
    let position = |p: &[f32; 3]| *p;
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    race(
        "build, one thread",
        n,
        repeats,
        &[
            (
                "ours",
                Box::new(|| {
                    let mut items = points.clone();
                    black_box(one.install(|| KdTree::build(&mut items, position)));
                    n as f64
                }),
            ),
            (
                "kiddo, immutable",
                Box::new(|| {
                    ImmutableKdTree::<f32, u32, 3, 32>::new_from_slice(&points).size() as f64
                }),
            ),
            (
                "hash grid",
                Box::new(|| HashGrid::build(&points, even).items.len() as f64),
            ),
        ],
    );
    let mut sorted = points.clone();
    let tree = KdTree::build(&mut sorted, position);
    let kiddo = ImmutableKdTree::<f32, u32, 3, 32>::new_from_slice(&points);
    let [fine, coarse] = [even, reach].map(|cell| HashGrid::build(&points, cell));
    let r2 = even * even;
    race(
        "everything within the radius of 50 photons, spread evenly",
        queries.len(),
        repeats,
        &[
            (
                "ours",
                Box::new(|| {
                    let mut sum = 0u64;
                    for q in &queries {
                        let mut found = Within(r2, |_| sum += 1);
                        tree.visit_near(Vec3::from(*q), &mut found, |_, _, _| true);
                    }
                    sum as f64
                }),
            ),
            (
                "kiddo, immutable",
                Box::new(|| {
                    let of = |q| kiddo.within_unsorted::<SquaredEuclidean>(q, r2).len();
                    queries.iter().map(of).sum::<usize>() as f64
                }),
            ),
            (
                "hash grid",
                Box::new(|| {
                    let mut sum = 0u64;
                    for q in &queries {
                        fine.within(Vec3::from(*q), r2, |_, _| sum += 1);
                    }
                    sum as f64
                }),
            ),
        ],
    );
    let most = NonZero::new(K).unwrap();
    let far = |d2: f32| f64::from(d2.sqrt());
    race(
        "the 50 nearest, within twice that radius",
        queries.len(),
        repeats,
        &[
            (
                "ours",
                Box::new(|| {
                    let mut found = Nearest::new();
                    let mut each = |q: &[f32; 3]| {
                        found.reset(K, reach * reach);
                        tree.visit_near(Vec3::from(*q), &mut found, |_, _, _| true);
                        far(found.iter().fold(0.0, |m, (_, d2)| m.max(d2)))
                    };
                    queries.iter().map(&mut each).sum()
                }),
            ),
            (
                "kiddo, immutable",
                Box::new(|| {
                    let each = |q: &[f32; 3]| {
                        let found = kiddo.nearest_n_within::<SquaredEuclidean>(
                            q,
                            reach * reach,
                            most,
                            false,
                        );
                        far(found.iter().fold(0.0, |m, f| m.max(f.distance)))
                    };
                    queries.iter().map(each).sum()
                }),
            ),
            (
                "hash grid",
                Box::new(|| {
                    let mut heap = Vec::new();
                    let mut each = |q: &[f32; 3]| {
                        heap.clear();
                        coarse.within(Vec3::from(*q), reach * reach, |_, d2| {
                            offer(&mut heap, K, d2);
                        });
                        far(heap.iter().fold(0.0, |m, d2| m.max(*d2)))
                    };
                    queries.iter().map(&mut each).sum()
                }),
            ),
        ],
    );
}

// ---- hierarchies ----

/// A bumpy closed surface of `4n²` triangles.
fn bumpy(n: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let step = std::f64::consts::PI / f64::from(n);
    for (j, i) in (0..=n).flat_map(|j| (0..=2 * n).map(move |i| (j, i))) {
        let (phi, theta) = (f64::from(i) * step, f64::from(j) * step);
        let r = 0.8 + 0.15 * (phi * 9.0).sin() * (theta * 11.0).sin();
        let (s, c) = theta.sin_cos();
        let p = DVec3::new(s * phi.cos(), c, s * phi.sin()) * r;
        mesh.positions.push(p.as_vec3().into());
    }
    let w = 2 * n + 1;
    for a in (0..n).flat_map(|j| (0..2 * n).map(move |i| j * w + i)) {
        mesh.indices.push([a, a + 1, a + w + 1]);
        mesh.indices.push([a, a + w + 1, a + w]);
    }
    mesh.drop_invalid();
    mesh
}

/// Rays from points inside, and the rays that leave diffusely where those end.
fn bounced(geometry: &Geometry, accel: &dyn Accelerator, count: usize) -> Vec<Ray> {
    let mut rng = Rng::new(7);
    let mut out = Vec::new();
    while out.len() < count {
        let from = warp::sphere(rng.next_2d()) * (0.3 * rng.next_1d());
        let ray = Ray::new(from, warp::sphere(rng.next_2d()));
        let Some(hit) = accel.intersect(&ray) else {
            continue;
        };
        let sp = geometry.surface_point(&ray, &hit);
        let up = if sp.front { sp.n } else { -sp.n };
        let local = warp::cosine_hemisphere(rng.next_2d());
        out.push(sp.spawn(Frame::from_normal(up).to_world(local)));
    }
    out
}

/// A hierarchy of the library with its triangles in the order of its leaves.
struct Peer<T> {
    tree: T,
    triangles: Vec<obvhs::triangle::Triangle>,
}

impl<T> Peer<T> {
    fn new(tree: T, order: &[u32], all: &[obvhs::triangle::Triangle]) -> Self {
        let triangles = order.iter().map(|i| all[*i as usize]).collect();
        Self { tree, triangles }
    }
}

fn peer_ray(ray: &Ray) -> obvhs::ray::Ray {
    let (o, d) = (ray.origin().as_vec3(), ray.direction().as_vec3());
    obvhs::ray::Ray::new_inf(Vec3A::from(o), Vec3A::from(d))
}

fn met(hit: &RayHit) -> f64 {
    f64::from(u8::from(hit.t < f32::INFINITY))
}

/// The library's tree with our test of triangles, in double precision.
fn watertight(cw: &Peer<CwBvh>, ray: &Ray) -> f64 {
    let own = Watertight::new(ray.origin(), ray.direction());
    let mut hit = RayHit::none();
    cw.tree.ray_traverse(peer_ray(ray), &mut hit, |r, i| {
        let t = &cw.triangles[i];
        let v = [t.v0, t.v1, t.v2].map(|v| v.to_array());
        let found = own.intersect_single(&v, f64::from(r.tmin), f64::from(r.tmax));
        found.map_or(f32::INFINITY, |h| h.t as f32)
    });
    met(&hit)
}

fn hierarchies(repeats: usize, n: u32) {
    let mesh = bumpy(n);
    let all: Vec<obvhs::triangle::Triangle> = mesh
        .indices
        .iter()
        .map(|t| {
            let [v0, v1, v2] = t.map(|i| Vec3A::from(mesh.positions[i as usize]));
            obvhs::triangle::Triangle { v0, v1, v2 }
        })
        .collect();
    let mut g = Geometry::default();
    g.shapes.push(Shape::Mesh(mesh));
    g.objects.push(Object {
        shape: ShapeId(0),
        placement: None,
        material: MaterialId(0),
        light: None,
        name: "bumpy".into(),
        coverage: None,
    });
    let g = Arc::new(g);
    let own: Vec<(&str, Box<dyn Accelerator>)> = ACCELERATORS
        .iter()
        .filter(|e| e.name != "linear")
        .map(|e| (e.name, (e.build)(&g, 2).unwrap()))
        .collect();
    let rays = bounced(&g, &*own[0].1, 100_000);
    let params = BvhBuildParams::slow_build();
    let mut spent = Duration::ZERO;
    let tree: CwBvh = build_cwbvh_from_tris(&all, params, &mut spent);
    let order = tree.primitive_indices.clone();
    let cw = Peer::new(tree, &order, &all);
    let tree: Bvh2 = build_bvh2_from_tris(&all, params, &mut spent);
    let order = tree.primitive_indices.clone();
    let two = Peer::new(tree, &order, &all);
    let mut contestants: Vec<Contestant<'_>> = own
        .iter()
        .map(|(name, a)| -> Contestant<'_> {
            let hits = || rays.iter().filter(|r| a.intersect(r).is_some()).count() as f64;
            (name, Box::new(hits))
        })
        .collect();
    contestants.extend([
        (
            "obvhs CWBVH",
            Box::new(|| {
                let each = |r: &Ray| {
                    let mut h = RayHit::none();
                    let test = |r: &_, i: usize| cw.triangles[i].intersect(r);
                    cw.tree.ray_traverse(peer_ray(r), &mut h, test);
                    met(&h)
                };
                rays.iter().map(each).sum()
            }) as Box<dyn Fn() -> f64>,
        ),
        (
            "obvhs CWBVH, our triangles",
            Box::new(|| rays.iter().map(|r| watertight(&cw, r)).sum()),
        ),
        (
            "obvhs BVH2",
            Box::new(|| {
                let each = |r: &Ray| {
                    let mut h = RayHit::none();
                    let test = |r: &_, i: usize| two.triangles[i].intersect(r);
                    two.tree.ray_traverse(peer_ray(r), &mut h, test);
                    met(&h)
                };
                rays.iter().map(each).sum()
            }),
        ),
    ]);
    let title = format!(
        "closest hits after a diffuse bounce, {} triangles",
        all.len()
    );
    race(&title, rays.len(), repeats, &contestants);
}

fn main() {
    let repeats = std::env::args().find_map(|a| a.parse().ok());
    let repeats: usize = repeats.unwrap_or(9);
    photon_maps(repeats);
    for n in [50, 250, 500] {
        hierarchies(repeats, n);
    }
}
