//! Three-vectors over any [`Real`].

use std::ops::{Add, Mul, Neg, Sub};

use super::{Dual, Real};
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
    #[inline(always)]
    pub fn constant(v: DVec3) -> Self {
        Self {
            x: R::constant(v.x),
            y: R::constant(v.y),
            z: R::constant(v.z),
        }
    }

    /// The primal values.
    #[inline(always)]
    pub fn re(self) -> DVec3 {
        DVec3::new(self.x.re(), self.y.re(), self.z.re())
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> R {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        Self {
            x: self.y * o.z - self.z * o.y,
            y: self.z * o.x - self.x * o.z,
            z: self.x * o.y - self.y * o.x,
        }
    }
}

impl<const N: usize> V3<Dual<f64, N>> {
    /// The vector `v` whose derivative by input `k` is `d[k]`.
    #[inline(always)]
    pub fn with_derivatives(v: DVec3, d: [DVec3; N]) -> Self {
        Self {
            x: Dual::new(v.x, d.map(|d| d.x)),
            y: Dual::new(v.y, d.map(|d| d.y)),
            z: Dual::new(v.z, d.map(|d| d.z)),
        }
    }

    /// The derivatives by each input; `None` where they do not exist.
    #[inline(always)]
    pub fn derivatives(self) -> Option<[DVec3; N]> {
        let (x, y, z) = (self.x.gradient()?, self.y.gradient()?, self.z.gradient()?);
        Some(std::array::from_fn(|k| DVec3::new(x[k], y[k], z[k])))
    }
}

impl V3<Dual<f64, 3>> {
    /// The vector `v` as three inputs: its own derivative is the unit matrix.
    #[inline(always)]
    pub fn variable(v: DVec3) -> Self {
        Self {
            x: Dual::variable(v.x, 0),
            y: Dual::variable(v.y, 1),
            z: Dual::variable(v.z, 2),
        }
    }
}

impl<R: Real> Add for V3<R> {
    type Output = Self;
    #[inline(always)]
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
    #[inline(always)]
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
    #[inline(always)]
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
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            x: -self.x,
            y: -self.y,
            z: -self.z,
        }
    }
}
