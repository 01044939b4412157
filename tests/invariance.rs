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
use dualight::accel::ACCELERATORS;
use dualight::color::Rgb;
use dualight::film::Image;
use dualight::geometry::{MaterialId, SphereSet, TriangleMesh};
use dualight::math::{DAffine3, DQuat, DVec3};
use dualight::pipeline::Rendering;
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};
use report::{Meter, Row, rows};

const SIZE: Size = Size {
    pixels: 16,
    spp: 8,
    photons: 8_000,
};

/// How a scene is changed without a change of its picture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    /// World from the scene's own space; a similarity, mirrored perhaps.
    map: DAffine3,
    /// Parts that every edge of a triangle is cut into.
    cuts: u32,
    /// Whether meshes carry the map themselves rather than their nodes.
    baked: bool,
    /// Whether spheres are balls of triangles, which mirror and turn with their nodes.
    balls: bool,
    /// Whether the scene is lit by a point, of which nothing is sampled, instead of the lamp.
    point: bool,
}

const PLAIN: Change = Change {
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
        put(&mut b, c, name, m, quad(p, e1, e2));
    }
    let lamp = quad(v(-0.25, 0.998, -0.25), DVec3::X * 0.5, DVec3::Z * 0.5);
    if c.point {
        let at = c.map.transform_point3(DVec3::Y * 0.7);
        b.add_light(common::light("point", at, DVec3::NEG_Y, 1.0));
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

/// A way to compute pictures: integrator, emission of photons and backend.
#[derive(Clone, Copy, Debug)]
struct Way {
    mode: Mode,
    emission: &'static str,
    effects: &'static str,
    backend: &'static str,
}

impl Way {
    fn name(&self) -> String {
        format!("{}, {}", self.backend, self.mode.name)
    }

    fn render(&self, c: &Change, seed: u64) -> Rendering {
        let mut s = settings(self.mode, SIZE, seed);
        s.accelerator = Some(self.backend.into());
        s.emission = Some(self.emission.into());
        s.effects = self.effects.into();
        rendering(&scene(c), &s)
    }
}

const HYBRID: Mode = Mode {
    name: "hybrid",
    integrator: "hybrid",
    gather_rays: 0,
};

/// Photons whose emission follows derivatives.
const ADAPTIVE: Mode = Mode {
    name: "photon with adaptive emission",
    ..GATHER
};

/// Every mode through both backends that render.
fn ways(modes: &[Mode]) -> Vec<Way> {
    let backends = ACCELERATORS.iter().filter(|a| a.name != "linear");
    backends
        .flat_map(|a| {
            modes.iter().map(|mode| Way {
                mode: *mode,
                emission: if mode.name == ADAPTIVE.name {
                    "adaptive"
                } else {
                    "uniform"
                },
                effects: "auto",
                backend: a.name,
            })
        })
        .collect()
}

/// Remembers what has been computed for a change: many are held against the same one.
struct Known<T>(Vec<(Change, T)>);

impl<T: Clone> Known<T> {
    fn get(&mut self, c: &Change, make: impl FnOnce() -> T) -> T {
        if let Some((_, known)) = self.0.iter().find(|(k, _)| k == c) {
            return known.clone();
        }
        let made = make();
        self.0.push((*c, made.clone()));
        made
    }
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

/// The same seeds, the same picture: `most` is the relative squared error. And as many photons.
fn same(row: &mut Row, ways: &[Way], changes: &[(Change, Change)], most: f64) {
    for way in ways {
        let [mut picture, mut stored] = [Meter::default(); 2];
        let mut known = Known(Vec::new());
        let mut seen = |c: &Change| {
            known.get(c, || {
                let r = way.render(c, 1);
                let s = &r.statistics;
                let counts = [&s.global_photons, &s.caustic_photons].map(|c| c.stored as f64);
                (r.film.develop(), counts)
            })
        };
        for (a, b) in changes {
            let (a, b) = (seen(a), seen(b));
            picture.see(distance(&a.0, &b.0));
            for (x, y) in a.1.into_iter().zip(b.1) {
                if y > 0.0 {
                    stored.see((x - y).abs() / y);
                }
            }
        }
        row.line(way.name(), "relative squared difference", picture, most);
        if stored.n > 0 {
            let what = "photons stored, relative difference";
            row.line(way.name(), what, stored, 1e-3);
        }
    }
}

/// The same seeds, the same pixels: `most` is the largest difference of any.
fn identical(row: &mut Row, ways: &[Way], changes: &[(Change, Change)], most: f64) {
    for way in ways {
        let mut m = Meter::default();
        for (a, b) in changes {
            let [a, b] = [a, b].map(|c| way.render(c, 1).film.develop());
            let (a, b) = (a.rgb("").unwrap(), b.rgb("").unwrap());
            for (x, y) in a.iter().flatten().zip(b.iter().flatten()) {
                m.see(f64::from(x - y).abs());
            }
        }
        row.line(way.name(), "difference of a pixel", m, most);
    }
}

/// Other samples, the same means: within four standard errors and 0.2 %.
fn alike(row: &mut Row, ways: &[Way], changes: &[(Change, Change)]) {
    for way in ways {
        let mut m = Meter::default();
        let mut known: Known<Vec<f64>> = Known(Vec::new());
        let mut means = |c: &Change| {
            known.get(c, || {
                let picture = |seed| way.render(c, seed).film.develop();
                (1..=6).map(|s| mean(&picture(s), "")).collect()
            })
        };
        for (a, b) in changes {
            let (x, y) = (means(a), means(b));
            let n = x.len() as f64;
            let of = |v: &[f64]| v.iter().sum::<f64>() / n;
            let variance =
                |v: &[f64]| v.iter().map(|m| (m - of(v)).powi(2)).sum::<f64>() / (n - 1.0);
            let error = ((variance(&x) + variance(&y)) / n).sqrt();
            let d = of(&x) - of(&y);
            m.see(d.abs() / (4.0 * error + 0.002 * of(&x)));
        }
        let what = "difference of means, of what is allowed";
        row.line(way.name(), what, m, 1.0);
    }
}

/// The box with analytic spheres, and the same all of triangles.
const SCENES: [Change; 2] = [
    PLAIN,
    Change {
        balls: true,
        ..PLAIN
    },
];

/// Both scenes, each with and without each of the maps.
fn mapped(maps: &[DAffine3]) -> Vec<(Change, Change)> {
    maps.iter()
        .flat_map(|&map| SCENES.map(|c| (c, Change { map, ..c })))
        .collect()
}

fn scale(s: f64) -> DAffine3 {
    DAffine3::from_scale(DVec3::splat(s))
}

mod pictures {
    use super::*;

    /// Every integrator, and photons of an emission that follows derivatives.
    const ALL: [Mode; 4] = [PATH, GATHER, HYBRID, ADAPTIVE];
    /// What is asked again for means where pictures are the same already.
    const TWO: [Mode; 2] = [PATH, GATHER];

    pub(crate) fn t18(row: &mut Row) {
        let exactly = [-13, 13].map(|k| scale(2f64.powi(k)));
        let nearly = [1e-4, 1e4].map(scale);
        row.tried("by 2⁻¹³ and 2¹³, both scenes; seed 1");
        same(row, &ways(&ALL), &mapped(&exactly), 1e-5);
        row.tried("by 1e-4 and 1e4, both scenes; seed 1");
        same(row, &ways(&ALL), &mapped(&nearly), 1e-5);
        row.tried("by 1e-4 and 1e4, both scenes; seeds 1 to 6");
        alike(row, &ways(&TWO), &mapped(&nearly));
    }

    pub(crate) fn t19(row: &mut Row) {
        // What nodes move keeps its digits: recentring takes the shift back, to the bit where it
        // is whole in the places that it rounds.
        let whole = |x: f64| DAffine3::from_translation(DVec3::splat(x));
        row.tried("by (x, x, x), x = 1e3, 1e5, 1e6, both scenes; seed 1");
        same(row, &ways(&ALL), &mapped(&[1e3, 1e5, 1e6].map(whole)), 1e-5);
        let moved = |x: f64| DAffine3::from_translation(DVec3::new(x, -x, 0.5 * x));
        let moved = mapped(&[1e3, 1e5, 1e6].map(moved));
        row.tried("by (x, −x, x/2), x = 1e3, 1e5, 1e6, both scenes; seed 1");
        same(row, &ways(&ALL), &moved, 1e-5);
        row.tried("by (x, −x, x/2), x = 1e3, 1e5, 1e6, both scenes; seeds 1 to 6");
        alike(row, &ways(&TWO), &moved);
        row.note(
            "by nodes; what the coordinates of vertices have lost before import cannot come back",
        );
    }

    pub(crate) fn t17(row: &mut Row) {
        let mirror = |x: f64, y: f64, z: f64| DAffine3::from_scale(DVec3::new(x, y, z));
        // Nodes within nodes, with a turn and a move in between.
        let turn = DAffine3::from_rotation_translation(
            DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7),
            DVec3::new(0.5, -1.0, 2.0),
        );
        let two = mirror(-1.0, 1.0, 1.0) * turn * mirror(1.0, -1.0, 1.0);
        let maps = [
            mirror(-1.0, 1.0, 1.0),
            mirror(-1.0, -1.0, -1.0),
            two,
            mirror(-1.0, -1.0, -1.0) * turn * two,
        ];
        row.tried(
            "(−1, 1, 1), (−1, −1, −1), two and three mirrors in one another with turns between, \
             both scenes; seeds 1 to 6",
        );
        alike(row, &ways(&ALL), &mapped(&maps));
        // What is seen by way of the mirror and the glass, and what the point lights: photon mapping
        // takes no random numbers for it but those that choose between reflection and refraction.
        let flips = [maps[0], maps[1], maps[0] * mirror(1.0, -1.0, 1.0)];
        let lit = |map, c: Change| Change {
            map,
            point: true,
            ..c
        };
        let changes: Vec<_> = flips
            .iter()
            .flat_map(|&map| SCENES.map(|c| (lit(DAffine3::IDENTITY, c), lit(map, c))))
            .collect();
        let sharp = ways(&[GATHER]).into_iter().map(|way| Way {
            effects: "-indirect,-caustics",
            ..way
        });
        row.tried(
            "(−1, 1, 1), (−1, −1, −1), two mirrors in one another; both scenes, lit by a point, \
             without indirect light; seed 1",
        );
        identical(row, &sharp.collect::<Vec<_>>(), &changes, 1e-5);
        row.note(
            "where directions are sampled, as paths do at every surface that scatters, sampling is not \
             mirrored with the scene, so that means are compared, not pixels: frames around a normal are right-handed on both sides of a mirror",
        );
    }

    pub(crate) fn turned(row: &mut Row) {
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        row.tried("both scenes; seeds 1 to 6");
        alike(row, &ways(&ALL), &mapped(&[DAffine3::from_quat(turn)]));
    }

    pub(crate) fn cut(row: &mut Row) {
        let cut = SCENES.map(|c| (c, Change { cuts: 3, ..c }));
        row.tried("both scenes; seeds 1 to 6");
        alike(row, &ways(&ALL), &cut);
    }

    pub(crate) fn baked(row: &mut Row) {
        let map = DAffine3::from_scale_rotation_translation(
            DVec3::splat(2.0),
            DQuat::from_axis_angle(DVec3::Y, 0.3),
            DVec3::new(3.0, 1.0, -2.0),
        );
        let nodes = SCENES.map(|c| Change { map, ..c });
        let baked = nodes.map(|c| (c, Change { baked: true, ..c }));
        row.tried("twice as large, turned by 0.3, moved by (3, 1, −2), both scenes; seed 1");
        same(row, &ways(&ALL), &baked, 1e-3);
    }
}

rows! { "invariance";
    t17: "mirrored, also within mirrors" in pictures;
    t18: "scaled" in pictures;
    t19: "moved" in pictures;
    turned: "turned by 0.7 about (1, 2, 3)" in pictures;
    cut: "each triangle cut into 9" in pictures;
    baked: "nodes' transforms in the vertices" in pictures;
}
