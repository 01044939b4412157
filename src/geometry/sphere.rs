//! Spheres: the quadratic in a form that does not cancel.
//!
//! Source: Haines, Günther and Akenine-Möller, *Precision Improvements for Ray/Sphere
//! Intersection*, Ray Tracing Gems, chapter 7, 2019.

use crate::ad::{Real, V3};
use crate::math::DVec3;

/// Discriminant below which a line counts as tangent: the derivative of the distance grows as its
/// inverse root, and that of the normal with it.
const TANGENT: f64 = 1e-6;

/// How a line passes a sphere.
#[derive(Clone, Copy, Debug)]
pub struct LineSphere<R> {
    /// Dimensionless discriminant `1 − (b/r)²`, with `b` the distance from the centre to the
    /// line: positive if the line meets the sphere, zero at tangency. Independent of the
    /// direction's length and of the scene's unit.
    pub discriminant: R,
    /// Parameter of the point of the line closest to the centre.
    pub t_closest: R,
    /// The discriminant times `|d|²`, a polynomial in `d` and, for parallel lines, in `o`.
    pub polynomial: R,
    /// `1/|d|²`.
    inv_dd: R,
    /// `−f·d`, with `f = o − c`.
    b: R,
    /// `(|f| − r)(|f| + r)`.
    c: R,
    r: f64,
}

/// Relates the line `o + t·d` to the sphere around `center` of radius `r`. `d` must not be zero.
///
/// Inlined by force: dual numbers are cheap only where the compiler sees which of them are constants.
#[inline(always)]
pub fn line_sphere<R: Real>(o: V3<R>, d: V3<R>, center: DVec3, r: f64) -> LineSphere<R> {
    let f = o - V3::constant(center);
    let dd = d.dot(d);
    let b = -f.dot(d);
    let inv_dd = R::constant(1.0) / dd;
    // Its length is that of the perpendicular times |d|; as that, it does not cancel.
    let moment = f.cross(d);
    let polynomial = dd - moment.dot(moment) * R::constant(1.0 / (r * r));
    let radius = R::constant(r);
    let ff = f.dot(f);
    // At the centre |f| = 0, where a square root has no derivative; r² − |f|² is exact there.
    let c = if ff.re() > 0.0 {
        let len = ff.sqrt();
        (len - radius) * (len + radius)
    } else {
        -(radius * radius)
    };
    LineSphere {
        discriminant: polynomial * inv_dd,
        polynomial,
        t_closest: b * inv_dd,
        inv_dd,
        b,
        c,
        r,
    }
}

impl<R: Real> LineSphere<R> {
    /// Both intersections in ascending order, or `None` if the line misses.
    #[inline(always)]
    pub fn roots(&self) -> Option<[R; 2]> {
        if !(self.discriminant.re() >= 0.0) {
            return None;
        }
        let mut root = self.polynomial.sqrt() * R::constant(self.r);
        if self.discriminant.re() < TANGENT {
            root = root.branch_point();
        }
        // The sum of equal signs is free of cancellation; the other root follows from c / q.
        let q = if self.b.re() >= 0.0 {
            self.b + root
        } else {
            self.b - root
        };
        if q.re() == 0.0 {
            return Some([self.t_closest, self.t_closest]);
        }
        let (t0, t1) = (self.c * (R::constant(1.0) / q), q * self.inv_dd);
        Some(if t0.re() <= t1.re() {
            [t0, t1]
        } else {
            [t1, t0]
        })
    }
}

/// First intersection with `tmin ≤ t ≤ tmax`.
#[inline]
pub fn intersect(o: DVec3, d: DVec3, center: DVec3, r: f64, tmin: f64, tmax: f64) -> Option<f64> {
    let [t0, t1] = line_sphere(V3::<f64>::constant(o), V3::constant(d), center, r).roots()?;
    [t0, t1].into_iter().find(|t| *t >= tmin && *t <= tmax)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roots(o: DVec3, d: DVec3, c: DVec3, r: f64) -> Option<[f64; 2]> {
        line_sphere(V3::<f64>::constant(o), V3::constant(d), c, r).roots()
    }

    #[test]
    fn head_on_and_inside_and_tangent() {
        let o = DVec3::new(0.0, 0.0, -5.0);
        for s in [1.0, 3.0, 1e15, 1e-15] {
            let [a, b] = roots(o, DVec3::Z * s, DVec3::ZERO, 1.0).expect("hits");
            assert!((a * s - 4.0).abs() < 1e-14 && (b * s - 6.0).abs() < 1e-14);
        }
        let [a, b] = roots(DVec3::ZERO, DVec3::Z, DVec3::ZERO, 2.0).expect("from the centre");
        assert_eq!((a, b), (-2.0, 2.0));
        let o = DVec3::new(1.0, 0.0, -5.0);
        let tangent = line_sphere(
            V3::<f64>::constant(o),
            V3::constant(DVec3::Z),
            DVec3::ZERO,
            1.0,
        );
        assert_eq!(tangent.discriminant, 0.0);
        let [a, b] = tangent.roots().expect("touches");
        assert!((a - 5.0).abs() < 1e-14 && (b - 5.0).abs() < 1e-14);
    }

    #[test]
    fn huge_ground_sphere_keeps_its_digits() {
        // Straight down from height h onto a sphere of radius 1e6: t = h exactly.
        for h in [0.5, 1.0, 10.0] {
            let t = intersect(
                DVec3::new(0.0, h, 0.0),
                -DVec3::Y,
                DVec3::new(0.0, -1e6, 0.0),
                1e6,
                0.0,
                f64::INFINITY,
            )
            .expect("hits");
            assert!((t - h).abs() < 1e-9 * h, "{t} {h}");
        }
    }

    #[test]
    fn discriminant_sign_is_right_far_away() {
        // Numerics of the far sphere: the form b² − ac fails from a distance of 1e8 on.
        for k in 1..=8 {
            let dist = 10f64.powi(k);
            for b in [0.999_999, 1.000_001] {
                let o = DVec3::new(b, 0.0, -dist);
                let hit = roots(o, DVec3::Z, DVec3::ZERO, 1.0).is_some();
                assert_eq!(hit, b < 1.0, "distance {dist}, offset {b}");
            }
        }
    }
}
