//! Glass that says nothing of a volume: thin walls by the specification, solid where it comes from
//! Blender and encloses one.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use asset::Asset;
use dualight::geometry::ShapeId;
use dualight::import::{ImportOptions, SolidGlass};
use dualight::scene::Scene;
use serde_json::json;

/// A tetrahedron of glass beside an open triangle of the same.
fn glass(generator: &str) -> Asset {
    let mut a = Asset::triangle();
    let corners = [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.];
    let positions = a.floats("VEC3", &corners);
    let sides = a.shorts("SCALAR", &[0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);
    let body = json!({"primitives": [
        {"attributes": {"POSITION": positions}, "indices": sides, "material": 0}
    ]});
    a.json["asset"]["generator"] = json!(generator);
    a.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    a.json["meshes"].as_array_mut().unwrap().push(body);
    a.json["nodes"] = json!([{"mesh": 0}, {"mesh": 1}]);
    a.json["scenes"] = json!([{"nodes": [0, 1]}]);
    a.json["materials"] = json!([{
        "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}
    }]);
    a
}

/// Whether the open triangle and the body bend light, and whether the user is told.
fn solid(scene: &Scene) -> (bool, bool, bool) {
    let bends = |shape: u32| {
        let objects = &scene.geometry.objects;
        let object = objects.iter().find(|o| o.shape == ShapeId(shape)).unwrap();
        scene.material(object.material).traits().refracts
    };
    let told = scene.notes.iter().any(|n| n.contains("taken for solid"));
    (bends(0), bends(1), told)
}

#[test]
fn closed_glass_of_blender_is_solid_unless_told_otherwise() {
    let blender = "Khronos glTF Blender I/O v4.5.47";
    for (generator, policy, expected) in [
        (blender, SolidGlass::Auto, (false, true, true)),
        (blender, SolidGlass::Never, (false, false, false)),
        (blender, SolidGlass::Always, (true, true, true)),
        ("another", SolidGlass::Auto, (false, false, false)),
        ("another", SolidGlass::Always, (true, true, true)),
    ] {
        let options = ImportOptions {
            solid_glass: policy,
            ..Default::default()
        };
        let scene = glass(generator).read_with(&options).unwrap();
        assert_eq!(solid(&scene), expected, "{generator}, {policy:?}");
    }
}

#[test]
fn a_volume_that_the_file_gives_is_left_alone() {
    let mut a = glass("Khronos glTF Blender I/O v4.5.47");
    a.json["materials"][0]["extensions"]["KHR_materials_volume"] = json!({"thicknessFactor": 1});
    let scene = a.read().unwrap();
    assert_eq!(solid(&scene), (true, true, false));
}

#[test]
fn a_body_of_two_materials_is_judged_as_a_whole() {
    // The tetrahedron's last side is of another material: each part is open, both enclose a body.
    let mut a = glass("Khronos glTF Blender I/O v4.5.47");
    let three = a.shorts("SCALAR", &[0, 2, 1, 0, 1, 3, 0, 3, 2]);
    let last = a.shorts("SCALAR", &[1, 2, 3]);
    let whole = a.json["meshes"][1]["primitives"][0].clone();
    let (mut sides, mut lid) = (whole.clone(), whole);
    sides["indices"] = json!(three);
    lid["indices"] = json!(last);
    lid["material"] = json!(1);
    let metal = json!({"name": "metal"});
    a.json["materials"].as_array_mut().unwrap().push(metal);
    a.json["meshes"][1]["primitives"] = json!([sides, lid]);
    assert_eq!(solid(&a.read().unwrap()), (false, true, true));
    // Without its lid it is open.
    a.json["meshes"][1]["primitives"] = json!([sides]);
    assert_eq!(solid(&a.read().unwrap()), (false, false, false));
}

#[test]
fn glass_that_says_its_thickness_is_zero_stays_thin() {
    let mut a = glass("Khronos glTF Blender I/O v4.5.47");
    let volume = json!({"thicknessFactor": 0, "attenuationDistance": 2});
    a.json["materials"][0]["extensions"]["KHR_materials_volume"] = volume;
    for solid_glass in [SolidGlass::Auto, SolidGlass::Always] {
        let options = ImportOptions {
            solid_glass,
            ..Default::default()
        };
        let scene = a.read_with(&options).unwrap();
        assert_eq!(solid(&scene), (false, false, false));
    }
}
