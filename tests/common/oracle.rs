//! The library `num-dual` as a scalar of ours: the oracle for `ad::Dual`, and its rival.

use std::ops::{Add, Div, Mul, Neg, Sub};

use dualight::ad::{Real, V3};
use dualight::math::DVec3;
use nalgebra::{Const, U1};
use num_dual::{DualNum, DualSVec64};

/// A value with three derivatives, as the library computes them.
#[derive(Clone, Copy)]
pub struct Oracle(pub DualSVec64<3>);

impl Oracle {
    /// Input number `i`.
    pub fn variable(x: f64, i: usize) -> Self {
        Self(DualSVec64::from_re(x).derivative(i))
    }

    /// The derivatives.
    pub fn gradient(self) -> [f64; 3] {
        let eps = self.0.eps.unwrap_generic(Const::<3>, U1);
        [eps[0], eps[1], eps[2]]
    }

    /// A vector of three inputs.
    pub fn inputs(v: DVec3) -> V3<Self> {
        V3 {
            x: Self::variable(v.x, 0),
            y: Self::variable(v.y, 1),
            z: Self::variable(v.z, 2),
        }
    }
}

macro_rules! binary {
    ($($trait:ident $f:ident),*) => {$(
        impl $trait for Oracle {
            type Output = Self;
            #[inline]
            fn $f(self, o: Self) -> Self {
                Self($trait::$f(self.0, o.0))
            }
        }
    )*};
}

binary!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Oracle {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Real for Oracle {
    #[inline]
    fn constant(x: f64) -> Self {
        Self(DualSVec64::from_re(x))
    }
    #[inline]
    fn re(self) -> f64 {
        self.0.re
    }
    #[inline]
    fn sqrt(self) -> Self {
        Self(DualNum::sqrt(&self.0))
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = DualNum::sin_cos(&self.0);
        (Self(s), Self(c))
    }
    #[inline]
    fn exp(self) -> Self {
        Self(DualNum::exp(&self.0))
    }
    #[inline]
    fn scale(self, s: f64) -> Self {
        Self(self.0 * s)
    }
}

/// The library's number with the invalid state that ours has: what using it would mean.
#[derive(Clone, Copy)]
pub struct Checked(pub DualSVec64<3>, pub bool);

impl Checked {
    /// A vector of three inputs.
    pub fn inputs(v: DVec3) -> V3<Self> {
        let v = Oracle::inputs(v);
        V3 {
            x: Self(v.x.0, true),
            y: Self(v.y.0, true),
            z: Self(v.z.0, true),
        }
    }

    /// The derivatives, if they exist.
    #[inline(always)]
    pub fn gradient(self) -> Option<[f64; 3]> {
        let g = Oracle(self.0).gradient();
        // As ours does it.
        let nothing = g.iter().fold(0.0 * self.0.re, |sum, x| sum + 0.0 * x);
        (self.1 && nothing == 0.0).then_some(g)
    }
}

impl Add for Checked {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self(self.0 + o.0, self.1 & o.1)
    }
}
impl Sub for Checked {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self(self.0 - o.0, self.1 & o.1)
    }
}
impl Mul for Checked {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self(self.0 * o.0, self.1 & o.1)
    }
}
impl Div for Checked {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        Self(self.0 / o.0, self.1 & o.1 & (o.0.re != 0.0))
    }
}
impl Neg for Checked {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0, self.1)
    }
}
impl Real for Checked {
    #[inline(always)]
    fn constant(x: f64) -> Self {
        Self(DualSVec64::from_re(x), true)
    }
    #[inline(always)]
    fn re(self) -> f64 {
        self.0.re
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(DualNum::sqrt(&self.0), self.1 & (self.0.re > 0.0))
    }
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = DualNum::sin_cos(&self.0);
        (Self(s, self.1), Self(c, self.1))
    }
    fn exp(self) -> Self {
        Self(DualNum::exp(&self.0), self.1)
    }
    #[inline(always)]
    fn scale(self, s: f64) -> Self {
        Self(self.0 * s, self.1)
    }
    #[inline(always)]
    fn branch_point(self) -> Self {
        Self(self.0, false)
    }
}
