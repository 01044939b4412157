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

#[test]
fn instances_share_one_shape() {
    let mut a = Asset::triangle();
    let t = a.floats("VEC3", &[0., 0., 0., 5., 0., 0., 0., 5., 0.]);
    let r = a.packed("VEC4", 5122, &[0, 0, 0, 0, 0, 0, 255, 127].repeat(3), 3);
    let s = a.floats("VEC3", &[1., 1., 1., 2., 2., 2., 1., 1., -1.]);
    a.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {
        "attributes": {"TRANSLATION": t, "ROTATION": r, "SCALE": s}}});
    a.json["nodes"][0]["translation"] = json!([0., 0., 1.]);
    a.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = a.read().unwrap();
    assert_eq!(scene.geometry.shapes.len(), 1);
    let placed: Vec<_> = scene
        .geometry
        .objects
        .iter()
        .map(|o| o.placement.unwrap())
        .collect();
    assert_eq!(placed.len(), 3);
    let to = |i: usize| placed[i].world_from_object.translation.to_array();
    assert_eq!(
        [to(0), to(1), to(2)],
        [[0., 0., 1.], [5., 0., 1.], [0., 5., 1.]]
    );
    assert!((placed[1].world_from_object.matrix3.determinant() - 8.0).abs() < 1e-6);
    // Lengths that differ, and none at all.
    let e = |a: &mut Asset, v| {
        a.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = v;
        a.error()
    };
    let short = a.floats("VEC3", &[0., 0., 0.]);
    let text = e(&mut a, json!({"TRANSLATION": t, "SCALE": short}));
    assert!(
        text.contains("different lengths") && text.contains("/nodes/0/extensions"),
        "{text}"
    );
    assert!(e(&mut a, json!({})).contains("no TRANSLATION"));
}

#[test]
fn equal_primitives_are_one_shape() {
    let mut a = Asset::triangle();
    let p = a.json["meshes"][0]["primitives"][0].clone();
    a.json["meshes"] = json!([{"primitives": [p.clone(), p.clone()]}, {"primitives": [p]}]);
    a.json["nodes"] = json!([{"mesh": 0, "children": [1]}, {"mesh": 1, "translation": [1, 0, 0]}]);
    let scene = a.read().unwrap();
    assert_eq!(
        (scene.geometry.shapes.len(), scene.geometry.objects.len()),
        (1, 3)
    );
}

#[test]
fn implicit_shapes_are_spheres() {
    let mut a = Asset::triangle();
    a.json["extensions"] = json!({"KHR_implicit_shapes": {"shapes": [
        {"type": "sphere", "sphere": {"radius": 2.0}}, {"type": "sphere"},
        {"type": "box", "box": {}}]}});
    a.json["extensionsRequired"] = json!(["KHR_implicit_shapes"]);
    let shape = |i: usize| json!({"KHR_implicit_shapes": {"shape": i}});
    // As a primitive, and as a node with and without a mesh.
    a.json["meshes"][0]["primitives"][0] = json!({"attributes": {}, "extensions": shape(0)});
    let scene = a.read().unwrap();
    assert_eq!(spheres(&scene).spheres, [[0., 0., 0., 2.]]);
    a.json["nodes"][0] = json!({"extensions": shape(1), "scale": [3.0, 3.0, 3.0]});
    assert_eq!(spheres(&a.read().unwrap()).spheres, [[0., 0., 0., 1.5]]);
    // Stretched, they stay analytic: an instance of a sphere.
    a.json["nodes"][0]["scale"] = json!([3.0, 1.0, 1.0]);
    let scene = a.read().unwrap();
    assert_eq!(spheres(&scene).spheres, [[0., 0., 0., 0.5]]);
    assert!(scene.geometry.objects[0].placement.is_some());
    a.json["nodes"][0]["extensions"] = shape(2);
    assert!(a.error().contains("holds no"));
    a.json["nodes"][0]["extensions"] = shape(9);
    assert!(
        a.error()
            .contains("/nodes/0/extensions/KHR_implicit_shapes/shape")
    );
}

/// A ray through each accelerator against the ellipsoid's own equation.
#[test]
fn ellipsoids_are_hit_where_they_are() {
    use dualight::accel::ACCELERATORS;
    use dualight::geometry::Ray;
    use dualight::math::DVec3;
    let mut a = Asset::triangle();
    let axes = DVec3::new(3.0, 1.0, 0.5);
    a.json["nodes"][0] = json!({
        "extras": {"sphere_radius": 1.0}, "scale": axes.to_array(), "translation": [1., 2., 3.]});
    let scene = a.read().unwrap();
    for entry in ACCELERATORS {
        let accel = (entry.build)(&scene.geometry, 1).unwrap();
        for i in 0..400 {
            let t = f64::from(i);
            let to = DVec3::new(
                (t * 0.7).cos() * 3.2,
                (t * 1.3).sin() * 1.1,
                (t * 2.1).sin() * 0.5,
            );
            let from = DVec3::new(4.0 * t.sin(), 5.0, 4.0 * t.cos());
            let ray = Ray::new(from + 1.0, to - from);
            // |(o + t d) / axes| = 1 about the centre.
            let (o, d) = (
                (ray.origin() - DVec3::new(1., 2., 3.)) / axes,
                ray.direction() / axes,
            );
            let (qa, qb, qc) = (d.dot(d), o.dot(d), o.dot(o) - 1.0);
            let disc = qb * qb - qa * qc;
            if disc.abs() < 1e-3 {
                continue;
            }
            let hit = accel.intersect(&ray);
            assert_eq!(hit.is_some(), disc > 0.0, "{}: ray {i}", entry.name);
            if let Some(hit) = hit {
                let sp = scene.surface_point(&ray, &hit);
                let expected = (-qb - disc.sqrt()) / qa * ray.direction().length();
                assert!(
                    (sp.distance - expected).abs() < 1e-6 * expected,
                    "{}",
                    entry.name
                );
                let n = ((sp.p - DVec3::new(1., 2., 3.)) / (axes * axes)).normalize();
                assert!((sp.ng - n).length() < 1e-6, "{}: {} {n}", entry.name, sp.ng);
            }
        }
    }
}

/// Nodes that mirror within nodes that mirror: the front stays the front, however often the
/// winding is turned (glTF 2.0, 3.7.4), for what is placed once and for what is shared.
#[test]
fn mirrors_within_mirrors_keep_the_front() {
    use dualight::accel::ACCELERATORS;
    use dualight::geometry::Ray;
    use dualight::math::{DAffine3, DQuat, DVec3};
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let mirrors = [[-1.0, 1.0, 1.0], [1.0, -2.0, 1.0], [-1.0, -1.0, -1.0]];
    for depth in 1..=3 {
        for copies in [1, 2] {
            let mut a = Asset::triangle();
            // The innermost node comes first and has the mesh; a copy lies farther out.
            let mut nodes: Vec<_> = (0..depth)
                .map(|k| {
                    json!({"scale": mirrors[k], "rotation": turn.to_array(),
                           "translation": [0.25, 0.5, -1.0]})
                })
                .collect();
            nodes[0]["mesh"] = json!(0);
            for (k, node) in nodes.iter_mut().enumerate().skip(1) {
                node["children"] = json!([k - 1]);
            }
            if copies == 2 {
                nodes.push(json!({"mesh": 0, "translation": [0.0, 0.0, 50.0]}));
                a.json["scenes"][0]["nodes"] = json!([depth - 1, depth]);
            } else {
                a.json["scenes"][0]["nodes"] = json!([depth - 1]);
            }
            a.json["nodes"] = json!(nodes);
            let scene = a.read().unwrap();
            let world = (0..depth).rev().fold(DAffine3::IDENTITY, |m, k| {
                m * DAffine3::from_scale_rotation_translation(
                    mirrors[k].into(),
                    turn,
                    DVec3::new(0.25, 0.5, -1.0),
                )
            });
            let at = |p: DVec3| world.transform_point3(p) - scene.center;
            let normal = (world.matrix3.inverse().transpose() * DVec3::Z).normalize();
            for entry in ACCELERATORS {
                let accel = (entry.build)(&scene.geometry, 1).unwrap();
                for side in [1.0, -1.0] {
                    let (from, to) = (DVec3::new(0.3, 0.2, side), DVec3::new(0.2, 0.3, 0.0));
                    let ray = Ray::new(at(from), at(to) - at(from));
                    let hit = accel.intersect(&ray).unwrap();
                    let sp = scene.surface_point(&ray, &hit);
                    assert_eq!(sp.front, side > 0.0, "{}, {depth} deep", entry.name);
                    assert!((sp.ng - normal).length() < 1e-6, "{} {normal}", sp.ng);
                }
            }
        }
    }
}

/// A shape that is placed often is in memory once, however it is hidden or squashed; and what is
/// placed once moves to the world without a copy.
#[test]
fn instances_share_one_shape_and_squashed_ones_cost_nothing() {
    let mut a = Asset::triangle();
    let scales = a.floats(
        "VEC3",
        &[
            [1., 1., 1.],
            [2., 1., 3.],
            [0., 0., 0.],
            [0., 1., 0.],
            [1., 1., 0.],
        ]
        .concat(),
    );
    a.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"SCALE": scales}}});
    let scene = a.read().unwrap();
    // Two instances, and the copy that is flat but has an area.
    assert_eq!(
        (scene.geometry.shapes.len(), scene.geometry.objects.len()),
        (2, 3)
    );
    assert!(scene.warnings[0].contains("1 without extent"));
    // A cloud of spheres that is placed twice stays one, too.
    let radius = a.floats("SCALAR", &[0.1, 0.2, 0.3]);
    a.json["meshes"][0]["primitives"][0]["mode"] = json!(0);
    a.attributes()["_RADIUS"] = json!(radius);
    let places = a.floats("VEC3", &[0., 0., 0., 4., 0., 0.]);
    a.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}});
    let scene = a.read().unwrap();
    assert_eq!(
        (scene.geometry.shapes.len(), scene.geometry.objects.len()),
        (1, 2)
    );
}
