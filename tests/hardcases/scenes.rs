//! Geometries, rays and backends that rows share.

use std::collections::HashMap;
use std::sync::Arc;

use dualight::accel::{ACCELERATORS, Accelerator, AcceleratorEntry};
use dualight::geometry::{
    Geometry, MaterialId, Object, Placement, Ray, Shape, ShapeId, SphereSet, SurfacePoint,
    TriangleMesh,
};
use dualight::math::{DAffine3, DVec3};
use dualight::sampling::Rng;

use crate::report::Meter;

/// Most primitives that are also looked through one by one.
const FEW: usize = 512;

/// The paths E and B of the catalogue, E also without its robust mode, and the search through
/// everything where there is little. E is left out of a build without Embree.
pub fn backends(geometry: &Arc<Geometry>) -> Vec<(&'static str, Box<dyn Accelerator>)> {
    let few = geometry.shapes.iter().map(Shape::len).sum::<usize>() <= FEW;
    let mut list: Vec<AcceleratorEntry> = ACCELERATORS.to_vec();
    list.retain(|e| few || e.name != "linear");
    #[cfg(feature = "embree")]
    list.insert(1, dualight::accel::EMBREE_FAST);
    list.into_iter()
        .map(|e| (e.name, (e.build)(geometry, 1).unwrap()))
        .collect()
}

/// Whether a backend computes in double precision: nothing is granted to it.
pub fn exact(backend: &str) -> bool {
    matches!(backend, "bvh" | "linear")
}

/// Meters of each backend, summed over several geometries.
#[derive(Default)]
pub struct PerPath<const N: usize>(Vec<(&'static str, [Meter; N])>);

impl<const N: usize> PerPath<N> {
    pub fn of(&mut self, path: &'static str) -> &mut [Meter; N] {
        let i = self.0.iter().position(|l| l.0 == path).unwrap_or_else(|| {
            self.0.push((path, [Meter::default(); N]));
            self.0.len() - 1
        });
        &mut self.0[i].1
    }

    pub fn into_iter(self) -> impl Iterator<Item = (&'static str, [Meter; N])> {
        self.0.into_iter()
    }
}

pub fn object(shape: u32, placement: Option<DAffine3>) -> Object {
    Object {
        shape: ShapeId(shape),
        placement: placement.map(|p| Placement::new(p).unwrap()),
        material: MaterialId(0),
        light: None,
        coverage: None,
        name: "object".into(),
    }
}

pub fn spheres(list: &[(DVec3, f64)]) -> Arc<Geometry> {
    let spheres = list
        .iter()
        .map(|(c, r)| [c.x as f32, c.y as f32, c.z as f32, *r as f32])
        .collect();
    Arc::new(Geometry {
        shapes: vec![Shape::Spheres(SphereSet { spheres })],
        objects: vec![object(0, None)],
    })
}

pub fn mesh(mesh: TriangleMesh) -> Arc<Geometry> {
    Arc::new(Geometry {
        shapes: vec![Shape::Mesh(mesh)],
        objects: vec![object(0, None)],
    })
}

pub fn triangle(v: [DVec3; 3]) -> TriangleMesh {
    TriangleMesh {
        positions: v.map(|p| p.as_vec3().into()).to_vec(),
        indices: vec![[0, 1, 2]],
        ..Default::default()
    }
}

/// A flat square of `2·n²` triangles and edge `size`, facing `+z`.
pub fn plane(n: u32, center: DVec3, size: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let at = |i: u32| (f64::from(i) / f64::from(n) - 0.5) * size;
    for j in 0..=n {
        for i in 0..=n {
            let p = center + DVec3::new(at(i), at(j), 0.0);
            mesh.positions.push(p.as_vec3().into());
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

/// A closed ball of `4·n·(n − 1)` triangles, fronts outward.
pub fn ball(n: u32, center: DVec3, r: f64) -> TriangleMesh {
    let sectors = 2 * n;
    let mut mesh = TriangleMesh::default();
    for i in 0..=n {
        for j in 0..sectors {
            let t = std::f64::consts::PI * f64::from(i) / f64::from(n);
            let a = std::f64::consts::TAU * f64::from(j) / f64::from(sectors);
            let sin = if i == 0 || i == n { 0.0 } else { t.sin() };
            let p = DVec3::new(sin * a.cos(), t.cos(), -sin * a.sin());
            mesh.positions.push((center + p * r).as_vec3().into());
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
    mesh.drop_invalid();
    mesh
}

/// A closed convex ball of `20·4^levels` triangles, fronts outward: an icosahedron whose edges
/// are halved again and again.
pub fn icosphere(levels: u32, center: DVec3, r: f64) -> TriangleMesh {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let mut corners: Vec<DVec3> = Vec::new();
    for k in 0..3 {
        for (a, b) in [
            (1.0, golden),
            (-1.0, golden),
            (1.0, -golden),
            (-1.0, -golden),
        ] {
            let mut p = DVec3::ZERO;
            (p[(k + 1) % 3], p[(k + 2) % 3]) = (a, b);
            corners.push(p.normalize());
        }
    }
    let edge = 2.0 / (1.0 + golden * golden).sqrt() * 1.001;
    let near = |a: usize, b: usize| corners[a].distance(corners[b]) < edge;
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    let out = corners[a].dot(corners[b].cross(corners[c])) > 0.0;
                    faces.push(if out { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    assert_eq!(faces.len(), 20);
    for _ in 0..levels {
        let mut halves: HashMap<[usize; 2], usize> = HashMap::new();
        let mut half = |a: usize, b: usize| {
            *halves.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                corners.push((corners[a] + corners[b]).normalize());
                corners.len() - 1
            })
        };
        faces = faces
            .into_iter()
            .flat_map(|[a, b, c]| {
                let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    TriangleMesh {
        positions: corners
            .iter()
            .map(|p| (center + *p * r).as_vec3().into())
            .collect(),
        indices: faces.iter().map(|f| f.map(|i| i as u32)).collect(),
        ..Default::default()
    }
}

/// Corners of a triangle of the first shape.
pub fn corners(g: &Geometry, prim: u32) -> [DVec3; 3] {
    match &g.shapes[0] {
        Shape::Mesh(m) => m.corners(prim),
        Shape::Spheres(_) => unreachable!("a mesh"),
    }
}

/// A ray at a point, as near as single precision allows.
pub fn ray_to(o: DVec3, target: DVec3) -> Ray {
    let ray = Ray::new(o, DVec3::X);
    Ray {
        d: (target - ray.origin()).as_vec3(),
        ..ray
    }
}

pub fn in_cube(rng: &mut Rng) -> DVec3 {
    DVec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) * 2.0 - 1.0
}

pub fn on_sphere(rng: &mut Rng) -> DVec3 {
    loop {
        let v = in_cube(rng);
        let l = v.length();
        if l > 0.1 && l <= 1.0 {
            return v / l;
        }
    }
}

/// The refined hit of a ray.
pub fn refined(g: &Geometry, accel: &dyn Accelerator, ray: &Ray) -> Option<SurfacePoint> {
    accel.intersect(ray).map(|h| g.surface_point(ray, &h))
}

/// How far a value is from what it should be, relative to that.
pub fn relative(x: f64, want: f64) -> f64 {
    if x == want {
        0.0
    } else {
        (x - want).abs() / want.abs()
    }
}
