//! `dielectric`: clear glass, smooth or rough, solid or thin-walled. In glTF: metallic 0,
//! transmission 1; solid with `KHR_materials_volume`, thin-walled without.

use super::lobes::{GgxDielectric, Lobe, SmoothDielectric, ThinDielectric};
use super::{Bsdf, Interior, Material, MaterialDesc, MaterialEntry, MaterialTraits};
use crate::color::Rgb;
use crate::geometry::Surface;

/// The transmitting part of a dielectric; shared with the general glTF material.
#[derive(Clone, Copy)]
pub(super) struct Interface {
    ior: f64,
    tint: Rgb,
    /// Share of the surface that transmits: neither metal nor opaque.
    share: f64,
    alpha: f64,
    smooth: bool,
    thin: bool,
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
            tint: d.base_color,
            share: d.transmission * (1.0 - d.metallic),
            alpha: d.roughness.max(MaterialDesc::SMOOTH).powi(2),
            // Index 1 bends nothing, however rough: a delta that light sampling leaves alone.
            smooth: d.is_smooth() || d.ior == 1.0,
            thin: !d.volume,
        })
    }

    /// The lobe, seen from the front or from inside.
    #[inline]
    pub(super) fn lobe(&self, front: bool) -> Lobe {
        let eta = if front { self.ior } else { 1.0 / self.ior };
        match (self.thin, self.smooth) {
            // A rough thin wall scatters less than its roughness says, since what one face
            // bends the other bends back: the pane is treated as clear.
            (true, _) => ThinDielectric {
                eta: self.ior,
                tint: self.tint,
                share: self.share,
            }
            .into(),
            (false, true) => SmoothDielectric {
                eta,
                tint: self.tint,
                share: self.share,
            }
            .into(),
            (false, false) => GgxDielectric::new(self.alpha, eta, self.tint, self.share).into(),
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
        bsdf.push(self.interface.lobe(at.sp.front));
    }

    fn traits(&self) -> MaterialTraits {
        MaterialTraits {
            diffuse: 0.0,
            reflects: self.interface.ior != 1.0,
            transmits: true,
            refracts: self.interface.refracts(),
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
        d.metallic == 0.0
            && d.transmission == 1.0
            && d.specular == 1.0
            && d.specular_color == Rgb::ONE
    },
    build,
};
