//! Meshes packed by Draco's encoder, for files that are made in a test.
#![allow(dead_code, reason = "each test uses a part of it")]

use draco_core::{
    DataType, EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, Mesh, MeshEncoder,
    PointAttribute,
};
use serde_json::{Map, Value, json};

use crate::asset::Asset;

/// An attribute by its name in glTF, so many numbers for each vertex.
pub(crate) struct Column<'a> {
    pub(crate) name: &'a str,
    pub(crate) width: usize,
    pub(crate) numbers: Numbers<'a>,
}

/// The numbers of an attribute.
pub(crate) enum Numbers<'a> {
    Floats(&'a [f32]),
    Bytes(&'a [u8]),
}

impl Column<'_> {
    fn attribute(&self, vertices: usize) -> PointAttribute {
        let kind = match self.name {
            "POSITION" => GeometryAttributeType::Position,
            "NORMAL" => GeometryAttributeType::Normal,
            "TEXCOORD_0" => GeometryAttributeType::TexCoord,
            "COLOR_0" => GeometryAttributeType::Color,
            _ => GeometryAttributeType::Generic,
        };
        let (data, bytes): (_, &[u8]) = match self.numbers {
            Numbers::Floats(all) => (DataType::Float32, bytemuck::cast_slice(all)),
            Numbers::Bytes(all) => (DataType::Uint8, all),
        };
        let mut attribute = PointAttribute::new();
        attribute.init(kind, self.width as u8, data, false, vertices);
        attribute.buffer_mut().write(0, bytes);
        attribute
    }

    fn component(&self) -> u32 {
        match self.numbers {
            Numbers::Floats(_) => 5126,
            Numbers::Bytes(_) => 5121,
        }
    }
}

/// The stream of a mesh; slow encoders (0) walk over its triangles, the fastest (10) lists them.
pub(crate) fn pack(columns: &[Column<'_>], triangles: &[[u32; 3]], speed: i32) -> Vec<u8> {
    let mut mesh = Mesh::new();
    for column in columns {
        let numbers = match column.numbers {
            Numbers::Floats(all) => all.len(),
            Numbers::Bytes(all) => all.len(),
        };
        mesh.add_attribute(column.attribute(numbers / column.width));
    }
    mesh.set_num_faces(triangles.len());
    for (i, t) in triangles.iter().enumerate() {
        mesh.set_face(FaceIndex(i as u32), t.map(Into::into));
    }
    let mut options = EncoderOptions::new();
    options.set_global_int("encoding_speed", speed);
    options.set_global_int("decoding_speed", speed);
    for (i, column) in columns.iter().enumerate() {
        if matches!(column.numbers, Numbers::Floats(_)) {
            options.set_attribute_int(i as i32, "quantization_bits", 14);
        }
    }
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut out = EncoderBuffer::new();
    encoder.encode(&options, &mut out).unwrap();
    out.data().to_vec()
}

/// A primitive whose attributes and triangles are in a stream of their own.
pub(crate) fn primitive(
    a: &mut Asset,
    columns: &[Column<'_>],
    triangles: &[[u32; 3]],
    vertices: usize,
    speed: i32,
) -> Value {
    let stream = pack(columns, triangles, speed);
    let view = a.view(&stream);
    let (mut attributes, mut ids) = (Map::new(), Map::new());
    for (i, column) in columns.iter().enumerate() {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][column.width - 1];
        let accessor = a.accessor(json!({
            "componentType": column.component(), "type": kind, "count": vertices,
            "normalized": column.component() == 5121,
        }));
        attributes.insert(column.name.into(), json!(accessor));
        ids.insert(column.name.into(), json!(i));
    }
    let indices = a.accessor(json!({
        "componentType": 5125, "type": "SCALAR", "count": 3 * triangles.len(),
    }));
    json!({
        "attributes": attributes, "indices": indices,
        "extensions": {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": ids}},
    })
}
