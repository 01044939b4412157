//! Geometries, rays and backends that rows share.

use std::sync::Arc;

use dualight::accel::{ACCELERATORS, Accelerator};
use dualight::geometry::{
    Geometry, MaterialId, Object, Placement, Ray, Shape, ShapeId, SphereSet, SurfacePoint,
    TriangleMesh,
};
use dualight::math::{DAffine3, DVec3};
use dualight::sampling::Rng;

/// The paths E and B of the catalogue; E is left out of a build without Embree.
pub fn backends(geometry: &Arc<Geometry>) -> Vec<(&'static str, Box<dyn Accelerator>)> {
    ACCELERATORS
        .iter()
        .filter(|e| e.name != "linear")
        .map(|e| (e.name, (e.build)(geometry, 1).unwrap()))
        .collect()
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
