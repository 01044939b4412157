//! Mirror reflection.

use super::{Branches, LobeClass, LobeModel, LobeSample};
use crate::color::Rgb;
use crate::materials::fresnel::Fresnel;
use crate::math::DVec3;

/// Reflection by a perfectly smooth surface .
#[derive(Clone, Copy, Debug)]
pub struct SmoothReflection {
    /// Reflectance by angle.
    pub fresnel: Fresnel,
}

impl LobeModel for SmoothReflection {
    #[inline]
    fn class(&self) -> LobeClass {
        LobeClass::Delta
    }

    #[inline]
    fn eval(&self, _wo: DVec3, _wi: DVec3) -> (Rgb, f64) {
        (Rgb::ZERO, 0.0)
    }

    #[inline]
    fn sample(&self, wo: DVec3, _u_pick: f64, _u: [f64; 2]) -> Option<LobeSample> {
        self.branches(wo).pop()
    }

    #[inline]
    fn branches(&self, wo: DVec3) -> Branches {
        Branches::from_iter([LobeSample {
            wi: DVec3::new(-wo.x, -wo.y, wo.z),
            weight: self.fresnel.at(wo.z),
            pdf: 0.0,
        }])
    }

    #[inline]
    fn albedo(&self, wo: DVec3) -> Rgb {
        self.fresnel.at(wo.z)
    }
}
