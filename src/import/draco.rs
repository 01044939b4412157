//! Primitives that `KHR_draco_mesh_compression` packs.

use std::sync::{Mutex, PoisonError};

use draco_core::{
    DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute, PointCloud,
    PointIndex,
};

use super::accessor::{Accessor, Component, Source};
use super::json::Cursor;
use super::quiet::quietly;
use super::{Problem, mesh};

/// A decoded primitive: the attributes that are in it, until they are read.
pub(super) struct Draco<'a> {
    cloud: Mutex<PointCloud>,
    /// From names of attributes to their ids in the stream.
    ids: Cursor<'a>,
}

/// How much more than what it makes the decoder needs while it works: it holds the edges of all
/// triangles, once more for each attribute with seams, beside the mesh. Measured for triangles with
/// normals and texture coordinates; the format's own library needs 4.3 times as much.
const EFFORT: usize = 5;

/// Bytes that all compressed primitives of the document `root` will take.
pub(super) fn total(root: &Cursor<'_>) -> usize {
    let meshes = root.items("meshes").unwrap_or_default();
    let primitives: Vec<_> = meshes
        .iter()
        .flat_map(|m| m.items("primitives").unwrap_or_default())
        .collect();
    sizes(root, primitives.iter())
        .into_iter()
        .fold(0, usize::saturating_add)
}

/// Bytes that each of these primitives will take, as far as Draco packs it.
pub(super) fn sizes<'p, 'a: 'p>(
    root: &Cursor<'a>,
    primitives: impl Iterator<Item = &'p Cursor<'a>>,
) -> Vec<usize> {
    let accessors = root.items("accessors").unwrap_or_default();
    let count = |at: Option<Cursor<'_>>| {
        let accessor = at.and_then(|at| accessors.get(at.index().ok()?));
        accessor.map_or(0, |a| a.index_or("count", 0).unwrap_or(0))
    };
    let one = |p: &Cursor<'_>| {
        let e = p.extension(mesh::DRACO)?;
        let vertices = count(p.get("attributes")?.get("POSITION"));
        Some(size(&e, vertices, count(p.get("indices"))))
    };
    primitives.map(|p| one(p).unwrap_or(0)).collect()
}

/// Does work in a thread of its own. Allocators keep what a thread frees for that thread: so the next
/// decoder gets what this one had, and not every thread of the pool keeps as much.
fn apart<T: Send>(
    at: &Cursor<'_>,
    work: impl FnOnce() -> Result<T, Problem> + Send,
) -> Result<T, Problem> {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().spawn_scoped(scope, || quietly(work));
        let thread = thread.map_err(|e| at.problem(format!("gets no thread ({e})")))?;
        let done = thread.join().ok().flatten();
        done.unwrap_or_else(|| Err(at.problem("cannot be decoded: its bytes are damaged")))
    })
}

/// Bytes of a primitive: 12 for each vertex in each attribute, more or less, and its indices.
fn size(e: &Cursor<'_>, vertices: usize, indices: usize) -> usize {
    let ids = e.get("attributes");
    let names = ids.and_then(|a| a.value().as_object().map(serde_json::Map::len));
    let vertex = names.unwrap_or(0).saturating_mul(12);
    vertices
        .saturating_mul(vertex)
        .saturating_add(indices.saturating_mul(4))
}

impl<'a> Draco<'a> {
    /// Decodes what the extension object `e` names, and gives its triangles, too; the primitive has
    /// `vertices` vertices, and `indices` indices.
    pub(super) fn decode(
        e: &Cursor<'a>,
        source: &Source<'a>,
        vertices: usize,
        indices: usize,
    ) -> Result<(Self, Vec<[u32; 3]>), Problem> {
        let ids = e.need("attributes")?;
        let names = ids.value().as_object().map_or(0, serde_json::Map::len);
        // Up to four 32-bit numbers in each attribute. What the accessors promise is the bound.
        let bytes = vertices
            .saturating_mul(16)
            .saturating_mul(names.max(1))
            .saturating_add(indices.saturating_mul(4));
        source.views.claim(bytes, e)?;
        let limits = DecodeLimits::default()
            .with_max_points(vertices as u64)
            .with_max_faces(indices as u64)
            .with_max_decoded_bytes((bytes as u64).saturating_mul(2).saturating_add(1 << 20));
        let packed = source.views.get(&e.need("bufferView")?)?;
        let size = size(e, vertices, indices);
        let decode = || {
            let packed = packed.read(0, packed.len)?;
            let mut mesh = Mesh::new();
            MeshDecoder::new()
                .decode(
                    &mut DecoderBuffer::new(&packed).with_limits(limits),
                    &mut mesh,
                )
                .map_err(|error| e.problem(format!("cannot be decoded ({error})")))?;
            Ok::<_, Problem>(mesh)
        };
        let need = size.saturating_mul(EFFORT);
        let mesh = source.gate.pass(need, size, || apart(e, decode))?;
        if mesh.num_points() != vertices {
            return Err(e.problem(format!(
                "holds {} vertices, the accessors say {vertices}",
                mesh.num_points()
            )));
        }
        let order: Vec<[u32; 3]> = mesh.faces().iter().map(|t| t.map(|i| i.0)).collect();
        if let Some(i) = order.iter().flatten().find(|&&i| i as usize >= vertices) {
            return Err(e.problem(format!("index {i} is out of range")));
        }
        let draco = Self {
            cloud: Mutex::new(mesh.into_point_cloud()),
            ids,
        };
        Ok((draco, order))
    }

    /// The attribute with this id in the stream and the number of vertices. It is gone then, unless
    /// several names share it.
    fn take(&self, id: &Cursor<'a>) -> Result<(PointAttribute, usize), Problem> {
        let mut cloud = self.cloud.lock().unwrap_or_else(PoisonError::into_inner);
        let unique = u32::try_from(id.index()?).unwrap_or(u32::MAX);
        let at = cloud.attribute_id_by_unique_id(unique);
        let n = cloud.num_points();
        let Some(attribute) = (at >= 0).then(|| cloud.attribute_mut(at)) else {
            return Err(id.problem("names an attribute that is not in the stream"));
        };
        let all = self.ids.value().as_object();
        let same = |v: &&serde_json::Value| v.as_u64() == Some(u64::from(unique));
        let shared = all.map_or(0, |ids| ids.values().filter(same).count()) > 1;
        if shared {
            return Ok((attribute.clone(), n));
        }
        // What is left in its place must not be found by the id of another.
        let mut empty = PointAttribute::new();
        empty.set_unique_id(u32::MAX);
        Ok((std::mem::replace(attribute, empty), n))
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
        let (attribute, n) = self.take(&id)?;
        if usize::from(attribute.num_components()) != N {
            return Err(id.problem(format!(
                "has {} components, {N} are needed",
                attribute.num_components()
            )));
        }
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
        if attribute.data_type() == DataType::Float32 {
            let (data, stride) = (attribute.buffer().data(), attribute.byte_stride() as usize);
            let one = |i: usize| {
                let at = attribute.mapped_index(PointIndex(i as u32)).0 as usize;
                let bytes = at
                    .checked_mul(stride)
                    .and_then(|at| data.get(at..)?.get(..4 * N));
                let words = bytes.map(|b| b.as_chunks::<4>().0);
                std::array::from_fn(|k| words.map_or(0.0, |w| number(f32::from_le_bytes(w[k]))))
            };
            return Ok(Some((0..n).map(one).collect()));
        }
        let flat = attribute.read_f32s(n, N);
        Ok(Some(
            flat.chunks_exact(N)
                .map(|c| std::array::from_fn(|k| number(c[k])))
                .collect(),
        ))
    }
}
