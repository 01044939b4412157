//! The scalar trait.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A real scalar: the operations that intersections and specular chains need.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The constant `x`, whose derivatives are zero.
    fn constant(x: f64) -> Self;
    /// The primal value, which decides every branch.
    fn re(self) -> f64;
    /// Square root; the caller makes sure that the primal value is not negative.
    fn sqrt(self) -> Self;

    /// Absolute value, by the branch of the primal value.
    #[inline]
    fn abs(self) -> Self {
        if self.re() < 0.0 { -self } else { self }
    }
}

impl Real for f64 {
    #[inline]
    fn constant(x: f64) -> Self {
        x
    }
    #[inline]
    fn re(self) -> f64 {
        self
    }
    #[inline]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
}

impl Real for f32 {
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounding to the scalar is the point"
    )]
    fn constant(x: f64) -> Self {
        x as f32
    }
    #[inline]
    fn re(self) -> f64 {
        f64::from(self)
    }
    #[inline]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
}
