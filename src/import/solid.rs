//! Glass without `KHR_materials_volume`: thin-walled by the specification, but what Blender's
//! exporter writes of ordinary solid glass.

use std::collections::{HashMap, HashSet};

use super::json::Cursor;
use crate::geometry::TriangleMesh;
use crate::materials::MaterialDesc;

/// Which transmitting materials without a volume are taken for solid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SolidGlass {
    /// In files of Blender's exporter, on closed meshes.
    #[default]
    Auto,
    /// All.
    Always,
    /// None, as the specification has it.
    Never,
}

/// The solid twin of a material, if it is glass that says nothing of a volume. One that says its
/// thickness is zero is meant to be thin.
pub(super) fn twin(m: &Cursor<'_>, desc: &MaterialDesc) -> Option<MaterialDesc> {
    let silent = m.extension("KHR_materials_volume").is_none();
    (desc.transmission > 0.0 && silent).then(|| MaterialDesc {
        volume: true,
        ..desc.clone()
    })
}

/// Whether in all `parts` together every edge is shared by two triangles of consistent winding.
/// Vertices in one place are one, as seams of texture coordinates and changes of material split
/// them; triangles without area do not count.
pub(super) fn is_closed(parts: &[&TriangleMesh]) -> bool {
    let mut known = HashMap::new();
    let mut edges = HashSet::new();
    for mesh in parts {
        let welded: Vec<u32> = mesh
            .positions
            .iter()
            .map(|p| {
                // Adding zero makes one of both zeros.
                let next = known.len() as u32;
                *known.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(next)
            })
            .collect();
        for t in &mesh.indices {
            let [a, b, c] = t.map(|i| welded[i as usize]);
            if a == b || b == c || c == a {
                continue;
            }
            for edge in [(a, b), (b, c), (c, a)] {
                if !edges.insert(edge) {
                    return false;
                }
            }
        }
    }
    !edges.is_empty() && edges.iter().all(|&(a, b)| edges.contains(&(b, a)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube, each side with vertices of its own.
    fn cube() -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for axis in 0..3 {
            for side in [0.0f32, 1.0] {
                let n = mesh.positions.len() as u32;
                for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                    let mut p = [-0.0; 3];
                    p[axis] = side;
                    p[(axis + 1) % 3] = u;
                    p[(axis + 2) % 3] = v;
                    mesh.positions.push(p);
                }
                let mut quad = [[n, n + 1, n + 2], [n, n + 2, n + 3]];
                if side == 0.0 {
                    quad.iter_mut().for_each(|t| t.swap(1, 2));
                }
                mesh.indices.extend(quad);
            }
        }
        mesh
    }

    #[test]
    fn bodies_are_closed_and_panes_and_broken_bodies_are_not() {
        let whole = cube();
        assert!(is_closed(&[&whole]));
        let mut degenerate = cube();
        degenerate.indices.push([0, 0, 1]);
        assert!(is_closed(&[&degenerate]));
        let mut holed = cube();
        holed.indices.pop();
        assert!(!is_closed(&[&holed]));
        let mut flipped = cube();
        flipped.indices[3].swap(0, 1);
        assert!(!is_closed(&[&flipped]));
        let mut doubled = cube();
        doubled.indices.push(doubled.indices[0]);
        assert!(!is_closed(&[&doubled]));
        assert!(!is_closed(&[&TriangleMesh::default()]) && !is_closed(&[]));
        let (mut lower, mut upper) = (cube(), cube());
        upper.indices = lower.indices.split_off(5);
        assert!(is_closed(&[&lower, &upper]) && !is_closed(&[&lower]) && !is_closed(&[&upper]));
    }
}
