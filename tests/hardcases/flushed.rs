//! Double precision that knows no denormal numbers: what a processor computes that is told to
//! take them for zero, before and after every operation.

use std::ops::{Add, Div, Mul, Neg, Sub};

use dualight::ad::Real;

#[derive(Clone, Copy, Debug)]
pub struct Flushed(f64);

impl Flushed {
    pub fn new(x: f64) -> Self {
        Self(if x.is_subnormal() { 0.0 } else { x })
    }
}

macro_rules! operator {
    ($trait:ident, $name:ident) => {
        impl $trait for Flushed {
            type Output = Self;
            fn $name(self, o: Self) -> Self {
                Self::new($trait::$name(self.0, o.0))
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl Neg for Flushed {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Real for Flushed {
    fn constant(x: f64) -> Self {
        Self::new(x)
    }
    fn re(self) -> f64 {
        self.0
    }
    fn sqrt(self) -> Self {
        Self::new(self.0.sqrt())
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (Self::new(sin), Self::new(cos))
    }
    fn exp(self) -> Self {
        Self::new(self.0.exp())
    }
    fn scale(self, s: f64) -> Self {
        Self::new(self.0 * s)
    }
}
