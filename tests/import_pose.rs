//! What moves: animations, morph targets, skins; and what a choice shows or hides.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use asset::{Asset, mesh};
use dualight::import::ImportOptions;
use dualight::math::{DQuat, DVec3, Vec3};
use dualight::scene::Scene;
use serde_json::{Value, json};

fn at(time: f64) -> ImportOptions {
    ImportOptions {
        time: Some(time),
        ..Default::default()
    }
}

/// The first corner of a scene's mesh, in the file's coordinates.
fn corner(scene: &Scene) -> DVec3 {
    Vec3::from(mesh(scene).positions[0]).as_dvec3() + scene.center
}

fn close(a: DVec3, b: DVec3) {
    assert!((a - b).length() < 1e-5, "{a} is not {b}");
}

/// A triangle whose node is moved by one channel.
fn animated(path: &str, kind: &str, times: &[f32], values: &[f32], how: &str) -> Asset {
    let mut a = Asset::triangle();
    let input = a.floats("SCALAR", times);
    let output = a.floats(kind, values);
    a.json["animations"] = json!([{
        "name": "move",
        "samplers": [{"input": input, "output": output, "interpolation": how}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": path}}],
    }]);
    a
}

#[test]
fn nodes_move_as_their_keys_say() {
    let times = [1.0, 3.0];
    let a = animated(
        "translation",
        "VEC3",
        &times,
        &[0., 0., 0., 4., 2., 0.],
        "LINEAR",
    );
    for (t, x) in [(0.0, 0.0), (1.0, 0.0), (1.5, 1.0), (3.0, 4.0), (99.0, 4.0)] {
        close(
            corner(&a.read_with(&at(t)).unwrap()),
            DVec3::new(x, x / 2.0, 0.0),
        );
    }
    assert!(
        corner(&a.read().unwrap()).length() < 1e-9,
        "at rest without a time"
    );
    let a = animated(
        "translation",
        "VEC3",
        &times,
        &[0., 0., 0., 4., 2., 0.],
        "STEP",
    );
    close(corner(&a.read_with(&at(2.9)).unwrap()), DVec3::ZERO);
    close(
        corner(&a.read_with(&at(3.0)).unwrap()),
        DVec3::new(4.0, 2.0, 0.0),
    );
    // x = t³ between 1 and 3, by values and slopes.
    let values = [
        0., 0., 0., 1., 0., 0., 3., 0., 0., 27., 0., 0., 27., 0., 0., 0., 0., 0.,
    ];
    let a = animated("translation", "VEC3", &times, &values, "CUBICSPLINE");
    for t in [1.0f64, 2.0, 2.5, 3.0] {
        close(corner(&a.read_with(&at(t)).unwrap()), DVec3::X * t.powi(3));
    }
    let a = animated("scale", "VEC3", &times, &[1., 1., 1., 3., 1., 1.], "LINEAR");
    let m = mesh(&a.read_with(&at(2.0)).unwrap());
    assert_eq!(m.positions[1], [2.0, 0.0, 0.0]);
}

#[test]
fn rotations_take_the_shorter_way_at_an_even_pace() {
    let end = DQuat::from_rotation_z(1.2);
    let q: [f64; 4] = (-end).into();
    let mut values = vec![0., 0., 0., 1.];
    values.extend(q.map(|x| x as f32));
    let a = animated("rotation", "VEC4", &[0.0, 1.0], &values, "LINEAR");
    for t in [0.0, 0.3, 0.5, 1.0] {
        let m = mesh(&a.read_with(&at(t)).unwrap());
        let expected = DQuat::from_rotation_z(1.2 * t) * DVec3::X;
        close(Vec3::from(m.positions[1]).as_dvec3(), expected);
    }
    // Normalised integers are the same rotation.
    let mut b = animated("rotation", "VEC4", &[0.0], &[0., 0., 0., 1.], "LINEAR");
    let bytes: Vec<u8> = q
        .iter()
        .flat_map(|x| ((x * 32767.0).round() as i16).to_le_bytes())
        .collect();
    let output = b.packed("VEC4", 5122, &bytes, 1);
    b.json["accessors"][output]["normalized"] = json!(true);
    b.json["animations"][0]["samplers"][0]["output"] = json!(output);
    let m = mesh(&b.read_with(&at(0.0)).unwrap());
    assert!((Vec3::from(m.positions[1]).as_dvec3() - end * DVec3::X).length() < 1e-4);
}

#[test]
fn one_animation_can_be_chosen() {
    let mut a = animated("translation", "VEC3", &[0.0], &[1., 0., 0.], "STEP");
    let other = a.floats("VEC3", &[0., 5., 0.]);
    let mut second = a.json["animations"][0].clone();
    second["name"] = json!("jump");
    second["samplers"][0]["output"] = json!(other);
    a.json["animations"].as_array_mut().unwrap().push(second);
    let scene = a.read_with(&at(0.0)).unwrap();
    close(corner(&scene), DVec3::X);
    assert!(
        scene.warnings[0].contains("--animation"),
        "{:?}",
        scene.warnings
    );
    let jump = ImportOptions {
        animation: Some("jump".into()),
        ..at(0.0)
    };
    close(corner(&a.read_with(&jump).unwrap()), DVec3::Y * 5.0);
    let none = ImportOptions {
        animation: Some("fly".into()),
        ..at(0.0)
    };
    let e = a.read_with(&none).err().unwrap().to_string();
    assert!(e.contains("'fly'") && e.contains("move, jump"), "{e}");
}

/// A triangle with two morph targets.
fn morphed() -> Asset {
    let mut a = Asset::triangle();
    let normal = a.floats("VEC3", &[0., 0., 1.].repeat(3));
    let tangent = a.floats("VEC4", &[1., 0., 0., -1.].repeat(3));
    let uv = a.floats("VEC2", &[0.0; 6]);
    let color = a.floats("VEC4", &[0.5, 0.5, 0.5, 1.0].repeat(3));
    *a.attributes() = json!({
        "POSITION": 0, "NORMAL": normal, "TANGENT": tangent, "TEXCOORD_0": uv, "COLOR_0": color,
    });
    let up = a.floats("VEC3", &[0., 0., 1.].repeat(3));
    let lean = a.floats("VEC3", &[1., 0., 0.].repeat(3));
    let turn = a.floats("VEC3", &[0., 1., 0.].repeat(3));
    let slide = a.floats("VEC2", &[0.25; 6]);
    let redden = a.floats("VEC4", &[1.0, -0.25, 0.0, -0.5].repeat(3));
    a.json["meshes"][0]["primitives"][0]["targets"] = json!([
        {"POSITION": up},
        {"NORMAL": lean, "TANGENT": turn, "TEXCOORD_0": slide, "COLOR_0": redden},
    ]);
    a
}

#[test]
fn morph_targets_displace_every_attribute() {
    let mut a = morphed();
    assert_eq!(a.mesh().positions[0], [0., 0., 0.], "no weights, no change");
    a.json["meshes"][0]["weights"] = json!([2.0, 1.0]);
    let m = a.mesh();
    close(corner(&a.read().unwrap()), DVec3::Z * 2.0);
    let r = 0.5f32.sqrt();
    for (x, y) in m.normals[0].iter().zip([r, 0.0, r]) {
        assert!((x - y).abs() < 1e-6, "{:?}", m.normals);
    }
    for (x, y) in m.tangents[0].iter().zip([r, r, 0.0, -1.0]) {
        assert!((x - y).abs() < 1e-6, "{:?}", m.tangents);
    }
    assert_eq!(m.uv_sets[0][0], [0.25, 0.25]);
    assert_eq!(m.colors[0], [1.0, 0.25, 0.5, 0.5], "and stay colours");
    // The node's weights go before the mesh's, an animation's before both.
    a.json["nodes"][0]["weights"] = json!([3.0, 0.0]);
    close(corner(&a.read().unwrap()), DVec3::Z * 3.0);
    let input = a.floats("SCALAR", &[0.0, 1.0]);
    let output = a.floats("SCALAR", &[0.0, 0.0, 8.0, 1.0]);
    a.json["animations"] = json!([{
        "samplers": [{"input": input, "output": output}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
    }]);
    let scene = a.read_with(&at(0.25)).unwrap();
    close(corner(&scene), DVec3::Z * 2.0);
    assert_eq!(mesh(&scene).uv_sets[0][0], [0.0625; 2]);
    // Equal weights share a shape.
    let mut a = morphed();
    a.json["nodes"] = json!([
        {"mesh": 0}, {"mesh": 0, "weights": [0.0, 0.0]}, {"mesh": 0, "weights": [1.0, 0.0]},
        {"mesh": 0, "weights": [1.0]},
    ]);
    a.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    let scene = a.read().unwrap();
    assert_eq!(
        (scene.geometry.shapes.len(), scene.geometry.objects.len()),
        (2, 4)
    );
}

/// A triangle that two joints hold: the first corner by the first, the others by the second.
fn skinned() -> Asset {
    let mut a = Asset::triangle();
    let normal = a.floats("VEC3", &[0., 0., 1.].repeat(3));
    let joints = a.packed("VEC4", 5121, &[0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0], 3);
    let weights = a.floats("VEC4", &[1., 0., 0., 0., 0., 1., 0., 0., 1., 0., 0., 0.]);
    *a.attributes() = json!({
        "POSITION": 0, "NORMAL": normal, "JOINTS_0": joints, "WEIGHTS_0": weights,
    });
    // The second joint stands at x = 1 and was bound there.
    let mut inverse = vec![0f32; 32];
    for k in [0, 5, 10, 15, 16, 21, 26, 31] {
        inverse[k] = 1.0;
    }
    inverse[16 + 12] = -1.0;
    let inverse = a.floats("MAT4", &inverse);
    a.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [7.0, 7.0, 7.0]},
        {"children": [2]},
        {"translation": [1.0, 0.0, 0.0]},
    ]);
    a.json["scenes"][0]["nodes"] = json!([0, 1]);
    a.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": inverse}]);
    a
}

fn corners(scene: &Scene) -> Vec<DVec3> {
    let m = mesh(scene);
    let world = |p: &[f32; 3]| Vec3::from(*p).as_dvec3() + scene.center;
    m.positions.iter().map(world).collect()
}

#[test]
fn joints_carry_their_vertices() {
    // Bound as it stands: the node's own place does not count.
    let a = skinned();
    for (p, q) in corners(&a.read().unwrap())
        .into_iter()
        .zip([DVec3::ZERO, DVec3::X, DVec3::Y])
    {
        close(p, q);
    }
    // The second joint turns about itself, by a quarter about y.
    let mut a = skinned();
    a.json["nodes"][2]["rotation"] = json!([0.0, 0.5f64.sqrt(), 0.0, 0.5f64.sqrt()]);
    let scene = a.read().unwrap();
    let found = corners(&scene);
    close(found[0], DVec3::ZERO);
    close(found[1], DVec3::X);
    close(found[2], DVec3::new(1.0, 1.0, 1.0));
    close(Vec3::from(mesh(&scene).normals[1]).as_dvec3(), DVec3::X);
    // A root far away keeps the digits.
    a.json["nodes"][1]["translation"] = json!([1e7, 0.0, 0.0]);
    let far = corners(&a.read().unwrap());
    for (p, q) in far.into_iter().zip(found) {
        close(p, q + DVec3::X * 1e7);
    }
    // A second set shares the last corner between both, with weights that sum to 4.
    let mut a = skinned();
    a.json["nodes"][2]["translation"] = json!([1.0, 0.0, 3.0]);
    let joints = a.packed("VEC4", 5121, &[0; 12], 3);
    let weights = a.floats("VEC4", &[0., 0., 0., 0., 0., 0., 0., 0., 1., 1., 1., 0.]);
    a.attributes()["JOINTS_1"] = json!(joints);
    a.attributes()["WEIGHTS_1"] = json!(weights);
    close(corners(&a.read().unwrap())[2], DVec3::new(0.0, 1.0, 0.75));
}

#[test]
fn mirrored_joints_turn_triangles_over() {
    let mut a = skinned();
    a.json["nodes"][1]["scale"] = json!([-1.0, 1.0, 1.0]);
    let scene = a.read().unwrap();
    let m = mesh(&scene);
    assert_eq!(m.indices, [[0, 2, 1]]);
    close(Vec3::from(m.normals[0]).as_dvec3(), DVec3::Z);
}

#[test]
fn what_moves_wrongly_is_refused_with_its_place() {
    type Change = fn(&mut Asset);
    let animation = || animated("translation", "VEC3", &[0., 1.], &[0.; 6], "LINEAR");
    let cases: &[(&str, &str, Asset, Change)] = &[
        (
            "/animations/0/samplers/0/output",
            "1 elements for 2 keys",
            animation(),
            |a| {
                let one = a.floats("VEC3", &[0.; 3]);
                a.json["animations"][0]["samplers"][0]["output"] = json!(one);
            },
        ),
        (
            "/animations/0/samplers/0/input",
            "ascend",
            animation(),
            |a| {
                let back = a.floats("SCALAR", &[1., 0.]);
                a.json["animations"][0]["samplers"][0]["input"] = json!(back);
            },
        ),
        (
            "/animations/0/samplers/0/input",
            "no key",
            animation(),
            |a| {
                let none = a.accessor(json!({"componentType": 5126, "type": "SCALAR", "count": 0}));
                a.json["animations"][0]["samplers"][0]["input"] = json!(none);
            },
        ),
        (
            "/animations/0/samplers/0/interpolation",
            "'CUBIC'",
            animation(),
            |a| {
                a.json["animations"][0]["samplers"][0]["interpolation"] = json!("CUBIC");
            },
        ),
        (
            "/animations/0/channels/0/target/path",
            "'colour'",
            animation(),
            |a| {
                a.json["animations"][0]["channels"][0]["target"]["path"] = json!("colour");
            },
        ),
        (
            "/animations/0/channels/0/target/path",
            "matrix",
            animation(),
            |a| {
                let one = [
                    1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.,
                ];
                a.json["nodes"][0]["matrix"] = json!(one);
            },
        ),
        (
            "/animations/0/channels/0/target/node",
            "/nodes/9",
            animation(),
            |a| a.json["animations"][0]["channels"][0]["target"]["node"] = json!(9),
        ),
        (
            "/animations/0/channels/0/sampler",
            "does not exist",
            animation(),
            |a| a.json["animations"][0]["channels"][0]["sampler"] = json!(3),
        ),
        ("JOINTS_0", "joint 1 is out of range", skinned(), |a| {
            a.json["skins"][0] = json!({"joints": [1]});
        }),
        (
            "/skins/0/inverseBindMatrices",
            "2 matrices for 3 joints",
            skinned(),
            |a| a.json["skins"][0]["joints"] = json!([1, 2, 0]),
        ),
        ("/skins/0/joints/1", "/nodes/77", skinned(), |a| {
            a.json["skins"][0]["joints"] = json!([1, 77]);
        }),
        ("/skins/0/joints/0", "cycle", skinned(), |a| {
            let nodes = a.json["nodes"].as_array_mut().unwrap();
            nodes.extend([json!({"children": [4]}), json!({"children": [3]})]);
            a.json["skins"][0]["joints"] = json!([3, 4]);
        }),
        (
            "/meshes/0/primitives/0/attributes/JOINTS_0",
            "WEIGHTS_0",
            skinned(),
            |a| {
                a.attributes().as_object_mut().unwrap().remove("WEIGHTS_0");
            },
        ),
        (
            "/meshes/0/primitives/0/targets/0/POSITION",
            "1 elements for 3",
            morphed(),
            |a| {
                let one = a.floats("VEC3", &[0.; 3]);
                a.json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = json!(one);
                a.json["meshes"][0]["weights"] = json!([1.0]);
            },
        ),
    ];
    for (place, what, asset, change) in cases {
        let mut a = asset.clone();
        change(&mut a);
        let e = match a.read_with(&at(0.5)) {
            Ok(_) => panic!("{place} {what}: was read"),
            Err(e) => e.to_string(),
        };
        assert!(e.contains(place) && e.contains(what), "{place} {what}: {e}");
    }
}

#[test]
fn hidden_nodes_hide_what_is_below_but_see() {
    let mut a = Asset::triangle();
    let hidden = json!({"KHR_node_visibility": {"visible": false}});
    a.json["extensionsUsed"] = json!(["KHR_node_visibility", "KHR_lights_punctual"]);
    a.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    a.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0}}]);
    a.json["nodes"] = json!([
        {"mesh": 0},
        {"children": [2], "extensions": hidden},
        {"mesh": 0, "camera": 0, "extensions": {
            "KHR_lights_punctual": {"light": 0},
            "KHR_node_visibility": {"visible": true},
        }},
    ]);
    a.json["scenes"][0]["nodes"] = json!([0, 1]);
    let scene = a.read().unwrap();
    assert_eq!(
        (
            scene.geometry.objects.len(),
            scene.lights.len(),
            scene.cameras.len()
        ),
        (1, 0, 1)
    );
}

#[test]
fn variants_change_materials() {
    let mut a = Asset::triangle();
    a.json["materials"] = json!([{"name": "red"}, {"name": "green"}, {"name": "blue"}]);
    a.json["extensions"] = json!({"KHR_materials_variants": {
        "variants": [{"name": "spring"}, {"name": "autumn"}, {"name": "winter"}],
    }});
    let p = &mut a.json["meshes"][0]["primitives"][0];
    p["material"] = json!(0);
    p["extensions"] = json!({"KHR_materials_variants": {"mappings": [
        {"material": 1, "variants": [0]}, {"material": 2, "variants": [1]},
    ]}});
    let shown = |name: Option<&str>| {
        let options = ImportOptions {
            variant: name.map(str::to_owned),
            ..Default::default()
        };
        let scene = a.read_with(&options).map_err(|e| e.to_string())?;
        let material = scene.geometry.objects[0].material;
        Ok::<_, String>(scene.material_names[material.index()].clone())
    };
    assert_eq!(shown(None).unwrap(), "red");
    assert_eq!(shown(Some("spring")).unwrap(), "green");
    assert_eq!(shown(Some("autumn")).unwrap(), "blue");
    assert_eq!(shown(Some("winter")).unwrap(), "red", "not mapped");
    let e = shown(Some("summer")).unwrap_err();
    assert!(e.contains("spring, autumn, winter"), "{e}");
}

/// Blender's tentacle with four bones, its ball with a shape key, its spinning cube: they move,
/// and nothing of the file is left out.
#[test]
fn blenders_animations_move_everything() {
    let path =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets/blender/anim.glb");
    if !path.exists() {
        eprintln!("skipped: {} is not there", path.display());
        return;
    }
    let read = |options: &ImportOptions| {
        let scene = dualight::import::load(&path, options, Default::default()).unwrap();
        assert_eq!(scene.warnings, Vec::<String>::new());
        scene
    };
    let (rest, first, later) = (
        read(&ImportOptions::default()),
        read(&at(1.0 / 24.0)),
        read(&at(0.6)),
    );
    let bounds = |scene: &Scene, name: &str| {
        let i = scene
            .geometry
            .objects
            .iter()
            .position(|o| &*o.name == name)
            .unwrap();
        let b = scene
            .geometry
            .object_bounds(dualight::geometry::ObjectId(i as u32));
        (b.min + scene.center, b.max + scene.center)
    };
    for name in ["Tentacle", "MorphBall", "SpinCube"] {
        let (a, b) = (bounds(&first, name), bounds(&later, name));
        let moved = (a.0 - b.0).length() + (a.1 - b.1).length();
        assert!(moved > 1e-3, "{name} does not move");
    }
    assert_eq!(bounds(&rest, "Floor"), bounds(&later, "Floor"));
    let eye = |s: &Scene| s.cameras[0].world_from_camera.translation + s.center;
    assert!((eye(&first) - eye(&later)).length() > 1e-3);
    let only: Value = json!("SpinCubeAction");
    let cube = read(&ImportOptions {
        animation: only.as_str().map(str::to_owned),
        ..at(0.6)
    });
    assert_eq!(bounds(&cube, "Tentacle"), bounds(&rest, "Tentacle"));
    assert_eq!(bounds(&cube, "SpinCube"), bounds(&later, "SpinCube"));
}
