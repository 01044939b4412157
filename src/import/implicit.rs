//! Analytic spheres: of `KHR_implicit_shapes`, and by `sphere_radius` in the extras of a node.
//!
//! The extension describes shapes and leaves their use to others. Here `{"shape": i}` in the
//! extension object of a primitive makes the primitive that shape; on a node it is placed there,
//! with the material of the node's mesh.

use super::json::Cursor;
use super::{Notes, Problem};
use crate::geometry::SphereSet;

/// The name of the extension.
pub(super) const NAME: &str = "KHR_implicit_shapes";

/// The shape that `owner` (a node or a primitive) refers to, if it does and it is a sphere.
pub(super) fn shape(
    owner: &Cursor<'_>,
    root: &Cursor<'_>,
    notes: &mut Notes,
) -> Result<Option<SphereSet>, Problem> {
    let Some(at) = owner.extension(NAME).and_then(|e| e.get("shape")) else {
        return Ok(None);
    };
    let shapes = match root.extension(NAME) {
        Some(list) => list.items("shapes")?,
        None => Vec::new(),
    };
    let shape = shapes
        .get(at.index()?)
        .ok_or_else(|| at.problem("names a shape that does not exist"))?;
    match shape.need("type")?.str()? {
        "sphere" => {
            // The default is the extension's.
            let sphere = shape.get("sphere");
            match sphere.as_ref().and_then(|s| s.get("radius")) {
                Some(r) => radius(&r).map(Some),
                None => Ok(Some(one(0.5))),
            }
        }
        other => {
            notes.add(format!("implicit shapes of type '{other}' are left out"), 1);
            Ok(Some(SphereSet::default()))
        }
    }
}

/// The sphere that the extras of `node` make of it, if they do.
pub(super) fn by_extras(node: &Cursor<'_>) -> Result<Option<SphereSet>, Problem> {
    let radius_at = node.get("extras").and_then(|e| e.get("sphere_radius"));
    radius_at.map(|r| radius(&r)).transpose()
}

fn radius(at: &Cursor<'_>) -> Result<SphereSet, Problem> {
    let r = at.f64()?;
    if r > 0.0 {
        Ok(one(r))
    } else {
        Err(at.problem(format!("{r} is not a positive radius")))
    }
}

/// A sphere about the origin.
fn one(r: f64) -> SphereSet {
    SphereSet {
        spheres: vec![[0.0, 0.0, 0.0, r as f32]],
    }
}
