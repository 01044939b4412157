//! A flat lamp of even radiance with four corners: the commonest light. Scenes keep it by value
//! beside its [`Light`](super::Light), so that shading reaches it without a call.

use super::LiSample;
use crate::color::Rgb;
use crate::math::DVec3;

/// A parallelogram that emits the same radiance everywhere.
#[derive(Clone, Copy, Debug)]
pub struct Parallelogram {
    pub(super) v0: DVec3,
    pub(super) e1: DVec3,
    pub(super) e2: DVec3,
    pub(super) face: Face,
}

/// What all points of a flat emitter have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    /// Unit normal of the side that emits.
    pub(super) ng: DVec3,
    /// Where shadow rays end, in metres off the surface.
    pub(super) offset: f64,
    pub(super) radiance: Rgb,
    /// Density of its points in area, 1/m².
    pub(super) pdf_area: f64,
    pub(super) double_sided: bool,
}

impl Face {
    /// The light that arrives at `p` from the point `on`.
    #[inline(always)]
    pub(super) fn li(&self, p: DVec3, on: DVec3) -> Option<LiSample> {
        let to = on - p;
        let d2 = to.length_squared();
        if !(d2 >= f64::MIN_POSITIVE) {
            return None;
        }
        let cos = -to.dot(self.ng);
        if cos == 0.0 || (cos < 0.0 && !self.double_sided) {
            return None;
        }
        let d = d2.sqrt();
        // The division does not wait for the root.
        let wi = to * (d * (1.0 / d2));
        Some(LiSample {
            wi,
            target: Some(on + self.ng * self.offset.copysign(cos)),
            radiance: self.radiance,
            pdf: d * (d2 * self.pdf_area / cos.abs()),
            delta: false,
        })
    }
}

impl Parallelogram {
    /// As [`Light::sample_li`](super::Light::sample_li).
    #[inline(always)]
    pub fn sample_li(&self, p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        self.face.li(p, self.v0 + self.e1 * u[0] + self.e2 * u[1])
    }
}
