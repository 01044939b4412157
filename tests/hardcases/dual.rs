//! The program's dual numbers with the six numbers of a ray as variables.

use dualight::ad::V3;
use dualight::math::DVec3;

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
