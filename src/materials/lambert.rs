//! `lambert`: ideal diffuse reflection. In glTF: roughness 1, metallic 0 and
//! `KHR_materials_specular` factor 0.

use super::lobes::Lambert;
use super::{Bsdf, Material, MaterialEntry, MaterialTraits};
use crate::color::Rgb;
use crate::geometry::Surface;

struct LambertMaterial {
    albedo: Rgb,
}

impl Material for LambertMaterial {
    #[inline]
    fn scatter(&self, _at: &Surface<'_>, bsdf: &mut Bsdf) {
        bsdf.push(Lambert {
            albedo: self.albedo,
        });
    }

    fn matte(&self) -> Option<Rgb> {
        (!self.albedo.is_black()).then_some(self.albedo)
    }

    fn traits(&self) -> MaterialTraits {
        MaterialTraits {
            diffuse: self.albedo.max_channel(),
            ..Default::default()
        }
    }
}

/// The registry's line.
pub(super) const ENTRY: MaterialEntry = MaterialEntry {
    name: "lambert",
    doc: "ideal diffuse reflection",
    claims: |d| d.is_plain() && d.metallic == 0.0 && d.transmission == 0.0 && d.specular == 0.0,
    build: |d| {
        Ok(Box::new(LambertMaterial {
            albedo: d.base_color,
        }))
    },
};
