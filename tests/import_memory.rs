//! What a scene takes in memory while it is read, against what it takes afterwards. What is measured
//! is a whole process, which reads nothing else.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;
#[cfg(feature = "draco")]
#[path = "common/draco.rs"]
mod draco;
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

/// Corners of the triangles of one mesh.
fn corners() -> Vec<u32> {
    let mut order: Vec<u32> = Vec::new();
    for quad in 0..SIDE * SIDE {
        let first = (quad / SIDE * (SIDE + 1) + quad % SIDE) as u32;
        let below = first + SIDE as u32 + 1;
        order.extend([first, below, first + 1, first + 1, below, below + 1]);
    }
    order
}

/// Shows every mesh of a file once.
fn show(a: &mut Asset, meshes: Vec<Value>) {
    let node = |m| json!({"mesh": m, "translation": [0, 0, m]});
    a.json["nodes"] = (0..meshes.len()).map(node).collect();
    a.json["scenes"] = json!([{"nodes": (0..meshes.len()).collect::<Vec<_>>()}]);
    a.json["meshes"] = Value::Array(meshes);
}

/// Wavy grids with normals and texture coordinates, all of one kind in one buffer view that `pack`
/// makes, as gltfpack writes them.
fn grids(mut pack: impl FnMut(&mut Asset, &[u8], usize, bool) -> usize) -> Asset {
    let mut a = Asset::new();
    let (n, quads, order) = ((SIDE + 1) * (SIDE + 1), SIDE * SIDE, corners());
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
    let mut meshes = Vec::new();
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
        meshes.push(json!({"primitives": [primitive]}));
    }
    show(&mut a, meshes);
    a
}

/// Such grids, each packed by Draco.
#[cfg(feature = "draco")]
fn packed_by_draco() -> Asset {
    let mut a = Asset::new();
    let (n, order) = ((SIDE + 1) * (SIDE + 1), corners());
    let p = vertices(0, |u, v| [u, (9.0 * u * v).sin(), v]).into_flattened();
    let normals = vertices(0, |u, v| [(u * v).sin(), (u * v).cos(), 0.0]).into_flattened();
    let uv = vertices(0, |u, v| [u, v]).into_flattened();
    let column = |name, width, numbers| draco::Column {
        name,
        width,
        numbers: draco::Numbers::Floats(numbers),
    };
    let columns = [
        column("POSITION", 3, &p),
        column("NORMAL", 3, &normals),
        column("TEXCOORD_0", 2, &uv),
    ];
    let primitive = draco::primitive(&mut a, &columns, order.as_chunks().0, n, 5);
    // The same stream for all, by accessors of their own: equal primitives would be one shape.
    let accessors = a.json["accessors"].as_array().unwrap().clone();
    let mesh = |m: usize| {
        let mut p = primitive.clone();
        for index in p["attributes"].as_object_mut().unwrap().values_mut() {
            *index = json!(index.as_u64().unwrap() as usize + m * accessors.len());
        }
        json!({"primitives": [p]})
    };
    let meshes = (0..MESHES).map(mesh).collect();
    let all = std::iter::repeat_n(&accessors, MESHES).flatten();
    a.json["accessors"] = all.cloned().collect();
    show(&mut a, meshes);
    a
}

/// Names the file that a process is to read.
const FILE: &str = "DUALIGHT_TEST_FILE";

/// Peak of memory while a file is read, over the size of what it holds; `None` where the system does
/// not tell. In a process of its own, since freed memory stays with those that had it.
fn measure(what: &str, file: &[u8]) -> Option<f64> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.glb");
    fs::write(&path, file).unwrap();
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
    let Some(ratio) = measure("plain", &plain.glb()) else {
        eprintln!("skipped: this system does not tell the peak of memory");
        return;
    };
    // On top come blocks that are being converted, and the JSON.
    assert!(ratio < 1.15, "{ratio}");

    // The data stays in the text.
    let ratio = measure("data URIs", plain.text().as_bytes()).unwrap();
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
        let ratio = measure("packed", &packed.glb()).unwrap();
        // What is unpacked goes as what is made of it comes; a view that was just unpacked is in
        // memory twice while it is divided, with its packed bytes.
        assert!(ratio < 1.6, "{ratio}");
    }
    #[cfg(feature = "draco")]
    {
        let ratio = measure("Draco", &packed_by_draco().glb()).unwrap();
        // The decoder needs five times what it makes, but of one or two of forty meshes.
        assert!(ratio < 1.5, "{ratio}");
    }
}
