//! `conductor`: a rough metal. In glTF: metallic 1, roughness above 0.

use super::fresnel::Schlick;
use super::lobes::GgxReflection;
use super::{Bsdf, Material, MaterialDesc, MaterialEntry, MaterialTraits};
use crate::geometry::Surface;

struct Conductor {
    lobe: GgxReflection,
    roughness: f64,
}

impl Material for Conductor {
    #[inline]
    fn scatter(&self, _at: &Surface<'_>, bsdf: &mut Bsdf) {
        bsdf.push(self.lobe);
    }

    fn traits(&self) -> MaterialTraits {
        MaterialTraits {
            reflects: true,
            roughness: self.roughness,
            ..Default::default()
        }
    }
}

fn build(d: &MaterialDesc) -> Result<Box<dyn Material>, String> {
    let fresnel = Schlick {
        f0: d.base_color,
        f90: 1.0,
    };
    let alpha = d.roughness.max(MaterialDesc::SMOOTH).powi(2);
    Ok(Box::new(Conductor {
        lobe: GgxReflection::new(alpha, fresnel),
        roughness: d.roughness,
    }))
}

/// The registry's line.
pub(super) const ENTRY: MaterialEntry = MaterialEntry {
    name: "conductor",
    doc: "a rough metal: GGX with visible-normal sampling",
    claims: |d| d.is_plain() && d.metallic == 1.0,
    build,
};
