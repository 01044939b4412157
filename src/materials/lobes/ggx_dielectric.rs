//! Rough reflection and refraction.
//!
//! Source: Walter et al. 2007, section 4.2, with exact Fresnel terms at the microfacet.

use super::{LobeClass, LobeModel, LobeSample};
use crate::color::Rgb;
use crate::materials::fresnel;
use crate::materials::microfacet::Ggx;
use crate::math::DVec3;

/// A rough interface between two dielectrics.
#[derive(Clone, Copy, Debug)]
pub struct GgxDielectric {
    ggx: Ggx,
    eta: f64,
    tint: Rgb,
    share: f64,
}

impl GgxDielectric {
    /// Width `alpha > 0`; `eta`, `tint` and `share` as in
    /// [`SmoothDielectric`](super::SmoothDielectric).
    #[inline]
    pub fn new(alpha: f64, eta: f64, tint: Rgb, share: f64) -> Self {
        Self {
            ggx: Ggx { alpha },
            eta,
            tint,
            share,
        }
    }

    /// Probability of reflecting, and the sum of what is reflected and transmitted, at a
    /// microfacet.
    #[inline]
    fn split(&self, cos: f64) -> (f64, f64, fresnel::Dielectric) {
        let f = fresnel::dielectric(cos, self.eta);
        (f.reflectance, self.share, f)
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
            let (p_reflect, _, f) = self.split(cos_h);
            let value = self.ggx.d(h) * self.ggx.g2(wo, wi) * f.reflectance * self.share
                / (4.0 * wo.z * wi.z);
            let pdf = self.ggx.visible_pdf(wo, h) / (4.0 * cos_h) * p_reflect;
            return (Rgb::splat(value), pdf);
        }
        // The generalised half vector of refraction, turned to the outer side.
        let Some(h) = (wo + wi * self.eta).try_normalize() else {
            return none;
        };
        let h = if h.z < 0.0 { -h } else { h };
        let (oh, ih) = (wo.dot(h), wi.dot(h));
        if oh <= 0.0 || ih >= 0.0 || wi.z == 0.0 {
            return none;
        }
        let (p_reflect, _, f) = self.split(oh);
        let denom = ih + oh / self.eta;
        let jacobian = ih.abs() / (denom * denom);
        let through = f.transmittance * self.share;
        let value =
            self.ggx.d(h) * self.ggx.g2(wo, wi) * through * jacobian * oh / (wo.z * wi.z.abs());
        let pdf = self.ggx.visible_pdf(wo, h) * jacobian * (1.0 - p_reflect);
        (self.tint * value, pdf)
    }

    fn sample(&self, wo: DVec3, u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        let h = self.ggx.sample_visible(wo, u);
        let oh = wo.dot(h);
        if oh <= 0.0 {
            return None;
        }
        let (p_reflect, sum, f) = self.split(oh);
        let reflect = u_pick < p_reflect;
        let wi = if reflect {
            h * (2.0 * oh) - wo
        } else {
            let inv = 1.0 / self.eta;
            (h * (oh * inv - f.cos_t) - wo * inv).normalize()
        };
        if (wi.z > 0.0) != reflect || wi.z == 0.0 {
            return None;
        }
        let shadow = self.ggx.g2(wo, wi) / self.ggx.g1(wo);
        let color = if reflect { Rgb::ONE } else { self.tint };
        let (_, pdf) = self.eval(wo, wi);
        Some(LobeSample {
            wi,
            weight: color * (sum * shadow),
            pdf,
        })
    }

    #[inline]
    fn albedo(&self, wo: DVec3) -> Rgb {
        let (_, _, f) = self.split(wo.z);
        (Rgb::splat(f.reflectance) + self.tint * f.transmittance) * self.share
    }

    #[inline]
    fn eta(&self) -> f64 {
        self.eta
    }
}
