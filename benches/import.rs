//! How fast a file becomes a scene, against reading the same file with the `gltf` crate: that one
//! reads the buffers whole and hands out iterators, which are collected here into the vectors
//! that a renderer needs. Each measurement is a process of its own, so that its peak of memory
//! is its own.
//!
//! Run with `cargo bench --bench import [-- FILE…]`; without files it writes one of a million
//! triangles.

#![allow(
    clippy::unwrap_used,
    reason = "a benchmark may stop at the first surprise"
)]

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use dualight::geometry::Shape;
use dualight::import::{ImportOptions, load};
use dualight::scene::ScenePlugins;
use dualight::stats::peak_memory;
use serde_json::{Value, json};

/// Times that each measurement is made; the best one counts.
const REPEATS: usize = 5;

/// Meshes of the file that is written, and quads along one side of each.
const MESHES: usize = 8;
const SIDE: usize = 250;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if let [mark, reader, file] = words.as_slice()
        && mark == "--one"
    {
        return one(reader, Path::new(file));
    }
    let dir = tempfile::tempdir().unwrap();
    let mut files: Vec<PathBuf> = words
        .iter()
        .filter(|w| !w.starts_with("--"))
        .map(PathBuf::from)
        .collect();
    if files.is_empty() {
        let path = dir.path().join("million.glb");
        std::fs::write(&path, grid()).unwrap();
        files.push(path);
    }
    println!(
        "{:<24}{:>10}{:>10}{:>10}{:>12}{:>12}{:>12}",
        "file", "reader", "seconds", "MB/s", "Mtri/s", "decoded MB", "peak MB"
    );
    for file in &files {
        let size = std::fs::metadata(file).unwrap().len() as f64;
        for reader in ["read", "gltf", "dualight"] {
            let runs: Vec<[f64; 4]> = (0..REPEATS).map(|_| run(reader, file)).collect();
            let best = |k: usize| runs.iter().map(|r| r[k]).fold(f64::INFINITY, f64::min);
            let (seconds, [_, triangles, decoded, _]) = (best(0), runs[0]);
            println!(
                "{:<24}{reader:>10}{seconds:>10.3}{:>10.0}{:>12.2}{:>12.1}{:>12.1}",
                file.file_name().unwrap().to_string_lossy(),
                size / seconds / 1e6,
                triangles / seconds / 1e6,
                decoded / 1e6,
                best(3) / 1e6,
            );
        }
    }
}

/// Measures in a process of its own: seconds, triangles, bytes as decoded, bytes at the peak.
fn run(reader: &str, file: &Path) -> [f64; 4] {
    let out = Command::new(std::env::current_exe().unwrap())
        .args(["--one", reader])
        .arg(file)
        .output()
        .unwrap();
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    let text = String::from_utf8(out.stdout).unwrap();
    let mut numbers = text.split_whitespace().map(|w| w.parse().unwrap());
    std::array::from_fn(|_| numbers.next().unwrap())
}

fn one(reader: &str, file: &Path) {
    let start = Instant::now();
    let (triangles, decoded) = match reader {
        // The least that any reader needs: the bytes, from the system's cache.
        "read" => (0, black_box(std::fs::read(file).unwrap()).len()),
        "gltf" => by_crate(file),
        _ => by_us(file),
    };
    let seconds = start.elapsed().as_secs_f64();
    let peak = peak_memory().unwrap_or(0);
    println!("{seconds} {triangles} {decoded} {peak}");
}

fn by_us(file: &Path) -> (usize, usize) {
    let scene = load(file, &ImportOptions::default(), ScenePlugins::default()).unwrap();
    let scene = black_box(scene);
    let (mut triangles, mut bytes) = (0, 0);
    for shape in &scene.geometry.shapes {
        if let Shape::Mesh(m) = shape {
            triangles += m.indices.len();
            bytes += 12 * (m.indices.len() + m.positions.len() + m.normals.len());
            bytes += 8 * m.uv_sets.iter().map(Vec::len).sum::<usize>();
            bytes += 16 * (m.colors.len() + m.tangents.len());
        }
    }
    (triangles, bytes)
}

fn by_crate(file: &Path) -> (usize, usize) {
    let blob = gltf::Gltf::open(file).unwrap();
    let buffers = gltf::import_buffers(&blob.document, file.parent(), blob.blob).unwrap();
    let (mut triangles, mut bytes) = (0, 0);
    for p in blob.document.meshes().flat_map(|m| m.primitives()) {
        let reader = p.reader(|b| buffers.get(b.index()).map(|d| &d.0[..]));
        let positions: Vec<[f32; 3]> = reader.read_positions().into_iter().flatten().collect();
        let normals: Vec<[f32; 3]> = reader.read_normals().into_iter().flatten().collect();
        let uvs: Vec<[f32; 2]> = reader
            .read_tex_coords(0)
            .into_iter()
            .flat_map(|t| t.into_f32())
            .collect();
        let indices: Vec<u32> = reader
            .read_indices()
            .into_iter()
            .flat_map(|i| i.into_u32())
            .collect();
        triangles += indices.len() / 3;
        bytes += 12 * (positions.len() + normals.len()) + 8 * uvs.len() + 4 * indices.len();
        black_box((positions, normals, uvs, indices));
    }
    (triangles, bytes)
}

/// Wavy grids with normals and texture coordinates, as GLB.
fn grid() -> Vec<u8> {
    let (mut bytes, mut views, mut accessors) = (Vec::<u8>::new(), Vec::new(), Vec::new());
    let (mut meshes, mut nodes): (Vec<Value>, Vec<Value>) = (Vec::new(), Vec::new());
    let mut add = |data: Vec<u8>, component: u32, kind: &str, count: usize| {
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": data.len()}));
        bytes.extend(data);
        accessors.push(json!({
            "bufferView": views.len() - 1, "componentType": component, "type": kind, "count": count,
        }));
        accessors.len() - 1
    };
    let n = (SIDE + 1) * (SIDE + 1);
    for mesh in 0..MESHES {
        let (mut positions, mut normals, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..n {
            let (u, v) = ((i % (SIDE + 1)) as f32, (i / (SIDE + 1)) as f32);
            let (u, v) = (u / SIDE as f32, v / SIDE as f32);
            let height = (9.0 * u).sin() * (7.0 * v).cos() * 0.1;
            let slope = (9.0 * u).cos() * (7.0 * v).cos() * 0.9;
            let length = (1.0 + slope * slope).sqrt();
            let normal = [-slope / length, 1.0 / length, 0.0];
            positions.extend([u, height, v].iter().flat_map(|x: &f32| x.to_le_bytes()));
            normals.extend(normal.iter().flat_map(|x: &f32| x.to_le_bytes()));
            uvs.extend([u, v].iter().flat_map(|x: &f32| x.to_le_bytes()));
        }
        let mut indices = Vec::new();
        for quad in 0..SIDE * SIDE {
            let a = (quad / SIDE) * (SIDE + 1) + quad % SIDE;
            let (b, c, d) = (a + 1, a + SIDE + 1, a + SIDE + 2);
            for i in [a, c, b, b, c, d] {
                indices.extend((i as u32).to_le_bytes());
            }
        }
        let attributes = json!({
            "POSITION": add(positions, 5126, "VEC3", n),
            "NORMAL": add(normals, 5126, "VEC3", n),
            "TEXCOORD_0": add(uvs, 5126, "VEC2", n),
        });
        let indices = add(indices, 5125, "SCALAR", 6 * SIDE * SIDE);
        meshes.push(json!({"primitives": [{"attributes": attributes, "indices": indices}]}));
        nodes.push(json!({"mesh": mesh, "translation": [mesh, 0, 0]}));
    }
    for a in accessors.iter_mut().filter(|a| a["type"] == "VEC3") {
        // The crate insists on bounds.
        (a["min"], a["max"]) = (json!([-1, -1, -1]), json!([1, 1, 1]));
    }
    let root = json!({
        "asset": {"version": "2.0"}, "scene": 0,
        "scenes": [{"nodes": (0..MESHES).collect::<Vec<_>>()}],
        "nodes": nodes, "meshes": meshes, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": bytes.len()}],
    });
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let word = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend(word(12 + 8 + text.len() + 8 + bytes.len()));
    out.extend(word(text.len()));
    out.extend(b"JSON");
    out.extend(text);
    out.extend(word(bytes.len()));
    out.extend(b"BIN\0");
    out.extend(bytes);
    out
}
