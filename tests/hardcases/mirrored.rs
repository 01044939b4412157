//! Row T17, its part without a picture: nodes that mirror, and mirrors within mirrors.

use std::sync::Arc;

use dualight::geometry::{Geometry, Shape, SphereSet};
use dualight::math::{DAffine3, DQuat, DVec3};
use dualight::sampling::Rng;

use crate::bounces;
use crate::report::Row;
use crate::scenes::{PerPath, backends, icosphere, object, on_sphere, ray_to, refined};

/// Nodes that turn a body inside out an odd number of times, or an even one.
pub fn maps() -> [DAffine3; 5] {
    let mirror = |x: f64, y: f64, z: f64| DAffine3::from_scale(DVec3::new(x, y, z));
    let turn = DAffine3::from_rotation_translation(
        DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7),
        DVec3::new(0.3, -0.2, 0.1),
    );
    [
        mirror(-1.0, 1.0, 1.0),
        mirror(-1.0, -1.0, -1.0),
        mirror(-1.0, 1.0, 1.0) * turn * mirror(1.0, -1.0, 1.0),
        mirror(-1.0, -1.0, -1.0) * turn * mirror(1.0, 1.0, -1.0),
        mirror(-1.0, 1.0, 1.0) * turn * mirror(-1.0, -1.0, -1.0) * turn * mirror(1.0, -1.0, 1.0),
    ]
}

pub fn t17(row: &mut Row) {
    let shapes = [
        Shape::Mesh(icosphere(2, DVec3::ZERO, 1.0)),
        Shape::Spheres(SphereSet {
            spheres: vec![[0.0, 0.0, 0.0, 1.0]],
        }),
    ];
    let mut found = PerPath::<2>::default();
    for map in maps() {
        for shape in &shapes {
            let g = Arc::new(Geometry {
                shapes: vec![shape.clone()],
                objects: vec![object(0, Some(map))],
            });
            // As backends see it, in single precision.
            let map = g.objects[0].placement.unwrap().world_from_object;
            let normals = map.matrix3.inverse().transpose();
            for (name, accel) in backends(&g) {
                let [side, normal] = found.of(name);
                let mut rng = Rng::new(17);
                for i in 0..2000 {
                    let out = on_sphere(&mut rng);
                    // From outside and from inside: a mirror does not swap them (glTF 2.0, 3.5.3).
                    let outside = i % 2 == 0;
                    let from = out * if outside { 3.0 } else { 0.1 };
                    let to = out * if outside { 0.1 } else { 3.0 };
                    let [from, to] = [from, to].map(|p| map.transform_point3(p));
                    let Some(sp) = refined(&g, &*accel, &ray_to(from, to)) else {
                        side.must(false);
                        continue;
                    };
                    side.must(sp.front == outside);
                    let want = match shape {
                        Shape::Mesh(m) => {
                            let v = m.corners(sp.prim);
                            (v[1] - v[0]).cross(v[2] - v[0])
                        }
                        Shape::Spheres(_) => map.inverse().transform_point3(sp.p),
                    };
                    normal.see((sp.ng - (normals * want).normalize()).length());
                }
            }
        }
    }
    row.tried(
        "(−1, 1, 1), (−1, −1, −1), two of two mirrors and one of three, with turns between; a \
         mesh and a sphere; seed 17",
    );
    for (name, [side, normal]) in found.into_iter() {
        row.line(name, "outside told for inside, or missed", side, 0.0);
        row.line(name, "normal against the inverse transpose", normal, 1e-14);
    }
    bounces::mirrored_chords(row);
}
