//! The program's dual numbers with the six numbers of a ray as variables.

use dualight::ad::V3;
use dualight::geometry::{sphere, triangle};
use dualight::math::DVec3;

use crate::exact::{ExactSphere, ExactTriangle};
use crate::report::{Meter, Row};

pub type Dual = dualight::ad::Dual<f64, 6>;

/// The gradient, by the origin and then by the direction; NaN where it is marked as invalid.
pub fn by(x: &Dual) -> [f64; 6] {
    x.gradient().unwrap_or([f64::NAN; 6])
}

/// A ray whose origin and direction are the variables.
pub fn variables(o: DVec3, d: DVec3) -> [V3<Dual>; 2] {
    let v = Dual::variable;
    [
        V3 {
            x: v(o.x, 0),
            y: v(o.y, 1),
            z: v(o.z, 2),
        },
        V3 {
            x: v(d.x, 3),
            y: v(d.y, 4),
            z: v(d.z, 5),
        },
    ]
}

/// What the derivative path makes of rays at one primitive, against exact arithmetic.
#[derive(Default)]
pub struct Seen {
    value: Meter,
    gradient: Meter,
}

impl Seen {
    /// One ray at a sphere: the root that `far` picks, and its gradient by the origin,
    /// `−n/(d·n)`, of that gradient's size. What is marked as a branch point has none.
    pub fn sphere(&mut self, o: DVec3, d: DVec3, c: DVec3, r: f64, far: bool) {
        let (Some(want), [vo, vd]) = (ExactSphere::new(o, d, c, r).roots(), variables(o, d)) else {
            return;
        };
        let Some(roots) = sphere::line_sphere(vo, vd, c, r).roots() else {
            self.value.see(f64::INFINITY);
            return;
        };
        let (t, want) = (&roots[usize::from(far)], want[usize::from(far)]);
        let unit = want.abs().max(r / d.length());
        self.value.see((t.value() - want).abs() / unit);
        self.slope(t, (o + d * want - c) / r, d);
    }

    /// One ray at the plane of a triangle: distance, barycentrics and the gradient of the first.
    pub fn triangle(&mut self, o: DVec3, d: DVec3, v: [DVec3; 3]) {
        let Some([t, b1, b2]) = ExactTriangle::new(o, d, v).hit() else {
            return;
        };
        let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
        let n = e1.cross(e2);
        let [vo, vd] = variables(o, d);
        let Some(hit) = triangle::plane_hit(vo, vd, v[0], e1, e2, n) else {
            self.value.see(f64::INFINITY);
            return;
        };
        self.value.see((hit.t.value() - t).abs() / t.abs());
        self.value.see((hit.b1.value() - b1).abs());
        self.value.see((hit.b2.value() - b2).abs());
        self.slope(&hit.t, n, d);
    }

    fn slope(&mut self, t: &Dual, n: DVec3, d: DVec3) {
        let Some(got) = t.gradient() else { return };
        let want = -n / d.dot(n);
        let got = DVec3::new(got[0], got[1], got[2]);
        self.gradient.see((got - want).length() / want.length());
    }

    /// Writes what was seen.
    pub fn report(self, row: &mut Row, value: f64, gradient: f64) {
        row.line("dual", "distance (and barycentrics)", self.value, value);
        row.line("dual", "gradient of the distance", self.gradient, gradient);
    }
}
