//! Vectors, frames, boxes and rounding bounds: what every other room stands on.
//!
//! Geometry is computed in `f64` ([`DVec3`]); what a ray tracing backend sees (vertices, ray
//! origins and directions) is `f32` and is promoted exactly, so that every backend and the
//! refinement on the primitive work from the same numbers.

mod aabb;
mod frame;
pub mod robust;

pub use aabb::{Aabb, BoundingSphere};
pub use frame::Frame;
pub use glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, Vec3};

/// Largest absolute component of `v`.
#[inline]
pub fn max_abs(v: DVec3) -> f64 {
    larger(larger(v.x.abs(), v.y.abs()), v.z.abs())
}

/// The larger of two numbers, in one instruction; `b` if either is NaN. (`f64::max` takes care
/// of NaN, at several times the price.)
#[inline]
pub fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Rounds every component to the nearest `f32` and promotes it back.
#[inline]
pub fn round_f32(v: DVec3) -> DVec3 {
    v.as_vec3().as_dvec3()
}

/// `d` normalised, and its length. What is unit up to its rounding to single precision, as nearly
/// all directions are, needs no square root: one Newton step leaves an error of 1e-13.
#[inline]
pub fn nearly_unit(d: DVec3) -> (DVec3, f64) {
    let dd = d.dot(d);
    let inv = if (dd - 1.0).abs() < 5e-7 {
        1.5 - 0.5 * dd
    } else {
        1.0 / dd.sqrt()
    };
    (d * inv, dd * inv)
}
