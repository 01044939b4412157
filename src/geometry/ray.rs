//! Rays as every backend sees them.

use crate::math::{DVec3, Vec3};

/// A ray segment `o + t·d`, `tmin ≤ t ≤ tmax`, in single precision.
///
/// All backends trace exactly these numbers; refinement promotes them to `f64`. `d` need not be
/// of unit length; `t` is in units of `|d|`.
///
/// In the order in which Embree reads them, so that they are copied four at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Origin, world space.
    pub o: Vec3,
    /// Start of the segment.
    pub tmin: f32,
    /// Direction, world space, any length but zero.
    pub d: Vec3,
    /// End of the segment.
    pub tmax: f32,
}

impl Ray {
    /// The ray from `o` along `d` without end, both rounded to single precision.
    #[inline]
    pub fn new(o: DVec3, d: DVec3) -> Self {
        Self {
            o: o.as_vec3(),
            d: d.as_vec3(),
            tmin: 0.0,
            tmax: f32::INFINITY,
        }
    }

    /// The segment from `from` to `to`; `t` runs from 0 to 1.
    #[inline]
    pub fn segment(from: DVec3, to: DVec3) -> Self {
        let o = from.as_vec3();
        Self {
            o,
            d: (to - o.as_dvec3()).as_vec3(),
            tmin: 0.0,
            tmax: 1.0,
        }
    }

    /// Origin in double precision.
    #[inline]
    pub fn origin(&self) -> DVec3 {
        self.o.as_dvec3()
    }

    /// Direction in double precision, not normalised.
    #[inline]
    pub fn direction(&self) -> DVec3 {
        self.d.as_dvec3()
    }

    /// Whether every number in it is usable: finite origin, finite non-zero direction, an interval
    /// that begins somewhere and holds no NaN. Backends answer "no hit" to any other ray.
    #[inline]
    pub fn is_valid(&self) -> bool {
        self.o.is_finite()
            && self.d.is_finite()
            && self.d != Vec3::ZERO
            && self.tmin > f32::NEG_INFINITY
            && self.tmin <= self.tmax
    }
}
