//! Meshes: the primitives that make surfaces.

use std::sync::Arc;

use super::accessor::Source;
use super::json::Cursor;
use super::skin::Skin;
use super::vertices::{Attributes, Vertices};
use super::{Notes, Problem, implicit, morph};
use crate::geometry::{SphereSet, TriangleMesh};
use crate::math::{DVec3, Vec3};

/// What a primitive is made of.
pub(super) enum Part {
    /// Triangles.
    Mesh(TriangleMesh),
    /// Points with a radius.
    Spheres(SphereSet),
}

/// What bends a primitive out of its rest shape.
#[derive(Clone, Copy, Default)]
pub(super) struct Shaping<'s> {
    /// Weights of the morph targets; those that are missing are zero.
    pub(super) weights: &'s [f64],
    /// Joints that carry the vertices.
    pub(super) skin: Option<&'s Skin>,
}

/// Reads a primitive; `None` if it makes no surface.
pub(super) fn read<'a>(
    p: &Cursor<'a>,
    source: &Source<'a>,
    shaping: Shaping<'_>,
    notes: &mut Notes,
) -> Result<Option<Part>, Problem> {
    if let Some(set) = implicit::shape(p, &source.root, notes)? {
        return Ok(Some(Part::Spheres(set)));
    }
    let mut mode = p.index_or("mode", 4)?;
    let map = p.need("attributes")?;
    let Some(position) = map.get("POSITION") else {
        notes.add("primitives without positions are left out", 1);
        return Ok(None);
    };
    match mode {
        0 if map.get("_RADIUS").is_some() => {}
        4..=6 => {}
        0 => {
            notes.add("points without _RADIUS have no surface and are left out", 1);
            return Ok(None);
        }
        1..=3 => {
            notes.add("lines have no surface and are left out", 1);
            return Ok(None);
        }
        other => return Err(p.need("mode")?.problem(format!("{other} is no mode"))),
    }
    let mut attributes = Attributes {
        count: source.accessor(&position)?.count,
        source,
        map,
        pick: None,
        #[cfg(feature = "draco")]
        draco: None,
    };
    let order = match p.extension(DRACO) {
        Some(e) => {
            // Strips come out as lists.
            mode = 4;
            Order::Triangles(compressed(p, &e, &mut attributes)?)
        }
        None => order(p, &mut attributes, &position, mode)?,
    };
    let mut vertices = attributes.vertices()?;
    let (mut indices, mut points) = (Vec::new(), None);
    if mode == 0 {
        points = Some(order);
    } else {
        indices = order.triangles(vertices.positions.len(), mode);
        check_normals(&vertices, &indices, &attributes)?;
    }
    morph::apply(p, &attributes, shaping.weights, &mut vertices)?;
    let mirrored = match shaping.skin {
        Some(skin) => skin.apply(&attributes, &mut vertices)?,
        None => false,
    };
    if let Some(order) = points {
        return Ok(Some(Part::Spheres(spheres(&vertices, order))));
    }
    if mirrored {
        for [_, b, c] in &mut indices {
            std::mem::swap(b, c);
        }
    }
    Ok(Some(Part::Mesh(TriangleMesh {
        indices,
        positions: vertices.positions,
        normals: vertices.normals,
        uv_sets: vertices.uv_sets,
        colors: vertices.colors,
        tangents: vertices.tangents,
        ..TriangleMesh::default()
    })))
}

/// The extension that compresses primitives.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// Decodes a compressed primitive and gives its triangles.
#[cfg(feature = "draco")]
fn compressed<'a>(
    p: &Cursor<'a>,
    e: &Cursor<'a>,
    attributes: &mut Attributes<'_, 'a>,
) -> Result<Vec<[u32; 3]>, Problem> {
    let indices = match p.get("indices") {
        Some(at) => attributes.source.accessor(&at)?.count,
        None => attributes.count,
    };
    let (draco, order) =
        super::draco::Draco::decode(e, attributes.source, attributes.count, indices)?;
    attributes.draco = Some(Arc::new(draco));
    Ok(order)
}

#[cfg(not(feature = "draco"))]
fn compressed<'a>(
    _: &Cursor<'a>,
    e: &Cursor<'a>,
    _: &mut Attributes<'_, 'a>,
) -> Result<Vec<[u32; 3]>, Problem> {
    Err(Problem::unsupported(
        e.path(),
        "is compressed, which this build cannot read",
        "build with the feature `draco`, or export without compression",
    ))
}

/// In which order a primitive takes its vertices.
enum Order {
    /// As they come.
    Plain,
    /// One after the other.
    Listed(Vec<u32>),
    /// By threes, as they stay: long lists are not copied.
    Triangles(Vec<[u32; 3]>),
}

impl Order {
    /// The vertices; `None` if they are taken as they come.
    fn flat(&mut self) -> Option<&mut [u32]> {
        match self {
            Self::Plain => None,
            Self::Listed(list) => Some(list),
            Self::Triangles(list) => Some(list.as_flattened_mut()),
        }
    }

    /// Triangles of a list (mode 4), strip (5) or fan (6) of `n` vertices; strips alternate their
    /// winding (glTF 2.0, 3.7.2.1).
    fn triangles(self, n: usize, mode: usize) -> Vec<[u32; 3]> {
        let list = match self {
            Self::Triangles(list) => return list,
            Self::Listed(list) => list,
            Self::Plain => {
                return (0..triangle_count(n, mode))
                    .map(|t| corners(t, mode).map(|k| k as u32))
                    .collect();
            }
        };
        (0..triangle_count(list.len(), mode))
            .map(|t| corners(t, mode).map(|k| list[k]))
            .collect()
    }
}

/// The order of a primitive. Where its indices name fewer vertices than there are, as when many
/// primitives share one array, only those are picked.
fn order<'a>(
    p: &Cursor<'a>,
    attributes: &mut Attributes<'_, 'a>,
    position: &Cursor<'a>,
    mode: usize,
) -> Result<Order, Problem> {
    let n = attributes.count;
    let Some(indices) = p.get("indices") else {
        return match u32::try_from(n) {
            Ok(_) => Ok(Order::Plain),
            Err(_) => Err(position.problem("has too many vertices")),
        };
    };
    let triples = match mode {
        4 => attributes.source.triples(&indices)?,
        _ => None,
    };
    let mut order = match triples {
        Some(list) => Order::Triangles(list),
        None => Order::Listed(attributes.source.indices(&indices)?),
    };
    let flat = order.flat().unwrap_or_default();
    if let Some(i) = flat.iter().copied().max().filter(|&i| i as usize >= n) {
        return Err(indices.problem(format!("index {i} is out of range: there are {n} vertices")));
    }
    if flat.len() < n {
        let mut used = flat.to_vec();
        used.sort_unstable();
        used.dedup();
        if used.len() < n {
            for i in flat {
                *i = used.binary_search(i).unwrap_or_default() as u32;
            }
            attributes.pick = Some(Arc::new(used));
        }
    }
    Ok(order)
}

/// Refuses normals without length, except on triangles without area, which nothing ever hits.
fn check_normals(
    v: &Vertices,
    indices: &[[u32; 3]],
    attributes: &Attributes<'_, '_>,
) -> Result<(), Problem> {
    if !v.normals.contains(&[0.0; 3]) {
        return Ok(());
    }
    for t in indices {
        let at = t.map(|i| i as usize);
        let Some(k) = at.iter().find(|&&i| v.normals[i] == [0.0; 3]) else {
            continue;
        };
        let [a, b, c] = at.map(|i| Vec3::from(v.positions[i]).as_dvec3());
        if (b - a).cross(c - a) != DVec3::ZERO {
            let normals = attributes.map.need("NORMAL")?;
            return Err(normals.problem(format!("the normal of vertex {k} has no length")));
        }
    }
    Ok(())
}

/// The spheres of points, each once.
fn spheres(v: &Vertices, mut order: Order) -> SphereSet {
    let one = |i: usize| {
        let ([x, y, z], [r]) = (v.positions[i], v.radii[i]);
        [x, y, z, r]
    };
    let spheres = match order.flat() {
        Some(order) => {
            let mut order = order.to_vec();
            order.sort_unstable();
            order.dedup();
            order.into_iter().map(|i| one(i as usize)).collect()
        }
        None => (0..v.positions.len()).map(one).collect(),
    };
    SphereSet { spheres }
}

/// Number of triangles that `n` vertices make.
fn triangle_count(n: usize, mode: usize) -> usize {
    match mode {
        4 => n / 3,
        _ => n.saturating_sub(2),
    }
}

/// Which vertices make triangle `t`.
fn corners(t: usize, mode: usize) -> [usize; 3] {
    match mode {
        5 if t.is_multiple_of(2) => [t, t + 1, t + 2],
        5 => [t, t + 2, t + 1],
        6 => [t + 1, t + 2, 0],
        _ => [3 * t, 3 * t + 1, 3 * t + 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_their_winding() {
        let listed = || Order::Listed(vec![0, 1, 2, 3]);
        for order in [listed, || Order::Plain] {
            let triangles = |mode| order().triangles(4, mode);
            assert_eq!(triangles(5), [[0, 1, 2], [1, 3, 2]]);
            assert_eq!(triangles(6), [[1, 2, 0], [2, 3, 0]]);
            assert_eq!(triangles(4), [[0, 1, 2]]);
        }
        let none = Order::Listed(vec![]).triangles(9, 6);
        assert!(none.is_empty() && Order::Plain.triangles(1, 5).is_empty());
    }
}
