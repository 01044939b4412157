//! Damaged files: whatever a file says, reading it ends soon, with a scene or an error in one line.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;
#[cfg(feature = "draco")]
#[path = "common/draco.rs"]
mod draco;

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use asset::Asset;
use dualight::import::{ImportOptions, load};
use dualight::sampling::Rng;
use dualight::scene::ScenePlugins;
use serde_json::{Value, json};

fn pick(rng: &mut Rng, n: usize) -> usize {
    (rng.next_u64() % n.max(1) as u64) as usize
}

/// A value that an honest file would not hold.
fn wild(rng: &mut Rng) -> Value {
    match pick(rng, 14) {
        0 => json!(-1),
        1 => json!(u64::MAX),
        2 => json!(1u64 << 31),
        3 => json!(1e300),
        4 => json!(null),
        5 => json!("a"),
        6 => json!([]),
        7 => json!({}),
        8 => json!([[[[0]]]]),
        9 => json!(0.5),
        10 => json!(true),
        11 => json!([1e30, -1e30, 0, 0]),
        12 => json!(1 << 20),
        _ => json!(pick(rng, 40)),
    }
}

/// Changes one value somewhere below `v`.
fn mutate(v: &mut Value, rng: &mut Rng) {
    let inner = match v {
        Value::Array(a) => !a.is_empty(),
        Value::Object(o) => !o.is_empty(),
        _ => false,
    };
    if !inner || pick(rng, 12) == 0 {
        *v = wild(rng);
        return;
    }
    match v {
        Value::Array(a) => {
            let i = pick(rng, a.len());
            match pick(rng, 20) {
                0 => drop(a.remove(i)),
                1 => a.push(a[i].clone()),
                _ => mutate(&mut a[i], rng),
            }
        }
        Value::Object(o) => {
            let key = o.keys().nth(pick(rng, o.len())).unwrap().clone();
            match pick(rng, 20) {
                0 => drop(o.remove(&key)),
                _ => mutate(&mut o[&key], rng),
            }
        }
        _ => {}
    }
}

/// Reads a file with everything that can be asked for.
fn try_all(path: &Path) {
    for time in [None, Some(0.3)] {
        let options = ImportOptions {
            time,
            ..Default::default()
        };
        let start = Instant::now();
        if let Err(e) = load(path, &options, ScenePlugins::default()) {
            assert_eq!(e.to_string().lines().count(), 1, "{e}");
        }
        assert!(start.elapsed() < Duration::from_secs(10), "{path:?}");
    }
}

/// Damages JSON and bytes of `asset` many times.
fn shake(asset: &Asset, seed: u64, rounds: usize) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.glb");
    let mut rng = Rng::new(seed);
    for _ in 0..rounds {
        let mut a = asset.clone();
        if pick(&mut rng, 3) > 0 {
            for _ in 0..=pick(&mut rng, 2) {
                mutate(&mut a.json, &mut rng);
            }
        }
        if !a.bytes.is_empty() && pick(&mut rng, 2) == 0 {
            for _ in 0..=pick(&mut rng, 8) {
                let at = pick(&mut rng, a.bytes.len());
                a.bytes[at] = rng.next_u64() as u8;
            }
        }
        fs::write(
            &path,
            if a.json.is_object() {
                a.glb()
            } else {
                b"{}".to_vec()
            },
        )
        .unwrap();
        try_all(&path);
    }
}

/// A file that uses much: a skin, a morph target, an animation, instances, colours.
fn rich() -> Asset {
    let mut a = Asset::triangle();
    let offset = a.floats("VEC3", &[0., 0., 1., 0., 0., 0., 0., 0., 0.]);
    let joints = a.packed("VEC4", 5121, &[0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], 3);
    let weights = a.floats("VEC4", &[1., 0., 0., 0.].repeat(3));
    let order = a.shorts("SCALAR", &[0, 1, 2]);
    let times = a.floats("SCALAR", &[0., 1.]);
    let turns = a.floats("VEC4", &[0., 0., 0., 1., 0., 0., 1., 0.]);
    let values = a.floats("SCALAR", &[0., 1., 0., 0., 1., 0.]);
    let places = a.floats("VEC3", &[0., 0., 0., 1., 0., 0.]);
    *a.attributes() = json!({"POSITION": 0, "COLOR_0": weights,
        "JOINTS_0": joints, "WEIGHTS_0": weights});
    let p = &mut a.json["meshes"][0]["primitives"][0];
    p["targets"] = json!([{"POSITION": offset}]);
    p["indices"] = json!(order);
    p["material"] = json!(0);
    a.json["materials"] = json!([{"emissiveFactor": [1, 1, 1], "alphaMode": "BLEND"}]);
    a.json["skins"] = json!([{"joints": [1, 2]}]);
    a.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "children": [1], "weights": [0.5]},
        {"children": [2], "rotation": [0, 0, 0, 1]},
        {"translation": [1, 0, 0], "mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {
            "attributes": {"TRANSLATION": places}}}}]);
    a.json["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 1, "path": "rotation"}},
            {"sampler": 1, "target": {"node": 0, "path": "weights"}}],
        "samplers": [{"input": times, "output": turns},
            {"input": times, "output": values, "interpolation": "CUBICSPLINE"}]}]);
    a.json["accessors"][0]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": order, "componentType": 5123},
        "values": {"bufferView": offset}});
    a
}

#[test]
fn a_damaged_rich_file_never_panics() {
    let a = rich();
    a.read().unwrap();
    shake(&a, 1, 2000);
}

/// Where nothing but packed views lies in a buffer, it needs no bytes: under either name.
#[test]
fn placeholders_need_no_bytes() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.gltf");
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        for fallback in [true, false] {
            let mut file: Value = serde_json::from_str(&rich().text()).unwrap();
            let buffers = file["buffers"].as_array_mut().unwrap();
            buffers.push(json!({"byteLength": 100, "extensions": {name: {"fallback": fallback}}}));
            fs::write(&path, file.to_string()).unwrap();
            let read = load(&path, &ImportOptions::default(), ScenePlugins::default());
            assert_eq!(read.is_ok(), fallback, "{name}");
        }
    }
}

#[cfg(feature = "meshopt")]
fn packed_by_meshopt() -> Asset {
    let mut a = Asset::new();
    let n = 200_u32;
    let positions: Vec<[f32; 3]> = (0..n)
        .map(|i| [i as f32, (i * i % 17) as f32, (i % 5) as f32])
        .collect();
    let order: Vec<u32> = (0..n - 2).flat_map(|i| [i, i + 1, i + 2]).collect();
    let vertices = a.view(&meshopt::encode_vertex_buffer(&positions).unwrap());
    let indices = a.view(&meshopt::encode_index_buffer(&order, n as usize).unwrap());
    let e = |a: &mut Asset, view: usize, count: usize, stride: usize, mode: &str| {
        let mut e = a.json["bufferViews"][view].clone();
        e["count"] = json!(count);
        e["byteStride"] = json!(stride);
        e["mode"] = json!(mode);
        // The view itself would lie in a fallback buffer, of which nothing is read.
        a.json["bufferViews"][view]["extensions"] = json!({"EXT_meshopt_compression": e});
    };
    e(&mut a, vertices, n as usize, 12, "ATTRIBUTES");
    e(&mut a, indices, order.len(), 4, "TRIANGLES");
    let p = a.accessor(
        json!({"bufferView": vertices, "componentType": 5126, "type": "VEC3",
        "count": n}),
    );
    let i = a.accessor(
        json!({"bufferView": indices, "componentType": 5125, "type": "SCALAR",
        "count": order.len()}),
    );
    a.json["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": p}, "indices": i}]);
    a
}

#[cfg(feature = "meshopt")]
#[test]
fn a_damaged_meshopt_file_never_panics() {
    let a = packed_by_meshopt();
    let m = a.mesh();
    assert_eq!((m.positions.len(), m.indices.len()), (200, 198));
    assert_eq!(m.positions[7], [7., 15., 2.]);
    shake(&a, 2, 1000);
}

#[cfg(feature = "draco")]
#[test]
fn a_damaged_draco_file_never_panics() {
    let side = 9_u32;
    let vertex = |i: u32| [(i % side) as f32, (i / side) as f32, (i * i % 7) as f32];
    let positions: Vec<f32> = (0..side * side).flat_map(vertex).collect();
    let cells = (0..side * side).filter(|i| i % side + 1 < side && i / side + 1 < side);
    let triangles: Vec<_> = cells
        .flat_map(|i| [[i, i + 1, i + side], [i + side, i + 1, i + side + 1]])
        .collect();
    for (seed, speed) in [(3, 0), (4, 5), (5, 10)] {
        let mut a = Asset::new();
        let columns = [draco::Column {
            name: "POSITION",
            width: 3,
            numbers: draco::Numbers::Floats(&positions),
        }];
        let vertices = (side * side) as usize;
        let p = draco::primitive(&mut a, &columns, &triangles, vertices, speed);
        a.json["meshes"][0]["primitives"] = json!([p]);
        assert_eq!(a.mesh().indices.len(), 128);
        shake(&a, seed, 400);
    }
}

/// Real files, Draco among them, where they are at hand.
#[test]
fn damaged_real_files_never_panic() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets/real");
    let Ok(index) = fs::read_to_string(folder.join("index.tsv")) else {
        eprintln!("skipped: {} is not there", folder.display());
        return;
    };
    let end = Instant::now() + Duration::from_secs(30);
    let dir = tempfile::tempdir().unwrap();
    let mut rng = Rng::new(7);
    for line in index.lines().skip(1) {
        let path = folder.join(line.split('\t').next().unwrap());
        let size = fs::metadata(&path).map_or(0, |m| m.len());
        if size > 200_000 || Instant::now() > end {
            continue;
        }
        let bytes = fs::read(&path).unwrap();
        if let Ok(json) = serde_json::from_slice::<Value>(&bytes) {
            for _ in 0..6 {
                let mut json = json.clone();
                for _ in 0..=pick(&mut rng, 3) {
                    mutate(&mut json, &mut rng);
                }
                let at = dir.path().join("scene.gltf");
                copy_buffers(&json, path.parent().unwrap(), dir.path());
                fs::write(&at, json.to_string()).unwrap();
                try_all(&at);
            }
        } else {
            for _ in 0..6 {
                let mut bytes = bytes.clone();
                for _ in 0..=pick(&mut rng, 12) {
                    let at = pick(&mut rng, bytes.len());
                    bytes[at] = rng.next_u64() as u8;
                }
                let at = dir.path().join("scene.glb");
                fs::write(&at, &bytes).unwrap();
                try_all(&at);
            }
        }
    }
}

/// Copies the small files that the buffers of a document name.
fn copy_buffers(json: &Value, from: &Path, to: &Path) {
    for buffer in json["buffers"].as_array().into_iter().flatten() {
        let Some(name) = buffer["uri"].as_str() else {
            continue;
        };
        let plain = !name.contains([':', '/', '\\']);
        if plain && fs::metadata(from.join(name)).is_ok_and(|m| m.len() < 1 << 20) {
            let _ = fs::copy(from.join(name), to.join(name));
        }
    }
}
