//! What every hit on a triangle needs of it.

use crate::math::{DVec3, larger, max_abs};

/// A triangle as refinement works with it, in the space of its mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// First corner.
    pub v0: DVec3,
    /// From there to the second.
    pub e1: DVec3,
    /// From there to the third.
    pub e2: DVec3,
    /// `e1 × e2`.
    pub normal: DVec3,
    /// The same at unit length; not finite if the triangle has no area.
    pub ng: DVec3,
    /// Largest absolute coordinate of a corner: a backend's rounding grows with it.
    pub reach: f64,
}

impl Facet {
    /// Of three corners.
    #[inline(always)]
    pub fn new([v0, v1, v2]: [DVec3; 3]) -> Self {
        let (e1, e2) = (v1 - v0, v2 - v0);
        let normal = e1.cross(e2);
        let n2 = normal.length_squared();
        Self {
            v0,
            e1,
            e2,
            normal,
            // One over the length, in which the division does not wait for the root.
            ng: normal * (n2.sqrt() * (1.0 / n2)),
            reach: larger(larger(max_abs(v0), max_abs(v1)), max_abs(v2)),
        }
    }
}
