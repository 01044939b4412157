//! glTF files made in a test, number by number.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::fs;
use std::path::PathBuf;

use base64::Engine;
use dualight::error::Error;
use dualight::geometry::{Shape, SphereSet, TriangleMesh};
use dualight::import::{ImportOptions, load};
use dualight::scene::{Scene, ScenePlugins};
use serde_json::{Value, json};

/// A file: its JSON, and the one buffer that its accessors read.
#[derive(Clone)]
pub struct Asset {
    pub json: Value,
    pub bytes: Vec<u8>,
}

impl Default for Asset {
    fn default() -> Self {
        Self::new()
    }
}

impl Asset {
    /// One node with one mesh without primitives.
    pub fn new() -> Self {
        Self {
            json: json!({
                "asset": {"version": "2.0"}, "scene": 0,
                "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                "meshes": [{"primitives": []}],
                "accessors": [], "bufferViews": [],
            }),
            bytes: Vec::new(),
        }
    }

    /// A triangle (0 0 0) (1 0 0) (0 1 0) as mesh 0.
    pub fn triangle() -> Self {
        let mut a = Self::new();
        let p = a.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
        a.json["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": p}}]);
        a
    }

    /// The attributes of the first primitive.
    pub fn attributes(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]["attributes"]
    }

    /// Adds a buffer view.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({
            "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()
        }));
        self.bytes.extend_from_slice(bytes);
        views.len() - 1
    }

    /// Adds an accessor.
    pub fn accessor(&mut self, v: Value) -> usize {
        let list = self.json["accessors"].as_array_mut().unwrap();
        list.push(v);
        list.len() - 1
    }

    /// Adds an accessor of packed elements.
    pub fn packed(&mut self, kind: &str, component: u32, bytes: &[u8], count: usize) -> usize {
        let view = self.view(bytes);
        self.accessor(json!({
            "bufferView": view, "componentType": component, "type": kind, "count": count
        }))
    }

    /// Adds an accessor of floats.
    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let count = values.len() / width(kind);
        self.packed(kind, 5126, &bytes, count)
    }

    /// Adds an accessor of 16-bit numbers.
    pub fn shorts(&mut self, kind: &str, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.packed(kind, 5123, &bytes, values.len() / width(kind))
    }

    /// The file as text, its buffer within.
    pub fn text(&self) -> String {
        let mut v = self.json.clone();
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bytes);
        v["buffers"] = json!([{
            "byteLength": self.bytes.len(),
            "uri": format!("data:application/octet-stream;base64,{data}"),
        }]);
        v.to_string()
    }

    /// The file as GLB.
    pub fn glb(&self) -> Vec<u8> {
        let mut v = self.json.clone();
        v["buffers"] = json!([{"byteLength": self.bytes.len()}]);
        let mut text = v.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bytes = self.bytes.clone();
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        let word = |n: usize| (n as u32).to_le_bytes();
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

    /// Reads it.
    pub fn read_with(&self, options: &ImportOptions) -> Result<Scene, Error> {
        let dir = tempfile::tempdir().unwrap();
        let path: PathBuf = dir.path().join("scene.gltf");
        fs::write(&path, self.text()).unwrap();
        load(&path, options, ScenePlugins::default())
    }

    /// Reads it as it comes.
    pub fn read(&self) -> Result<Scene, Error> {
        self.read_with(&ImportOptions::default())
    }

    /// Reads it; what is wrong with it, in words.
    pub fn error(&self) -> String {
        match self.read() {
            Ok(_) => panic!("was read: {}", self.json),
            Err(e) => e.to_string(),
        }
    }

    /// Its only mesh.
    pub fn mesh(&self) -> TriangleMesh {
        mesh(&self.read().unwrap())
    }
}

/// The first mesh of a scene.
pub fn mesh(scene: &Scene) -> TriangleMesh {
    let found = scene.geometry.shapes.iter().find_map(|s| match s {
        Shape::Mesh(m) => Some(m.clone()),
        Shape::Spheres(_) => None,
    });
    found.unwrap()
}

/// The first set of spheres of a scene.
pub fn spheres(scene: &Scene) -> SphereSet {
    let found = scene.geometry.shapes.iter().find_map(|s| match s {
        Shape::Spheres(s) => Some(s.clone()),
        Shape::Mesh(_) => None,
    });
    found.unwrap()
}

fn width(kind: &str) -> usize {
    match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        _ => 16,
    }
}

/// A triangle, and node 1 with what `node` says.
pub fn with_node(node: Value) -> Asset {
    let mut a = Asset::triangle();
    a.json["nodes"] = json!([{"mesh": 0}, node]);
    a.json["scenes"] = json!([{"nodes": [0, 1]}]);
    a
}

/// A triangle under a lamp, as `KHR_lights_punctual` has it.
pub fn with_light(light: Value) -> Asset {
    let mut a = with_node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    a.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    a
}

/// A triangle under an area light, as our extras have it.
pub fn area(area: Value) -> Asset {
    with_node(json!({
        "name": "Area", "scale": [2, 3, 1],
        "extras": {"dualight": {"area_light": area}, "stranger": 1}
    }))
}
