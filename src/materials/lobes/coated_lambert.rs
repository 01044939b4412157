//! Diffuse reflection below a reflecting layer.
//!
//! glTF 2.0, B.3.5 (`fresnel_mix`) scales the base by `1 − F(wo·h)`, which gives back up to 1.7
//! times the light at grazing angles, since the layer above reflects by the angle to its normal.
//! Here the base keeps what the layer's directional albedo `E` leaves, on the way in and on the
//! way out: reciprocal, and a white base under a lossless layer returns all light (Ashikhmin and
//! Shirley, *An Anisotropic Phong BRDF Model*, 2000, generalised by Kelemen and Szirmay-Kalos,
//! 2001).

use std::f64::consts::FRAC_1_PI;

use super::{LobeClass, LobeModel, LobeSample};
use crate::color::Rgb;
use crate::materials::layer::LayerAlbedo;
use crate::math::DVec3;
use crate::sampling::warp;

/// `f = albedo / π · (1 − E(wo)) (1 − E(wi)) / (1 − Ē)`.
#[derive(Clone, Copy, Debug)]
pub struct CoatedLambert {
    albedo: Rgb,
    layer: LayerAlbedo,
    scale: f64,
}

impl CoatedLambert {
    /// A base of reflectance `albedo` under a layer.
    #[inline]
    pub(in crate::materials) fn new(albedo: Rgb, layer: LayerAlbedo) -> Self {
        Self {
            albedo,
            layer,
            scale: 1.0 / (1.0 - layer.mean()).max(1e-3),
        }
    }

    #[inline]
    fn passes(&self, wo: DVec3, wi: DVec3) -> f64 {
        (1.0 - self.layer.at(wo.z)) * (1.0 - self.layer.at(wi.z)) * self.scale
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
        let f = self.albedo * (FRAC_1_PI * self.passes(wo, wi));
        (f, warp::cosine_hemisphere_pdf(wi.z))
    }

    #[inline]
    fn sample(&self, wo: DVec3, _u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        let wi = warp::cosine_hemisphere(u);
        Some(LobeSample {
            wi,
            weight: self.albedo * self.passes(wo, wi),
            pdf: warp::cosine_hemisphere_pdf(wi.z),
        })
    }

    #[inline]
    fn albedo(&self, wo: DVec3) -> Rgb {
        self.albedo * (1.0 - self.layer.at(wo.z))
    }
}
