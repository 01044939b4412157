//! `pbr`: glTF's metallic-roughness material in general: a metal and a dielectric mixed, the
//! dielectric a diffuse or transmitting base under a reflecting layer (glTF 2.0, appendix B).

use super::dielectric::Interface;
use super::fresnel::Schlick;
use super::lobes::{CoatedLambert, GgxReflection, Lobe, SmoothReflection};
use super::{Bsdf, Interior, Material, MaterialDesc, MaterialEntry, MaterialTraits};
use crate::color::Rgb;
use crate::geometry::Surface;

struct Pbr {
    diffuse: Rgb,
    layer: Schlick,
    /// The reflection of metal and dielectric together: Schlick's term is linear in f0 and f90.
    reflection: Schlick,
    alpha: f64,
    smooth: bool,
    interface: Option<Interface>,
    interior: Option<Interior>,
}

impl Material for Pbr {
    #[inline]
    fn scatter(&self, at: &Surface<'_>, bsdf: &mut Bsdf) {
        bsdf.push(CoatedLambert {
            albedo: self.diffuse,
            layer: self.layer,
        });
        let lobe: Lobe = if self.smooth {
            SmoothReflection {
                fresnel: self.reflection,
            }
            .into()
        } else {
            GgxReflection::new(self.alpha, self.reflection).into()
        };
        bsdf.push(lobe);
        if let Some(interface) = &self.interface {
            bsdf.push(interface.lobe(at.sp.front));
        }
    }

    fn traits(&self) -> MaterialTraits {
        MaterialTraits {
            diffuse: self.diffuse.max_channel(),
            reflects: self.reflection.f0.max_channel() > 0.0 || self.reflection.f90 > 0.0,
            transmits: self.interface.is_some(),
            refracts: self.interface.is_some_and(|i| i.refracts()),
        }
    }

    fn interior(&self) -> Option<Interior> {
        self.interior
    }
}

fn build(d: &MaterialDesc) -> Result<Box<dyn Material>, String> {
    let transmits = d.transmission > 0.0 && d.metallic < 1.0;
    let interface = if transmits {
        Some(Interface::new(d)?)
    } else {
        None
    };
    // KHR_materials_ior: an index of 0 means a reflectance of 1 at all angles.
    let r = if d.ior == 0.0 {
        1.0
    } else {
        ((d.ior - 1.0) / (d.ior + 1.0)).powi(2)
    };
    let f0 = (d.specular_color * r).map(|c| c.min(1.0)) * d.specular;
    let dielectric = 1.0 - d.metallic;
    // Where the base transmits, its interface reflects by exact Fresnel terms; the layer covers
    // the rest.
    let opaque = dielectric * (1.0 - d.transmission);
    let layer = Schlick {
        f0,
        f90: d.specular,
    };
    let weight = if transmits { opaque } else { dielectric };
    Ok(Box::new(Pbr {
        diffuse: d.base_color * opaque,
        layer,
        reflection: Schlick {
            f0: d.base_color * d.metallic + layer.f0 * weight,
            f90: d.metallic + layer.f90 * weight,
        },
        alpha: d.roughness.max(MaterialDesc::SMOOTH).powi(2),
        smooth: d.is_smooth(),
        interface,
        interior: d.interior(),
    }))
}

/// The registry's line.
pub(super) const ENTRY: MaterialEntry = MaterialEntry {
    name: "pbr",
    doc: "glTF metallic-roughness: metal and coated dielectric mixed",
    claims: |_| true,
    build,
};
