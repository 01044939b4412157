//! Orthonormal frames around a normal.
//!
//! Source: Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6(1), 2017.

use super::DVec3;

/// A right-handed orthonormal frame whose `z` axis is a given unit normal.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// First tangent.
    pub x: DVec3,
    /// Second tangent.
    pub y: DVec3,
    /// The normal.
    pub z: DVec3,
}

impl Frame {
    /// The frame around the unit vector `n`; continuous except at `n.z = 0⁻`.
    #[inline]
    pub fn from_normal(n: DVec3) -> Self {
        let sign = 1f64.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            x: DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            y: DVec3::new(b, sign + n.y * n.y * a, -n.y),
            z: n,
        }
    }

    /// The frame around the unit vector `n` whose first axis follows `t`; `None` if they are
    /// parallel.
    pub fn from_normal_and_tangent(n: DVec3, t: DVec3) -> Option<Self> {
        let x = (t - n * n.dot(t)).try_normalize()?;
        Some(Self {
            x,
            y: n.cross(x),
            z: n,
        })
    }

    /// World direction of a direction given in the frame.
    #[inline]
    pub fn to_world(&self, v: DVec3) -> DVec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    /// The frame's coordinates of a world direction.
    #[inline]
    pub fn to_local(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for n in [
            DVec3::Z,
            -DVec3::Z,
            DVec3::X,
            DVec3::new(0.3, -0.4, -0.866_025_403_784_438_6).normalize(),
            DVec3::new(1e-9, 1e-9, -1.0).normalize(),
        ] {
            let f = Frame::from_normal(n);
            for (a, b) in [(f.x, f.y), (f.y, f.z), (f.z, f.x)] {
                assert!(a.dot(b).abs() < 1e-14, "{n}");
            }
            assert!((f.x.cross(f.y) - f.z).length() < 1e-14, "{n}");
            let v = DVec3::new(0.1, 0.2, 0.3);
            assert!((f.to_local(f.to_world(v)) - v).length() < 1e-14);
        }
    }
}
