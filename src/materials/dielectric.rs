//! `dielectric`: clear glass, smooth or rough, solid or thin-walled. In glTF: metallic 0,
//! transmission 1; solid with `KHR_materials_volume`, thin-walled without.

use super::bsdf::FrameId;
use super::filmed::FacetFilm;
use super::lobes::{GgxDielectric, Lobe, SmoothDielectric, ThinDielectric, ThinGgx};
use super::microfacet::Ggx;
use super::thin_film::ThinFilm;
use super::{Bsdf, Interior, Material, MaterialDesc, MaterialEntry, MaterialTraits};
use crate::color::Rgb;
use crate::geometry::Surface;
use crate::stats::tally::{self, Event};

/// The transmitting part of a dielectric; shared with the general glTF material.
#[derive(Clone, Copy)]
pub(super) struct Interface {
    pub(super) ior: f64,
    /// 20 over the Abbe number.
    pub(super) dispersion: f64,
    pub(super) tint: Rgb,
    /// Colour of the reflection, white for all of it.
    pub(super) reflect: Rgb,
    /// Share of the surface that transmits: neither metal nor opaque.
    pub(super) share: f64,
    pub(super) ggx: Ggx,
    pub(super) smooth: bool,
    pub(super) thin: bool,
    /// A film, and the share of the interface that it covers.
    pub(super) film: Option<(ThinFilm, f64)>,
}

impl Interface {
    pub(super) fn new(d: &MaterialDesc) -> Result<Self, String> {
        if !(d.ior >= 1.0) {
            return Err(format!(
                "ior {} is below 1; a transmitting material needs 1 or more",
                d.ior
            ));
        }
        Ok(Self {
            ior: d.ior,
            dispersion: 0.0,
            tint: d.base_color,
            reflect: Rgb::ONE,
            share: d.transmission * (1.0 - d.metallic),
            ggx: Ggx::round(d.roughness.max(MaterialDesc::SMOOTH).powi(2)),
            // Index 1 bends nothing, however rough: a delta that light sampling leaves alone.
            smooth: d.is_smooth() || (d.ior == 1.0 && d.volume),
            thin: !d.volume,
            film: None,
        })
    }

    /// Pushes the lobes, seen from the front or from inside: one, or one for each channel if
    /// the index depends on the wavelength. `events` are counted when they are evaluated.
    #[inline]
    pub(super) fn push(&self, front: bool, events: u32, bsdf: &mut Bsdf) {
        let disperses = !cfg!(dualight_without = "dispersion") && self.dispersion > 0.0;
        if disperses && !self.thin {
            tally::count(Event::Dispersions);
            // KHR_materials_dispersion: the indices of red, green and blue.
            let half = (self.ior - 1.0) * 0.025 * self.dispersion;
            for (ior, channel) in [self.ior - half, self.ior, self.ior + half]
                .into_iter()
                .zip(Rgb::CHANNELS)
            {
                let lobe = self.lobe(front, ior.max(1.0), channel * self.share);
                bsdf.push_in(lobe, FrameId::MAIN, events);
            }
        } else {
            let lobe = self.lobe(front, self.ior, Rgb::splat(self.share));
            bsdf.push_in(lobe, FrameId::MAIN, events);
        }
    }

    #[inline]
    fn lobe(&self, front: bool, ior: f64, share: Rgb) -> Lobe {
        let Self {
            tint, reflect, ggx, ..
        } = *self;
        // Both faces of a pane are outside.
        let outside = front || self.thin;
        let film = self
            .film
            .map(|(film, strength)| FacetFilm::new(&film, strength, outside));
        if self.thin {
            let facet = ThinDielectric {
                eta: ior,
                tint,
                reflect,
                share,
                film,
            };
            return if self.smooth {
                facet.into()
            } else {
                ThinGgx { ggx, facet }.into()
            };
        }
        let facet = SmoothDielectric {
            eta: if front { ior } else { 1.0 / ior },
            tint,
            reflect,
            share,
            film,
        };
        if self.smooth {
            facet.into()
        } else {
            GgxDielectric { ggx, facet }.into()
        }
    }

    pub(super) fn refracts(&self) -> bool {
        !self.thin && self.ior != 1.0
    }
}

struct DielectricMaterial {
    interface: Interface,
    interior: Option<Interior>,
}

impl Material for DielectricMaterial {
    #[inline]
    fn scatter(&self, at: &Surface<'_>, bsdf: &mut Bsdf) {
        self.interface.push(at.sp.front, 0, bsdf);
    }

    fn traits(&self) -> MaterialTraits {
        MaterialTraits {
            diffuse: 0.0,
            reflects: self.interface.ior != 1.0,
            transmits: true,
            refracts: self.interface.refracts(),
            roughness: self.interface.ggx.y.sqrt(),
        }
    }

    fn interior(&self) -> Option<Interior> {
        self.interior
    }
}

fn build(d: &MaterialDesc) -> Result<Box<dyn Material>, String> {
    Ok(Box::new(DielectricMaterial {
        interface: Interface::new(d)?,
        interior: d.interior(),
    }))
}

/// The registry's line.
pub(super) const ENTRY: MaterialEntry = MaterialEntry {
    name: "dielectric",
    doc: "clear glass with exact Fresnel terms: smooth or rough, solid or thin-walled",
    claims: |d| {
        d.is_plain()
            && d.metallic == 0.0
            && d.transmission == 1.0
            && d.specular == 1.0
            && d.specular_color == Rgb::ONE
    },
    build,
};
