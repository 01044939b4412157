//! `dualight inspect`: what a file holds, as text and as JSON.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use std::path::Path;
use std::process::Command;

use asset::Asset;
use dualight::import::{Inventory, inventory};
use serde_json::{Value, json};

fn inspect(path: &Path, words: &[&str]) -> String {
    let out = Command::new(env!("CARGO_BIN_EXE_dualight"))
        .arg("inspect")
        .arg(path)
        .args(words)
        .output()
        .unwrap();
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    String::from_utf8(out.stdout).unwrap()
}

/// A red texel as PNG.
fn png() -> Vec<u8> {
    let mut bytes = Vec::new();
    image::ImageBuffer::from_pixel(3, 2, image::Rgb([255u8, 0, 0]))
        .write_to(
            &mut std::io::Cursor::new(&mut bytes),
            image::ImageFormat::Png,
        )
        .unwrap();
    bytes
}

fn everything() -> Asset {
    let mut a = Asset::triangle();
    let view = a.view(&png());
    let times = a.floats("SCALAR", &[0.5, 1.0, 2.5]);
    let values = a.floats("VEC3", &[0.; 9]);
    a.json["asset"]["generator"] = json!("a test");
    a.json["scenes"] = json!([{"nodes": [0], "name": "one"}, {"nodes": [], "name": "two"}]);
    a.json["images"] = json!([
        {"bufferView": view, "mimeType": "image/png", "name": "red"},
        {"uri": "missing.png"},
    ]);
    a.json["textures"] = json!([{"source": 0}]);
    a.json["materials"] = json!([{
        "name": "paint", "alphaMode": "MASK", "doubleSided": true,
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "extensions": {"KHR_materials_clearcoat": {"clearcoatTexture": {"index": 0}}},
    }]);
    a.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    a.json["animations"] = json!([{
        "name": "walk",
        "samplers": [{"input": times, "output": values}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
    }]);
    a.json["extensionsUsed"] = json!([
        "KHR_materials_clearcoat",
        "KHR_materials_variants",
        "EXT_none"
    ]);
    a.json["extensionsRequired"] = json!(["KHR_materials_clearcoat"]);
    a.json["extensions"] = json!({
        "KHR_materials_variants": {"variants": [{"name": "spring"}]},
        "KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 683.0}]},
    });
    a.json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    a
}

#[test]
fn a_file_is_told_as_it_is() {
    let a = everything();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("all.gltf");
    std::fs::write(&path, a.text()).unwrap();
    let told: Inventory = inventory(&path).unwrap();
    assert_eq!(told.generator.as_deref(), Some("a test"));
    assert_eq!(told.scenes, ["one", "two"]);
    assert_eq!(told.default_scene.as_deref(), Some("one"));
    assert_eq!(told.variants, ["spring"]);
    let walk = &told.animations[0];
    assert_eq!(
        (walk.name.as_str(), walk.start, walk.end, walk.channels),
        ("walk", 0.5, 2.5, 1)
    );
    let paint = &told.materials[0];
    assert_eq!((paint.alpha.as_str(), paint.double_sided), ("MASK", true));
    let mut textures = paint.textures.clone();
    textures.sort();
    assert_eq!(textures, ["baseColor", "clearcoat"]);
    let red = &told.images[0];
    assert_eq!((red.format, red.size), ("png", Some([3, 2])));
    assert_eq!(red.bytes as usize, png().len());
    let missing = &told.images[1];
    assert_eq!(missing.name, "missing.png");
    assert!(missing.problem.as_ref().unwrap().contains("/images/1/uri"));
    assert_eq!(told.extensions.ignored, ["EXT_none"]);
    assert_eq!(told.extensions.required, ["KHR_materials_clearcoat"]);
    // The same through the command.
    let text = inspect(&path, &[]);
    for part in [
        "walk: 0.5000 to 2.5000 s, 1 channels",
        "paint: alpha mask, both sides",
        "red: png, 3 x 2",
        "EXT_none: ignored",
        "KHR_materials_clearcoat: required",
        "spring",
        "one (default)",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let v: Value = serde_json::from_str(&inspect(&path, &["--json"])).unwrap();
    assert_eq!(v["triangles"], 1);
    // 683 cd are 1 W/sr, and 4π W all around.
    let watts = v["lights"][0]["watts"][0].as_f64().unwrap();
    assert!((watts - 4.0 * std::f64::consts::PI).abs() < 1e-9);
    assert_eq!(v["file"]["images"][0]["size"], json!([3, 2]));
    assert_eq!(v["file"]["animations"][0]["end"], json!(2.5));
}

#[test]
fn a_refused_file_is_told_with_all_of_its_extensions() {
    let mut a = everything();
    a.json["extensionsRequired"] = json!(["KHR_materials_clearcoat", "EXT_none", "EXT_unlisted"]);
    // Nothing beyond the JSON is read.
    a.json["images"] = json!([{"uri": "missing.png"}]);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("new.gltf");
    std::fs::write(&path, a.text()).unwrap();
    let run = |words: &[&str]| {
        let out = Command::new(env!("CARGO_BIN_EXE_dualight"))
            .arg("inspect")
            .arg(&path)
            .args(words)
            .output()
            .unwrap();
        assert_eq!(out.status.code(), Some(3));
        let error = String::from_utf8(out.stderr).unwrap();
        assert!(error.contains("/extensionsRequired/1"), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        String::from_utf8(out.stdout).unwrap()
    };
    let text = run(&[]);
    let rows: Vec<&str> = text.lines().map(str::trim).collect();
    assert_eq!(
        rows,
        [
            "extension  KHR_materials_clearcoat: required",
            "extension  KHR_materials_variants",
            "extension  EXT_none: required, not supported",
            "extension  EXT_unlisted: required, not supported",
        ]
    );
    let v: Value = serde_json::from_str(&run(&["--json"])).unwrap();
    let told = &v["file"]["extensions"];
    assert_eq!(told["ignored"], json!(["EXT_none", "EXT_unlisted"]));
    assert_eq!(told["required"].as_array().unwrap().len(), 3);
}
