//! Dual numbers: a value and its derivatives by `N` inputs, computed together.
//!
//! Source: Namae and Makino 2002, section 3 and table 1 (forward mode). What the paper leaves
//! open is what happens where a derivative does not exist; here the number says so.

use std::array::from_fn;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::Real;

/// A value with its partial derivatives by `N` inputs.
///
/// Values are computed by the same operations, in the same order, as on the plain scalar, so every
/// branch is taken as it would be there. Where an operation has no derivative (a root at zero, a
/// division by zero, a branch point), the number keeps its value and becomes *invalid*: from then
/// on, [`gradient`](Self::gradient) of everything computed from it is `None`. A NaN instead would
/// make comparisons quietly false.
///
/// `T` may be a dual number again; the derivatives then have derivatives of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<T, const N: usize> {
    re: T,
    eps: [T; N],
    valid: bool,
}

impl<T: Real, const N: usize> Dual<T, N> {
    /// The value `re` with the given derivatives.
    #[inline]
    pub fn new(re: T, eps: [T; N]) -> Self {
        Self {
            re,
            eps,
            valid: true,
        }
    }

    /// Input number `i`, whose derivative by itself is one.
    #[inline]
    pub fn variable(re: T, i: usize) -> Self {
        Self::new(re, from_fn(|k| T::constant(f64::from(u8::from(k == i)))))
    }

    /// The value as the scalar it was computed in.
    #[inline]
    pub fn value(&self) -> T {
        self.re
    }

    /// The derivatives; `None` where they do not exist, or are too large for the scalar.
    #[inline]
    pub fn gradient(&self) -> Option<[T; N]> {
        let finite = self.eps.iter().all(|e| e.re().is_finite());
        (self.valid && self.re.re().is_finite() && finite).then_some(self.eps)
    }

    /// The linear forecast `f + ∇f·h` (the paper's equation 1).
    #[inline]
    pub fn forecast(&self, h: [T; N]) -> Option<T> {
        let g = self.gradient()?;
        Some((0..N).fold(self.re, |sum, k| sum + g[k] * h[k]))
    }

    /// `re` with derivatives made from those of `self` by the factor `slope`.
    #[inline]
    fn chain(self, re: T, slope: T) -> Self {
        Self {
            re,
            eps: self.eps.map(|e| e * slope),
            valid: self.valid,
        }
    }
}

impl<T: Real, const N: usize> Add for Dual<T, N> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self {
            re: self.re + o.re,
            eps: from_fn(|k| self.eps[k] + o.eps[k]),
            valid: self.valid & o.valid,
        }
    }
}

impl<T: Real, const N: usize> Sub for Dual<T, N> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self {
            re: self.re - o.re,
            eps: from_fn(|k| self.eps[k] - o.eps[k]),
            valid: self.valid & o.valid,
        }
    }
}

impl<T: Real, const N: usize> Mul for Dual<T, N> {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        Self {
            re: self.re * o.re,
            eps: from_fn(|k| self.eps[k] * o.re + self.re * o.eps[k]),
            valid: self.valid & o.valid,
        }
    }
}

impl<T: Real, const N: usize> Div for Dual<T, N> {
    type Output = Self;
    #[inline]
    fn div(self, o: Self) -> Self {
        let re = self.re / o.re;
        let inv = T::constant(1.0) / o.re;
        Self {
            re,
            eps: from_fn(|k| (self.eps[k] - re * o.eps[k]) * inv),
            valid: self.valid & o.valid & (o.re.re() != 0.0),
        }
    }
}

impl<T: Real, const N: usize> Neg for Dual<T, N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self {
            re: -self.re,
            eps: self.eps.map(|e| -e),
            valid: self.valid,
        }
    }
}

impl<T: Real, const N: usize> Real for Dual<T, N> {
    #[inline]
    fn constant(x: f64) -> Self {
        Self::new(T::constant(x), [T::constant(0.0); N])
    }

    #[inline]
    fn re(self) -> f64 {
        self.re.re()
    }

    #[inline]
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        let out = self.chain(root, T::constant(0.5) / root);
        if self.re.re() > 0.0 {
            out
        } else {
            out.branch_point()
        }
    }

    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.re.sin_cos();
        (self.chain(s, c), self.chain(c, -s))
    }

    #[inline]
    fn exp(self) -> Self {
        let e = self.re.exp();
        self.chain(e, e)
    }

    #[inline]
    fn scale(self, s: f64) -> Self {
        Self {
            re: self.re.scale(s),
            eps: self.eps.map(|e| e.scale(s)),
            valid: self.valid,
        }
    }

    #[inline]
    fn abs(self) -> Self {
        match self.re.re() {
            x if x < 0.0 => -self,
            0.0 => self.branch_point(),
            _ => self,
        }
    }

    #[inline]
    fn branch_point(self) -> Self {
        Self {
            re: self.re,
            eps: [T::constant(0.0); N],
            valid: false,
        }
    }

    #[inline]
    fn has_derivative(self) -> bool {
        self.gradient().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type D = Dual<f64, 2>;

    #[test]
    fn rules_are_those_of_the_paper() {
        let (u, v) = (D::variable(3.0, 0), D::variable(2.0, 1));
        assert_eq!((u + v).gradient(), Some([1.0, 1.0]));
        assert_eq!((u - v).gradient(), Some([1.0, -1.0]));
        assert_eq!((u * v).gradient(), Some([2.0, 3.0]));
        assert_eq!((u / v).gradient(), Some([0.5, -0.75]));
        assert_eq!(
            (u * u).sin_cos().0.gradient(),
            Some([9f64.cos() * 6.0, 0.0])
        );
        assert_eq!((u * v).forecast([0.5, -1.0]), Some(6.0 + 1.0 - 3.0));
    }

    #[test]
    fn what_has_no_derivative_says_so_and_keeps_its_value() {
        let zero = D::variable(0.0, 0);
        let root = zero.sqrt();
        assert_eq!((root.value(), root.gradient()), (0.0, None));
        // Nothing made from it gets its derivative back, not even times a constant zero.
        let later = (root * D::constant(0.0) + D::variable(7.0, 1)).scale(2.0);
        assert_eq!((later.value(), later.gradient()), (14.0, None));
        assert!(!later.has_derivative() && later.forecast([1.0; 2]).is_none());
        assert_eq!((D::constant(1.0) / zero).gradient(), None);
        assert_eq!(zero.abs().gradient(), None);
        assert_eq!((-D::constant(1.0)).sqrt().gradient(), None);
        // Overflow of a derivative alone.
        let steep = D::new(1.0, [1e200, 0.0]) * D::constant(1e200);
        assert_eq!((steep.value(), steep.gradient()), (1e200, None));
    }

    #[test]
    fn duals_of_duals_hold_second_derivatives() {
        type Second = Dual<Dual<f64, 1>, 1>;
        let x = Second::new(Dual::variable(2.0, 0), [Dual::constant(1.0)]);
        let y = x * x * x;
        let slope = y.gradient().expect("smooth")[0];
        assert_eq!((slope.value(), slope.gradient()), (12.0, Some([12.0])));
    }
}
