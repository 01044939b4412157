//! A thin film on an interface that transmits (`KHR_materials_iridescence`).

use super::fresnel::{Dielectric, f0};
use super::thin_film::ThinFilm;
use crate::color::Rgb;

/// A film on part of a transmitting facet. What it does not reflect it transmits, channel by
/// channel, since it absorbs nothing. Seven digits tell a film; lobes are copied often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacetFilm {
    ior: f32,
    /// Nanometres.
    thickness: f32,
    /// Share of the facet that it covers.
    strength: f32,
    /// Whether light comes from the side that the film is on.
    outside: bool,
}

impl FacetFilm {
    /// `film` on the share `strength` of a facet, seen from `outside` or through the body.
    pub fn new(film: &ThinFilm, strength: f64, outside: bool) -> Self {
        Self {
            ior: film.ior as f32,
            thickness: film.thickness as f32,
            strength: strength as f32,
            outside,
        }
    }

    /// Reflectance of the filmed face where Fresnel's equations say `f` at the cosine `cos` and
    /// the relative index `eta`. It is asked for by the angle on the film's side from within as
    /// well, so that both ways along one path reflect alike: otherwise the film would not be
    /// reciprocal.
    pub(super) fn reflectance(&self, f: &Dielectric, cos: f64, eta: f64, reflect: Rgb) -> Rgb {
        let film = ThinFilm {
            ior: self.ior.into(),
            thickness: self.thickness.into(),
        };
        let cos = if self.outside { cos } else { f.cos_t };
        film.reflectance(cos, reflect * f0(eta, 1.0))
    }

    /// What the facet reflects and transmits, `bare` where the film is not; where it is, it
    /// reflects `reflectance` and colours by `tint` what it transmits.
    pub(super) fn over(&self, bare: [Rgb; 2], reflectance: Rgb, tint: Rgb) -> [Rgb; 2] {
        let on = f64::from(self.strength);
        let [reflected, passed] = bare.map(|c| c * (1.0 - on));
        [
            reflected + reflectance * on,
            passed + tint * (Rgb::ONE - reflectance) * on,
        ]
    }
}
