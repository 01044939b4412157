//! One scene in many forms that must give the same picture.

use dualight::color::Rgb;
use dualight::geometry::{MaterialId, SphereSet, TriangleMesh};
use dualight::math::{DAffine3, DVec3};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};

use super::{add_sphere, camera, glass, lambert, lamp, mirror};

/// How a scene is changed without a change of its picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// World from the scene's own space; a similarity, mirrored perhaps.
    pub map: DAffine3,
    /// Parts that every edge of a triangle is cut into.
    pub cuts: u32,
    /// Whether meshes carry the map themselves rather than their nodes.
    pub baked: bool,
    /// Whether spheres are balls of triangles, which mirror and turn with their nodes.
    pub balls: bool,
    /// Whether the scene is lit by a point, of which nothing is sampled, instead of the lamp.
    pub point: bool,
}

pub const PLAIN: Change = Change {
    map: DAffine3::IDENTITY,
    cuts: 1,
    baked: false,
    balls: false,
    point: false,
};

fn quad(p: DVec3, e1: DVec3, e2: DVec3) -> TriangleMesh {
    TriangleMesh {
        positions: [p, p + e1, p + e1 + e2, p + e2]
            .map(|p| p.as_vec3().into())
            .to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..Default::default()
    }
}

/// Every triangle cut into `n²`. Normals are those that were interpolated, not of unit length, so
/// that shading sees the same.
fn subdivided(mesh: &TriangleMesh, n: u32) -> TriangleMesh {
    let mut out = TriangleMesh::default();
    let at = |p: [f32; 3]| dualight::math::Vec3::from(p).as_dvec3();
    for t in &mesh.indices {
        let first = out.positions.len() as u32;
        // Row j has n + 1 − j points.
        let index = |i: u32, j: u32| first + j * (n + 1) - j * (j.max(1) - 1) / 2 + i;
        for j in 0..=n {
            for i in 0..=n - j {
                assert_eq!(index(i, j) as usize, out.positions.len());
                let [b, c] = [i, j].map(|k| f64::from(k) / f64::from(n));
                let mix = |v: &[[f32; 3]]| {
                    let [p, q, r] = t.map(|k| at(v[k as usize]));
                    (p * (1.0 - b - c) + q * b + r * c).as_vec3().into()
                };
                out.positions.push(mix(&mesh.positions));
                if !mesh.normals.is_empty() {
                    out.normals.push(mix(&mesh.normals));
                }
                if i + j < n {
                    out.indices
                        .push([index(i, j), index(i + 1, j), index(i, j + 1)]);
                }
                if i + j + 1 < n {
                    let right = index(i + 1, j);
                    out.indices
                        .push([right, index(i + 1, j + 1), index(i, j + 1)]);
                }
            }
        }
    }
    out
}

fn put(b: &mut SceneBuilder, c: &Change, name: &str, m: MaterialId, mut mesh: TriangleMesh) {
    let mut world_from_object = c.map;
    if c.cuts > 1 {
        mesh = subdivided(&mesh, c.cuts);
    }
    if c.baked {
        let at = |p: [f32; 3]| dualight::math::Vec3::from(p).as_dvec3();
        for p in &mut mesh.positions {
            *p = c.map.transform_point3(at(*p)).as_vec3().into();
        }
        let cofactor = c.map.matrix3.inverse().transpose();
        for n in &mut mesh.normals {
            *n = (cofactor * at(*n)).normalize().as_vec3().into();
        }
        if c.map.matrix3.determinant() < 0.0 {
            for t in &mut mesh.indices {
                t.swap(1, 2);
            }
        }
        world_from_object = DAffine3::IDENTITY;
    }
    let shape = b.add_mesh(mesh, name);
    b.place(MeshPlacement {
        shape,
        material: m,
        world_from_object,
        name: name.into(),
    });
}

fn put_sphere(b: &mut SceneBuilder, c: &Change, m: MaterialId, p: DVec3, r: f64) {
    if c.baked {
        let scale = c.map.matrix3.determinant().abs().cbrt();
        return add_sphere(b, "ball", m, c.map.transform_point3(p), r * scale);
    }
    let set = SphereSet {
        spheres: vec![[0.0, 0.0, 0.0, r as f32]],
    };
    let shape = b.add_spheres(set, "ball");
    b.place(MeshPlacement {
        shape,
        material: m,
        world_from_object: c.map * DAffine3::from_translation(p),
        name: "ball".into(),
    });
}

/// The box with a mirror and a glass ball, changed. The lamp's radiance does not depend on the
/// unit, so neither does the picture.
pub fn scene(c: &Change) -> Scene {
    let mut b = SceneBuilder::default();
    let mut add = |d| b.add_material(&d).unwrap();
    let grey = add(lambert("grey", Rgb::splat(0.75)));
    let red = add(lambert("red", Rgb::new(0.75, 0.1, 0.1)));
    let green = add(lambert("green", Rgb::new(0.1, 0.75, 0.1)));
    let light = add(lamp(Rgb::splat(15.0)));
    let (mirror, glass) = (add(mirror()), add(glass(1.5)));
    let v = DVec3::new;
    let (x, y, z) = (DVec3::X * 2.0, DVec3::Y * 2.0, DVec3::Z * 2.0);
    for (name, m, p, e1, e2) in [
        ("floor", grey, v(-1.0, -1.0, -1.0), z, x),
        ("ceiling", grey, v(-1.0, 1.0, -1.0), x, z),
        ("back", grey, v(-1.0, -1.0, -1.0), x, y),
        ("left", red, v(-1.0, -1.0, -1.0), y, z),
        ("right", green, v(1.0, -1.0, -1.0), z, y),
    ] {
        put(&mut b, c, name, m, quad(p, e1, e2));
    }
    let lamp = quad(v(-0.25, 0.998, -0.25), DVec3::X * 0.5, DVec3::Z * 0.5);
    if c.point {
        let at = c.map.transform_point3(DVec3::Y * 0.7);
        b.add_light(super::light("point", at, DVec3::NEG_Y, 1.0));
    } else {
        put(&mut b, c, "lamp", light, lamp);
    }
    for (m, p) in [(mirror, v(-0.4, -0.6, -0.3)), (glass, v(0.4, -0.6, 0.3))] {
        if c.balls {
            let place = DAffine3::from_translation(p) * DAffine3::from_scale(DVec3::splat(0.4));
            let map = c.map * place;
            put(
                &mut b,
                &Change {
                    map,
                    baked: c.baked,
                    ..*c
                },
                "ball",
                m,
                ball(24),
            );
        } else {
            put_sphere(&mut b, c, m, p, 0.4);
        }
    }
    let mut view = camera(v(0.0, 0.0, 3.8), 39.3);
    let scale = c.map.matrix3.determinant().abs().cbrt();
    // A camera has no size: only its place and its axes follow.
    let rigid = DAffine3 {
        matrix3: c.map.matrix3 * (1.0 / scale),
        translation: c.map.translation,
    };
    let place = c.map.transform_point3(view.world_from_camera.translation);
    view.world_from_camera = DAffine3 {
        matrix3: rigid.matrix3,
        translation: place,
    };
    b.add_camera(view);
    b.finish().unwrap()
}

fn ball(n: u32) -> TriangleMesh {
    let sectors = 2 * n;
    let mut mesh = TriangleMesh::default();
    for i in 0..=n {
        for j in 0..sectors {
            let t = std::f64::consts::PI * f64::from(i) / f64::from(n);
            let a = std::f64::consts::TAU * f64::from(j) / f64::from(sectors);
            let p = DVec3::new(t.sin() * a.cos(), t.cos(), -t.sin() * a.sin()).as_vec3();
            mesh.positions.push(p.into());
            mesh.normals.push(p.into());
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
