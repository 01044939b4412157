//! Buffer views that `EXT_meshopt_compression` packs, in every mode and with every filter for
//! vertices, packed here by the library's encoder.
#![cfg(feature = "meshopt")]
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use asset::Asset;
use serde_json::{Value, json};

/// Adds a packed view of `count` elements of `stride` bytes.
fn view(
    a: &mut Asset,
    data: &[u8],
    count: usize,
    stride: usize,
    mode: &str,
    filter: &str,
) -> usize {
    let view = a.view(data);
    let mut e = a.json["bufferViews"][view].take();
    e["byteStride"] = json!(stride);
    e["count"] = json!(count);
    e["mode"] = json!(mode);
    e["filter"] = json!(filter);
    a.json["bufferViews"][view] = json!({
        "buffer": 0, "byteLength": 0, "extensions": {"EXT_meshopt_compression": e},
    });
    if mode == "ATTRIBUTES" {
        a.json["bufferViews"][view]["byteStride"] = json!(stride);
    }
    view
}

fn accessor(
    a: &mut Asset,
    view: usize,
    offset: usize,
    component: u32,
    kind: &str,
    n: usize,
) -> Value {
    json!(a.accessor(json!({
        "bufferView": view, "byteOffset": offset, "componentType": component, "type": kind,
        "count": n, "normalized": matches!(component, 5120..=5123) && kind != "SCALAR",
    })))
}

const N: usize = 60;

/// Places along a helix, no three of which are on a line.
fn place(i: usize) -> [f32; 3] {
    let t = i as f32 * 0.37;
    [t.cos(), t.sin(), 0.1 * t]
}

/// Triangles of three vertices that follow each other.
fn order() -> Vec<u32> {
    (0..N as u32 - 2).flat_map(|i| [i, i + 1, i + 2]).collect()
}

fn positions() -> Vec<[f32; 3]> {
    (0..N).map(place).collect()
}

#[test]
fn indices_come_in_both_modes_and_widths() {
    for (mode, stride) in [
        ("TRIANGLES", 2),
        ("TRIANGLES", 4),
        ("INDICES", 2),
        ("INDICES", 4),
    ] {
        let mut a = Asset::triangle();
        let flat = positions().into_flattened();
        let p = a.floats("VEC3", &flat);
        let packed = match mode {
            "TRIANGLES" => meshopt::encode_index_buffer(&order(), N).unwrap(),
            _ => meshopt::encode_index_sequence(&order(), N).unwrap(),
        };
        let n = order().len();
        let v = view(&mut a, &packed, n, stride, mode, "NONE");
        let component = if stride == 2 { 5123 } else { 5125 };
        let indices = accessor(&mut a, v, 0, component, "SCALAR", n);
        a.attributes()["POSITION"] = json!(p);
        a.json["meshes"][0]["primitives"][0]["indices"] = indices;
        let mesh = a.mesh();
        // The encoder may turn a triangle, not over.
        let sorted = |t: &[u32; 3]| {
            let first = (0..3).min_by_key(|k| t[*k]).unwrap();
            [t[first], t[(first + 1) % 3], t[(first + 2) % 3]]
        };
        let got: Vec<_> = mesh.indices.iter().map(sorted).collect();
        let want: Vec<[u32; 3]> = order().chunks(3).map(|c| [c[0], c[1], c[2]]).collect();
        assert_eq!(got, want, "{mode} {stride}");
    }
}

/// A vertex of `W` words: its position, its number where texture coordinates are, and filling.
fn interleaved<const W: usize>() {
    #[derive(Clone)]
    #[repr(transparent)]
    struct Vertex<const W: usize>([u32; W]);
    let vertex = |i: usize| {
        let [x, y, z] = place(i);
        let mut words = [7; W];
        for (word, value) in words.iter_mut().zip([x, y, z, i as f32, -(i as f32)]) {
            *word = value.to_bits();
        }
        Vertex(words)
    };
    let vertices: Vec<Vertex<W>> = (0..N).map(vertex).collect();
    let packed = meshopt::encode_vertex_buffer(&vertices).unwrap();
    let mut a = Asset::triangle();
    let v = view(&mut a, &packed, N, 4 * W, "ATTRIBUTES", "NONE");
    a.attributes()["POSITION"] = accessor(&mut a, v, 0, 5126, "VEC3", N);
    a.attributes()["TEXCOORD_0"] = accessor(&mut a, v, 12, 5126, "VEC2", N);
    let mesh = a.mesh();
    assert_eq!(mesh.positions, positions());
    for (i, uv) in mesh.uv_sets[0].iter().enumerate() {
        assert_eq!(*uv, [i as f32, -(i as f32)]);
    }
}

#[test]
fn vertices_may_be_of_any_size_and_interleaved() {
    interleaved::<5>();
    interleaved::<32>();
    interleaved::<33>();
    interleaved::<64>();
}

#[test]
fn filters_give_back_what_they_took() {
    let close = |a: f32, b: f32, by: f32| (a - b).abs() <= by;
    // Exponents: 23 bits of mantissa hold a float of this size to 1e-6.
    let exp = meshopt::encode_filter_exp(&positions(), 24, meshopt::EncodeExpMode::Separate);
    let exp = meshopt::encode_vertex_buffer(&exp).unwrap();
    // Unit vectors of 8 and of 16 bits.
    let unit = |i: usize| {
        let [x, y, _] = place(i);
        [0.6 * x, 0.6 * y, 0.8, 0.0]
    };
    let units: Vec<[f32; 4]> = (0..N).map(unit).collect();
    let small: Vec<[u8; 4]> = meshopt::encode_filter_oct(&units, 8);
    let small = meshopt::encode_vertex_buffer(&small).unwrap();
    let large: Vec<[u16; 4]> = meshopt::encode_filter_oct(&units, 16);
    let large = meshopt::encode_vertex_buffer(&large).unwrap();
    for (packed, stride, component, by) in [(&small, 4, 5120, 0.02), (&large, 8, 5122, 2e-4)] {
        let mut a = Asset::triangle();
        let p = view(&mut a, &exp, N, 12, "ATTRIBUTES", "EXPONENTIAL");
        a.attributes()["POSITION"] = accessor(&mut a, p, 0, 5126, "VEC3", N);
        let n = view(&mut a, packed, N, stride, "ATTRIBUTES", "OCTAHEDRAL");
        a.attributes()["NORMAL"] = accessor(&mut a, n, 0, component, "VEC3", N);
        let mesh = a.mesh();
        for i in 0..N {
            for k in 0..3 {
                assert!(close(mesh.positions[i][k], place(i)[k], 1e-6));
                assert!(
                    close(mesh.normals[i][k], unit(i)[k], by),
                    "{:?}",
                    mesh.normals[i]
                );
            }
        }
    }
    // Colours of 8 bits, in another space in between.
    let color = |i: usize| [0.2 + 0.01 * i as f32, 0.9, 0.5, 1.0];
    let colors: Vec<[f32; 4]> = (0..N).map(color).collect();
    let packed: Vec<[u8; 4]> = meshopt::encode_filter_color(&colors, 8);
    let packed = meshopt::encode_vertex_buffer(&packed).unwrap();
    let mut a = Asset::triangle();
    let p = a.floats("VEC3", &positions().into_flattened());
    a.attributes()["POSITION"] = json!(p);
    let c = view(&mut a, &packed, N, 4, "ATTRIBUTES", "COLOR");
    a.attributes()["COLOR_0"] = accessor(&mut a, c, 0, 5121, "VEC4", N);
    for (i, got) in a.mesh().colors.iter().enumerate() {
        let want = color(i);
        assert!(
            (0..4).all(|k| close(got[k], want[k], 0.02)),
            "{got:?} {want:?}"
        );
    }
}
