//! Diffuse transmission (`KHR_materials_diffuse_transmission`).

use std::f64::consts::FRAC_1_PI;

use super::{LobeClass, LobeModel, LobeSample};
use crate::color::Rgb;
use crate::materials::layer::LayerAlbedo;
use crate::math::DVec3;
use crate::sampling::warp;

/// Light that leaves the other side in all directions alike, as far as the layers on both sides
/// let it pass.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseTransmission {
    albedo: Rgb,
    layer: LayerAlbedo,
    scale: f64,
}

impl DiffuseTransmission {
    /// Transmittance `albedo` between two layers.
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
        (1.0 - self.layer.at(wo.z)) * (1.0 - self.layer.at(-wi.z)) * self.scale
    }
}

impl LobeModel for DiffuseTransmission {
    #[inline]
    fn class(&self) -> LobeClass {
        LobeClass::Diffuse
    }

    #[inline]
    fn eval(&self, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
        if wi.z >= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        (
            self.albedo * (FRAC_1_PI * self.passes(wo, wi)),
            warp::cosine_hemisphere_pdf(-wi.z),
        )
    }

    #[inline]
    fn sample(&self, wo: DVec3, _u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        let up = warp::cosine_hemisphere(u);
        let wi = DVec3::new(up.x, up.y, -up.z);
        Some(LobeSample {
            wi,
            weight: self.albedo * self.passes(wo, wi),
            pdf: warp::cosine_hemisphere_pdf(up.z),
        })
    }

    #[inline]
    fn albedo(&self, wo: DVec3) -> Rgb {
        self.albedo * (1.0 - self.layer.at(wo.z))
    }
}
