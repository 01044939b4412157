//! The surface around a site that has looked where it goes on: which photons lie on it.

use super::{FLATNESS, NORMAL_AGREEMENT, PackedNormal, Side, Site};
use crate::math::Vec3;

/// What a site saw of the surface that it is on: how far a point may lie above or below its tangent
/// plane grows with the distance, as it did for the rays that looked. Thus what a kernel's area
/// counts as surface, beyond a fold too, is what photons are counted on.
pub(super) struct Ground {
    /// The side of the surface that the site is on.
    pub(super) side: Side,
    radius: f32,
}

impl Ground {
    #[inline]
    pub(super) fn new(site: &Site, radius: f32) -> Self {
        Self {
            side: Side::new(site),
            radius,
        }
    }

    /// Height of a point over the tangent plane, and the greatest that still counts as ground,
    /// squared.
    #[inline]
    fn heights(&self, q: Vec3) -> (f32, f32) {
        let way = q - self.side.p;
        let height = way.dot(self.side.ng);
        let away2 = way.length_squared() - height * height;
        let most2 = FLATNESS * FLATNESS * away2.max(self.radius * self.radius);
        (height, most2)
    }

    /// Whether a point lies on the ground.
    #[inline]
    pub(super) fn supports(&self, q: Vec3) -> bool {
        let (height, most2) = self.heights(q);
        height * height <= most2
    }

    /// Whether a photon at `q` with normal `n` lies on the ground.
    #[inline]
    pub(super) fn accepts(&self, q: Vec3, n: PackedNormal) -> bool {
        self.supports(q)
            && (n == self.side.packed || n.unpack().dot(self.side.ng) >= NORMAL_AGREEMENT)
    }

    /// Squared distance from `p` to the farthest point of the ground over the kernel around it.
    #[inline]
    pub(super) fn reach(&self, p: Vec3) -> f32 {
        let (height, _) = self.heights(p);
        let away = (p - self.side.p).length();
        let rise = height.abs() + FLATNESS * (away + self.radius);
        self.radius * self.radius + rise * rise
    }
}
