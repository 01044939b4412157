//! Dual numbers: a value and its derivatives by `N` inputs, computed together.
//!
//! Source: Namae and Makino 2002, section 3 and table 1 (forward mode). What the paper leaves
//! open is what happens where a derivative does not exist; here the number says so.

use std::array::from_fn;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::Real;

/// What is known of the derivatives; of two operands the later one counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum State {
    /// They are zero. Most operands of an intersection are constants (a centre, a corner, the
    /// light's position); the compiler sees it, and half of the work goes.
    Constant,
    /// They exist.
    Varies,
    /// They do not.
    Invalid,
}

/// A value with its partial derivatives by `N` inputs.
///
/// Values are computed by the same operations, in the same order, as on the plain scalar, so every
/// branch is taken as it would be there. Where an operation has no derivative (a root at zero, a
/// division by zero, a branch point), the number keeps its value and becomes *invalid*: from then
/// on, [`gradient`](Self::gradient) of everything computed from it is `None`. A NaN instead would
/// make comparisons quietly false.
///
/// Everything is inlined by force: only then does the compiler see which operands are constants,
/// and without that an intersection takes twice as long.
///
/// `T` may be a dual number again; the derivatives then have derivatives of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<T, const N: usize> {
    re: T,
    eps: [T; N],
    state: State,
}

impl<T: Real, const N: usize> Dual<T, N> {
    /// The value `re` with the given derivatives.
    #[inline(always)]
    pub fn new(re: T, eps: [T; N]) -> Self {
        Self {
            re,
            eps,
            state: State::Varies,
        }
    }

    /// Input number `i`, whose derivative by itself is one.
    #[inline(always)]
    pub fn variable(re: T, i: usize) -> Self {
        Self::new(re, from_fn(|k| T::constant(f64::from(u8::from(k == i)))))
    }

    /// The value as the scalar it was computed in.
    #[inline(always)]
    pub fn value(&self) -> T {
        self.re
    }

    /// The derivatives; `None` where they do not exist, or are too large for the scalar.
    #[inline(always)]
    pub fn gradient(&self) -> Option<[T; N]> {
        let finite = self.eps.iter().all(|e| e.re().is_finite());
        let valid = self.state != State::Invalid;
        (valid && self.re.re().is_finite() && finite).then_some(self.eps)
    }

    /// The linear forecast `f + ∇f·h` (the paper's equation 1).
    #[inline(always)]
    pub fn forecast(&self, h: [T; N]) -> Option<T> {
        let g = self.gradient()?;
        Some((0..N).fold(self.re, |sum, k| sum + g[k] * h[k]))
    }

    /// `re` with derivatives made from those of `self` by the factor `slope`.
    #[inline(always)]
    fn chain(self, re: T, slope: T) -> Self {
        Self {
            re,
            eps: self.each(|e| e * slope),
            state: self.state,
        }
    }

    /// The derivatives, each by `f`; those of a constant are zero without any work.
    #[inline(always)]
    fn each(self, f: impl Fn(T) -> T) -> [T; N] {
        match self.state {
            State::Constant => self.eps,
            _ => self.eps.map(f),
        }
    }

    /// The derivatives of a function of two numbers with these partial derivatives.
    #[inline(always)]
    fn join(self, o: Self, re: T, by_self: T, by_o: T) -> Self {
        match (self.state, o.state) {
            (State::Constant, _) => o.chain(re, by_o),
            (_, State::Constant) => self.chain(re, by_self),
            (a, b) => Self {
                re,
                eps: from_fn(|k| self.eps[k] * by_self + o.eps[k] * by_o),
                state: a.max(b),
            },
        }
    }
}

impl<T: Real, const N: usize> Add for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        let (re, state) = (self.re + o.re, self.state.max(o.state));
        let eps = match (self.state, o.state) {
            (State::Constant, _) => o.eps,
            (_, State::Constant) => self.eps,
            _ => from_fn(|k| self.eps[k] + o.eps[k]),
        };
        Self { re, eps, state }
    }
}

impl<T: Real, const N: usize> Sub for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        let (re, state) = (self.re - o.re, self.state.max(o.state));
        let eps = match (self.state, o.state) {
            (_, State::Constant) => self.eps,
            (State::Constant, _) => o.each(|e| -e),
            _ => from_fn(|k| self.eps[k] - o.eps[k]),
        };
        Self { re, eps, state }
    }
}

impl<T: Real, const N: usize> Mul for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        self.join(o, self.re * o.re, o.re, self.re)
    }
}

impl<T: Real, const N: usize> Div for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let (re, inv) = (self.re / o.re, T::constant(1.0) / o.re);
        let out = self.join(o, re, inv, -re * inv);
        if o.re.re() == 0.0 {
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
        Self {
            re: -self.re,
            eps: self.each(|e| -e),
            state: self.state,
        }
    }
}

impl<T: Real, const N: usize> Real for Dual<T, N> {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        Self {
            re: T::constant(x),
            eps: [T::constant(0.0); N],
            state: State::Constant,
        }
    }

    #[inline(always)]
    fn re(self) -> f64 {
        self.re.re()
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        let out = self.chain(root, T::constant(0.5) / root);
        if self.re.re() > 0.0 {
            out
        } else {
            out.branch_point()
        }
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.re.sin_cos();
        (self.chain(s, c), self.chain(c, -s))
    }

    #[inline(always)]
    fn exp(self) -> Self {
        let e = self.re.exp();
        self.chain(e, e)
    }

    #[inline(always)]
    fn scale(self, s: f64) -> Self {
        Self {
            re: self.re.scale(s),
            eps: self.each(|e| e.scale(s)),
            state: self.state,
        }
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
        Self {
            state: State::Invalid,
            ..self
        }
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
