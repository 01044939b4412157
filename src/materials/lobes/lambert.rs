//! Ideal diffuse reflection.

use std::f64::consts::FRAC_1_PI;

use super::{LobeClass, LobeModel, LobeSample};
use crate::color::Rgb;
use crate::math::DVec3;
use crate::sampling::warp;

/// `f = albedo / π`.
#[derive(Clone, Copy, Debug)]
pub struct Lambert {
    /// Reflectance.
    pub albedo: Rgb,
}

impl Lambert {
    /// Its value above the horizon.
    #[inline]
    pub(in crate::materials) fn f(&self) -> Rgb {
        self.albedo * FRAC_1_PI
    }
}

impl LobeModel for Lambert {
    #[inline]
    fn class(&self) -> LobeClass {
        LobeClass::Diffuse
    }

    #[inline]
    fn eval(&self, _wo: DVec3, wi: DVec3) -> (Rgb, f64) {
        if wi.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        (self.f(), warp::cosine_hemisphere_pdf(wi.z))
    }

    #[inline(always)]
    fn sample(&self, _wo: DVec3, _u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        let wi = warp::cosine_hemisphere(u);
        Some(LobeSample {
            wi,
            weight: self.albedo,
            pdf: warp::cosine_hemisphere_pdf(wi.z),
        })
    }

    #[inline]
    fn albedo(&self, _wo: DVec3) -> Rgb {
        self.albedo
    }
}
