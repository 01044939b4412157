//! A picture does not depend on the unit, the place, the handedness or the orientation of a
//! scene, nor on how its surfaces are cut into triangles and its places into nodes.
//!
//! Rows T17 to T19 of the hard cases, and more like them. Where numbers scale exactly (powers of two) or recentring
//! takes the shift back, pictures are the same but for rounding; elsewhere sampling differs, and
//! the mean of a layer must agree within four standard errors.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;
#[path = "hardcases/report.rs"]
mod report;

use common::render::{GATHER, Mode, PATH, Size, mean, rendering, settings};
use common::{add_sphere, camera, glass, lambert, lamp, mirror};
use dualight::color::Rgb;
use dualight::film::Image;
use dualight::geometry::{MaterialId, TriangleMesh};
use dualight::math::{DAffine3, DQuat, DVec3};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};
use report::{Meter, Row, rows};

const SIZE: Size = Size {
    pixels: 16,
    spp: 8,
    photons: 8_000,
};

/// How a scene is changed without a change of its picture.
#[derive(Clone, Copy, Debug)]
struct Change {
    /// World from the scene's own space; a similarity, mirrored perhaps.
    map: DAffine3,
    /// Cuts of every edge of a surface.
    cuts: u32,
    /// Whether meshes carry the map themselves rather than their nodes.
    baked: bool,
    /// Whether spheres are balls of triangles, which mirror and turn with their nodes.
    balls: bool,
}

const PLAIN: Change = Change {
    map: DAffine3::IDENTITY,
    cuts: 1,
    baked: false,
    balls: false,
};

fn grid(p: DVec3, e1: DVec3, e2: DVec3, n: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for j in 0..=n {
        for i in 0..=n {
            let (a, b) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            mesh.positions.push((p + e1 * a + e2 * b).as_vec3().into());
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

fn put(b: &mut SceneBuilder, c: &Change, name: &str, m: MaterialId, mut mesh: TriangleMesh) {
    let mut world_from_object = c.map;
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

/// The box with a mirror and a glass ball, changed. The lamp's radiance does not depend on the
/// unit, so neither does the picture.
fn scene(c: &Change) -> Scene {
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
        put(&mut b, c, name, m, grid(p, e1, e2, c.cuts));
    }
    let lamp = grid(v(-0.25, 0.998, -0.25), DVec3::X * 0.5, DVec3::Z * 0.5, 1);
    put(&mut b, c, "lamp", light, lamp);
    for (m, p) in [(mirror, v(-0.4, -0.6, -0.3)), (glass, v(0.4, -0.6, 0.3))] {
        let scale = c.map.matrix3.determinant().abs().cbrt();
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
            add_sphere(&mut b, "ball", m, c.map.transform_point3(p), 0.4 * scale);
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

fn picture(c: &Change, mode: Mode, seed: u64) -> Image {
    // One backend for all seeds that are compared.
    let mut s = settings(mode, SIZE, 0);
    s.integrator_settings.seed = seed;
    rendering(&scene(c), &s).film.develop()
}

/// Mean relative squared difference of two pictures.
fn distance(a: &Image, b: &Image) -> f64 {
    let (a, b) = (a.rgb("").unwrap(), b.rgb("").unwrap());
    let sum: f64 = a
        .iter()
        .flatten()
        .zip(b.iter().flatten())
        .map(|(x, y)| f64::from(x - y).powi(2) / (f64::from(*y).powi(2) + 0.01))
        .sum();
    sum / (3 * a.len()) as f64
}

/// The same seeds, the same picture: `most` is the relative squared error.
fn same(row: &mut Row, changes: &[(Change, Change)], most: f64) {
    for mode in [PATH, GATHER] {
        let mut m = Meter::default();
        for (a, b) in changes {
            m.see(distance(&picture(a, mode, 1), &picture(b, mode, 1)));
        }
        row.line(mode.name, "relative squared difference", m, most);
    }
}

/// Other samples, the same means: within four standard errors and 0.2 %.
fn alike(row: &mut Row, changes: &[(Change, Change)]) {
    for mode in [PATH, GATHER] {
        let mut m = Meter::default();
        for (a, b) in changes {
            let means = |c: &Change| -> Vec<f64> {
                (1..=6)
                    .map(|seed| mean(&picture(c, mode, seed), ""))
                    .collect()
            };
            let (x, y) = (means(a), means(b));
            let n = x.len() as f64;
            let of = |v: &[f64]| v.iter().sum::<f64>() / n;
            let variance =
                |v: &[f64]| v.iter().map(|m| (m - of(v)).powi(2)).sum::<f64>() / (n - 1.0);
            let error = ((variance(&x) + variance(&y)) / n).sqrt();
            let d = of(&x) - of(&y);
            m.see(d.abs() / (4.0 * error + 0.002 * of(&x)));
        }
        row.line(mode.name, "difference of means, of what is allowed", m, 1.0);
    }
}

fn mapped(map: DAffine3) -> Change {
    Change { map, ..PLAIN }
}

fn scaled(s: f64) -> (Change, Change) {
    (PLAIN, mapped(DAffine3::from_scale(DVec3::splat(s))))
}

/// With balls of triangles.
fn meshed(map: DAffine3) -> (Change, Change) {
    let balls = |c| Change { balls: true, ..c };
    (balls(PLAIN), balls(mapped(map)))
}

mod pictures {
    use super::*;

    pub(crate) fn t18(row: &mut Row) {
        same(row, &[-13, 13].map(|k| scaled(2f64.powi(k))), 1e-5);
        alike(row, &[1e-4, 1e4].map(scaled));
        row.note("by 2⁻¹³ and 2¹³ pixel by pixel, by 1e-4 and 1e4 in the mean");
    }

    pub(crate) fn t19(row: &mut Row) {
        // What nodes move keeps its digits: recentring takes the shift back.
        let moved = |x: f64| meshed(DAffine3::from_translation(DVec3::new(x, -x, 0.5 * x)));
        alike(row, &[1e3, 1e5, 1e6].map(moved));
        // Rounded to whole places of the shift, it comes back to the bit.
        let whole = |x: f64| meshed(DAffine3::from_translation(DVec3::splat(x)));
        same(row, &[1e3, 1e5, 1e6].map(whole), 1e-5);
        row.note("by nodes, to 1e3, 1e5 and 1e6; what the coordinates of vertices have lost before import cannot come back");
    }

    pub(crate) fn t17(row: &mut Row) {
        let mirrored = |s| meshed(DAffine3::from_scale(s));
        alike(
            row,
            &[DVec3::new(-1.0, 1.0, 1.0), DVec3::NEG_ONE].map(mirrored),
        );
        row.note("sampling is not mirrored with the scene, so that means are compared, not pixels");
    }

    pub(crate) fn turned(row: &mut Row) {
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        alike(row, &[(PLAIN, mapped(DAffine3::from_quat(turn)))]);
    }

    pub(crate) fn cut(row: &mut Row) {
        alike(row, &[(PLAIN, Change { cuts: 7, ..PLAIN })]);
    }

    pub(crate) fn baked(row: &mut Row) {
        let (_, node) = meshed(DAffine3::from_scale_rotation_translation(
            DVec3::splat(2.0),
            DQuat::from_axis_angle(DVec3::Y, 0.3),
            DVec3::new(3.0, 1.0, -2.0),
        ));
        same(
            row,
            &[(
                node,
                Change {
                    baked: true,
                    ..node
                },
            )],
            1e-3,
        );
    }
}

rows! { "invariance";
    t17: "mirrored in one axis and in all" in pictures;
    t18: "scaled" in pictures;
    t19: "moved" in pictures;
    turned: "turned by 0.7 about (1, 2, 3)" in pictures;
    cut: "each wall cut into 49 squares" in pictures;
    baked: "nodes' transforms in the vertices" in pictures;
}
