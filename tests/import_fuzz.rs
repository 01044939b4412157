//! Files that lie: whatever is in them, reading one ends soon, with a scene or with one line that
//! says what is wrong. Mutates files of many exporters, where they are at hand, and small ones
//! made here, at the level of their JSON and of their bytes.
//!
//! `DUALIGHT_FUZZ=N` makes N times as many mutations, `DUALIGHT_FUZZ_SEED=N` others.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use asset::Asset;
use base64::Engine;
use dualight::import::{ImportOptions, inventory, load};
use dualight::sampling::Rng;
use dualight::scene::ScenePlugins;
use serde_json::{Map, Value, json};

/// Mutations of each file.
const EACH: u64 = 24;

/// Largest file that is mutated.
const MOST_BYTES: usize = 150_000;

/// A file may take this long on a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);

/// A file to be mutated: its JSON, and the bytes of its buffers.
struct Seed {
    name: String,
    json: Value,
    buffers: Vec<Vec<u8>>,
}

impl Seed {
    /// The file at `path` with all its buffers; `None` if it is not whole or too large.
    fn open(path: &Path) -> Option<Self> {
        let bytes = fs::read(path).ok()?;
        let (text, mut chunk) = if bytes.starts_with(b"glTF") {
            let word = |at: usize| {
                let b = bytes.get(at..at + 4)?.try_into().ok()?;
                Some(u32::from_le_bytes(b) as usize)
            };
            let n = word(12)?;
            let text = bytes.get(20..20 + n)?.to_vec();
            (text, bytes.get(28 + n..).map(<[u8]>::to_vec))
        } else {
            (bytes, None)
        };
        let json: Value = serde_json::from_slice(&text).ok()?;
        let mut buffers = Vec::new();
        for b in json["buffers"].as_array().into_iter().flatten() {
            buffers.push(match b["uri"].as_str() {
                None => chunk.take().unwrap_or_default(),
                Some(uri) if uri.starts_with("data:") => {
                    let data = uri.split_once(',')?.1;
                    base64::engine::general_purpose::STANDARD
                        .decode(data)
                        .ok()?
                }
                Some(uri) => fs::read(path.parent()?.join(uri)).ok()?,
            });
        }
        let total: usize = text.len() + buffers.iter().map(Vec::len).sum::<usize>();
        (total <= MOST_BYTES).then(|| Self {
            name: path.display().to_string(),
            json,
            buffers,
        })
    }

    /// As one file of text.
    fn text(&self) -> Vec<u8> {
        let mut v = self.json.clone();
        for (i, bytes) in self.buffers.iter().enumerate() {
            let data = base64::engine::general_purpose::STANDARD.encode(bytes);
            let buffer = v.get_mut("buffers").and_then(|b| b.get_mut(i));
            if let Some(b) = buffer.and_then(Value::as_object_mut) {
                b.insert("uri".into(), json!(format!("data:;base64,{data}")));
            }
        }
        v.to_string().into_bytes()
    }
}

/// A file with something of everything, small enough to be hit everywhere.
fn handmade() -> Seed {
    let mut a = Asset::triangle();
    let normal = a.floats("VEC3", &[0., 0., 1.].repeat(3));
    let uv = a.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
    let color = a.floats("VEC4", &[0.5; 12]);
    let joints = a.packed("VEC4", 5121, &[0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0], 3);
    let weights = a.floats("VEC4", &[1., 0., 0., 0., 0., 1., 0., 0., 1., 0., 0., 0.]);
    let order = a.shorts("SCALAR", &[0, 1, 2]);
    let radius = a.floats("SCALAR", &[0.1; 3]);
    let times = a.floats("SCALAR", &[0.0, 1.0]);
    let moves = a.floats("VEC3", &[0., 0., 0., 1., 1., 1.]);
    let turns = a.floats("VEC4", &[0., 0., 0., 1., 0., 1., 0., 0.]);
    let morphs = a.floats("SCALAR", &[0.0, 1.0]);
    let sparse = a.view(&[2, 0, 0, 0, 0, 0, 128, 63, 0, 0, 128, 63, 0, 0, 128, 63]);
    let target = a.accessor(json!({
        "componentType": 5126, "type": "VEC3", "count": 3, "sparse": {
            "count": 1,
            "indices": {"bufferView": sparse, "componentType": 5121},
            "values": {"bufferView": sparse, "byteOffset": 4},
        },
    }));
    a.json["meshes"] = json!([
        {"weights": [0.5], "primitives": [{
            "attributes": {
                "POSITION": 0, "NORMAL": normal, "TEXCOORD_0": uv, "COLOR_0": color,
                "JOINTS_0": joints, "WEIGHTS_0": weights,
            },
            "indices": order, "material": 0, "targets": [{"POSITION": target}],
            "extensions": {"KHR_materials_variants": {
                "mappings": [{"material": 1, "variants": [0]}],
            }},
        }]},
        {"primitives": [
            {"attributes": {"POSITION": 0, "_RADIUS": radius}, "mode": 0},
            {"attributes": {"POSITION": 0}, "mode": 5},
        ]},
    ]);
    a.json["materials"] = json!([
        {"normalTexture": {"index": 0}, "emissiveFactor": [1.0, 1.0, 1.0]},
        {"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {
            "index": 0, "extensions": {"KHR_texture_transform": {"scale": [2.0, 2.0]}},
        }}},
    ]);
    let png = a.view(PNG);
    a.json["images"] = json!([{"bufferView": png, "mimeType": "image/png"}]);
    a.json["samplers"] = json!([{"magFilter": 9728, "wrapS": 33071}]);
    a.json["textures"] = json!([{"source": 0, "sampler": 0}]);
    a.json["skins"] = json!([{"joints": [2, 3]}]);
    a.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0}}]);
    a.json["nodes"] = json!([
        {"mesh": 0, "skin": 0},
        {"mesh": 1, "children": [2], "scale": [1.0, 2.0, 1.0], "extensions": {
            "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves, "ROTATION": turns}},
        }},
        {"children": [3], "rotation": [0.0, 0.0, 0.0, 1.0]},
        {"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}},
    ]);
    a.json["scenes"][0]["nodes"] = json!([0, 1]);
    a.json["extensions"] = json!({
        "KHR_lights_punctual": {"lights": [{
            "type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.3},
        }]},
        "KHR_materials_variants": {"variants": [{"name": "spring"}]},
    });
    let channel = |sampler: usize, path: &str| {
        let node = [1, 2, 0][sampler];
        json!({"sampler": sampler, "target": {"node": node, "path": path}})
    };
    a.json["animations"] = json!([{
        "samplers": [
            {"input": times, "output": moves},
            {"input": times, "output": turns, "interpolation": "LINEAR"},
            {"input": times, "output": morphs, "interpolation": "STEP"},
        ],
        "channels": [channel(0, "translation"), channel(1, "rotation"), channel(2, "weights")],
    }]);
    a.json["buffers"] = json!([{"byteLength": a.bytes.len()}]);
    Seed {
        name: "handmade".into(),
        json: a.json,
        buffers: vec![a.bytes],
    }
}

/// One grey texel.
const PNG: &[u8] = &[
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 1, 0, 0, 0, 1, 8, 0, 0,
    0, 0, 58, 126, 155, 85, 0, 0, 0, 10, 73, 68, 65, 84, 120, 156, 99, 104, 0, 0, 0, 130, 0, 129,
    119, 205, 114, 182, 0, 0, 0, 0, 73, 69, 78, 68, 174, 66, 96, 130,
];

fn pick(rng: &mut Rng, n: usize) -> usize {
    (rng.next_u64() % n.max(1) as u64) as usize
}

/// Number of values in a tree.
fn count(v: &Value) -> usize {
    1 + match v {
        Value::Array(a) => a.iter().map(count).sum(),
        Value::Object(o) => o.values().map(count).sum::<usize>(),
        _ => 0,
    }
}

/// Value `n` of a tree, in the order of [`count`].
fn nth<'a>(v: &'a mut Value, n: &mut usize) -> Option<&'a mut Value> {
    if *n == 0 {
        return Some(v);
    }
    *n -= 1;
    match v {
        Value::Array(a) => a.iter_mut().find_map(|v| nth(v, n)),
        Value::Object(o) => o.values_mut().find_map(|v| nth(v, n)),
        _ => None,
    }
}

/// A value that a careless reader may trip over.
fn odd(rng: &mut Rng) -> Value {
    const NUMBERS: &[f64] = &[
        0.0,
        1.0,
        -1.0,
        0.5,
        2.0,
        3.0,
        255.0,
        256.0,
        65535.0,
        65536.0,
        4294967295.0,
        4294967296.0,
        9007199254740993.0,
        1e19,
        1e300,
        -1e300,
        1e-320,
        1e18,
        -0.0,
    ];
    match pick(rng, 12) {
        0 => Value::Null,
        1 => json!(u64::MAX),
        2 => json!(i64::MIN),
        3 => json!("x"),
        4 => json!([]),
        5 => Value::Object(Map::new()),
        6 => json!(true),
        _ => json!(NUMBERS[pick(rng, NUMBERS.len())]),
    }
}

/// Changes one thing.
fn mutate(seed: &mut Seed, rng: &mut Rng) {
    let n = count(&seed.json);
    let mut at = pick(rng, n);
    let other = {
        let mut at = pick(rng, n);
        nth(&mut seed.json, &mut at).map(|v| v.clone())
    };
    if pick(rng, 6) == 0 {
        let which = pick(rng, seed.buffers.len());
        if let Some(bytes) = seed.buffers.get_mut(which) {
            for _ in 0..=pick(rng, 8) {
                let i = pick(rng, bytes.len());
                if let Some(b) = bytes.get_mut(i) {
                    // Bit patterns of infinities, huge indices and the like.
                    *b = [0, 255, 127, 128, 1, rng.next_u64() as u8][pick(rng, 6)];
                }
            }
            if pick(rng, 8) == 0 {
                bytes.truncate(pick(rng, bytes.len()));
            }
        }
        return;
    }
    let Some(v) = nth(&mut seed.json, &mut at) else {
        return;
    };
    match (pick(rng, 8), v) {
        (0, Value::Object(o)) if !o.is_empty() => {
            let key = o.keys().nth(pick(rng, o.len())).cloned().unwrap();
            o.remove(&key);
        }
        (1, Value::Array(a)) if !a.is_empty() => {
            let one = a[pick(rng, a.len())].clone();
            a.push(one);
        }
        (2, Value::Array(a)) => a.truncate(pick(rng, a.len() + 1)),
        (3, v) => {
            if let Some(other) = other {
                *v = other;
            }
        }
        // An index or a count that is a little off.
        (4..=5, v) if v.is_number() => {
            let x = v.as_f64().unwrap_or(0.0);
            *v = json!([x + 1.0, x - 1.0, x * 2.0, -x, x * 1e6, 0.0][pick(rng, 6)] as i64);
        }
        (_, v) if v.is_number() || pick(rng, 3) == 0 => *v = odd(rng),
        (_, v) => {
            // Hit something below it instead.
            let mut below = pick(rng, count(v));
            if let Some(v) = nth(v, &mut below) {
                *v = odd(rng);
            }
        }
    }
}

fn seeds() -> Vec<Seed> {
    let mut seeds: Vec<Seed> = (0..20).map(|_| handmade()).collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut stack: Vec<PathBuf> = vec![
        root.join("scenes"),
        root.join("../shared/assets/real"),
        root.join("../shared/assets/blender"),
    ];
    while let Some(dir) = stack.pop() {
        let Ok(entries) = fs::read_dir(&dir) else {
            eprintln!("without {}, which is not there", dir.display());
            continue;
        };
        let mut paths: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
        paths.sort();
        for path in paths {
            if path.is_dir() {
                stack.push(path);
            } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb") {
                seeds.extend(Seed::open(&path));
            }
        }
    }
    seeds
}

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name)
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(default)
}

/// Reads the file; what went wrong, if it did.
fn try_it(path: &Path, time: Option<f64>) -> Option<String> {
    let start = Instant::now();
    let options = ImportOptions {
        time,
        ..Default::default()
    };
    let result = catch_unwind(AssertUnwindSafe(|| {
        let _ = inventory(path);
        load(path, &options, ScenePlugins::default()).err()
    }));
    let took = start.elapsed();
    match result {
        Err(_) => Some("panicked".into()),
        Ok(Some(e)) if e.to_string().lines().count() != 1 => Some(format!("says: {e}")),
        Ok(_) if took > PATIENCE => Some(format!("took {took:?}")),
        Ok(_) => None,
    }
}

#[test]
fn no_lie_makes_it_panic_or_hang() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("mutant.gltf");
    let (times, base) = (number("DUALIGHT_FUZZ", 1), number("DUALIGHT_FUZZ_SEED", 7));
    for (i, seed) in seeds().into_iter().enumerate() {
        for round in 0..EACH * times {
            let mut rng = Rng::new(base << 40 | (i as u64) << 24 | round);
            let mut mutant = Seed {
                name: seed.name.clone(),
                json: seed.json.clone(),
                buffers: seed.buffers.clone(),
            };
            for _ in 0..=pick(&mut rng, 3) {
                mutate(&mut mutant, &mut rng);
            }
            let text = mutant.text();
            fs::write(&path, &text).unwrap();
            let time = (pick(&mut rng, 2) == 0).then_some(0.5);
            if let Some(problem) = try_it(&path, time) {
                let kept = std::env::temp_dir().join("dualight-mutant.gltf");
                fs::write(&kept, &text).unwrap();
                panic!(
                    "{}, round {round}, seed {base}: {problem}; kept as {}",
                    seed.name,
                    kept.display()
                );
            }
        }
    }
}

#[test]
fn deep_and_long_files_are_refused_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("deep.gltf");
    let nested = |n: usize| format!("{}1{}", "[".repeat(n), "]".repeat(n));
    for n in [100, 1000, 1_000_000] {
        let text = format!(
            r#"{{"asset": {{"version": "2.0"}}, "extras": {}}}"#,
            nested(n)
        );
        fs::write(&path, text).unwrap();
        assert_eq!(try_it(&path, None), None, "{n}");
    }
    // A chain of nodes as long as one likes is not a deep tree to the reader.
    let mut a = Asset::triangle();
    let n = 200_000;
    let mut nodes: Vec<Value> = (1..n).map(|i| json!({"children": [i]})).collect();
    nodes.push(json!({"mesh": 0}));
    a.json["nodes"] = json!(nodes);
    assert_eq!(a.read().unwrap().geometry.objects.len(), 1);
    // So is a skin at its end.
    let joints = a.packed("VEC4", 5121, &[0; 12], 3);
    let weights = a.floats("VEC4", &[0.25; 12]);
    a.attributes()["JOINTS_0"] = json!(joints);
    a.attributes()["WEIGHTS_0"] = json!(weights);
    a.json["skins"] = json!([{"joints": [n - 1, n / 2, 0]}]);
    a.json["nodes"][n - 1]["skin"] = json!(0);
    assert_eq!(a.read().unwrap().geometry.objects.len(), 1);
}
