//! Meshes: the primitives that make surfaces.

use super::accessor::Source;
use super::json::Cursor;
use super::{Notes, Problem};
use crate::geometry::TriangleMesh;

/// Reads a primitive; `None` if it makes no surface.
pub(super) fn read<'a>(
    p: &Cursor<'a>,
    source: &Source<'a>,
    notes: &mut Notes,
) -> Result<Option<TriangleMesh>, Problem> {
    let mode = p.index_or("mode", 4)?;
    if !(4..=6).contains(&mode) {
        notes.add(
            "primitives that are points or lines have no surface and are left out",
            1,
        );
        return Ok(None);
    }
    if p.get("targets").is_some() {
        notes.add(
            "morph targets are not supported yet: the rest shape is used",
            1,
        );
    }
    let attributes = p.need("attributes")?;
    let Some(position) = attributes.get("POSITION") else {
        notes.add("primitives without positions are left out", 1);
        return Ok(None);
    };
    let positions = source.read::<3>(&position)?;
    let n = positions.len();
    let order = match p.get("indices") {
        Some(indices) => source.read_indices(&indices)?,
        None => {
            (0..u32::try_from(n).map_err(|_| position.problem("has too many vertices"))?).collect()
        }
    };
    let mesh = TriangleMesh {
        positions: narrow(positions),
        indices: triangles(&order, mode),
        normals: match attributes.get("NORMAL") {
            Some(a) => narrow(same_length(&a, source.read::<3>(&a)?, n)?),
            None => Vec::new(),
        },
        uv_sets: match attributes.get("TEXCOORD_0") {
            Some(a) => vec![narrow(same_length(&a, source.read::<2>(&a)?, n)?)],
            None => Vec::new(),
        },
        ..Default::default()
    };
    if let Some(i) = order.iter().find(|&&i| i as usize >= n) {
        return Err(p.problem(format!("index {i} is out of range: there are {n} vertices")));
    }
    Ok(Some(mesh))
}

fn same_length<const N: usize>(
    a: &Cursor<'_>,
    v: Vec<[f64; N]>,
    n: usize,
) -> Result<Vec<[f64; N]>, Problem> {
    if v.len() == n {
        Ok(v)
    } else {
        Err(a.problem(format!("has {} elements for {n} positions", v.len())))
    }
}

fn narrow<const N: usize>(v: Vec<[f64; N]>) -> Vec<[f32; N]> {
    v.into_iter().map(|e| e.map(|x| x as f32)).collect()
}

/// Triangles of a list (mode 4), strip (5) or fan (6); strips alternate their winding
/// (glTF 2.0, 3.7.2.1).
fn triangles(order: &[u32], mode: usize) -> Vec<[u32; 3]> {
    match mode {
        5 => order
            .windows(3)
            .enumerate()
            .map(|(i, w)| {
                if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[0], w[2], w[1]]
                }
            })
            .collect(),
        6 => order
            .windows(2)
            .skip(1)
            .map(|w| [w[0], w[1], order[0]])
            .collect(),
        _ => order.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_their_winding() {
        assert_eq!(triangles(&[0, 1, 2, 3], 5), [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(triangles(&[0, 1, 2, 3], 6), [[1, 2, 0], [2, 3, 0]]);
        assert_eq!(triangles(&[0, 1, 2, 3], 4), [[0, 1, 2]]);
        assert!(triangles(&[], 6).is_empty() && triangles(&[0], 5).is_empty());
    }
}
