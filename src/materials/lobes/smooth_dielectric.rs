//! Reflection and refraction by a smooth interface.

use super::{Branches, LobeClass, LobeModel, LobeSample, pick};
use crate::color::Rgb;
use crate::materials::filmed::FacetFilm;
use crate::materials::fresnel;
use crate::math::{DVec3, nearly_unit};

/// A smooth interface between two dielectrics, with exact Fresnel terms.
#[derive(Clone, Copy, Debug)]
pub struct SmoothDielectric {
    /// Index beyond the surface over index on the side of `wo`.
    pub eta: f64,
    /// Colour of what is refracted.
    pub tint: Rgb,
    /// Colour of what is reflected, where not everything is; what it leaves is refracted.
    pub reflect: Rgb,
    /// Share of the surface that is this interface, by channel; the rest is left to other lobes.
    pub share: Rgb,
    /// A film on it.
    pub film: Option<FacetFilm>,
}

impl SmoothDielectric {
    /// What is reflected and refracted at the cosine for which Fresnel's equations gave `f`.
    #[inline]
    pub(super) fn split(&self, f: &fresnel::Dielectric, cos: f64) -> [Rgb; 2] {
        let bare = fresnel::split(f, self.reflect, self.tint);
        let sides = match &self.film {
            Some(film) if f.cos_t > 0.0 => {
                let reflectance = film.reflectance(f, cos, self.eta, self.reflect);
                film.over(bare, reflectance, self.tint)
            }
            _ => bare,
        };
        sides.map(|c| c * self.share)
    }
}

impl LobeModel for SmoothDielectric {
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
        let f = fresnel::dielectric(wo.z, self.eta);
        let [reflected, refracted] = self.split(&f, wo.z);
        let mut out = Branches::new();
        out.push(LobeSample {
            wi: DVec3::new(-wo.x, -wo.y, wo.z),
            weight: reflected,
            pdf: 0.0,
        });
        if !refracted.is_black() {
            let inv = 1.0 / self.eta;
            out.push(LobeSample {
                wi: nearly_unit(DVec3::new(-wo.x * inv, -wo.y * inv, -f.cos_t)).0,
                weight: refracted,
                pdf: 0.0,
            });
        }
        out
    }

    #[inline]
    fn albedo(&self, wo: DVec3) -> Rgb {
        let [reflected, refracted] = self.split(&fresnel::dielectric(wo.z, self.eta), wo.z);
        reflected + refracted
    }

    #[inline]
    fn importance(&self, _wo: DVec3) -> f64 {
        // What Fresnel's equations part is whole: no need to solve them for this.
        let most = match self.film {
            None => self.reflect.max_channel().max(self.tint.max_channel()),
            Some(_) => 1.0,
        };
        (self.share * most).max_channel()
    }

    #[inline]
    fn eta(&self) -> f64 {
        self.eta
    }
}
