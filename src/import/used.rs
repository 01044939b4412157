//! Which materials a scene uses, told from the file before anything large is read.

use std::collections::HashSet;

use super::Problem;
use super::json::Cursor;

/// Indices of the materials on meshes below the nodes `roots`, in every variant. Broken
/// references are left to the code that reads them.
pub(super) fn materials<'a>(
    root: &Cursor<'a>,
    roots: &[Cursor<'a>],
) -> Result<HashSet<usize>, Problem> {
    let (nodes, meshes) = (root.items("nodes")?, root.items("meshes")?);
    let mut stack: Vec<Cursor<'a>> = roots.to_vec();
    let (mut seen, mut read, mut used) = (HashSet::new(), HashSet::new(), HashSet::new());
    while let Some(at) = stack.pop() {
        let index = at.index()?;
        let Some(node) = nodes.get(index).filter(|_| seen.insert(index)) else {
            continue;
        };
        stack.extend(node.items("children")?);
        let Some(index) = node.get("mesh").and_then(|m| m.index().ok()) else {
            continue;
        };
        let Some(mesh) = meshes.get(index).filter(|_| read.insert(index)) else {
            continue;
        };
        for p in mesh.items("primitives")? {
            used.extend(p.get("material").and_then(|m| m.index().ok()));
            if let Some(variants) = p.extension("KHR_materials_variants") {
                for m in variants.items("mappings")? {
                    used.extend(m.get("material").and_then(|m| m.index().ok()));
                }
            }
        }
    }
    Ok(used)
}
