//! Geometry as the importer reads it: attributes of every type, points, instances, shapes.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use asset::{Asset, spheres};
use serde_json::json;

#[test]
fn all_attributes_arrive() {
    let mut a = Asset::triangle();
    let normal = a.packed("VEC3", 5120, &[0, 0, 127, 0].repeat(3), 3);
    a.json["bufferViews"][1]["byteStride"] = json!(4);
    a.json["accessors"][normal]["normalized"] = json!(true);
    let uv0 = a.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
    let uv2 = a.shorts("VEC2", &[0, 65535, 0, 0, 65535, 0]);
    a.json["accessors"][uv2]["normalized"] = json!(true);
    let color = a.packed("VEC3", 5121, &[255, 0, 51, 0].repeat(3), 3);
    a.json["accessors"][color]["normalized"] = json!(true);
    a.json["bufferViews"][4]["byteStride"] = json!(4);
    let tangent = a.floats("VEC4", &[1., 0., 0., 1., 1., 0., 0., 1., 1., 0., 0., -1.]);
    *a.attributes() = json!({
        "POSITION": 0, "NORMAL": normal, "TEXCOORD_0": uv0, "TEXCOORD_2": uv2,
        "COLOR_0": color, "TANGENT": tangent,
    });
    let m = a.mesh();
    assert_eq!(m.normals, [[0., 0., 1.]; 3]);
    assert_eq!(m.uv_sets.len(), 3);
    assert_eq!(m.uv_sets[0], [[0., 0.], [1., 0.], [0., 1.]]);
    assert!(m.uv_sets[1].is_empty());
    assert_eq!(m.uv_sets[2], [[0., 1.], [0., 0.], [1., 0.]]);
    assert_eq!(m.tangents[2], [1., 0., 0., -1.]);
    assert_eq!(m.colors, [[1., 0., 0.2, 1.]; 3], "three are opaque");
}

#[test]
fn colors_of_every_type_agree() {
    for (component, kind, bytes) in [
        (5121, "VEC4", vec![255u8, 0, 51, 102]),
        (
            5123,
            "VEC4",
            [65535u16, 0, 13107, 26214]
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect(),
        ),
        (
            5126,
            "VEC4",
            [1.0f32, 0.0, 0.2, 0.4]
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect(),
        ),
    ] {
        let mut a = Asset::triangle();
        let c = a.packed(kind, component, &bytes.repeat(3), 3);
        a.json["accessors"][c]["normalized"] = json!(component != 5126);
        a.attributes()["COLOR_0"] = json!(c);
        for c in a.mesh().colors {
            for (x, y) in c.iter().zip([1.0, 0.0, 0.2, 0.4]) {
                assert!((x - y).abs() < 1e-7, "{component}: {c:?}");
            }
        }
    }
}

#[test]
fn attributes_of_other_lengths_or_types_are_refused_with_their_place() {
    for (name, kind, values, what) in [
        (
            "NORMAL",
            "VEC3",
            &[0., 0., 1.][..],
            "1 elements for 3 positions",
        ),
        ("COLOR_0", "VEC2", &[0.; 6][..], "is VEC2, VEC4 is needed"),
        ("TEXCOORD_1", "VEC2", &[f32::NAN; 6][..], "element 0"),
        ("TANGENT", "VEC4", &[f32::INFINITY; 12][..], "element 0"),
    ] {
        let mut a = Asset::triangle();
        let at = a.floats(kind, values);
        a.attributes()[name] = json!(at);
        let e = a.error();
        let place = format!("/meshes/0/primitives/0/attributes/{name}");
        assert!(e.contains(what) && e.contains(&place), "{name}: {e}");
    }
}

#[test]
fn points_with_a_radius_are_spheres() {
    let mut a = Asset::triangle();
    let radius = a.floats("SCALAR", &[0.1, 0.2, 0.3]);
    a.json["meshes"][0]["primitives"][0]["mode"] = json!(0);
    a.attributes()["_RADIUS"] = json!(radius);
    a.json["nodes"][0]["scale"] = json!([2., 2., 2.]);
    let s = spheres(&a.read().unwrap());
    assert_eq!(
        s.spheres,
        [[0., 0., 0., 0.2], [2., 0., 0., 0.4], [0., 2., 0., 0.6]]
    );
    // An index that comes twice makes one sphere.
    let order = a.shorts("SCALAR", &[2, 2, 0]);
    a.json["meshes"][0]["primitives"][0]["indices"] = json!(order);
    assert_eq!(spheres(&a.read().unwrap()).spheres.len(), 2);
    // Without a radius there is nothing to hit.
    a.attributes().as_object_mut().unwrap().remove("_RADIUS");
    assert!(a.error().contains("holds no geometry"));
}

#[test]
fn empty_accessors_are_nothing_and_hurt_nobody() {
    let mut a = Asset::triangle();
    let none = a.accessor(json!({"componentType": 5126, "type": "VEC3", "count": 0}));
    let primitives = a.json["meshes"][0]["primitives"].as_array_mut().unwrap();
    primitives.push(json!({"attributes": {"POSITION": none}}));
    primitives.push(json!({"attributes": {"POSITION": 0}, "indices": 2}));
    a.accessor(json!({"componentType": 5123, "type": "SCALAR", "count": 0}));
    assert_eq!(a.read().unwrap().geometry.objects.len(), 1);
}

#[test]
fn only_the_vertices_that_are_used_are_read() {
    let mut a = Asset::new();
    let many: Vec<f32> = (0..3000).map(|i| i as f32).collect();
    let p = a.floats("VEC3", &many);
    let uv = a.floats("VEC2", &many[..2000]);
    let order = a.shorts("SCALAR", &[500, 2, 4, 4, 2, 7]);
    a.json["meshes"][0]["primitives"] =
        json!([{"attributes": {"POSITION": p, "TEXCOORD_0": uv}, "indices": order}]);
    // Points on a line have no area: bend one.
    a.bytes[4 * 1500..4 * 1500 + 4].copy_from_slice(&0.5f32.to_le_bytes());
    a.bytes[4 * 21..4 * 21 + 4].copy_from_slice(&0.5f32.to_le_bytes());
    let m = a.mesh();
    assert_eq!(m.positions.len(), 4);
    assert_eq!(m.indices, [[3, 0, 1], [1, 0, 2]]);
    assert_eq!(
        m.uv_sets[0],
        [[4., 5.], [8., 9.], [14., 15.], [1000., 1001.]]
    );
    assert_eq!(m.positions[3], [0.5, 1501., 1502.]);
}

#[test]
fn overlapping_strides_and_wild_counts_are_refused() {
    let mut a = Asset::triangle();
    a.json["bufferViews"][0]["byteStride"] = json!(4);
    let e = a.error();
    assert!(e.contains("/accessors/0") && e.contains("overlap"), "{e}");
    // Nothing behind it: zeros, but not gigabytes of them.
    let mut a = Asset::triangle();
    a.json["accessors"][0] = json!({"componentType": 5126, "type": "VEC3", "count": 1 << 30});
    let e = a.error();
    assert!(
        e.contains("/accessors/0") && e.contains("proportion"),
        "{e}"
    );
    // Many primitives that share a large array do not copy it.
    let mut a = Asset::new();
    let p = a.floats("VEC3", &vec![0.5; 300_000]);
    let mut list = Vec::new();
    for i in 0..500 {
        let order = a.shorts("SCALAR", &[i, i + 1, i + 2]);
        list.push(json!({"attributes": {"POSITION": p}, "indices": order}));
    }
    a.json["meshes"][0]["primitives"] = json!(list);
    assert!(a.error().contains("no triangle"));
}

#[test]
fn a_glb_is_read_as_its_text_is() {
    let a = Asset::triangle();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.glb");
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        dualight::import::load(&path, &Default::default(), Default::default())
    };
    let glb = a.glb();
    assert_eq!(
        asset::mesh(&read(&glb).unwrap()).positions,
        a.mesh().positions
    );
    for (change, code, what) in [
        ((4, 1u8), 3, "glTF 1"),
        ((8, 255), 1, "truncated"),
        ((13, 255), 1, "claims"),
        ((16, b'X'), 1, "first chunk"),
    ] {
        let mut bytes = glb.clone();
        let (at, value): (usize, u8) = change;
        bytes[at] = value;
        let e = read(&bytes).err().unwrap();
        assert!(e.to_string().contains(what), "{e}");
        assert_eq!(e.exit_code(), code);
    }
}
