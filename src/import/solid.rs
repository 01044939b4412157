//! Glass without `KHR_materials_volume`: thin-walled by the specification, but what Blender's
//! exporter writes of ordinary solid glass.

use rayon::prelude::*;

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
    // Adding zero makes one of both zeros.
    let positions = || parts.iter().flat_map(|m| &m.positions);
    let welded = weld(positions().map(|p| p.map(|x| (x + 0.0).to_bits())));
    // Edges by their ends, those that go up and those that go down: lists, which are sorted, since
    // tables would take more memory than the mesh.
    let (mut up, mut down) = (Vec::new(), Vec::new());
    let mut first = 0;
    for mesh in parts {
        for t in &mesh.indices {
            let [a, b, c] = t.map(|i| u64::from(welded[first + i as usize]));
            if a == b || b == c || c == a {
                continue;
            }
            for (from, to) in [(a, b), (b, c), (c, a)] {
                if from < to {
                    up.push(from << 32 | to);
                } else {
                    down.push(to << 32 | from);
                }
            }
        }
        first += mesh.positions.len();
    }
    if up.is_empty() || up.len() != down.len() {
        return false;
    }
    up.par_sort_unstable();
    down.par_sort_unstable();
    up == down && up.windows(2).all(|w| w[0] != w[1])
}

/// For each key the same number as for all keys that are equal.
fn weld(keys: impl Iterator<Item = [u32; 3]>) -> Vec<u32> {
    let mut sorted: Vec<([u32; 3], u32)> = keys.zip(0..).collect();
    sorted.par_sort_unstable();
    let mut numbers = vec![0; sorted.len()];
    let mut number = 0;
    for (i, (key, at)) in sorted.iter().enumerate() {
        if i > 0 && sorted[i - 1].0 != *key {
            number += 1;
        }
        numbers[*at as usize] = number;
    }
    numbers
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
