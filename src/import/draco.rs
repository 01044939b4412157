//! Primitives that `KHR_draco_mesh_compression` packs.

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};

use super::Problem;
use super::accessor::{Accessor, Component, Source};
use super::json::Cursor;

/// A decoded primitive: indices and the attributes that are in it.
pub(super) struct Draco<'a> {
    mesh: Mesh,
    /// From names of attributes to their ids in the stream.
    ids: Cursor<'a>,
    at: Cursor<'a>,
}

impl<'a> Draco<'a> {
    /// Decodes what the extension object `e` names; the primitive has `vertices` vertices, and
    /// `indices` indices.
    pub(super) fn decode(
        e: &Cursor<'a>,
        source: &Source<'a>,
        vertices: usize,
        indices: usize,
    ) -> Result<Self, Problem> {
        let ids = e.need("attributes")?;
        let names = ids.value().as_object().map_or(0, serde_json::Map::len);
        // Up to four 32-bit numbers in each attribute. What the accessors promise is the bound.
        let bytes = vertices
            .saturating_mul(16)
            .saturating_mul(names.max(1))
            .saturating_add(indices.saturating_mul(4));
        source.views.claim(bytes, e)?;
        let packed = source.views.bytes(&e.need("bufferView")?)?;
        let limits = DecodeLimits::default()
            .with_max_points(vertices as u64)
            .with_max_faces(indices as u64)
            .with_max_decoded_bytes((bytes as u64).saturating_mul(2).saturating_add(1 << 20));
        let mut mesh = Mesh::new();
        MeshDecoder::new()
            .decode(
                &mut DecoderBuffer::new(&packed).with_limits(limits),
                &mut mesh,
            )
            .map_err(|error| e.problem(format!("cannot be decoded ({error})")))?;
        if mesh.num_points() != vertices {
            return Err(e.problem(format!(
                "holds {} vertices, the accessors say {vertices}",
                mesh.num_points()
            )));
        }
        Ok(Self {
            mesh,
            ids,
            at: e.clone(),
        })
    }

    /// Its triangles.
    pub(super) fn indices(&self) -> Result<Vec<[u32; 3]>, Problem> {
        let n = self.mesh.num_points();
        let order: Vec<[u32; 3]> = self.mesh.faces().iter().map(|t| t.map(|i| i.0)).collect();
        match order.iter().flatten().find(|&&i| i as usize >= n) {
            Some(i) => Err(self.at.problem(format!("index {i} is out of range"))),
            None => Ok(order),
        }
    }

    /// The attribute of `N` numbers that an accessor stands for, which says of which type they are;
    /// `None` if it is not in the stream.
    pub(super) fn floats<const N: usize>(
        &self,
        accessor: &Accessor<'a>,
    ) -> Result<Option<Vec<[f32; N]>>, Problem> {
        // The last part of the pointer to the reference is the attribute's name.
        let name = accessor.from.path().rsplit('/').next().unwrap_or_default();
        let Some(id) = self.ids.get(name) else {
            return Ok(None);
        };
        let known = u32::try_from(id.index()?)
            .ok()
            .and_then(|id| self.mesh.attribute_by_unique_id(id));
        let Some(attribute) = known else {
            return Err(id.problem("names an attribute that is not in the stream"));
        };
        if usize::from(attribute.num_components()) != N {
            return Err(id.problem(format!(
                "has {} components, {N} are needed",
                attribute.num_components()
            )));
        }
        let flat = attribute.read_f32s(self.mesh.num_points(), N);
        let scale = match (accessor.normalized, accessor.component) {
            (true, Component::I8) => 127.0,
            (true, Component::U8) => 255.0,
            (true, Component::I16) => 32767.0,
            (true, Component::U16) => 65535.0,
            _ => 1.0,
        };
        let number = |x: f32| {
            if scale == 1.0 {
                x
            } else {
                (x / scale).max(-1.0)
            }
        };
        Ok(Some(
            flat.chunks_exact(N)
                .map(|c| std::array::from_fn(|k| number(c[k])))
                .collect(),
        ))
    }
}
