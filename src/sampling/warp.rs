//! Maps from the unit square to what renderers sample, each with its density.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_4, PI};
use std::hint::select_unpredictable;

use crate::math::{DVec3, larger};

/// Sine and cosine for `|x| ≤ π/4`, absolute error below 1e-13: Chebyshev fits over `x²`, summed
/// in pairs so that the multiplications overlap.
///
/// Several times faster than the general functions, whose argument reduction is not needed here.
#[inline]
fn sin_cos_octant(x: f64) -> (f64, f64) {
    let x2 = x * x;
    let x4 = x2 * x2;
    let sum = |a: [f64; 6]| {
        let (low, mid, high) = (a[0] + a[1] * x2, a[2] + a[3] * x2, a[4] + a[5] * x2);
        low + x4 * (mid + x4 * high)
    };
    let s = sum([
        0.999_999_999_999_995_7,
        -0.166_666_666_666_166_85,
        0.008_333_333_323_878_15,
        -0.000_198_412_632_983_904_88,
        2.755_527_189_338_574e-6,
        -2.475_655_877_168_648_7e-8,
    ]);
    let c = sum([
        0.999_999_999_999_944_4,
        -0.499_999_999_993_511_15,
        0.041_666_666_543_911_19,
        -0.001_388_888_039_377_639_8,
        2.479_892_875_531_837_4e-5,
        -2.717_342_984_064_137e-7,
    ]);
    (x * s, c)
}

/// Uniform point of the unit disc, by the concentric map of Shirley and Chiu (1997), and its
/// distance from the centre, up to its sign.
#[inline(always)]
fn concentric(u: [f64; 2]) -> ([f64; 2], f64) {
    let a = 2.0 * u[0] - 1.0;
    let b = 2.0 * u[1] - 1.0;
    if a == 0.0 && b == 0.0 {
        return ([0.0, 0.0], 0.0);
    }
    // Which octant is a coin toss that no processor predicts: selects, not branches.
    let wide = a.abs() > b.abs();
    let r = select_unpredictable(wide, a, b);
    let other = select_unpredictable(wide, b, a);
    let (s, c) = sin_cos_octant(FRAC_PI_4 * (other / r));
    let (along, across) = (r * c, r * s);
    let x = select_unpredictable(wide, along, across);
    let y = select_unpredictable(wide, across, along);
    ([x, y], r)
}

/// Uniform point of the unit disc.
#[inline(always)]
pub fn disc(u: [f64; 2]) -> [f64; 2] {
    concentric(u).0
}

/// Direction around `+z` with density [`cosine_hemisphere_pdf`].
#[inline(always)]
pub fn cosine_hemisphere(u: [f64; 2]) -> DVec3 {
    let ([x, y], r) = concentric(u);
    // By the radius, which is known before the point is.
    DVec3::new(x, y, (1.0 - r * r).sqrt())
}

/// Density `cos θ / π` in solid angle.
#[inline]
pub fn cosine_hemisphere_pdf(cos_theta: f64) -> f64 {
    larger(cos_theta, 0.0) * FRAC_1_PI
}

/// Uniform direction of the unit sphere; density `1/4π`.
#[inline]
pub fn sphere(u: [f64; 2]) -> DVec3 {
    cone(u, -1.0)
}

/// Direction around `+z`, uniform in solid angle among those with `cos θ ≥ cos_max`.
/// Density [`cone_pdf`].
#[inline]
pub fn cone(u: [f64; 2], cos_max: f64) -> DVec3 {
    cone_from_complement(u, 1.0 - cos_max)
}

/// As [`cone`], given `1 − cos θ_max`: keeps its digits for a narrow cone.
#[inline]
pub fn cone_from_complement(u: [f64; 2], one_minus_cos_max: f64) -> DVec3 {
    // The disc's radius squared is uniform: it serves as the height, its angle as the azimuth.
    let [x, y] = disc(u);
    let r2 = (x * x + y * y).min(1.0);
    let h = one_minus_cos_max * r2;
    let cos_theta = 1.0 - h;
    // sin²θ = h (2 − h); dividing by r² leaves a form that does not cancel.
    let scale = (one_minus_cos_max * (2.0 - h)).max(0.0).sqrt();
    DVec3::new(x * scale, y * scale, cos_theta)
}

/// Density of [`cone`] in solid angle, inside the cone.
#[inline]
pub fn cone_pdf(one_minus_cos_max: f64) -> f64 {
    1.0 / (2.0 * PI * one_minus_cos_max)
}

/// Barycentric weights of the second and third vertex of a uniform point of a triangle.
///
/// Source: Heitz, *A Low-Distortion Map Between Triangle and Square*, 2019.
#[inline]
pub fn triangle(u: [f64; 2]) -> [f64; 2] {
    let m = 0.5 * u[0].min(u[1]);
    [u[0] - m, u[1] - m]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octant_sine_and_cosine_match_the_library() {
        for i in -1000..=1000 {
            let x = f64::from(i) / 1000.0 * FRAC_PI_4;
            let (s, c) = sin_cos_octant(x);
            assert!(
                (s - x.sin()).abs() < 1e-13 && (c - x.cos()).abs() < 1e-13,
                "{x}"
            );
        }
    }

    #[test]
    fn directions_are_unit_and_inside() {
        for i in 0..64 {
            for j in 0..64 {
                let u = [(f64::from(i) + 0.5) / 64.0, (f64::from(j) + 0.5) / 64.0];
                for cos_max in [-1.0, 0.0, 0.9, 1.0 - 1e-12] {
                    let d = cone(u, cos_max);
                    assert!((d.length() - 1.0).abs() < 1e-12);
                    assert!(d.z >= cos_max - 1e-15);
                }
                assert!((cosine_hemisphere(u).length() - 1.0).abs() < 1e-12);
                let [b1, b2] = triangle(u);
                assert!(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0);
            }
        }
    }
}
