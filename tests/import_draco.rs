//! Primitives that `KHR_draco_mesh_compression` packs, packed here by the library's encoder.
#![cfg(feature = "draco")]
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;
#[path = "common/draco.rs"]
mod draco;

use asset::Asset;
use draco::{Column, Numbers, primitive};
use dualight::geometry::TriangleMesh;
use serde_json::{Value, json};

/// Vertices along one side of the grid.
const SIDE: usize = 13;
const N: usize = SIDE * SIDE;

/// A wavy grid: no two vertices agree in anything.
struct Grid {
    positions: Vec<f32>,
    normals: Vec<f32>,
    uvs: Vec<f32>,
    colors: Vec<u8>,
    triangles: Vec<[u32; 3]>,
}

fn grid() -> Grid {
    let at = |i: usize| {
        let (x, y) = ((i % SIDE) as f32, (i / SIDE) as f32);
        (x / (SIDE - 1) as f32, y / (SIDE - 1) as f32)
    };
    let each = |f: &dyn Fn(f32, f32) -> Vec<f32>| {
        (0..N).flat_map(|i| f(at(i).0, at(i).1)).collect::<Vec<_>>()
    };
    let mut triangles = Vec::new();
    for quad in 0..(SIDE - 1) * (SIDE - 1) {
        let a = (quad / (SIDE - 1) * SIDE + quad % (SIDE - 1)) as u32;
        let c = a + SIDE as u32;
        triangles.extend([[a, a + 1, c], [c, a + 1, c + 1]]);
    }
    Grid {
        positions: each(&|x, y| vec![x, y, 0.2 * (5.0 * x * y).sin()]),
        normals: each(&|x, y| {
            let (s, c) = (0.7 * x + 0.3 * y).sin_cos();
            vec![0.6 * s, 0.6 * c, 0.8]
        }),
        uvs: each(&|x, y| vec![0.1 + 0.8 * x, 0.9 - 0.7 * y]),
        colors: (0..4 * N).map(|i| (i * 7 % 251) as u8).collect(),
        triangles,
    }
}

impl Grid {
    fn columns(&self) -> Vec<Column<'_>> {
        let floats = |name, width, numbers| Column {
            name,
            width,
            numbers: Numbers::Floats(numbers),
        };
        vec![
            floats("POSITION", 3, &self.positions),
            floats("NORMAL", 3, &self.normals),
            floats("TEXCOORD_0", 2, &self.uvs),
            Column {
                name: "COLOR_0",
                width: 4,
                numbers: Numbers::Bytes(&self.colors),
            },
        ]
    }

    fn asset(&self, speed: i32) -> Asset {
        let mut a = Asset::new();
        let p = primitive(&mut a, &self.columns(), &self.triangles, N, speed);
        a.json["meshes"][0]["primitives"] = json!([p]);
        a
    }

    /// Which vertex stands where this one of a decoded mesh does.
    fn original(&self, mesh: &TriangleMesh, i: u32) -> usize {
        let [x, y, _] = mesh.positions[i as usize];
        let near = |v: f32| (v * (SIDE - 1) as f32).round() as usize;
        near(y) * SIDE + near(x)
    }
}

fn extension(a: &mut Asset) -> &mut Value {
    &mut a.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]
}

#[test]
fn every_attribute_comes_back_by_each_way_of_packing() {
    let grid = grid();
    // Both ways of packing triangles, and what lies between.
    for speed in [0, 5, 10] {
        let mesh = grid.asset(speed).mesh();
        assert_eq!(mesh.positions.len(), N, "{speed}");
        for i in 0..N as u32 {
            let (own, was) = (i as usize, grid.original(&mesh, i));
            // 14 bits over the extent of an attribute; directions are on an octahedron of as many.
            let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 4e-4);
            let of = |all: &'_ [f32], n: usize| all[n * was..n * (was + 1)].to_vec();
            assert!(close(&mesh.positions[own], &of(&grid.positions, 3)));
            assert!(close(&mesh.normals[own], &of(&grid.normals, 3)));
            assert!(close(&mesh.uv_sets[0][own], &of(&grid.uvs, 2)));
            let color = grid.colors[4 * was..4 * was + 4].iter();
            let color: Vec<f32> = color.map(|&c| f32::from(c) / 255.0).collect();
            assert_eq!(mesh.colors[own].as_slice(), color, "{speed}");
        }
        // The same triangles, wound the same way, whichever corner comes first.
        let turned = |t: [usize; 3]| {
            let first = (0..3).min_by_key(|&k| t[k]).unwrap();
            [t[first], t[(first + 1) % 3], t[(first + 2) % 3]]
        };
        let sorted = |all: &mut dyn Iterator<Item = [usize; 3]>| {
            let mut all: Vec<_> = all.map(turned).collect();
            all.sort_unstable();
            all
        };
        let decoded = mesh.indices.iter();
        let decoded = sorted(&mut decoded.map(|t| t.map(|i| grid.original(&mesh, i))));
        let given = grid.triangles.iter();
        assert_eq!(decoded, sorted(&mut given.map(|t| t.map(|i| i as usize))));
    }
}

#[test]
fn names_may_share_an_attribute() {
    let mut a = grid().asset(5);
    let second = a.accessor(json!({"componentType": 5126, "type": "VEC2", "count": N}));
    a.attributes()["TEXCOORD_1"] = json!(second);
    extension(&mut a)["attributes"]["TEXCOORD_1"] = json!(2);
    let mesh = a.mesh();
    assert_eq!(mesh.uv_sets.len(), 2);
    assert_eq!(mesh.uv_sets[0], mesh.uv_sets[1]);
}

#[test]
fn what_the_stream_does_not_hold_is_told_with_its_place() {
    let whole = grid().asset(0);
    let told = |change: &dyn Fn(&mut Asset), place: &str, what: &str| {
        let mut a = whole.clone();
        change(&mut a);
        let text = a.error();
        assert!(text.contains(place) && text.contains(what), "{text}");
    };
    let e = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    told(
        &|a| extension(a)["attributes"]["NORMAL"] = json!(9),
        &format!("{e}/attributes/NORMAL"),
        "not in the stream",
    );
    told(
        &|a| extension(a)["attributes"]["NORMAL"] = json!(2),
        &format!("{e}/attributes/NORMAL"),
        "has 2 components, 3 are needed",
    );
    told(
        &|a| {
            for accessor in a.json["accessors"].as_array_mut().unwrap() {
                if accessor["count"] == json!(N) {
                    accessor["count"] = json!(N + 1);
                }
            }
        },
        e,
        "the accessors say 170",
    );
    told(
        &|a| a.json["bufferViews"][0]["byteLength"] = json!(100),
        e,
        "cannot be decoded",
    );
    // More than the accessors promise is refused before there is room for it.
    told(
        &|a| {
            for accessor in a.json["accessors"].as_array_mut().unwrap() {
                accessor["count"] = json!(3);
            }
        },
        e,
        "cannot be decoded",
    );
}
