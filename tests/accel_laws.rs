//! The laws that every ray tracing backend obeys, each stated once and run over all of
//! [`ACCELERATORS`]; `linear`, which tests every primitive in `f64`, is the truth.
//!
//! `bvh` runs the same tests on the same numbers and must return the same bits. A backend in
//! single precision may differ near edges and silhouettes within its rounding, and where the
//! surface is closed lose at most 2e-5 of the rays (the bound of Embree's own watertightness
//! tests). Seeds are fixed; every count is stated where it is used.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::sync::Arc;

use dualight::accel::{ACCELERATORS, Accelerator, AcceleratorEntry};
use dualight::geometry::{
    Geometry, Hit, MaterialId, Object, ObjectId, Placement, Ray, Shape, ShapeId, SphereSet,
    TriangleMesh, sphere,
};
use dualight::math::robust::UNIT_ROUNDOFF;
use dualight::math::{DAffine3, DQuat, DVec3, Vec3};
use dualight::sampling::Rng;

/// Laws for backends that compute in `f64` and keep to segments that begin before the origin.
/// Where Embree, in single precision, may differ near edges is bounded in `tests/accel.rs`.
const EXACT_ONLY: &[&str] = &[
    "both_ends_of_the_segment_count",
    "box_with_spheres",
    "instances_turned_stretched_and_mirrored",
    "meshes_here_and_far_from_the_origin",
    "triangle_soup_and_sphere_cloud",
];

/// Runs each body for every backend but the truth; `linear` is run where the body asks for it.
macro_rules! laws {
    ($($(#[$meta:meta])* fn $name:ident($backend:ident) $body:block)*) => {$(
        $(#[$meta])*
        #[test]
        fn $name() {
            for $backend in ACCELERATORS {
                if $backend.name == "embree" && EXACT_ONLY.contains(&stringify!($name)) {
                    continue;
                }
                $body
            }
        }
    )*};
}

// Scenes ---------------------------------------------------------------------------------------

#[derive(Default)]
struct Make(Geometry);

impl Make {
    fn shape(&mut self, shape: Shape) -> ShapeId {
        self.0.shapes.push(shape);
        ShapeId(self.0.shapes.len() as u32 - 1)
    }

    fn place(&mut self, shape: ShapeId, world: Option<DAffine3>) -> &mut Self {
        self.0.objects.push(Object {
            shape,
            placement: world.map(|w| Placement::new(w).unwrap()),
            material: MaterialId(0),
            light: None,
            coverage: None,
            name: Arc::from("object"),
        });
        self
    }

    fn mesh(&mut self, mesh: TriangleMesh) -> &mut Self {
        let id = self.shape(Shape::Mesh(mesh));
        self.place(id, None)
    }

    fn spheres(&mut self, spheres: Vec<[f32; 4]>) -> &mut Self {
        let id = self.shape(Shape::Spheres(SphereSet { spheres }));
        self.place(id, None)
    }

    fn done(&mut self) -> Arc<Geometry> {
        Arc::new(std::mem::take(&mut self.0))
    }
}

fn build(entry: &AcceleratorEntry, geometry: &Arc<Geometry>) -> Box<dyn Accelerator> {
    (entry.build)(geometry, 2).unwrap()
}

fn truth(geometry: &Arc<Geometry>) -> Box<dyn Accelerator> {
    let linear = ACCELERATORS.iter().find(|e| e.name == "linear").unwrap();
    build(linear, geometry)
}

fn quad(a: [f32; 3], b: [f32; 3], c: [f32; 3], d: [f32; 3]) -> TriangleMesh {
    TriangleMesh {
        positions: vec![a, b, c, d],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..Default::default()
    }
}

/// A box of 12 triangles in six objects, and three spheres.
fn box_scene() -> Arc<Geometry> {
    let mut make = Make::default();
    let p = |k: usize| [0, 1, 2].map(|i| if k >> i & 1 == 0 { -1.0 } else { 1.0f32 });
    for [a, b, c, d] in [
        [0, 1, 3, 2],
        [4, 6, 7, 5],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 5, 7, 3],
    ] {
        make.mesh(quad(p(a), p(b), p(c), p(d)));
    }
    make.spheres(vec![[-0.45, -0.65, 0.2, 0.35]])
        .spheres(vec![[0.4, -0.7, -0.3, 0.3], [0.3, 0.3, 0.3, 0.2]])
        .done()
}

/// `n × n` quads in a wavy sheet, around `center`.
fn sheet(n: u32, center: DVec3, size: f64, waves: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (
                f64::from(i) / f64::from(n) - 0.5,
                f64::from(j) / f64::from(n) - 0.5,
            );
            let z = waves * (x * 9.0).sin() * (y * 7.0).cos();
            mesh.positions
                .push((center + DVec3::new(x, y, z) * size).as_vec3().into());
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            mesh.indices.push([a, a + 1, a + n + 2]);
            mesh.indices.push([a, a + n + 2, a + n + 1]);
        }
    }
    mesh
}

/// A closed sphere of `20·4^level` triangles.
fn icosphere(level: u32, center: DVec3, r: f64) -> TriangleMesh {
    let g = f64::midpoint(1.0, 5f64.sqrt());
    let mut dirs: Vec<DVec3> = [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)]
        .iter()
        .flat_map(|&(a, b)| {
            [
                DVec3::new(0.0, a, b),
                DVec3::new(a, b, 0.0),
                DVec3::new(b, 0.0, a),
            ]
        })
        .map(DVec3::normalize)
        .collect();
    let edge = dirs[0].distance(dirs[1]).min(dirs[0].distance(dirs[2])) * 1.01;
    let mut indices = Vec::new();
    for a in 0..12u32 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let d = |i: u32, j: u32| dirs[i as usize].distance(dirs[j as usize]);
                if d(a, b) < edge && d(b, c) < edge && d(c, a) < edge {
                    let [x, y, z] = [a, b, c].map(|i| dirs[i as usize]);
                    let out = (y - x).cross(z - x).dot(x) > 0.0;
                    indices.push(if out { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..level {
        let mut middle = std::collections::HashMap::new();
        let mut next = Vec::new();
        for [a, b, c] in indices {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(i, j)| {
                *middle.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    dirs.push((dirs[i as usize] + dirs[j as usize]).normalize());
                    dirs.len() as u32 - 1
                })
            });
            next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        indices = next;
    }
    TriangleMesh {
        positions: dirs
            .iter()
            .map(|d| (center + *d * r).as_vec3().into())
            .collect(),
        indices,
        ..Default::default()
    }
}

fn soup(n: usize, size: f64, rng: &mut Rng) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..n as u32 {
        let c = in_cube(rng);
        for _ in 0..3 {
            mesh.positions
                .push((c + in_cube(rng) * size).as_vec3().into());
        }
        mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

/// Instances of a sheet, an icosphere and a sphere cloud, turned, stretched and mirrored.
fn instances(rng: &mut Rng) -> Arc<Geometry> {
    let mut make = Make::default();
    let shapes = [
        Shape::Mesh(sheet(6, DVec3::ZERO, 1.0, 0.2)),
        Shape::Mesh(icosphere(1, DVec3::new(3.0, 0.0, 0.0), 0.5)),
        Shape::Spheres(SphereSet {
            spheres: vec![[0.0, 0.0, 0.0, 0.5], [0.7, 0.2, 0.1, 0.3]],
        }),
    ]
    .map(|s| make.shape(s));
    for i in 0..24 {
        let scale = DVec3::new(
            0.2 + rng.next_1d(),
            0.2 + rng.next_1d(),
            0.02 + rng.next_1d(),
        ) * if i % 4 == 3 { -1.0 } else { 1.0 };
        let turn = DQuat::from_axis_angle(on_sphere(rng), rng.next_1d() * 6.0);
        let world = DAffine3::from_scale_rotation_translation(scale, turn, in_cube(rng) * 2.0);
        make.place(shapes[i % 3], Some(world));
    }
    make.mesh(sheet(8, DVec3::new(0.0, 0.0, -1.0), 5.0, 0.1))
        .done()
}

fn in_cube(rng: &mut Rng) -> DVec3 {
    DVec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) * 2.0 - 1.0
}

fn on_sphere(rng: &mut Rng) -> DVec3 {
    loop {
        let v = in_cube(rng);
        let l = v.length();
        if l > 0.1 && l <= 1.0 {
            return v / l;
        }
    }
}

/// Rays from around and inside the geometry, with directions of many lengths.
fn random_rays(geometry: &Geometry, n: usize, rng: &mut Rng) -> Vec<Ray> {
    let around = geometry.bounds().bounding_sphere();
    let (c, r) = (around.center, around.radius);
    (0..n)
        .map(|i| {
            let o = c + in_cube(rng) * r * if i % 3 == 0 { 0.5 } else { 1.5 };
            let d = if i % 2 == 0 {
                on_sphere(rng)
            } else {
                c + in_cube(rng) * 0.5 * r - o
            };
            let mut ray = Ray::new(o, d * 10f64.powi((i % 5) as i32 - 2));
            if i % 7 == 0 {
                ray.tmin = (rng.next_1d() * r / ray.direction().length()) as f32;
            }
            if i % 11 == 0 {
                ray.tmin = -ray.tmin;
            }
            if i % 4 == 0 {
                let far = rng.next_1d() * 2.0 * r / ray.direction().length();
                ray.tmax = ray.tmin.max(0.0) + far as f32;
            }
            ray
        })
        .collect()
}

// Comparison -----------------------------------------------------------------------------------

/// How far single precision may be off at a hit: rounding of the largest number in play.
fn rounding(geometry: &Geometry, ray: &Ray, hit: &Hit) -> f64 {
    let p = geometry.surface_point(ray, hit);
    let reach = (p.p - ray.origin()).length() + p.p.length() + ray.origin().length();
    64.0 * UNIT_ROUNDOFF * reach
}

/// Whether the hit lies within rounding of the primitive's edge or silhouette, or of an end of
/// the segment.
fn marginal(geometry: &Geometry, ray: &Ray, hit: &Hit) -> bool {
    let object = geometry.object(hit.object);
    let slack = rounding(geometry, ray, hit);
    let p = geometry.surface_point(ray, hit);
    let len = ray.direction().length();
    let cos = p.wo.dot(p.ng).abs().max(1e-3);
    let near_end = |t: f32| ((f64::from(t) - f64::from(hit.t)) * len).abs() <= slack / cos;
    if near_end(ray.tmin) || near_end(ray.tmax) {
        return true;
    }
    let (mut o, mut d, mut scale) = (ray.origin(), ray.direction(), 1.0);
    if let Some(place) = &object.placement {
        o = place.object_from_world.transform_point3(o);
        d = place.object_from_world.transform_vector3(d);
        scale = d.length() / len;
    }
    let slack = slack * scale.max(1.0) / cos;
    match geometry.shape(object.shape) {
        Shape::Mesh(mesh) => {
            let [a, b, c] = mesh.corners(hit.prim);
            let area = (b - a).cross(c - a).length();
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let (u, v) = (f64::from(hit.u), f64::from(hit.v));
            u.min(v).min(1.0 - u - v) * area / longest <= slack
        }
        Shape::Spheres(set) => {
            let (c, r) = set.get(hit.prim);
            let line = sphere::line_sphere(
                dualight::ad::V3::<f64>::constant(o),
                dualight::ad::V3::constant(d),
                c,
                r,
            );
            line.discriminant <= 2.0 * slack / r
        }
    }
}

#[derive(Default)]
struct Tally {
    rays: usize,
    hits: usize,
    wrong: usize,
}

impl Tally {
    fn compare(
        &mut self,
        entry: &AcceleratorEntry,
        geometry: &Geometry,
        ray: &Ray,
        want: Option<Hit>,
        got: Option<Hit>,
    ) {
        self.rays += 1;
        self.hits += usize::from(want.is_some());
        if exact(entry) {
            assert_eq!(want, got, "{}: {ray:?}", entry.name);
            return;
        }
        let ok = match (want, got) {
            (None, None) => true,
            (Some(a), Some(b)) => {
                let (pa, pb) = (
                    geometry.surface_point(ray, &a),
                    geometry.surface_point(ray, &b),
                );
                let same = (a.object, a.prim) == (b.object, b.prim);
                let slack = rounding(geometry, ray, &a);
                if same && (pa.p - pb.p).length() <= slack {
                    assert_eq!(
                        (pa.p, pa.ng),
                        (pb.p, pb.ng),
                        "{}: one primitive, two refinements",
                        entry.name
                    );
                }
                (pa.distance - pb.distance).abs() <= slack
                    || marginal(geometry, ray, &a)
                    || marginal(geometry, ray, &b)
            }
            (Some(h), None) | (None, Some(h)) => marginal(geometry, ray, &h),
        };
        self.wrong += usize::from(!ok);
    }

    fn check(&self, entry: &AcceleratorEntry, what: &str) {
        let allowed = if exact(entry) {
            0
        } else {
            (2e-5 * self.rays as f64).ceil() as usize
        };
        assert!(
            self.wrong <= allowed,
            "{}, {what}: {} of {} rays wrong",
            entry.name,
            self.wrong,
            self.rays
        );
        assert!(self.hits > self.rays / 50, "{what}: {} hits", self.hits);
    }
}

/// Backends that must give the bits of `linear`.
fn exact(entry: &AcceleratorEntry) -> bool {
    matches!(entry.name, "bvh" | "linear")
}

fn agree(entry: &AcceleratorEntry, geometry: &Arc<Geometry>, rays: &[Ray], what: &str) {
    if entry.name == "linear" {
        return;
    }
    let (linear, own) = (truth(geometry), build(entry, geometry));
    let mut tally = Tally::default();
    for ray in rays {
        let got = own.intersect(ray);
        tally.compare(entry, geometry, ray, linear.intersect(ray), got);
        if exact(entry) {
            assert_eq!(own.occluded(ray), got.is_some(), "{what}: {ray:?}");
        } else if own.occluded(ray) != got.is_some() {
            let h = got.or_else(|| linear.intersect(ray));
            tally.wrong += usize::from(!h.is_some_and(|h| marginal(geometry, ray, &h)));
        }
    }
    tally.check(entry, what);
}

// Laws -----------------------------------------------------------------------------------------

laws! {
    fn box_with_spheres(backend) {
        let geometry = box_scene();
        let mut rng = Rng::new(1);
        let rays = random_rays(&geometry, 200_000, &mut rng);
        agree(backend, &geometry, &rays, "box");
    }

    fn no_ray_leaves_a_closed_box(backend) {
        let geometry = box_scene();
        let own = build(backend, &geometry);
        let mut rng = Rng::new(2);
        let lost = (0..200_000)
            .filter(|_| {
                let o = in_cube(&mut rng) * 0.99;
                own.intersect(&Ray::new(o, on_sphere(&mut rng))).is_none()
            })
            .count();
        assert!(lost <= if exact(backend) { 0 } else { 4 }, "{}: {lost} lost", backend.name);
    }

    fn triangle_soup_and_sphere_cloud(backend) {
        let mut rng = Rng::new(3);
        for size in [0.5, 0.05, 1e-3] {
            let mut make = Make::default();
            make.mesh(soup(400, size, &mut rng));
            let cloud = (0..200)
                .map(|_| {
                    let c = in_cube(&mut rng).as_vec3();
                    [c.x, c.y, c.z, (size * rng.next_1d() + 1e-6) as f32]
                })
                .collect();
            let geometry = make.spheres(cloud).done();
            let mut rays = random_rays(&geometry, 8000, &mut rng);
            // Small things are met only when aimed at.
            for ray in rays.iter_mut().step_by(2) {
                let mesh = match &geometry.shapes[0] {
                    Shape::Mesh(m) => m,
                    Shape::Spheres(_) => unreachable!(),
                };
                let v = mesh.corners((rng.next_u64() % 400) as u32);
                let target = v[0] * 0.5 + v[1] * 0.3 + v[2] * 0.2;
                *ray = Ray::new(ray.origin(), target - ray.origin());
            }
            agree(backend, &geometry, &rays, &format!("soup of size {size}"));
        }
    }

    fn meshes_here_and_far_from_the_origin(backend) {
        let mut rng = Rng::new(4);
        for center in [DVec3::ZERO, DVec3::new(148_376.0, 1234.0, -223_423.0), DVec3::splat(1e6)] {
            let mut make = Make::default();
            let geometry = make
                .mesh(sheet(24, center, 40.0, 0.05))
                .mesh(icosphere(2, center, 8.0))
                .done();
            let rays = random_rays(&geometry, 8000, &mut rng);
            agree(backend, &geometry, &rays, &format!("meshes at {center}"));
        }
    }

    fn no_ray_slips_between_triangles(backend) {
        // From inside a closed surface of 5120 triangles: at random, at vertices, at edges.
        let mut rng = Rng::new(5);
        for center in [DVec3::ZERO, DVec3::new(148_376.0, 1234.0, -223_423.0), DVec3::splat(1e6)] {
            let mesh = icosphere(4, center, 100.0);
            let mut make = Make::default();
            let geometry = make.mesh(mesh.clone()).done();
            if backend.name == "linear" {
                continue;
            }
            let own = build(backend, &geometry);
            let n = 30_000;
            let mut lost = [0; 3];
            for _ in 0..n {
                let v = mesh.corners((rng.next_u64() % mesh.indices.len() as u64) as u32);
                let s = rng.next_1d();
                let o = center + in_cube(&mut rng) * 20.0;
                let targets = [o + on_sphere(&mut rng), v[0], v[0] + (v[1] - v[0]) * s];
                for (lost, target) in lost.iter_mut().zip(targets) {
                    let mut ray = Ray::new(o, DVec3::X);
                    ray.d = (target - ray.origin()).as_vec3();
                    *lost += usize::from(own.intersect(&ray).is_none());
                }
            }
            // Single precision is known to lose rays aimed exactly at vertices and edges.
            let allowed = if exact(backend) { [0; 3] } else { [1, n / 200, n / 200] };
            assert!(
                lost.iter().zip(allowed).all(|(l, a)| *l <= a),
                "{} at {center}: {lost:?} of {n} lost",
                backend.name
            );
        }
    }

    fn instances_turned_stretched_and_mirrored(backend) {
        let mut rng = Rng::new(6);
        for round in 0..4 {
            let geometry = instances(&mut rng);
            let rays = random_rays(&geometry, 6000, &mut rng);
            agree(backend, &geometry, &rays, &format!("instances, round {round}"));
        }
    }

    fn instances_far_out_and_extremely_stretched(backend) {
        let mut rng = Rng::new(7);
        for scale in [DVec3::new(1.0, 100.0, 0.01), DVec3::new(1e4, 1.0, 1e-3)] {
            for shift in [0.0, 1e4] {
                let mut make = Make::default();
                let ball = make.shape(Shape::Spheres(SphereSet { spheres: vec![[0.0, 0.0, 0.0, 1.0]] }));
                let mesh = make.shape(Shape::Mesh(icosphere(2, DVec3::ZERO, 1.0)));
                let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.5);
                for (k, shape) in [ball, mesh].into_iter().enumerate() {
                    make.place(shape, Some(DAffine3::from_scale_rotation_translation(
                        scale, turn, DVec3::new(shift, k as f64, -shift),
                    )));
                }
                let geometry = make.done();
                // At points of the surface, or of its rim.
                let rays: Vec<_> = (0..6000).map(|i| {
                    let w = &geometry.objects[i % 2].placement.unwrap().world_from_object;
                    let target = w.transform_point3(on_sphere(&mut rng) * rng.next_1d().sqrt());
                    let o = target + w.transform_vector3(on_sphere(&mut rng) * 3.0);
                    Ray::new(o, target - o)
                }).collect();
                agree(backend, &geometry, &rays, &format!("scale {scale}, shift {shift}"));
            }
        }
    }

    fn odd_directions_and_intervals(backend) {
        let geometry = box_scene();
        let linear = truth(&geometry);
        let own = build(backend, &geometry);
        let mut rng = Rng::new(8);
        let odd = [0.0f32, -0.0, 1e-40, -1e-40, 1e-20, 1e-7, -1e-3, 1.0, -1.0];
        let mut tally = Tally::default();
        for i in 0..50_000 {
            let mut pick = || odd[(rng.next_u64() % odd.len() as u64) as usize];
            let d = Vec3::new(pick(), pick(), pick()) * [1.0, 1e15, 1e-15][i % 3];
            let mut ray = Ray::new(in_cube(&mut rng) * 1.2, DVec3::X);
            if i % 2 == 0 {
                // In the very planes of the walls and through their edges.
                ray.o = (ray.o * 2.0).round() * 0.5;
            }
            ray.d = d;
            if !exact(backend) && (d.length() > 1e14 || d.length() < 1e-14) {
                continue;
            }
            tally.compare(backend, &geometry, &ray, linear.intersect(&ray), own.intersect(&ray));
            if exact(backend) {
                assert_eq!(own.occluded(&ray), own.intersect(&ray).is_some());
            }
        }
        tally.check(backend, "odd directions");
    }

    fn both_ends_of_the_segment_count(backend) {
        let mut make = Make::default();
        let geometry = make
            .mesh(quad([-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]))
            .spheres(vec![[5.0, 0.0, 0.0, 1.0]])
            .done();
        let own = build(backend, &geometry);
        // The plane and the sphere's front are both at a distance of 2.
        for (o, hit_at) in [(DVec3::new(0.25, 0.125, -2.0), 2.0), (DVec3::new(5.0, 0.0, -3.0), 2.0)] {
            for (tmin, tmax) in [(hit_at, 9.0), (0.0, hit_at), (hit_at, hit_at), (-9.0, hit_at)] {
                let ray = Ray { tmin, tmax, ..Ray::new(o, DVec3::Z) };
                let hit = own.intersect(&ray);
                assert!(hit.is_some_and(|h| h.t == hit_at), "{}: {ray:?} {hit:?}", backend.name);
                assert!(own.occluded(&ray));
            }
            let after = Ray { tmin: 2.0f32.next_up(), tmax: 2.5, ..Ray::new(o, DVec3::Z) };
            let before = Ray { tmax: 2.0f32.next_down(), ..Ray::new(o, DVec3::Z) };
            assert!(own.intersect(&after).is_none() && own.intersect(&before).is_none());
            assert!(!own.occluded(&after) && !own.occluded(&before));
        }
        // Beginning inside the sphere meets its far side; ending behind the origin looks back.
        let inside = Ray::new(DVec3::new(5.0, 0.0, 0.0), DVec3::Z);
        assert_eq!(own.intersect(&inside).map(|h| h.t), Some(1.0));
        let back = Ray { tmin: -1.5, tmax: -0.5, ..inside };
        assert_eq!(own.intersect(&back).map(|h| h.t), Some(-1.0));
        assert!(own.occluded(&back));
        // A sphere's other side, when the segment begins within.
        let second = Ray { tmin: 2.5, ..Ray::new(DVec3::new(5.0, 0.0, -3.0), DVec3::Z) };
        assert_eq!(own.intersect(&second).map(|h| h.t), Some(4.0));
    }

    fn invalid_rays_hit_nothing(backend) {
        let geometry = box_scene();
        let own = build(backend, &geometry);
        let good = Ray::new(DVec3::ZERO, DVec3::Z);
        assert!(own.occluded(&good));
        let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        let mut rays = vec![
            Ray { d: Vec3::ZERO, ..good },
            Ray { d: Vec3::new(-0.0, 0.0, 0.0), ..good },
            Ray { tmin: 2.0, tmax: 1.0, ..good },
            Ray { tmin: f32::NAN, ..good },
            Ray { tmax: f32::NAN, ..good },
            Ray { tmax: f32::NEG_INFINITY, ..good },
            Ray { tmin: f32::NEG_INFINITY, ..good },
            Ray { tmin: f32::INFINITY, ..good },
        ];
        for b in bad {
            for k in 0..3 {
                let (mut o, mut d) = (good.o, good.d);
                o[k] = b;
                d[k] = b;
                rays.extend([Ray { o, ..good }, Ray { d, ..good }]);
            }
        }
        for ray in rays {
            assert_eq!(own.intersect(&ray), None, "{}: {ray:?}", backend.name);
            assert!(!own.occluded(&ray));
        }
    }

    fn refinement_lies_on_the_primitive(backend) {
        let mut rng = Rng::new(9);
        for geometry in [box_scene(), instances(&mut rng)] {
            let own = build(backend, &geometry);
            let mut seen = 0;
            for ray in random_rays(&geometry, 10_000, &mut rng) {
                let Some(hit) = own.intersect(&ray) else { continue };
                seen += 1;
                let p = geometry.surface_point(&ray, &hit);
                let object = geometry.object(hit.object);
                let (mut local, mut to_world) = (p.p, 1.0);
                if let Some(place) = &object.placement {
                    local = place.object_from_world.transform_point3(p.p);
                    to_world = place.world_from_object.matrix3.x_axis.length()
                        .max(place.world_from_object.matrix3.y_axis.length())
                        .max(place.world_from_object.matrix3.z_axis.length());
                }
                let off = match geometry.shape(object.shape) {
                    Shape::Mesh(mesh) => {
                        let [a, b, c] = mesh.corners(hit.prim);
                        let n = (b - a).cross(c - a).normalize();
                        (local - a).dot(n).abs()
                    }
                    Shape::Spheres(set) => {
                        let (c, r) = set.get(hit.prim);
                        ((local - c).length() - r).abs()
                    }
                };
                assert!(off * to_world <= 1e-9 * (1.0 + p.p.length()), "{}: off by {off}", backend.name);
                for n in [p.ng, p.n, p.wo] {
                    assert!((n.length() - 1.0).abs() < 1e-12);
                }
                assert!(p.n.dot(p.ng) >= 0.0);
                assert_eq!(p.front, p.wo.dot(p.ng) > 0.0);
                assert_eq!((p.prim, p.object), (hit.prim, hit.object));
            }
            assert!(seen > 1000);
        }
    }

    fn spawned_rays_leave_spheres(backend) {
        // 5 radii × 4 places × 5000 directions = 1e5.
        let mut rng = Rng::new(10);
        for r in [1e-4, 1e-2, 1.0, 1e2, 1e4] {
            for far in [0.0, 1.0, 1e3, 1e5] {
                let c = (DVec3::new(0.6, -0.48, 0.64) * far).as_vec3();
                let mut make = Make::default();
                let geometry = make.spheres(vec![[c.x, c.y, c.z, r as f32]]).done();
                let own = build(backend, &geometry);
                let (c, r) = (c.as_dvec3(), f64::from(r as f32));
                for _ in 0..5000 {
                    let o = c + on_sphere(&mut rng) * r * 3.0 + DVec3::splat(far * 1e-6);
                    let aim = Ray::new(o, c + in_cube(&mut rng) * 0.5 * r - o);
                    let Some(hit) = own.intersect(&aim) else { continue };
                    let p = geometry.surface_point(&aim, &hit);
                    let w = on_sphere(&mut rng);
                    let cos = w.dot(p.ng);
                    let ray = p.spawn(w);
                    let again = own.intersect(&ray);
                    if cos >= 0.0 {
                        assert_eq!(again, None, "{}: r {r} at {far}: {ray:?}", backend.name);
                    } else if cos < -0.05 && p.offset < 1e-3 * r {
                        let back = geometry.surface_point(&ray, &again.unwrap());
                        let want = 2.0 * r * -cos;
                        let slack = 1e-5 * want + 64.0 * p.offset;
                        assert!(
                            (back.distance - want).abs() <= slack,
                            "{}: r {r} at {far}: {} for {want}", backend.name, back.distance
                        );
                    }
                }
            }
        }
    }

    fn spawned_rays_leave_triangles(backend) {
        // 5 sizes × 4 places × 50 triangles × 100 directions = 1e5.
        let mut rng = Rng::new(11);
        for size in [1e-4, 1e-2, 1.0, 1e2, 1e4] {
            for far in [0.0, 1.0, 1e3, 1e5] {
                let c = DVec3::new(0.6, -0.48, 0.64) * far;
                for _ in 0..50 {
                    let mut mesh = TriangleMesh::default();
                    for _ in 0..3 {
                        mesh.positions.push((c + in_cube(&mut rng) * size).as_vec3().into());
                    }
                    mesh.indices.push([0, 1, 2]);
                    if mesh.drop_invalid().total() > 0 {
                        continue;
                    }
                    let v = mesh.corners(0);
                    let mut make = Make::default();
                    let geometry = make.mesh(mesh).done();
                    let own = build(backend, &geometry);
                    for _ in 0..100 {
                        let target = v[0] * 0.4 + v[1] * 0.35 + v[2] * 0.25;
                        let o = target + on_sphere(&mut rng) * size * 2.0;
                        let aim = Ray::new(o, target - o);
                        let Some(hit) = own.intersect(&aim) else { continue };
                        let p = geometry.surface_point(&aim, &hit);
                        let ray = p.spawn(on_sphere(&mut rng));
                        assert_eq!(
                            own.intersect(&ray), None,
                            "{}: size {size} at {far}: {ray:?}", backend.name
                        );
                    }
                }
            }
        }
    }

    fn spawned_rays_leave_ellipsoids(backend) {
        let mut rng = Rng::new(12);
        for scale in [DVec3::new(1.0, 100.0, 0.01), DVec3::new(3.0, 0.5, 1.0), DVec3::splat(-2.0)] {
            for far in [0.0, 1e3] {
                let mut make = Make::default();
                let ball = make.shape(Shape::Spheres(SphereSet { spheres: vec![[0.0, 0.0, 0.0, 1.0]] }));
                let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.5);
                let world = DAffine3::from_scale_rotation_translation(scale, turn, DVec3::splat(far));
                let geometry = make.place(ball, Some(world)).done();
                let own = build(backend, &geometry);
                let mut missed = 0;
                for _ in 0..10_000 {
                    let target = world.transform_point3(on_sphere(&mut rng) * 0.7);
                    let o = target + on_sphere(&mut rng) * 300.0;
                    let aim = Ray::new(o, target - o);
                    let Some(hit) = own.intersect(&aim) else {
                        missed += 1;
                        continue;
                    };
                    let p = geometry.surface_point(&aim, &hit);
                    let w = on_sphere(&mut rng);
                    let again = own.intersect(&p.spawn(w));
                    if w.dot(p.ng) >= 0.0 {
                        assert_eq!(again, None, "{}: scale {scale} at {far}", backend.name);
                    }
                }
                assert!(missed < 2000, "{missed} of 10000");
            }
        }
    }

    fn coincident_primitives_are_one_hit(backend) {
        let mut make = Make::default();
        let mesh = quad([-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]);
        let mut turned = mesh.clone();
        for tri in &mut turned.indices {
            tri.swap(1, 2);
        }
        let shared = make.shape(Shape::Mesh(mesh.clone()));
        let geometry = make
            .mesh(mesh.clone())
            .mesh(turned)
            .mesh(mesh)
            .place(shared, Some(DAffine3::IDENTITY))
            .spheres(vec![[0.0, 0.0, 3.0, 1.0]; 7])
            .done();
        let own = build(backend, &geometry);
        let again = build(backend, &geometry);
        let mut rng = Rng::new(13);
        for _ in 0..5000 {
            let o = in_cube(&mut rng) - DVec3::Z * 3.0;
            let ray = Ray::new(o, in_cube(&mut rng) * DVec3::new(0.9, 0.9, 0.0) - o);
            let hit = own.intersect(&ray).unwrap();
            assert_eq!(Some(hit), again.intersect(&ray));
            // What lies behind is not hit again once the segment begins after it.
            let past = Ray { tmin: hit.t * 1.001, tmax: hit.t * 1.01, ..ray };
            assert!(!own.occluded(&past) || own.intersect(&past).unwrap().object.0 > 3);
            if exact(backend) {
                // A rounding of the last bit may prefer the other winding; equal ones do not.
                assert!(hit.object < ObjectId(2), "{hit:?}");
            }
        }
        let ray = Ray::new(DVec3::new(0.1, 0.2, 9.0), -DVec3::Z);
        let hit = own.intersect(&ray).unwrap();
        assert!(!exact(backend) || (hit.prim, hit.object) == (0, ObjectId(4)));
    }

    fn degenerate_builds(backend) {
        // Nothing at all; an object without primitives; a placed shape without primitives.
        let mut make = Make::default();
        let empty = make.shape(Shape::Mesh(TriangleMesh::default()));
        for geometry in [
            Make::default().done(),
            Make::default().mesh(TriangleMesh::default()).done(),
            make.place(empty, Some(DAffine3::IDENTITY)).done(),
        ] {
            let own = build(backend, &geometry);
            let ray = Ray::new(DVec3::ZERO, DVec3::Z);
            assert!(own.intersect(&ray).is_none() && !own.occluded(&ray));
            assert_eq!(own.stats().primitives, 0);
        }
        // One primitive.
        let geometry = Make::default().spheres(vec![[0.0, 0.0, 5.0, 1.0]]).done();
        let own = build(backend, &geometry);
        assert!(own.occluded(&Ray::new(DVec3::ZERO, DVec3::Z)));
        assert!(!own.occluded(&Ray::new(DVec3::ZERO, DVec3::X)));
        assert_eq!(own.stats().primitives, 1);
        // 1e5 in one place, 1e5 on one line, 1e5 in one plane.
        let n = 100_000;
        for kind in 0..3 {
            let mut mesh = TriangleMesh::default();
            for i in 0..n as u32 {
                let x = if kind == 0 { 0.0 } else { i as f32 * 1e-3 };
                let y = if kind == 2 { (i % 317) as f32 * 0.01 } else { 0.0 };
                mesh.positions.extend([[x, y, 1.0], [x + 1.0, y, 1.0], [x, y + 1.0, 1.0]]);
                mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
            }
            let geometry = Make::default().mesh(mesh).done();
            let ray = Ray::new(DVec3::new(0.25, 0.25, 0.0), DVec3::Z);
            let linear = truth(&geometry);
            let start = std::time::Instant::now();
            let own = build(backend, &geometry);
            let hit = own.intersect(&ray).unwrap();
            assert!((hit.t - 1.0).abs() < 1e-5);
            assert!(!exact(backend) || Some(hit) == linear.intersect(&ray));
            assert!(!own.occluded(&Ray::new(DVec3::new(-5.0, 0.25, 0.0), DVec3::Z)));
            assert!(start.elapsed().as_secs_f64() < 5.0, "{}: kind {kind}", backend.name);
            assert_eq!(own.stats().primitives, n as u64);
        }
    }

    fn huge_and_tiny_worlds(backend) {
        let mut rng = Rng::new(14);
        for scale in [1e-12, 1e12, 1e17] {
            let mut make = Make::default();
            let cloud = (0..100)
                .map(|_| {
                    let c = (in_cube(&mut rng) * scale).as_vec3();
                    [c.x, c.y, c.z, (0.1 * scale) as f32]
                })
                .collect();
            let mut mesh = soup(100, 0.5, &mut rng);
            for p in &mut mesh.positions {
                *p = p.map(|x| (f64::from(x) * scale) as f32);
            }
            let geometry = make.mesh(mesh).spheres(cloud).done();
            // Single precision squares these numbers; there only the absence of surprises counts.
            let rays: Vec<_> = random_rays(&geometry, 3000, &mut rng);
            if exact(backend) {
                agree(backend, &geometry, &rays, &format!("scale {scale}"));
            } else {
                let own = build(backend, &geometry);
                for ray in &rays {
                    if let Some(h) = own.intersect(ray) {
                        assert!(geometry.surface_point(ray, &h).p.is_finite());
                    }
                }
            }
        }
    }

    fn far_and_small_spheres(backend) {
        // The ladder of distance over radius; single precision is right but for the silhouette.
        let mut rng = Rng::new(15);
        for (r, dist) in [(1.0, 1e1), (1.0, 1e3), (1.0, 1e4), (1e-3, 1e1), (1e-4, 1.0), (1e3, 1e3)] {
            let geometry = Make::default().spheres(vec![[0.0, 0.0, 0.0, r as f32]]).done();
            let r = f64::from(r as f32);
            let own = build(backend, &geometry);
            for _ in 0..3000 {
                let o = (on_sphere(&mut rng) * (dist + r)).as_vec3().as_dvec3();
                let side = o.cross(on_sphere(&mut rng)).normalize();
                let target = side * (r * rng.next_1d() * 1.2);
                let ray = Ray::new(o, target - o);
                let f = o - ray.direction() * (o.dot(ray.direction()) / ray.direction().length_squared());
                let b = f.length();
                let margin = if exact(backend) { 1e-12 } else { 4.0 * UNIT_ROUNDOFF * dist / r };
                if (1.0 - b / r).abs() > margin {
                    assert_eq!(own.occluded(&ray), b < r, "{}: r {r} at {dist}, b {b}", backend.name);
                }
            }
        }
    }
}
