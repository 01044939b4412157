//! Axis-aligned boxes and bounding spheres.

use super::{DAffine3, DVec3};

/// An axis-aligned box; empty when `min > max` in any axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest corner.
    pub min: DVec3,
    /// Largest corner.
    pub max: DVec3,
}

impl Aabb {
    /// The box that holds nothing; growing it by a point gives that point.
    pub const EMPTY: Self = Self {
        min: DVec3::splat(f64::INFINITY),
        max: DVec3::splat(f64::NEG_INFINITY),
    };

    /// Smallest box around this one and `p`.
    #[inline]
    pub fn grow(&mut self, p: DVec3) {
        self.min = self.min.min(p);
        self.max = self.max.max(p);
    }

    /// Smallest box around both.
    #[inline]
    pub fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Its corners under an affine map; none of an empty box.
    pub fn corners_under(self, map: &DAffine3) -> impl Iterator<Item = DVec3> {
        let n = if self.is_empty() { 0 } else { 8 };
        (0..n).map(move |k| {
            let ends = [self.min, self.max];
            let corner = [0, 1, 2].map(|axis| ends[k >> axis & 1][axis]);
            map.transform_point3(corner.into())
        })
    }

    /// Whether it holds no point at all.
    pub fn is_empty(&self) -> bool {
        !(self.min.x <= self.max.x && self.min.y <= self.max.y && self.min.z <= self.max.z)
    }

    /// Midpoint; the origin for an empty box.
    pub fn center(&self) -> DVec3 {
        if self.is_empty() {
            DVec3::ZERO
        } else {
            0.5 * (self.min + self.max)
        }
    }

    /// Edge lengths; zero for an empty box.
    pub fn extent(&self) -> DVec3 {
        if self.is_empty() {
            DVec3::ZERO
        } else {
            self.max - self.min
        }
    }

    /// The sphere around the box's centre that holds its corners.
    pub fn bounding_sphere(&self) -> BoundingSphere {
        BoundingSphere {
            center: self.center(),
            radius: 0.5 * self.extent().length(),
        }
    }
}

/// A sphere that holds something; radius in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingSphere {
    /// Centre, in world space.
    pub center: DVec3,
    /// Radius, at least zero.
    pub radius: f64,
}

impl BoundingSphere {
    /// Area of the section of a beam of parallel light that just holds it, in m².
    pub fn beam_area(&self) -> f64 {
        std::f64::consts::PI * self.radius * self.radius
    }

    /// Smallest sphere around two spheres.
    pub fn union(self, other: Self) -> Self {
        let d = other.center - self.center;
        let dist = d.length();
        if dist + other.radius <= self.radius {
            return self;
        }
        if dist + self.radius <= other.radius {
            return other;
        }
        let radius = 0.5 * (dist + self.radius + other.radius);
        Self {
            center: self.center + d * ((radius - self.radius) / dist),
            radius,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn union_of_spheres_holds_both() {
        let a = BoundingSphere {
            center: DVec3::ZERO,
            radius: 1.0,
        };
        let b = BoundingSphere {
            center: DVec3::new(3.0, 0.0, 0.0),
            radius: 0.5,
        };
        let u = a.union(b);
        for s in [a, b] {
            assert!((s.center - u.center).length() + s.radius <= u.radius + 1e-12);
        }
        assert!((u.radius - 2.25).abs() < 1e-12);
        assert_eq!(a.union(BoundingSphere { radius: 0.1, ..a }), a);
    }

    #[test]
    fn empty_box_grows_to_a_point() {
        let mut b = Aabb::EMPTY;
        assert!(b.is_empty());
        b.grow(DVec3::ONE);
        assert_eq!(b.center(), DVec3::ONE);
        assert_eq!(b.extent(), DVec3::ZERO);
    }
}
