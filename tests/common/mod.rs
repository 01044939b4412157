//! What tests share: scenes made in code, tiny renderings, statistics.
#![allow(dead_code, reason = "each test binary uses its own part")]
#![allow(
    unreachable_pub,
    reason = "shared by binaries, each a crate of its own"
)]
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

pub mod changed;
pub mod chi2;
pub mod oracle;
pub mod photons;
pub mod points;
pub mod random;
pub mod render;
pub mod show;
pub mod stats;

use dualight::cameras::{CameraDesc, Lens};
use dualight::color::Rgb;
use dualight::geometry::{MaterialId, SphereSet, TriangleMesh};
use dualight::lights::LightDesc;
use dualight::materials::MaterialDesc;
use dualight::math::{DAffine3, DVec3, Frame};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};

/// A Lambert surface.
pub fn lambert(name: &str, albedo: Rgb) -> MaterialDesc {
    MaterialDesc {
        name: name.into(),
        base_color: albedo,
        metallic: 0.0,
        specular: 0.0,
        ..Default::default()
    }
}

/// A perfect mirror.
pub fn mirror() -> MaterialDesc {
    MaterialDesc {
        name: "mirror".into(),
        roughness: 0.0,
        ..Default::default()
    }
}

/// Clear solid glass.
pub fn glass(ior: f64) -> MaterialDesc {
    MaterialDesc {
        name: "glass".into(),
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        volume: true,
        ior,
        ..Default::default()
    }
}

/// A black surface that emits from its front.
pub fn lamp(radiance: Rgb) -> MaterialDesc {
    MaterialDesc {
        emission: radiance,
        ..lambert("lamp", Rgb::ZERO)
    }
}

/// A square of half width 1 in the plane z = 0, with texture coordinates from 0 to 1 along x and
/// from 1 to 0 along y.
pub fn square() -> TriangleMesh {
    TriangleMesh {
        positions: vec![
            [-1.0, -1.0, 0.0],
            [1.0, -1.0, 0.0],
            [1.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
        ],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        uv_sets: vec![vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]],
        ..Default::default()
    }
}

/// Adds a parallelogram; its front is where `e1 × e2` points.
pub fn add_quad(
    b: &mut SceneBuilder,
    name: &str,
    material: MaterialId,
    p: DVec3,
    e1: DVec3,
    e2: DVec3,
) {
    let mesh = TriangleMesh {
        positions: [p, p + e1, p + e1 + e2, p + e2]
            .map(|v| v.as_vec3().into())
            .to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..Default::default()
    };
    let shape = b.add_mesh(mesh, name);
    place(b, name, shape, material);
}

/// Adds a sphere.
pub fn add_sphere(b: &mut SceneBuilder, name: &str, material: MaterialId, c: DVec3, r: f64) {
    let set = SphereSet {
        spheres: vec![[c.x as f32, c.y as f32, c.z as f32, r as f32]],
    };
    let shape = b.add_spheres(set, name);
    place(b, name, shape, material);
}

fn place(
    b: &mut SceneBuilder,
    name: &str,
    shape: dualight::geometry::ShapeId,
    material: MaterialId,
) {
    b.place(MeshPlacement {
        shape,
        material,
        world_from_object: DAffine3::IDENTITY,
        name: name.into(),
    });
}

/// A perspective camera at `eye` looking along `-z`.
pub fn camera(eye: DVec3, yfov_degrees: f64) -> CameraDesc {
    CameraDesc {
        name: "camera".into(),
        kind: "perspective",
        world_from_camera: DAffine3::from_translation(eye),
        vertical: yfov_degrees.to_radians(),
        aspect: Some(1.0),
        shift: [0.0; 2],
        lens: None,
    }
}

/// A round opening of so many metres.
pub fn round_lens(radius: f64, focus: f64) -> Lens {
    Lens {
        radius,
        focus,
        blades: 0,
        rotation: 0.0,
        ratio: 1.0,
    }
}

/// A camera at `eye` that looks at `target`, of a kind of the table; `vertical` as there.
pub fn look_at(kind: &'static str, eye: DVec3, target: DVec3, vertical: f64) -> CameraDesc {
    let up = if (target - eye).normalize().y.abs() < 0.9 {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let z = (eye - target).normalize();
    let x = up.cross(z).normalize();
    CameraDesc {
        name: "camera".into(),
        kind,
        world_from_camera: DAffine3::from_cols(x, z.cross(x), z, eye),
        vertical,
        aspect: Some(1.0),
        shift: [0.0; 2],
        lens: None,
    }
}

/// Adds the six sides of a box of half width `h` around the origin, fronts inward.
pub fn add_room(b: &mut SceneBuilder, material: MaterialId, h: f64) {
    for (name, axis, side) in [("x", 0, 1.0), ("y", 1, 1.0), ("z", 2, 1.0)]
        .into_iter()
        .flat_map(|(n, a, s)| [(n, a, s), (n, a, -s)])
    {
        let e = |k: usize| DVec3::AXES[(axis + k) % 3];
        // The cross product of the edges points to the origin.
        let (e1, e2) = if side > 0.0 {
            (e(2), e(1))
        } else {
            (e(1), e(2))
        };
        let corner = (e(0) * side - e(1) - e(2)) * h;
        add_quad(b, name, material, corner, e1 * (2.0 * h), e2 * (2.0 * h));
    }
}

/// Adds a polygon of `n` sides with the area of a disc of radius `r`; its front is toward the
/// unit vector `axis`.
pub fn add_disc(
    b: &mut SceneBuilder,
    name: &str,
    material: MaterialId,
    center: DVec3,
    axis: DVec3,
    r: f64,
) {
    const N: u32 = 128;
    let turn = std::f64::consts::TAU / f64::from(N);
    let r = r * (turn / turn.sin()).sqrt();
    let frame = Frame::from_normal(axis);
    let mut positions: Vec<[f32; 3]> = vec![center.as_vec3().into()];
    positions.extend((0..N).map(|i| {
        let (s, c) = (f64::from(i) * turn).sin_cos();
        <[f32; 3]>::from((center + (frame.x * c + frame.y * s) * r).as_vec3())
    }));
    let mesh = TriangleMesh {
        positions,
        indices: (0..N).map(|i| [0, 1 + i, 1 + (i + 1) % N]).collect(),
        ..Default::default()
    };
    let shape = b.add_mesh(mesh, name);
    place(b, name, shape, material);
}

/// A light without surface that shines white.
pub fn light(kind: &'static str, position: DVec3, direction: DVec3, strength: f64) -> LightDesc {
    LightDesc {
        kind,
        name: kind.into(),
        position,
        direction,
        strength: Rgb::splat(strength),
        ..Default::default()
    }
}

/// The paper's box: a diffuse, a mirror and a glass ball under a square lamp.
pub fn box_scene() -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.75))).unwrap();
    let red = b
        .add_material(&lambert("red", Rgb::new(0.75, 0.1, 0.1)))
        .unwrap();
    let green = b
        .add_material(&lambert("green", Rgb::new(0.1, 0.75, 0.1)))
        .unwrap();
    let light = b.add_material(&lamp(Rgb::splat(15.0))).unwrap();
    let mirror = b.add_material(&mirror()).unwrap();
    let glass = b.add_material(&glass(1.5)).unwrap();
    let v = DVec3::new;
    let (x, y, z) = (DVec3::X * 2.0, DVec3::Y * 2.0, DVec3::Z * 2.0);
    add_quad(&mut b, "floor", grey, v(-1.0, -1.0, -1.0), z, x);
    add_quad(&mut b, "ceiling", grey, v(-1.0, 1.0, -1.0), x, z);
    add_quad(&mut b, "back", grey, v(-1.0, -1.0, -1.0), x, y);
    add_quad(&mut b, "left", red, v(-1.0, -1.0, -1.0), y, z);
    add_quad(&mut b, "right", green, v(1.0, -1.0, -1.0), z, y);
    add_quad(
        &mut b,
        "lamp",
        light,
        v(-0.25, 0.998, -0.25),
        DVec3::X * 0.5,
        DVec3::Z * 0.5,
    );
    add_sphere(&mut b, "diffuse ball", grey, v(-0.6, -0.7, 0.1), 0.3);
    add_sphere(&mut b, "mirror ball", mirror, v(0.0, -0.7, -0.4), 0.3);
    add_sphere(&mut b, "glass ball", glass, v(0.6, -0.7, 0.3), 0.3);
    b.add_camera(camera(v(0.0, 0.0, 3.8), 39.3));
    b.finish().unwrap()
}
