//! Sheen of cloth.
//!
//! Source: Estevez and Kulla, *Production Friendly Microfacet Sheen BRDF*, 2017, as
//! `KHR_materials_sheen` states it.

use std::f64::consts::TAU;

use super::{LobeClass, LobeModel, LobeSample};
use crate::color::Rgb;
use crate::materials::layer::SheenAlbedo;
use crate::math::DVec3;
use crate::sampling::warp;

/// Least roughness: below it the rim is narrower than any pixel sees.
const SMOOTHEST: f64 = 0.07;

/// The fit of the masking function stays finite at the horizon, where the cosine below it does
/// not: from here on it is held.
const GRAZING: f64 = 1e-3;

/// A microfacet distribution of fibres that stand upright.
#[derive(Clone, Copy, Debug)]
pub struct Sheen {
    color: Rgb,
    roughness: f64,
    /// Inverse of the distribution's width.
    inverse: f64,
}

impl Sheen {
    /// Sheen of a colour and a roughness from 0 to 1.
    #[inline]
    pub fn new(color: Rgb, roughness: f64) -> Self {
        let roughness = roughness.clamp(SMOOTHEST, 1.0);
        Self {
            color,
            roughness,
            inverse: 1.0 / (roughness * roughness),
        }
    }

    /// What it takes from the lobes below.
    pub(in crate::materials) fn cover(&self) -> SheenAlbedo {
        SheenAlbedo::new(self.roughness, self.color.max_channel())
    }

    /// The fit of the masking function's logarithm.
    fn log_lambda(&self, x: f64) -> f64 {
        let alpha = 1.0 / self.inverse;
        let k = (1.0 - alpha) * (1.0 - alpha);
        let mix = |rough: f64, smooth: f64| rough + (smooth - rough) * k;
        let (a, b, c) = (
            mix(21.5473, 25.3245),
            mix(3.82987, 3.32435),
            mix(0.19823, 0.16801),
        );
        let (d, e) = (mix(-1.97760, -1.27393), mix(-4.32054, -4.85967));
        a / (1.0 + b * x.powf(c)) + d * x + e
    }

    fn lambda(&self, cos: f64) -> f64 {
        if cos < 0.5 {
            self.log_lambda(cos).exp()
        } else {
            (2.0 * self.log_lambda(0.5) - self.log_lambda(1.0 - cos)).exp()
        }
    }

    /// White sheen's `f`, both directions above the surface. At grazing angles the model returns
    /// more than it gets; it is held to that, reciprocally.
    fn held(&self, wo: DVec3, wi: DVec3) -> f64 {
        let white = SheenAlbedo::new(self.roughness, 1.0);
        let excess = white.unheld(wo.z).max(white.unheld(wi.z)).max(1.0);
        self.value(wo, wi) / excess
    }

    /// The model itself.
    pub(in crate::materials) fn value(&self, wo: DVec3, wi: DVec3) -> f64 {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return 0.0;
        }
        let Some(h) = (wo + wi).try_normalize() else {
            return 0.0;
        };
        let sin2 = (h.x * h.x + h.y * h.y).min(1.0);
        let d = (2.0 + self.inverse) * sin2.powf(0.5 * self.inverse) / TAU;
        let g = 1.0 / (1.0 + self.lambda(wo.z) + self.lambda(wi.z));
        d * g / (4.0 * wo.z.max(GRAZING) * wi.z.max(GRAZING))
    }
}

impl LobeModel for Sheen {
    #[inline]
    fn class(&self) -> LobeClass {
        LobeClass::Diffuse
    }

    fn eval(&self, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
        if wi.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let f = self.color * self.held(wo, wi);
        (f, warp::cone_pdf(1.0))
    }

    fn sample(&self, wo: DVec3, _u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        // The rim is brightest toward grazing angles, where cosine sampling is poor.
        let wi = warp::cone(u, 0.0);
        let pdf = warp::cone_pdf(1.0);
        Some(LobeSample {
            wi,
            weight: self.color * (self.held(wo, wi) * wi.z / pdf),
            pdf,
        })
    }

    fn albedo(&self, wo: DVec3) -> Rgb {
        let top = self.color.max_channel();
        if top == 0.0 {
            return Rgb::ZERO;
        }
        self.color * (self.cover().at(wo.z) / top)
    }
}
