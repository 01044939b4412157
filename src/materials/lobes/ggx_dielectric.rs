//! Rough reflection and refraction.
//!
//! Source: Walter et al. 2007, section 4.2, with exact Fresnel terms at the microfacet.

use super::{LobeClass, LobeModel, LobeSample, SmoothDielectric};
use crate::color::Rgb;
use crate::materials::fresnel;
use crate::materials::microfacet::Ggx;
use crate::math::DVec3;

/// A rough interface between two dielectrics.
#[derive(Clone, Copy, Debug)]
pub struct GgxDielectric {
    pub(in crate::materials) ggx: Ggx,
    /// What a microfacet does.
    pub(in crate::materials) facet: SmoothDielectric,
}

/// What a microfacet does with light.
struct Facet {
    /// Probability of reflecting.
    p_reflect: f64,
    reflected: Rgb,
    refracted: Rgb,
    cos_t: f64,
}

impl GgxDielectric {
    #[inline]
    fn facet(&self, cos: f64) -> Facet {
        let f = fresnel::dielectric(cos, self.facet.eta);
        let [reflected, refracted] = self.facet.split(&f, cos);
        let (r, t) = (reflected.max_channel(), refracted.max_channel());
        Facet {
            p_reflect: if r > 0.0 { r / (r + t) } else { 0.0 },
            reflected,
            refracted,
            cos_t: f.cos_t,
        }
    }
}

impl LobeModel for GgxDielectric {
    #[inline]
    fn class(&self) -> LobeClass {
        LobeClass::Glossy
    }

    fn eval(&self, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
        let none = (Rgb::ZERO, 0.0);
        if wi.z > 0.0 {
            let h = (wo + wi).normalize();
            let cos_h = wo.dot(h);
            let facet = self.facet(cos_h);
            let value = self.ggx.d(h) * self.ggx.g2(wo, wi) / (4.0 * wo.z * wi.z);
            let pdf = self.ggx.visible_pdf(wo, h) / (4.0 * cos_h) * facet.p_reflect;
            return (facet.reflected * value, pdf);
        }
        // The generalised half vector of refraction, turned to the outer side.
        let Some(h) = (wo + wi * self.facet.eta).try_normalize() else {
            return none;
        };
        let h = if h.z < 0.0 { -h } else { h };
        let (oh, ih) = (wo.dot(h), wi.dot(h));
        if oh <= 0.0 || ih >= 0.0 || wi.z == 0.0 {
            return none;
        }
        let facet = self.facet(oh);
        let denom = ih + oh / self.facet.eta;
        let jacobian = ih.abs() / (denom * denom);
        let value = self.ggx.d(h) * self.ggx.g2(wo, wi) * jacobian * oh / (wo.z * wi.z.abs());
        let pdf = self.ggx.visible_pdf(wo, h) * jacobian * (1.0 - facet.p_reflect);
        (facet.refracted * value, pdf)
    }

    fn sample(&self, wo: DVec3, u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        let h = self.ggx.sample_visible(wo, u);
        let oh = wo.dot(h);
        if oh <= 0.0 {
            return None;
        }
        let facet = self.facet(oh);
        let reflect = u_pick < facet.p_reflect;
        let wi = if reflect {
            h * (2.0 * oh) - wo
        } else {
            let inv = 1.0 / self.facet.eta;
            (h * (oh * inv - facet.cos_t) - wo * inv).normalize()
        };
        if (wi.z > 0.0) != reflect || wi.z == 0.0 {
            return None;
        }
        let shadow = self.ggx.g2(wo, wi) / self.ggx.g1(wo);
        let color = if reflect {
            facet.reflected / facet.p_reflect
        } else {
            facet.refracted / (1.0 - facet.p_reflect)
        };
        let (_, pdf) = self.eval(wo, wi);
        Some(LobeSample {
            wi,
            weight: color * shadow,
            pdf,
        })
    }

    #[inline]
    fn albedo(&self, wo: DVec3) -> Rgb {
        self.facet.albedo(wo)
    }

    #[inline]
    fn eta(&self) -> f64 {
        self.facet.eta
    }
}
