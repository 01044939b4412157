//! Thin-walled rough transmission: a frosted pane.
//!
//! Source: glTF's `KHR_materials_transmission`: the microfacet reflection, mirrored to the other
//! side of the surface.

use super::{LobeClass, LobeModel, LobeSample, ThinDielectric};
use crate::color::Rgb;
use crate::materials::microfacet::Ggx;
use crate::math::DVec3;

/// A thin pane that scatters by its roughness both what it reflects and what passes.
#[derive(Clone, Copy, Debug)]
pub struct ThinGgx {
    pub(in crate::materials) ggx: Ggx,
    /// What a microfacet does.
    pub(in crate::materials) facet: ThinDielectric,
}

impl ThinGgx {
    /// Colours of the two sides at a microfacet, and the probability of reflecting.
    #[inline]
    fn facet(&self, cos: f64) -> ([Rgb; 2], f64) {
        let sides = self.facet.split(cos);
        let [r, t] = sides.map(Rgb::max_channel);
        (sides, if r > 0.0 { r / (r + t) } else { 0.0 })
    }
}

impl LobeModel for ThinGgx {
    #[inline]
    fn class(&self) -> LobeClass {
        LobeClass::Glossy
    }

    fn eval(&self, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
        if wi.z == 0.0 || wo.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let up = DVec3::new(wi.x, wi.y, wi.z.abs());
        let h = (wo + up).normalize();
        let cos_h = wo.dot(h);
        let ([reflected, passed], p) = self.facet(cos_h);
        let (color, p) = if wi.z > 0.0 {
            (reflected, p)
        } else {
            (passed, 1.0 - p)
        };
        let f = color * (self.ggx.d(h) * self.ggx.g2(wo, up) / (4.0 * wo.z * up.z));
        (f, self.ggx.visible_pdf(wo, h) / (4.0 * cos_h) * p)
    }

    fn sample(&self, wo: DVec3, u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        let h = self.ggx.sample_visible(wo, u);
        let cos_h = wo.dot(h);
        let up = h * (2.0 * cos_h) - wo;
        if up.z <= 0.0 || cos_h <= 0.0 {
            return None;
        }
        let ([reflected, passed], p) = self.facet(cos_h);
        let (color, p, side) = if u_pick < p {
            (reflected, p, 1.0)
        } else {
            (passed, 1.0 - p, -1.0)
        };
        Some(LobeSample {
            wi: DVec3::new(up.x, up.y, side * up.z),
            weight: color * (self.ggx.g2(wo, up) / (self.ggx.g1(wo) * p)),
            pdf: self.ggx.visible_pdf(wo, h) / (4.0 * cos_h) * p,
        })
    }

    #[inline]
    fn albedo(&self, wo: DVec3) -> Rgb {
        self.facet.albedo(wo)
    }
}
