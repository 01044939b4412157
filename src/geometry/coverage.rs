//! Surfaces that are not whole: cut-outs and partial transparency.
//!
//! A backend that finds a hit on such a surface asks whether it counts. Partial opacity is
//! decided by chance, which is unbiased in every estimate; the chance is a pure function of ray
//! and primitive, so that all backends decide alike, however often they ask.

use super::{Ray, Shape};
use crate::stats::tally::{self, Event, Part};

/// Says how much of a surface is there.
pub trait Coverage: Send + Sync {
    /// Share of light that is stopped, from 0 to 1, at barycentric weights of a triangle's
    /// second and third corner, or anywhere on a sphere.
    fn opacity(&self, shape: &Shape, prim: u32, barycentrics: [f64; 2]) -> f64;
}

/// Scrambles a number (Stafford's variant 13 of the finaliser of MurmurHash3).
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// What tells a ray from all others: its origin and direction, to the bit.
pub fn ray_key(ray: &Ray) -> u64 {
    let pair = |a: f32, b: f32| u64::from(a.to_bits()) << 32 | u64::from(b.to_bits());
    let words = [
        pair(ray.o.x, ray.o.y),
        pair(ray.o.z, ray.d.x),
        pair(ray.d.y, ray.d.z),
    ];
    words
        .into_iter()
        .fold(0x9e37_79b9_7f4a_7c15, |h, w| mix(h ^ w).wrapping_add(w))
}

/// A hit on a surface that is not whole.
#[derive(Clone, Copy, Debug)]
pub struct CoverageQuery {
    /// The ray's [`ray_key`].
    pub key: u64,
    /// Index of the object.
    pub object: u32,
    /// Primitive within its shape.
    pub prim: u32,
    /// Barycentric weights.
    pub barycentrics: [f64; 2],
    /// Whether the ray runs out of a sphere rather than into it.
    pub outward: bool,
}

impl CoverageQuery {
    /// Whether the hit counts.
    pub fn stops(&self, coverage: &dyn Coverage, shape: &Shape) -> bool {
        let _scope = tally::enter(Part::Alpha);
        tally::count(Event::FilterCalls);
        let opacity = coverage.opacity(shape, self.prim, self.barycentrics);
        if opacity <= 0.0 {
            return false;
        }
        if opacity >= 1.0 {
            return true;
        }
        let which = u64::from(self.object) << 32 | u64::from(self.prim);
        let side = u64::from(self.outward && matches!(shape, Shape::Spheres(_)));
        let bits = mix(mix(self.key ^ mix(which.wrapping_add(1))) ^ side);
        // 53 bits, as many as the fraction holds.
        (bits >> 11) as f64 * (1.0 / (1u64 << 53) as f64) < opacity
    }
}
