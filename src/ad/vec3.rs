//! Three-vectors over any [`Real`].

use std::ops::{Add, Mul, Neg, Sub};

use super::Real;
use crate::math::DVec3;

/// A three-vector of scalars.
#[derive(Clone, Copy, Debug)]
pub struct V3<R> {
    /// First component.
    pub x: R,
    /// Second component.
    pub y: R,
    /// Third component.
    pub z: R,
}

impl<R: Real> V3<R> {
    /// A constant vector.
    #[inline]
    pub fn constant(v: DVec3) -> Self {
        Self {
            x: R::constant(v.x),
            y: R::constant(v.y),
            z: R::constant(v.z),
        }
    }

    /// The primal values.
    #[inline]
    pub fn re(self) -> DVec3 {
        DVec3::new(self.x.re(), self.y.re(), self.z.re())
    }

    /// Scalar product.
    #[inline]
    pub fn dot(self, o: Self) -> R {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Vector product.
    #[inline]
    pub fn cross(self, o: Self) -> Self {
        Self {
            x: self.y * o.z - self.z * o.y,
            y: self.z * o.x - self.x * o.z,
            z: self.x * o.y - self.y * o.x,
        }
    }
}

impl<R: Real> Add for V3<R> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self {
            x: self.x + o.x,
            y: self.y + o.y,
            z: self.z + o.z,
        }
    }
}

impl<R: Real> Sub for V3<R> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self {
            x: self.x - o.x,
            y: self.y - o.y,
            z: self.z - o.z,
        }
    }
}

impl<R: Real> Mul<R> for V3<R> {
    type Output = Self;
    #[inline]
    fn mul(self, s: R) -> Self {
        Self {
            x: self.x * s,
            y: self.y * s,
            z: self.z * s,
        }
    }
}

impl<R: Real> Neg for V3<R> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self {
            x: -self.x,
            y: -self.y,
            z: -self.z,
        }
    }
}
