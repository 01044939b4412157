//! What single precision cannot resolve in a scene of this size.

use crate::geometry::{Geometry, Shape};
use crate::math::robust::UNIT_ROUNDOFF;

/// Radius over diameter of the scene below which rays that cross the scene see a sphere blurred:
/// their rounding moves silhouettes by some `2u` of the way, 3 % of such a radius.
const SMALLEST: f64 = 64.0 * UNIT_ROUNDOFF;

/// A warning for every object with spheres that are too small for the scene around them.
pub(super) fn warnings(geometry: &Geometry) -> Vec<String> {
    let bounds = geometry.bounds();
    let diameter = (bounds.max - bounds.min).length();
    let mut out = Vec::new();
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
    out
}
