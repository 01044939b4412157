//! A linear RGB triple: radiance, flux, albedo or throughput, by context.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Sub};

use crate::math::{DVec3, larger};

/// Linear Rec.709 triple in `f64`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rgb {
    /// Red.
    pub r: f64,
    /// Green.
    pub g: f64,
    /// Blue.
    pub b: f64,
}

impl Rgb {
    /// Black.
    pub const ZERO: Self = Self::splat(0.0);
    /// One in every channel.
    pub const ONE: Self = Self::splat(1.0);

    /// One in each channel alone.
    pub const CHANNELS: [Self; 3] = [
        Self::new(1.0, 0.0, 0.0),
        Self::new(0.0, 1.0, 0.0),
        Self::new(0.0, 0.0, 1.0),
    ];

    /// The triple `(r, g, b)`.
    #[inline]
    pub const fn new(r: f64, g: f64, b: f64) -> Self {
        Self { r, g, b }
    }

    /// The same value in every channel.
    #[inline]
    pub const fn splat(x: f64) -> Self {
        Self { r: x, g: x, b: x }
    }

    /// Whether every channel is zero.
    #[inline]
    pub fn is_black(self) -> bool {
        self.r == 0.0 && self.g == 0.0 && self.b == 0.0
    }

    /// Whether every channel is a finite number.
    #[inline]
    pub fn is_finite(self) -> bool {
        (self.r + self.g + self.b).is_finite()
    }

    /// Largest channel.
    #[inline]
    pub fn max_channel(self) -> f64 {
        larger(larger(self.r, self.g), self.b)
    }

    /// Mean of the channels.
    #[inline]
    pub fn mean(self) -> f64 {
        (self.r + self.g + self.b) / 3.0
    }

    /// Rec.709 luminance.
    #[inline]
    pub fn luminance(self) -> f64 {
        0.2126 * self.r + 0.7152 * self.g + 0.0722 * self.b
    }

    /// Applies `f` to every channel.
    #[inline]
    pub fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self::new(f(self.r), f(self.g), f(self.b))
    }

    /// Channels as an array of `f32`, as films and photon maps store them.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "storage format")]
    pub fn to_f32(self) -> [f32; 3] {
        [self.r as f32, self.g as f32, self.b as f32]
    }
}

impl From<[f32; 3]> for Rgb {
    #[inline]
    fn from(c: [f32; 3]) -> Self {
        Self::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2]))
    }
}

impl From<DVec3> for Rgb {
    #[inline]
    fn from(v: DVec3) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

impl Add for Rgb {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self::new(self.r + o.r, self.g + o.g, self.b + o.b)
    }
}
impl Sub for Rgb {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self::new(self.r - o.r, self.g - o.g, self.b - o.b)
    }
}
impl AddAssign for Rgb {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl Mul for Rgb {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        Self::new(self.r * o.r, self.g * o.g, self.b * o.b)
    }
}
impl MulAssign for Rgb {
    #[inline]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}
impl Mul<f64> for Rgb {
    type Output = Self;
    #[inline]
    fn mul(self, s: f64) -> Self {
        Self::new(self.r * s, self.g * s, self.b * s)
    }
}
impl Mul<Rgb> for f64 {
    type Output = Rgb;
    #[inline]
    fn mul(self, c: Rgb) -> Rgb {
        c * self
    }
}
impl MulAssign<f64> for Rgb {
    #[inline]
    fn mul_assign(&mut self, s: f64) {
        *self = *self * s;
    }
}
impl Div<f64> for Rgb {
    type Output = Self;
    #[inline]
    fn div(self, s: f64) -> Self {
        self * (1.0 / s)
    }
}
impl Sum for Rgb {
    fn sum<I: Iterator<Item = Self>>(iter: I) -> Self {
        iter.fold(Self::ZERO, |a, b| a + b)
    }
}
