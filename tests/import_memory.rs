//! What a scene takes in memory while it is read, against what it takes afterwards. What is measured
//! is a whole process, which reads nothing else.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;
#[path = "common/memory.rs"]
mod memory;

use std::fs;
use std::path::Path;
use std::process::Command;

use asset::Asset;
use dualight::geometry::Shape;
use dualight::import::{ImportOptions, load};
use dualight::scene::ScenePlugins;
use memory::{forget, peak};
use serde_json::{Value, json};

/// Meshes of a file, and quads along one side of each.
const MESHES: usize = 40;
const SIDE: usize = 120;

/// Numbers of all vertices of one mesh.
fn vertices<const N: usize>(mesh: usize, at: impl Fn(f32, f32) -> [f32; N]) -> Vec<[f32; N]> {
    let n = SIDE + 1;
    let one = |i: usize| at((i % n + mesh) as f32 * 0.01, (i / n) as f32 * 0.01);
    (0..n * n).map(one).collect()
}

/// Wavy grids with normals and texture coordinates, all of one kind in one buffer view that `pack`
/// makes, as gltfpack writes them.
fn grids(mut pack: impl FnMut(&mut Asset, &[u8], usize, bool) -> usize) -> Asset {
    let mut a = Asset::new();
    let (n, quads) = ((SIDE + 1) * (SIDE + 1), SIDE * SIDE);
    let mut order: Vec<u32> = Vec::new();
    for quad in 0..quads {
        let first = (quad / SIDE * (SIDE + 1) + quad % SIDE) as u32;
        let below = first + SIDE as u32 + 1;
        order.extend([first, below, first + 1, first + 1, below, below + 1]);
    }
    let mut view = |a: &mut Asset, numbers: Vec<f32>, width: usize| {
        pack(a, bytemuck::cast_slice(&numbers), 4 * width, false)
    };
    let all = |one: &dyn Fn(usize) -> Vec<f32>| (0..MESHES).flat_map(one).collect::<Vec<f32>>();
    let p = all(&|m| vertices(m, |u, v| [u, (9.0 * u * v).sin(), v]).into_flattened());
    let p = view(&mut a, p, 3);
    let normals =
        all(&|m| vertices(m, |u, v| [(u * v).sin(), (u * v).cos(), 0.0]).into_flattened());
    let normals = view(&mut a, normals, 3);
    let uv = all(&|m| vertices(m, |u, v| [u, v]).into_flattened());
    let uv = view(&mut a, uv, 2);
    let order: Vec<u32> = (0..MESHES).flat_map(|_| order.clone()).collect();
    let order = pack(&mut a, bytemuck::cast_slice(&order), 4, true);
    a.json["meshes"] = json!([]);
    a.json["nodes"] = json!([]);
    for m in 0..MESHES {
        let mut accessor = |view: usize, component: u32, kind: &str, count: usize, size: usize| {
            a.accessor(json!({
                "bufferView": view, "byteOffset": m * count * size, "componentType": component,
                "type": kind, "count": count,
            }))
        };
        let primitive = json!({
            "attributes": {
                "POSITION": accessor(p, 5126, "VEC3", n, 12),
                "NORMAL": accessor(normals, 5126, "VEC3", n, 12),
                "TEXCOORD_0": accessor(uv, 5126, "VEC2", n, 8),
            },
            "indices": accessor(order, 5125, "SCALAR", 6 * quads, 4),
        });
        let push = |list: &mut Value, v: Value| list.as_array_mut().unwrap().push(v);
        push(&mut a.json["meshes"], json!({"primitives": [primitive]}));
        push(
            &mut a.json["nodes"],
            json!({"mesh": m, "translation": [0, 0, m]}),
        );
    }
    a.json["scenes"] = json!([{"nodes": (0..MESHES).collect::<Vec<_>>()}]);
    a
}

/// Names the file that a process is to read.
const FILE: &str = "DUALIGHT_TEST_FILE";

/// Peak of memory while a file is read, over the size of what it holds; `None` where the system does
/// not tell. In a process of its own, since freed memory stays with those that had it.
fn measure(what: &str, a: &Asset) -> Option<f64> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.glb");
    fs::write(&path, a.glb()).unwrap();
    let out = Command::new(std::env::current_exe().unwrap())
        .args(["a_process_of_its_own", "--exact", "--nocapture"])
        .env(FILE, &path)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(out.status.success(), "{text}");
    let numbers = text.lines().find_map(|l| l.strip_prefix("measured "));
    let numbers: Vec<f64> = numbers?
        .split_whitespace()
        .map(|n| n.parse().unwrap())
        .collect();
    println!("{what}: {numbers:?}");
    Some(numbers[1] / numbers[0])
}

#[test]
fn a_process_of_its_own() {
    let Ok(path) = std::env::var(FILE) else {
        return;
    };
    // Threads, and what else is made once.
    let _ = Asset::triangle().read().unwrap();
    let Some(before) = forget().and_then(|()| peak()) else {
        return;
    };
    let scene = load(
        Path::new(&path),
        &ImportOptions::default(),
        ScenePlugins::default(),
    )
    .unwrap();
    let most = peak().unwrap() - before;
    let mut decoded = 0;
    for shape in &scene.geometry.shapes {
        if let Shape::Mesh(m) = shape {
            assert_eq!(m.indices.len(), 2 * SIDE * SIDE);
            decoded += 12 * (m.indices.len() + m.positions.len() + m.normals.len());
            decoded += 8 * m.uv_sets[0].len();
        }
    }
    assert_eq!(
        decoded,
        MESHES * (32 * (SIDE + 1) * (SIDE + 1) + 24 * SIDE * SIDE)
    );
    println!("\nmeasured {decoded} {most}");
}

#[test]
fn reading_takes_little_more_than_what_is_read() {
    let plain = grids(|a, bytes, _, _| a.view(bytes));
    let Some(ratio) = measure("plain", &plain) else {
        eprintln!("skipped: this system does not tell the peak of memory");
        return;
    };
    // On top come blocks that are being converted, and the JSON.
    assert!(ratio < 1.15, "{ratio}");

    #[cfg(feature = "meshopt")]
    {
        let packed = grids(|a, bytes, stride, indices| {
            let n = bytes.len() / stride;
            let (data, mode) = match (indices, stride) {
                (true, _) => {
                    let order: &[u32] = bytemuck::cast_slice(bytes);
                    let vertices = (SIDE + 1) * (SIDE + 1);
                    (meshopt::encode_index_buffer(order, vertices), "TRIANGLES")
                }
                (_, 8) => {
                    let v: &[[u32; 2]] = bytemuck::cast_slice(bytes);
                    (meshopt::encode_vertex_buffer(v), "ATTRIBUTES")
                }
                _ => {
                    let v: &[[u32; 3]] = bytemuck::cast_slice(bytes);
                    (meshopt::encode_vertex_buffer(v), "ATTRIBUTES")
                }
            };
            let view = a.view(&data.unwrap());
            let mut e = a.json["bufferViews"][view].take();
            e["byteStride"] = json!(stride);
            e["count"] = json!(n);
            e["mode"] = json!(mode);
            a.json["bufferViews"][view] = json!({
                "buffer": 0, "byteLength": 0, "extensions": {"EXT_meshopt_compression": e},
            });
            view
        });
        let ratio = measure("packed", &packed).unwrap();
        // What is unpacked goes as what is made of it comes; a view that was just unpacked is in
        // memory twice while it is divided, with its packed bytes.
        assert!(ratio < 1.6, "{ratio}");
    }
}
