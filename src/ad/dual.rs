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
/// on, [`gradient`](Self::gradient) of everything computed from it is `None`. The value never
/// becomes NaN for that, which would make comparisons quietly false.
///
/// Everything is inlined by force: only then does the compiler see which derivatives are zero, and
/// without that an intersection takes twice as long.
///
/// `T` may be a dual number again; the derivatives then have derivatives of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<T, const N: usize> {
    re: T,
    /// Invalid derivatives are infinite or NaN, and stay so: finite numbers times them, and added
    /// to them, make nothing finite. So what does not exist is never tested for on the way.
    eps: [T; N],
    /// Which derivatives may be other than zero: none of a constant (a centre, a corner, the
    /// light's position), one of an input. It follows from how a number was made and never from
    /// values, so that the compiler knows, and most of the work on the first products goes.
    varies: [bool; N],
}

impl<T: Real, const N: usize> Dual<T, N> {
    /// The value `re` with the given derivatives.
    #[inline(always)]
    pub fn new(re: T, eps: [T; N]) -> Self {
        Self {
            re,
            eps,
            varies: [true; N],
        }
    }

    /// Input number `i`, whose derivative by itself is one.
    #[inline(always)]
    pub fn variable(re: T, i: usize) -> Self {
        Self {
            re,
            eps: from_fn(|k| T::constant(f64::from(u8::from(k == i)))),
            varies: from_fn(|k| k == i),
        }
    }

    /// The value as the scalar it was computed in.
    #[inline(always)]
    pub fn value(&self) -> T {
        self.re
    }

    /// The derivatives; `None` where they do not exist, or are too large for the scalar.
    #[inline(always)]
    pub fn gradient(&self) -> Option<[T; N]> {
        // Zero times a finite number is zero, times another it is NaN: one comparison for all.
        let mut nothing = 0.0 * self.re.re();
        for k in 0..N {
            if self.varies[k] {
                nothing += 0.0 * self.eps[k].re();
            }
        }
        (nothing == 0.0).then_some(self.eps)
    }

    /// The linear forecast `f + ∇f·h` (the paper's equation 1).
    #[inline(always)]
    pub fn forecast(&self, h: [T; N]) -> Option<T> {
        let g = self.gradient()?;
        Some((0..N).fold(self.re, |sum, k| sum + g[k] * h[k]))
    }

    /// `re` with each derivative of `self` by `f`.
    #[inline(always)]
    fn each(self, re: T, f: impl Fn(T) -> T) -> Self {
        let eps = from_fn(|k| {
            if self.varies[k] {
                f(self.eps[k])
            } else {
                self.eps[k]
            }
        });
        Self { re, eps, ..self }
    }

    /// `re` with derivatives made from those of two numbers: by `both`, or by `left` or `right`
    /// where one of the two is zero.
    #[inline(always)]
    fn join(
        self,
        o: Self,
        re: T,
        left: impl Fn(T) -> T,
        right: impl Fn(T) -> T,
        both: impl Fn(T, T) -> T,
    ) -> Self {
        let eps = from_fn(|k| match (self.varies[k], o.varies[k]) {
            (false, false) => self.eps[k],
            (true, false) => left(self.eps[k]),
            (false, true) => right(o.eps[k]),
            (true, true) => both(self.eps[k], o.eps[k]),
        });
        Self {
            re,
            eps,
            varies: from_fn(|k| self.varies[k] | o.varies[k]),
        }
    }

    /// The product.
    #[inline(always)]
    fn times(self, o: Self) -> Self {
        let (u, v) = (self.re, o.re);
        self.join(o, u * v, |a| a * v, |b| b * u, |a, b| a * v + b * u)
    }

    /// Whether it is a constant.
    #[inline(always)]
    fn is_constant(&self) -> bool {
        !self.varies.iter().fold(false, |any, v| any | v)
    }
}

impl<T: Real, const N: usize> Add for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        self.join(o, self.re + o.re, |a| a, |b| b, |a, b| a + b)
    }
}

impl<T: Real, const N: usize> Sub for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        self.join(o, self.re - o.re, |a| a, |b| -b, |a, b| a - b)
    }
}

impl<T: Real, const N: usize> Mul for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        self.times(o)
    }
}

impl<T: Real, const N: usize> Div for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let (re, inv) = (self.re / o.re, T::constant(1.0) / o.re);
        let by_o = -re * inv;
        let out = self.join(o, re, |a| a * inv, |b| b * by_o, |a, b| (a - re * b) * inv);
        // By zero, the factors are infinite and leave no derivative finite but a constant's.
        if out.is_constant() && o.re.re() == 0.0 {
            out.branch_point()
        } else {
            out
        }
    }
}

impl<T: Real, const N: usize> Neg for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.each(-self.re, |e| -e)
    }
}

impl<T: Real, const N: usize> Real for Dual<T, N> {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        Self {
            re: T::constant(x),
            eps: [T::constant(0.0); N],
            varies: [false; N],
        }
    }

    #[inline(always)]
    fn re(self) -> f64 {
        self.re.re()
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        let slope = T::constant(0.5) / root;
        let out = self.each(root, |e| e * slope);
        // At zero, the slope is infinite and leaves no derivative finite but a constant's.
        if self.is_constant() && !(self.re.re() > 0.0) {
            out.branch_point()
        } else {
            out
        }
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.re.sin_cos();
        (self.each(s, |x| x * c), self.each(c, |x| -x * s))
    }

    #[inline(always)]
    fn exp(self) -> Self {
        let e = self.re.exp();
        self.each(e, |x| x * e)
    }

    #[inline(always)]
    fn scale(self, s: f64) -> Self {
        self.each(self.re.scale(s), |e| e.scale(s))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        match self.re.re() {
            x if x < 0.0 => -self,
            0.0 => self.branch_point(),
            _ => self,
        }
    }

    #[inline(always)]
    fn branch_point(self) -> Self {
        Self::new(self.re, [T::constant(f64::NAN); N])
    }

    #[inline(always)]
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
        assert_eq!((u / (u * v)).gradient(), Some([0.0, -0.25]));
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
        // A constant that is infinite, or no number, has none either, nor has what follows.
        let pole = D::constant(1.0) / D::constant(0.0);
        assert_eq!((D::constant(1.0) / pole).gradient(), None);
        assert_eq!(D::constant(0.0).sqrt().gradient(), None);
        // Each derivative for itself: by what does not vary, a root at zero has none all the same.
        let both = D::new(0.0, [0.0, 1.0]).sqrt();
        assert_eq!((both.value(), both.gradient()), (0.0, None));
        assert_eq!((both * both - both).gradient(), None);
        assert_eq!(zero.branch_point().forecast([0.0; 2]), None);
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
