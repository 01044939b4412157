//! Scenes made in code, for tests.
#![allow(dead_code, reason = "each test binary uses its own part")]

use dualight::cameras::CameraDesc;
use dualight::color::Rgb;
use dualight::geometry::{MaterialId, SphereSet, TriangleMesh};
use dualight::materials::MaterialDesc;
use dualight::math::{DAffine3, DVec3};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};

/// A Lambert surface.
pub(crate) fn lambert(name: &str, albedo: Rgb) -> MaterialDesc {
    MaterialDesc {
        name: name.into(),
        base_color: albedo,
        metallic: 0.0,
        specular: 0.0,
        ..Default::default()
    }
}

/// A perfect mirror.
pub(crate) fn mirror() -> MaterialDesc {
    MaterialDesc {
        name: "mirror".into(),
        roughness: 0.0,
        ..Default::default()
    }
}

/// Clear solid glass.
pub(crate) fn glass(ior: f64) -> MaterialDesc {
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
pub(crate) fn lamp(radiance: Rgb) -> MaterialDesc {
    MaterialDesc {
        emission: radiance,
        ..lambert("lamp", Rgb::ZERO)
    }
}

/// Adds a parallelogram; its front is where `e1 × e2` points.
pub(crate) fn add_quad(
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
pub(crate) fn add_sphere(b: &mut SceneBuilder, name: &str, material: MaterialId, c: DVec3, r: f64) {
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
pub(crate) fn camera(eye: DVec3, yfov_degrees: f64) -> CameraDesc {
    CameraDesc {
        name: "camera".into(),
        kind: "perspective",
        world_from_camera: DAffine3::from_translation(eye),
        vertical: yfov_degrees.to_radians(),
        aspect: Some(1.0),
    }
}

/// The paper's box: a diffuse, a mirror and a glass ball under a square lamp.
pub(crate) fn box_scene() -> Scene {
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
