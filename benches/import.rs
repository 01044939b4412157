//! How fast a file becomes a scene, and what memory that takes, against reading its bytes and
//! against the `gltf` crate: that one reads buffers and images whole and hands out iterators, which
//! are collected here into the vectors that a renderer needs. Each measurement is a process of its
//! own. The readers take turns, so that a busy machine is busy for all of them. Memory is measured in
//! further processes, which read a tiny file first: threads and the program itself do not count.
//!
//! Run with `cargo bench --bench import [-- FILE…]`; `million`, which is also what is read without
//! files, stands for one of a million triangles that is made here.

#![allow(
    clippy::unwrap_used,
    reason = "a benchmark may stop at the first surprise"
)]

use std::collections::HashMap;
use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use dualight::geometry::Shape;
use dualight::import::{ImportOptions, load};
use dualight::scene::ScenePlugins;
use serde_json::{Value, json};

/// Times that each measurement is made; the median counts.
const REPEATS: usize = 9;

/// Who reads: the system alone, the crate, Dualight.
const READERS: [&str; 3] = ["read", "gltf", "dualight"];

/// Meshes of the file of a million triangles, and quads along one side of each.
const MILLION: (usize, usize) = (8, 250);

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if let [how, reader, file] = words.as_slice()
        && matches!(how.as_str(), "--one" | "--peak")
    {
        if how == "--peak" {
            let dir = tempfile::tempdir().unwrap();
            let tiny = dir.path().join("tiny.glb");
            fs::write(&tiny, grid(1, 2)).unwrap();
            let _ = read(reader, &tiny);
        }
        return one(reader, Path::new(file));
    }
    let dir = tempfile::tempdir().unwrap();
    let mut files: Vec<&str> = words.iter().map(String::as_str).collect();
    files.retain(|w| !w.starts_with("--"));
    if files.is_empty() {
        files.push("million");
    }
    println!(
        "{:<24}{:>10}{:>10}{:>9}{:>9}{:>9}{:>13}{:>11}{:>14}",
        "file",
        "reader",
        "seconds",
        "of gltf",
        "MB/s",
        "Mtri/s",
        "decoded MB",
        "peak MB",
        "peak/decoded"
    );
    for file in files {
        let path = match file {
            "million" => {
                let path = dir.path().join("million.glb");
                fs::write(&path, grid(MILLION.0, MILLION.1)).unwrap();
                path
            }
            other => PathBuf::from(other),
        };
        measure(&path);
    }
}

/// Prints the medians of all readers of a file.
fn measure(file: &Path) {
    let size = fs::metadata(file).unwrap().len() as f64;
    let mut runs: HashMap<&str, Vec<[f64; 4]>> = HashMap::new();
    let mut peaks: HashMap<&str, f64> = HashMap::new();
    let mut refused: HashMap<&str, String> = HashMap::new();
    for _ in 0..REPEATS {
        for reader in READERS {
            if refused.contains_key(reader) {
                continue;
            }
            match run("--one", reader, file) {
                Ok(numbers) => {
                    runs.entry(reader).or_default().push(numbers);
                    let [.., peak] = run("--peak", reader, file).unwrap();
                    let most = peaks.entry(reader).or_default();
                    *most = most.max(peak);
                }
                Err(why) => {
                    refused.insert(reader, why);
                }
            }
        }
    }
    for reader in READERS {
        let name = file.file_name().unwrap().to_string_lossy();
        if let Some(why) = refused.get(reader) {
            println!("{name:<24}{reader:>10}   refuses it: {why}");
            continue;
        }
        let own = &runs[reader];
        let at = |k: usize| median(own.iter().map(|r| r[k]).collect());
        let (seconds, triangles, decoded, peak) = (at(0), at(1), at(2), peaks[reader]);
        // Turn by turn, which takes out how busy the machine was.
        let ratio = match runs.get("gltf") {
            Some(crates) if reader != "read" => {
                let turns = own.iter().zip(crates).map(|(a, b)| a[0] / b[0]);
                format!("{:.2}", median(turns.collect()))
            }
            _ => "-".to_owned(),
        };
        println!(
            "{name:<24}{reader:>10}{seconds:>10.4}{ratio:>9}{:>9.0}{:>9.2}{:>13.2}{:>11.2}{:>14.2}",
            size / seconds / 1e6,
            triangles / seconds / 1e6,
            decoded / 1e6,
            peak / 1e6,
            peak / decoded,
        );
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Measures in a process of its own: seconds, triangles, bytes as decoded, bytes at the peak. Fails
/// with the first line of what the process says.
fn run(how: &str, reader: &str, file: &Path) -> Result<[f64; 4], String> {
    let out = Command::new(std::env::current_exe().unwrap())
        .args([how, reader])
        .arg(file)
        .output()
        .unwrap();
    if !out.status.success() {
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        return Err(text.lines().next().unwrap_or("no reason").to_owned());
    }
    let text = String::from_utf8(out.stdout).unwrap();
    let mut numbers = text.split_whitespace().map(|w| w.parse().unwrap());
    Ok(std::array::from_fn(|_| numbers.next().unwrap()))
}

fn one(reader: &str, file: &Path) {
    let base = most_memory(true);
    let start = Instant::now();
    let done = read(reader, file);
    let seconds = start.elapsed().as_secs_f64();
    match done {
        Ok((triangles, decoded)) => {
            let peak = most_memory(false) - base;
            println!("{seconds} {triangles} {decoded} {peak}");
        }
        Err(why) => {
            eprintln!("{why}");
            std::process::exit(1);
        }
    }
}

fn read(reader: &str, file: &Path) -> Result<(usize, usize), String> {
    match reader {
        // The least that any reader needs: the bytes, from the system's cache.
        "read" => Ok((0, black_box(fs::read(file).unwrap()).len())),
        "gltf" => by_crate(file),
        _ => by_us(file),
    }
}

/// Most bytes that this process had in memory, from now on if it is to `begin` anew. 0 where the
/// system is not Linux.
fn most_memory(begin: bool) -> u64 {
    if begin {
        let _ = fs::write("/proc/self/clear_refs", "5");
    }
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM:"));
    let kilobytes = line.and_then(|l| l.split_whitespace().nth(1)?.parse().ok());
    kilobytes.unwrap_or(0u64) * 1024
}

/// Triangles and bytes of what became of a file: vertices, indices and the images as they are.
fn by_us(file: &Path) -> Result<(usize, usize), String> {
    let scene = load(file, &ImportOptions::default(), ScenePlugins::default());
    let scene = black_box(scene.map_err(|e| e.to_string())?);
    let (mut triangles, mut bytes) = (0, 0);
    for shape in &scene.geometry.shapes {
        if let Shape::Mesh(m) = shape {
            triangles += m.indices.len();
            bytes += 12 * (m.indices.len() + m.positions.len() + m.normals.len());
            bytes += 8 * m.uv_sets.iter().map(Vec::len).sum::<usize>();
            bytes += 16 * (m.colors.len() + m.tangents.len());
        }
    }
    let images: HashMap<_, usize> = scene
        .textures
        .iter()
        .map(|t| (Arc::as_ptr(&t.image), t.image.texels().as_bytes().len()))
        .collect();
    Ok((triangles, bytes + images.values().sum::<usize>()))
}

fn by_crate(file: &Path) -> Result<(usize, usize), String> {
    let (document, buffers, images) = gltf::import(file).map_err(|e| e.to_string())?;
    let (mut triangles, mut bytes) = (0, 0);
    for p in document.meshes().flat_map(|m| m.primitives()) {
        let reader = p.reader(|b| buffers.get(b.index()).map(|d| &d.0[..]));
        let positions: Vec<[f32; 3]> = reader.read_positions().into_iter().flatten().collect();
        let normals: Vec<[f32; 3]> = reader.read_normals().into_iter().flatten().collect();
        let tangents: Vec<[f32; 4]> = reader.read_tangents().into_iter().flatten().collect();
        let uvs: Vec<[f32; 2]> = reader
            .read_tex_coords(0)
            .into_iter()
            .flat_map(|t| t.into_f32())
            .collect();
        let colors: Vec<[f32; 4]> = reader
            .read_colors(0)
            .into_iter()
            .flat_map(|c| c.into_rgba_f32())
            .collect();
        let indices: Vec<u32> = reader
            .read_indices()
            .into_iter()
            .flat_map(|i| i.into_u32())
            .collect();
        triangles += indices.len() / 3;
        bytes += 12 * (positions.len() + normals.len()) + 8 * uvs.len() + 4 * indices.len();
        bytes += 16 * (tangents.len() + colors.len());
        // They stay, as those of a scene do.
        std::mem::forget(black_box((
            positions, normals, tangents, uvs, colors, indices,
        )));
    }
    bytes += images.iter().map(|i| i.pixels.len()).sum::<usize>();
    black_box(images);
    Ok((triangles, bytes))
}

/// Wavy grids with normals and texture coordinates, as GLB.
fn grid(meshes_in_all: usize, side: usize) -> Vec<u8> {
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
    let n = (side + 1) * (side + 1);
    for mesh in 0..meshes_in_all {
        let (mut positions, mut normals, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..n {
            let (u, v) = ((i % (side + 1)) as f32, (i / (side + 1)) as f32);
            let (u, v) = (u / side as f32, v / side as f32);
            let height = (9.0 * u).sin() * (7.0 * v).cos() * 0.1;
            let slope = (9.0 * u).cos() * (7.0 * v).cos() * 0.9;
            let length = (1.0 + slope * slope).sqrt();
            let normal = [-slope / length, 1.0 / length, 0.0];
            positions.extend([u, height, v].iter().flat_map(|x: &f32| x.to_le_bytes()));
            normals.extend(normal.iter().flat_map(|x: &f32| x.to_le_bytes()));
            uvs.extend([u, v].iter().flat_map(|x: &f32| x.to_le_bytes()));
        }
        let mut indices = Vec::new();
        for quad in 0..side * side {
            let a = (quad / side) * (side + 1) + quad % side;
            let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
            for i in [a, c, b, b, c, d] {
                indices.extend((i as u32).to_le_bytes());
            }
        }
        let attributes = json!({
            "POSITION": add(positions, 5126, "VEC3", n),
            "NORMAL": add(normals, 5126, "VEC3", n),
            "TEXCOORD_0": add(uvs, 5126, "VEC2", n),
        });
        let indices = add(indices, 5125, "SCALAR", 6 * side * side);
        meshes.push(json!({"primitives": [{"attributes": attributes, "indices": indices}]}));
        nodes.push(json!({"mesh": mesh, "translation": [mesh, 0, 0]}));
    }
    for a in accessors.iter_mut().filter(|a| a["type"] == "VEC3") {
        // The crate insists on bounds.
        (a["min"], a["max"]) = (json!([-1, -1, -1]), json!([1, 1, 1]));
    }
    let root = json!({
        "asset": {"version": "2.0"}, "scene": 0,
        "scenes": [{"nodes": (0..meshes_in_all).collect::<Vec<_>>()}],
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
