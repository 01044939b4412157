//! `mirror`: a perfectly smooth metal. In glTF: metallic 1, roughness 0.

use super::fresnel::Schlick;
use super::lobes::SmoothReflection;
use super::{Bsdf, Material, MaterialDesc, MaterialEntry, MaterialTraits};
use crate::geometry::Surface;

struct Mirror {
    fresnel: Schlick,
}

impl Material for Mirror {
    #[inline]
    fn scatter(&self, _at: &Surface<'_>, bsdf: &mut Bsdf) {
        bsdf.push(SmoothReflection {
            fresnel: self.fresnel.into(),
        });
    }

    fn traits(&self) -> MaterialTraits {
        MaterialTraits {
            reflects: true,
            ..Default::default()
        }
    }
}

fn build(d: &MaterialDesc) -> Result<Box<dyn Material>, String> {
    Ok(Box::new(Mirror {
        fresnel: Schlick {
            f0: d.base_color,
            f90: 1.0,
        },
    }))
}

/// The registry's line.
pub(super) const ENTRY: MaterialEntry = MaterialEntry {
    name: "mirror",
    doc: "a perfectly smooth metal, with Schlick's Fresnel term on its colour",
    claims: |d| d.is_plain() && d.metallic == 1.0 && d.is_smooth(),
    build,
};
