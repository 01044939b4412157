//! Diffuse reflection below a reflecting layer.
//!
//! Source: glTF 2.0, appendix B.3.5 (`fresnel_mix`): the layer takes `F(wo·h)` of the light.

use std::f64::consts::FRAC_1_PI;

use super::{LobeClass, LobeModel, LobeSample};
use crate::color::Rgb;
use crate::materials::fresnel::Schlick;
use crate::math::DVec3;
use crate::sampling::warp;

/// `f = albedo / π · (1 − max F(wo·h))`; reciprocal.
#[derive(Clone, Copy, Debug)]
pub struct CoatedLambert {
    /// Reflectance of the base.
    pub albedo: Rgb,
    /// Fresnel term of the layer above.
    pub layer: Schlick,
}

impl CoatedLambert {
    #[inline]
    fn scale(&self, wo: DVec3, wi: DVec3) -> f64 {
        let Some(h) = (wo + wi).try_normalize() else {
            return 0.0;
        };
        (1.0 - self.layer.at(wo.dot(h).abs()).max_channel()).max(0.0)
    }
}

impl LobeModel for CoatedLambert {
    #[inline]
    fn class(&self) -> LobeClass {
        LobeClass::Diffuse
    }

    #[inline]
    fn eval(&self, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
        if wi.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let f = self.albedo * (FRAC_1_PI * self.scale(wo, wi));
        (f, warp::cosine_hemisphere_pdf(wi.z))
    }

    #[inline]
    fn sample(&self, wo: DVec3, _u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        let wi = warp::cosine_hemisphere(u);
        Some(LobeSample {
            wi,
            weight: self.albedo * self.scale(wo, wi),
            pdf: warp::cosine_hemisphere_pdf(wi.z),
        })
    }

    #[inline]
    fn albedo(&self, _wo: DVec3) -> Rgb {
        // Reflectance at normal incidence stands for the mean over directions.
        self.albedo * (1.0 - self.layer.f0.max_channel()).max(0.0)
    }
}
