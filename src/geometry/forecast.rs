//! Forecasts: what a neighbouring ray will meet, told from the derivatives of one hit test.
//!
//! A ray runs from `P_L` through `P_N`; a check point lies at `P_N + h`, where for parallel light
//! the whole ray is shifted by `h` instead. Of a sphere, the discriminant `D` of the quadratic
//! equation is forecast (Namae and Makino 2002, equations 8 and 9); of a triangle, the three edge
//! functions.
//!
//! The paper's forecast is linear. A sphere's `D` is concave in `h`, so the linear one never sees
//! the far rim: from a ray through the centre, where the gradient is zero, it sees no rim at all.
//! But `D` is a quadratic form in `P_N`, and so its second-order term closes the series: the
//! quadratic forecast has the sign of the truth, at every distance. Edge functions are linear in
//! `P_N` to begin with.

use super::sphere::line_sphere;
use crate::ad::{Dual, Real, V3};
use crate::math::DVec3;

/// What a check point moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moves {
    /// The point that the ray aims at; its origin stays. Light from a point.
    Target,
    /// The whole ray, sideways. Parallel light.
    Ray,
}

/// How much of the series is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// `D + ∇D·h`, as in the paper.
    Linear,
    /// With the second-order term, which makes it exact.
    Quadratic,
}

/// The discriminant of a ray and a sphere, and how it changes.
#[derive(Clone, Copy, Debug)]
pub struct SphereForecast {
    /// At the ray itself, dimensionless: `1 − (b/r)²` with `b` the distance from the centre to
    /// the line. Positive if the line meets the sphere.
    pub discriminant: f64,
    /// Its gradient by the check point, for the polynomial form `D·|d|²/|d₀|²`.
    pub gradient: DVec3,
    moves: Moves,
    d: DVec3,
    f: DVec3,
    inv_dd: f64,
    inv_r2: f64,
}

impl SphereForecast {
    /// The forecast for the ray from `o` along `d = P_N − P_L`, which must not be zero, and the
    /// sphere around `center` of radius `r`. Hits and misses are told alike: a miss knows by how
    /// much. `None` if nothing can be said (an overflow).
    #[inline]
    pub fn new(o: DVec3, d: DVec3, center: DVec3, r: f64, moves: Moves) -> Option<Self> {
        // Three derivatives, by the coordinates of what moves. Each way on its own, so that the
        // compiler knows of every number whether it varies.
        let dual: Dual<f64, 3> = match moves {
            Moves::Target => line_sphere(V3::constant(o), V3::variable(d), center, r).polynomial,
            Moves::Ray => line_sphere(V3::variable(o), V3::constant(d), center, r).polynomial,
        };
        let inv_dd = 1.0 / d.dot(d);
        let discriminant = dual.value() * inv_dd;
        let gradient = DVec3::from_array(dual.gradient()?) * inv_dd;
        Some(Self {
            discriminant,
            gradient,
            moves,
            d,
            f: o - center,
            inv_dd,
            inv_r2: 1.0 / (r * r),
        })
    }

    /// The discriminant forecast at `h`, up to a positive factor.
    #[inline]
    pub fn at(&self, h: DVec3, order: Order) -> f64 {
        let linear = self.discriminant + self.gradient.dot(h);
        match (order, self.moves) {
            (Order::Linear, _) => linear,
            (Order::Quadratic, Moves::Target) => {
                let moment = self.f.cross(h);
                linear + (h.dot(h) - moment.dot(moment) * self.inv_r2) * self.inv_dd
            }
            (Order::Quadratic, Moves::Ray) => {
                let along = h.dot(self.d);
                linear - (h.dot(h) - along * along * self.inv_dd) * self.inv_r2
            }
        }
    }

    /// Whether the line at `h` is forecast to meet the sphere.
    #[inline]
    pub fn meets(&self, h: DVec3, order: Order) -> bool {
        self.at(h, order) >= 0.0
    }
}

/// Edge functions of the line `o + t·d` and a triangle: element `i` belongs to the edge from
/// corner `i` to corner `i + 1` and is the volume `d · (a × b)` that the line spans with it. The
/// line passes inside where all three have one sign; where they are positive, it comes from the
/// back. The function of a shared edge differs in sign only, to the last bit.
///
/// They are left un-normalised: barycentric coordinates have a pole at grazing incidence, these
/// are polynomials. They are linear in what moves, so that value and gradient at a ray add up to
/// the value at a check point. Where a single check point is asked about, that is computed for
/// less at the point itself, and its sign does not depend on which of two triangles asks.
#[inline(always)]
pub fn edge_functions<R: Real>(o: V3<R>, d: V3<R>, v: [DVec3; 3]) -> [R; 3] {
    let r = v.map(|p| V3::constant(p) - o);
    [0, 1, 2].map(|i| d.dot(r[i].cross(r[(i + 1) % 3])))
}
