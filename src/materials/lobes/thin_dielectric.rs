//! Thin-walled transmission: a pane with two parallel interfaces, which bends nothing.

use super::{Branches, LobeClass, LobeModel, LobeSample, pick};
use crate::color::Rgb;
use crate::materials::filmed::FacetFilm;
use crate::materials::fresnel;
use crate::math::DVec3;

/// A thin smooth pane, with all reflections between its faces: `R' = R + T²R/(1 − R²)
/// = 2R/(1 + R)`.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Index of the pane over that of its surroundings.
    pub eta: f64,
    /// Colour of what passes.
    pub tint: Rgb,
    /// Colour of what is reflected, where not everything is; what it leaves passes.
    pub reflect: Rgb,
    /// Share of the surface that is this pane; the rest is left to other lobes.
    pub share: Rgb,
    /// A film on both of its faces.
    pub film: Option<FacetFilm>,
}

impl ThinDielectric {
    /// What is reflected and what passes.
    #[inline]
    pub(super) fn split(&self, cos: f64) -> [Rgb; 2] {
        let f = fresnel::dielectric(cos, self.eta);
        let sum = 1.0 + f.reflectance;
        let pane = fresnel::Dielectric {
            reflectance: 2.0 * f.reflectance / sum,
            transmittance: f.transmittance / sum,
            cos_t: 1.0,
        };
        let bare = fresnel::split(&pane, self.reflect, self.tint);
        let sides = match &self.film {
            None => bare,
            Some(film) => {
                let face = film.reflectance(&f, cos, self.eta, self.reflect);
                film.over(bare, face.map(|r| 2.0 * r / (1.0 + r)), self.tint)
            }
        };
        sides.map(|c| c * self.share)
    }
}

impl LobeModel for ThinDielectric {
    #[inline]
    fn class(&self) -> LobeClass {
        LobeClass::Delta
    }

    #[inline]
    fn eval(&self, _wo: DVec3, _wi: DVec3) -> (Rgb, f64) {
        (Rgb::ZERO, 0.0)
    }

    #[inline]
    fn sample(&self, wo: DVec3, u_pick: f64, _u: [f64; 2]) -> Option<LobeSample> {
        pick(self.branches(wo), u_pick)
    }

    #[inline]
    fn branches(&self, wo: DVec3) -> Branches {
        let [r, t] = self.split(wo.z);
        Branches::from_iter([
            LobeSample {
                wi: DVec3::new(-wo.x, -wo.y, wo.z),
                weight: r,
                pdf: 0.0,
            },
            LobeSample {
                wi: -wo,
                weight: t,
                pdf: 0.0,
            },
        ])
    }

    #[inline]
    fn albedo(&self, wo: DVec3) -> Rgb {
        let [r, t] = self.split(wo.z);
        r + t
    }
}
