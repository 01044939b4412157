//! What single precision cannot resolve in a scene of this size.

use crate::geometry::{Geometry, Shape};
use crate::math::robust::UNIT_ROUNDOFF;

/// Radius over diameter of the scene below which rays that cross the scene see a sphere blurred:
/// their rounding moves silhouettes by some `2u` of the way, 3 % of such a radius.
const SMALLEST: f64 = 64.0 * UNIT_ROUNDOFF;

/// Diameter of a scene in metres above which single precision may be too short for what is common.
const LARGE: f64 = 1e9;

/// Extent over diameter of the scene below which robust traversal multiplies lengths down to where
/// single precision ends, so that a mesh is lost.
const LOST: f64 = 1e-12;

/// Extent of a scene in metres below which photons and their kernels leave single precision: flux
/// and area fall with its square.
const LEAST: f64 = 1e-17;

/// A warning for a scene that is too small itself, for every object with spheres that are too small
/// for the scene around them, and for meshes that get lost in it.
pub(super) fn warnings(geometry: &Geometry) -> Vec<String> {
    let bounds = geometry.bounds();
    let diameter = (bounds.max - bounds.min).length();
    let mut out = Vec::new();
    if diameter > 0.0 && diameter < LEAST {
        out.push(format!(
            "the scene measures {diameter:.1e} m, less than the {LEAST:.0e} m down to which photons \
             keep their light; scale it up"
        ));
    }
    for object in &geometry.objects {
        let Shape::Spheres(set) = geometry.shape(object.shape) else {
            continue;
        };
        let scale = object.placement.map_or(1.0, |p| {
            p.world_from_object.matrix3.determinant().abs().cbrt()
        });
        let least = SMALLEST * diameter;
        let small = set
            .spheres
            .iter()
            .filter(|s| f64::from(s[3]) * scale < least);
        let n = small.count();
        if n > 0 {
            out.push(format!(
                "'{}': {n} spheres have a radius below {least:.1e} m, too small for a scene of \
                 {diameter:.1e} m: their outlines are inexact from afar; leave out what is far away",
                object.name
            ));
        }
    }
    if diameter > LARGE {
        out.extend(lost(geometry, diameter));
    }
    out
}

/// One warning for the meshes that are too small for the scene around them.
fn lost(geometry: &Geometry, diameter: f64) -> Option<String> {
    let mut extents = vec![None; geometry.shapes.len()];
    let mut lost = geometry.objects.iter().filter(|object| {
        let shape = geometry.shape(object.shape);
        let own = extents[object.shape.index()].get_or_insert_with(|| shape.bounds().extent());
        let scale = object.placement.map_or(1.0, |p| {
            p.world_from_object.matrix3.determinant().abs().cbrt()
        });
        matches!(shape, Shape::Mesh(_)) && own.max_element() * scale < LOST * diameter
    });
    let first = lost.next()?.name.clone();
    Some(format!(
        "{} meshes are smaller than {:.1e} m, '{first}' first, too small for a scene of \
         {diameter:.1e} m: rays may pass through them; leave out what is far away",
        1 + lost.count(),
        LOST * diameter
    ))
}
