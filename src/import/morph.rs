//! Morph targets (glTF 2.0, 3.7.2.2): displacements of vertex attributes, by weight.

use super::Problem;
use super::json::Cursor;
use super::vertices::{Attributes, Vertices};
use crate::math::Vec3;

/// The weights of the targets of a mesh: those of its pose, or of the node, or its own. Zeros at
/// the end are left out, so that equal shapes have equal weights.
pub(super) fn weights(
    posed: Option<&Vec<f64>>,
    node: &Cursor<'_>,
    mesh: &Cursor<'_>,
) -> Result<Vec<f64>, Problem> {
    let mut weights = match posed {
        Some(w) => w.clone(),
        None => {
            let own = if node.get("weights").is_some() {
                node
            } else {
                mesh
            };
            let list = own.items("weights")?;
            list.iter()
                .map(Cursor::f64)
                .collect::<Result<Vec<_>, _>>()?
        }
    };
    while weights.last() == Some(&0.0) {
        weights.pop();
    }
    Ok(weights)
}

/// Moves the vertices of primitive `p` by its targets.
pub(super) fn apply<'a>(
    p: &Cursor<'a>,
    base: &Attributes<'_, 'a>,
    weights: &[f64],
    v: &mut Vertices,
) -> Result<(), Problem> {
    let mut turned = false;
    for (target, &weight) in p.items("targets")?.into_iter().zip(weights) {
        if weight == 0.0 {
            continue;
        }
        let target = base.target(target);
        let weight = weight as f32;
        add(&mut v.positions, &target.floats::<3>("POSITION")?, weight);
        add(&mut v.normals, &target.floats::<3>("NORMAL")?, weight);
        // The sign of a tangent is not displaced.
        let tangents = target.floats::<3>("TANGENT")?;
        for (t, d) in v.tangents.iter_mut().zip(&tangents) {
            for (x, d) in t.iter_mut().zip(d) {
                *x += d * weight;
            }
        }
        for (i, set) in v.uv_sets.iter_mut().enumerate() {
            if !set.is_empty() {
                add(set, &target.floats::<2>(&format!("TEXCOORD_{i}"))?, weight);
            }
        }
        if !v.colors.is_empty() {
            add(&mut v.colors, &target.color_offsets("COLOR_0")?, weight);
        }
        turned = true;
    }
    if turned {
        for n in &mut v.normals {
            *n = Vec3::from(*n).normalize_or_zero().into();
        }
        for t in &mut v.tangents {
            let unit = Vec3::new(t[0], t[1], t[2]).normalize_or_zero();
            *t = [unit.x, unit.y, unit.z, t[3]];
        }
        for c in v.colors.iter_mut().flatten() {
            *c = c.clamp(0.0, 1.0);
        }
    }
    Ok(())
}

/// Adds displacements, if there are any.
fn add<const N: usize>(values: &mut [[f32; N]], by: &[[f32; N]], weight: f32) {
    for (v, d) in values.iter_mut().zip(by) {
        for (x, d) in v.iter_mut().zip(d) {
            *x += d * weight;
        }
    }
}
