//! Rough reflection.

use super::{LobeClass, LobeModel, LobeSample};
use crate::color::Rgb;
use crate::materials::fresnel::Fresnel;
use crate::materials::microfacet::Ggx;
use crate::math::DVec3;

/// GGX reflection, sampled by visible normals.
#[derive(Clone, Copy, Debug)]
pub struct GgxReflection {
    pub(in crate::materials) ggx: Ggx,
    pub(in crate::materials) fresnel: Fresnel,
}

impl GgxReflection {
    /// Reflection of microfacet width `alpha > 0`, the same in all directions.
    #[inline]
    pub fn new(alpha: f64, fresnel: impl Into<Fresnel>) -> Self {
        Self {
            ggx: Ggx::round(alpha),
            fresnel: fresnel.into(),
        }
    }
}

impl LobeModel for GgxReflection {
    #[inline]
    fn class(&self) -> LobeClass {
        LobeClass::Glossy
    }

    #[inline]
    fn eval(&self, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let h = (wo + wi).normalize();
        let cos_h = wo.dot(h);
        let f =
            self.fresnel.at(cos_h) * (self.ggx.d(h) * self.ggx.g2(wo, wi) / (4.0 * wo.z * wi.z));
        (f, self.ggx.visible_pdf(wo, h) / (4.0 * cos_h))
    }

    #[inline]
    fn sample(&self, wo: DVec3, _u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        let h = self.ggx.sample_visible(wo, u);
        let cos_h = wo.dot(h);
        let wi = h * (2.0 * cos_h) - wo;
        if wi.z <= 0.0 || cos_h <= 0.0 {
            return None;
        }
        Some(LobeSample {
            wi,
            weight: self.fresnel.at(cos_h) * (self.ggx.g2(wo, wi) / self.ggx.g1(wo)),
            pdf: self.ggx.visible_pdf(wo, h) / (4.0 * cos_h),
        })
    }

    #[inline]
    fn albedo(&self, wo: DVec3) -> Rgb {
        self.fresnel.at(wo.z)
    }
}
