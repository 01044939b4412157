//! The importer: the box is exactly what its description says, and a broken file gives one error
//! that names the place in it.

use std::fs;
use std::path::{Path, PathBuf};

use dualight::error::Error;
use dualight::geometry::Shape;
use dualight::import::{ImportOptions, load};
use dualight::math::DVec3;
use dualight::sampling::Rng;
use dualight::scene::{Census, Scene, ScenePlugins};
use serde_json::{Value, json};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn read(path: &Path) -> Result<Scene, Error> {
    load(path, &ImportOptions::default(), ScenePlugins::default())
}

#[test]
fn the_box_is_the_papers() {
    let scene = read(&file("scenes/box.gltf")).unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
    let census = Census::new(&scene);
    assert_eq!(
        (census.placed_triangles, census.spheres, census.objects),
        (12, 3, 9)
    );
    let mut spheres: Vec<[f32; 4]> = scene
        .geometry
        .shapes
        .iter()
        .filter_map(|s| match s {
            Shape::Spheres(s) => Some(s.spheres.clone()),
            Shape::Mesh(_) => None,
        })
        .flatten()
        .collect();
    spheres.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let expected = [
        [-0.6, -0.7, 0.1, 0.3],
        [0.0, -0.7, -0.4, 0.3],
        [0.6, -0.7, 0.3, 0.3f32],
    ];
    for (s, e) in spheres.iter().zip(expected) {
        for (a, b) in s.iter().zip(e) {
            assert!((a - b).abs() < 1e-6, "{spheres:?}");
        }
    }
    // One lamp of 0.5 × 0.5 m and radiance 15: Φ = π L A.
    assert_eq!(scene.lights.len(), 1);
    let flux = scene.flux();
    assert!(
        (flux.r / (std::f64::consts::PI * 15.0 * 0.25) - 1.0).abs() < 1e-6,
        "{flux:?}"
    );
    let camera = &scene.cameras[0];
    assert!((camera.vertical.to_degrees() - 39.3).abs() < 1e-9);
    assert!((camera.world_from_camera.translation - DVec3::new(0.0, 0.0, 3.8)).length() < 1e-12);
    assert!(scene.center.length() < 1e-12 && (scene.bounds.max - 1.0).length() < 1e-6);
}

#[test]
fn the_box_of_triangles_has_the_same_lamp_and_many_triangles() {
    let scene = read(&file("scenes/box_mesh.glb")).unwrap();
    let census = Census::new(&scene);
    assert!(
        census.placed_triangles > 150_000 && census.spheres == 0,
        "{census:?}"
    );
    assert_eq!(scene.lights.len(), 1);
}

/// A triangle that is valid, to be broken by `change`.
fn triangle(change: impl FnOnce(&mut Value)) -> Value {
    let mut v = json!({
        "asset": {"version": "2.0"}, "scene": 0,
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR"}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 3}],
        // (0 0 0) (1 0 0) (0 1 0), then 0 1 2.
        "buffers": [{"byteLength": 39, "uri": "data:application/octet-stream;base64,\
            AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAEC"}],
    });
    change(&mut v);
    v
}

fn written(text: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.gltf");
    fs::write(&path, text).unwrap();
    (dir, path)
}

#[test]
fn broken_files_are_refused_with_their_place() {
    let good = triangle(|_| ());
    let (_dir, path) = written(good.to_string().as_bytes());
    let scene = read(&path).unwrap();
    assert!(
        scene.cameras.is_empty() && scene.lights.is_empty(),
        "no camera, no light: still a scene"
    );

    type Change = fn(&mut Value);
    let cases: &[(&str, u8, Change)] = &[
        ("/accessors/0", 1, |v| v["accessors"][0]["count"] = json!(4)),
        ("/accessors/0", 1, |v| {
            v["accessors"][0]["count"] = json!(u64::MAX)
        }),
        ("/accessors/0", 1, |v| {
            v["accessors"][0]["byteOffset"] = json!(1_000_000)
        }),
        ("/accessors/0/componentType", 1, |v| {
            v["accessors"][0]["componentType"] = json!(1)
        }),
        ("/accessors/0/type", 1, |v| {
            v["accessors"][0]["type"] = json!("VEC2")
        }),
        ("/accessors/1", 1, |v| {
            v["accessors"][1]["count"] = json!(-1)
        }),
        ("/bufferViews/0", 1, |v| {
            v["bufferViews"][0]["byteLength"] = json!(99)
        }),
        ("/bufferViews/9", 1, |v| {
            v["accessors"][0]["bufferView"] = json!(9)
        }),
        ("/bufferViews/0/buffer", 1, |v| {
            v["bufferViews"][0]["buffer"] = json!(7)
        }),
        ("/buffers/0", 1, |v| {
            v["buffers"][0]["byteLength"] = json!(400)
        }),
        ("/buffers/0/uri", 1, |v| {
            v["buffers"][0]["uri"] = json!("missing.bin")
        }),
        ("/buffers/0/uri", 1, |v| {
            v["buffers"][0]["uri"] = json!("data:;base64,***")
        }),
        ("/buffers/0", 1, |v| {
            v["buffers"][0] = json!({"byteLength": 39})
        }),
        ("/meshes/3", 1, |v| v["nodes"][0]["mesh"] = json!(3)),
        ("/meshes/0/primitives/0", 1, |v| {
            v["buffers"][0]["uri"] = json!(
                "data:;base64,\
                AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAEJ"
            );
        }),
        ("/meshes/0/primitives/0/material", 1, |v| {
            v["meshes"][0]["primitives"][0]["material"] = json!(2);
        }),
        ("/nodes/0/children/0", 1, |v| {
            v["nodes"][0]["children"] = json!([0])
        }),
        ("/nodes/5", 1, |v| v["scenes"][0]["nodes"] = json!([5])),
        ("/nodes/0/translation", 1, |v| {
            v["nodes"][0]["translation"] = json!([1.0])
        }),
        ("/nodes/0/extras/sphere_radius", 1, |v| {
            v["nodes"][0]["extras"] = json!({"sphere_radius": -1.0});
        }),
        ("/scene", 1, |v| v["scene"] = json!(4)),
        ("the scene", 1, |v| v["scenes"][0]["nodes"] = json!([])),
        ("/meshes/0/primitives/0/attributes/POSITION", 1, |v| {
            v["buffers"][0]["uri"] = json!(
                "data:;base64,\
                AAAAAAAAAAAAAAAAAADAfwAAAAAAAAAAAAAAAAAAgD8AAAAAAAEC"
            );
        }),
        ("/asset/version", 3, |v| {
            v["asset"]["version"] = json!("1.0")
        }),
        ("the document", 1, |v| *v = json!({})),
        ("/extensionsRequired/0", 3, |v| {
            v["extensionsRequired"] = json!(["EXT_something"])
        }),
        ("/materials/0", 2, |v| {
            v["materials"] = json!([{"extras": {"dualight_material": "no such kind"}}]);
        }),
        ("/cameras/0/type", 1, |v| {
            v["cameras"] = json!([{"type": "fisheye"}]);
            v["nodes"][0]["camera"] = json!(0);
        }),
        ("/cameras/0/perspective/yfov", 1, |v| {
            v["cameras"] =
                json!([{"type": "perspective", "perspective": {"yfov": -1, "znear": 1}}]);
            v["nodes"][0]["camera"] = json!(0);
        }),
        ("/cameras/0/orthographic/xmag", 1, |v| {
            let o = json!({"xmag": 0, "ymag": 1, "znear": 0, "zfar": 1});
            v["cameras"] = json!([{"type": "orthographic", "orthographic": o}]);
            v["nodes"][0]["camera"] = json!(0);
        }),
    ];
    for (place, code, change) in cases {
        let text = triangle(change).to_string();
        let (_dir, path) = written(text.as_bytes());
        let error = match read(&path) {
            Ok(_) => panic!("{place}: was read"),
            Err(e) => e,
        };
        let message = error.to_string();
        assert_eq!(message.lines().count(), 1, "{message}");
        assert_eq!(error.exit_code(), *code, "{message}");
        if *code != 2 {
            assert!(
                message.contains(place) && message.contains("scene.gltf"),
                "{place}: {message}"
            );
        }
    }
}

#[test]
fn what_is_out_of_range_is_shown_and_told() {
    let good = triangle(|_| ());
    let marked = [b"\xef\xbb\xbf", good.to_string().as_bytes()].concat();
    let (_dir, path) = written(&marked);
    assert!(read(&path).unwrap().warnings.is_empty());

    let (_dir, path) = written(
        triangle(|v| {
            v["meshes"][0]["primitives"][0]["material"] = json!(0);
            v["materials"] = json!([{
                "name": "m", "emissiveFactor": [2, -1, 0],
                "pbrMetallicRoughness": {"roughnessFactor": -3, "metallicFactor": 0.5,
                    "baseColorTexture": {"index": 0, "texCoord": 7}},
                "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 7}},
            }]);
            v["textures"] = json!([{"source": 0}]);
            v["images"] = json!([{"uri": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAA\
                AfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg=="}]);
            let spot = json!({"innerConeAngle": 0.6, "outerConeAngle": 0.5});
            v["extensions"] = json!({"KHR_lights_punctual": {"lights": [
                {"type": "spot", "intensity": -5, "spot": spot}]}});
            v["cameras"] =
                json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]);
            v["nodes"].as_array_mut().unwrap().extend([
                json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}),
                json!({"camera": 0, "scale": [1, 0, 1]}),
            ]);
            v["scenes"][0]["nodes"] = json!([0, 1, 2]);
        })
        .to_string()
        .as_bytes(),
    );
    let scene = read(&path).unwrap();
    assert!(scene.cameras.is_empty());
    let lights = "/extensions/KHR_lights_punctual/lights/0";
    for told in [
        "/materials/0/emissiveFactor: -1 is out of range and taken for 0",
        "/materials/0/pbrMetallicRoughness/roughnessFactor: -3 is out of range and taken for 0",
        "/materials/0/extensions/KHR_materials_clearcoat/clearcoatFactor: 7 is out of range and taken for 1",
        "material 'm' has textures that need TEXCOORD_7, which /meshes/0/primitives/0 lacks",
        &format!("{lights}/intensity: -5 is out of range and taken for 0"),
        &format!("{lights}/spot: the inner cone, 0.6, is wider than the outer one, 0.5"),
        "cameras whose nodes have a scale of zero",
    ] {
        let found = scene.warnings.iter().any(|w| w.contains(told));
        assert!(found, "{told}: {:#?}", scene.warnings);
    }
    assert_eq!(scene.warnings.len(), 7, "{:#?}", scene.warnings);
}

#[test]
fn files_that_are_no_gltf_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let missing = dir.path().join("none.glb");
    assert!(matches!(read(&missing).err(), Some(Error::File { .. })));
    let glb = fs::read(file("scenes/box_mesh.glb")).unwrap();
    for bytes in [
        &b""[..],
        b"hello",
        b"glTF",
        &glb[..100],
        &glb[..glb.len() / 2],
        b"[1, 2",
    ] {
        let (_dir, path) = written(bytes);
        let error = read(&path).err().expect("is refused");
        assert_eq!(
            (error.exit_code(), error.to_string().lines().count()),
            (1, 1),
            "{error}"
        );
    }
}

#[test]
fn no_damage_to_the_bytes_makes_it_panic() {
    let text = triangle(|_| ()).to_string().into_bytes();
    let mut rng = Rng::new(21);
    let pick = |rng: &mut Rng, n: usize| (rng.next_u64() % n as u64) as usize;
    for _ in 0..3000 {
        let mut bytes = text.clone();
        for _ in 0..=pick(&mut rng, 3) {
            let at = pick(&mut rng, bytes.len());
            // Mostly digits and punctuation: they keep the JSON readable and its numbers wrong.
            let choices = b"0123456789-e.,:{}[]\"";
            bytes[at] = choices[pick(&mut rng, choices.len())];
        }
        if pick(&mut rng, 8) == 0 {
            bytes.truncate(pick(&mut rng, bytes.len()));
        }
        let (_dir, path) = written(&bytes);
        let _ = read(&path);
    }
}

/// Real files of many exporters, where they are at hand: what is valid loads, unless it needs an
/// extension that is not supported; what is invalid never panics.
#[test]
fn real_files_load_or_say_why_not() {
    let folder = file("../shared/assets/real");
    let Ok(index) = fs::read_to_string(folder.join("index.tsv")) else {
        eprintln!("skipped: {} is not there", folder.display());
        return;
    };
    let (mut loaded, mut refused) = (0, Vec::new());
    for line in index.lines().skip(1) {
        let columns: Vec<&str> = line.split('\t').collect();
        let result = read(&folder.join(columns[0]));
        match (columns[2], result) {
            ("valid", Ok(_)) => loaded += 1,
            ("valid", Err(e)) if e.exit_code() == 3 => {}
            ("valid", Err(e)) => refused.push(e.to_string()),
            _ => {}
        }
    }
    // Valid files without any surface are refused as such.
    refused.retain(|e| !e.contains("holds no"));
    assert!(
        loaded > 100 && refused.is_empty(),
        "{loaded} loaded; {refused:#?}"
    );
}
