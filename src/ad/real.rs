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
    /// Square root; the caller makes sure that the primal value is not negative. At zero it has
    /// no derivative.
    fn sqrt(self) -> Self;
    /// Sine and cosine.
    fn sin_cos(self) -> (Self, Self);
    /// Exponential function.
    fn exp(self) -> Self;
    /// The product with a constant, without the work that a product's derivative takes.
    fn scale(self, s: f64) -> Self;

    /// Absolute value, by the branch of the primal value; no derivative at zero.
    #[inline]
    fn abs(self) -> Self {
        if self.re() < 0.0 { -self } else { self }
    }

    /// The larger of two by the primal value.
    #[inline]
    fn larger(self, o: Self) -> Self {
        if self.re() > o.re() { self } else { o }
    }

    /// The same value where its derivatives do not exist or must not be trusted: at tangency, at
    /// grazing incidence, where an algorithm changes its branch.
    #[inline]
    fn branch_point(self) -> Self {
        self
    }

    /// Whether derivatives are carried, and exist.
    #[inline]
    fn has_derivative(self) -> bool {
        false
    }
}

macro_rules! plain {
    ($type:ty) => {
        impl Real for $type {
            #[inline]
            #[allow(
                clippy::cast_possible_truncation,
                reason = "rounding to the scalar is the point"
            )]
            fn constant(x: f64) -> Self {
                x as Self
            }
            #[inline]
            fn re(self) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn sqrt(self) -> Self {
                <$type>::sqrt(self)
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                <$type>::sin_cos(self)
            }
            #[inline]
            fn exp(self) -> Self {
                <$type>::exp(self)
            }
            #[inline]
            fn scale(self, s: f64) -> Self {
                self * Self::constant(s)
            }
        }
    };
}

plain!(f64);
plain!(f32);
