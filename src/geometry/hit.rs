//! What a backend answers.

use super::ObjectId;

/// The five numbers of a hit: distance, two barycentrics, primitive and object.
///
/// Only `prim` and `object` are relied upon; the rest says which of a primitive's
/// intersections was meant and is recomputed in `f64`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray in units of `|d|`, approximate.
    pub t: f32,
    /// Barycentric weight of the second vertex, approximate; 0 for spheres.
    pub u: f32,
    /// Barycentric weight of the third vertex, approximate; 0 for spheres.
    pub v: f32,
    /// Index of the triangle or sphere within its shape.
    pub prim: u32,
    /// The object, which names shape and placement.
    pub object: ObjectId,
}
