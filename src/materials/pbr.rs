//! `pbr`: glTF's metallic-roughness material in general: a metal and a dielectric mixed, the
//! dielectric a diffuse or transmitting base under a reflecting layer, then sheen and clear coat
//! (glTF 2.0, appendix B, and the `KHR_materials` extensions), each value a factor times a
//! texture.

use std::sync::Arc;

use super::bsdf::FrameId;
use super::slots::TextureSlots;
use super::values::{Values, interior};
use super::{Bsdf, Interior, Material, MaterialDesc, MaterialEntry, MaterialTraits};
use crate::color::Rgb;
use crate::geometry::Surface;

struct Pbr {
    values: Values,
    textures: Option<Arc<TextureSlots>>,
    vertex_colors: bool,
    interior: Option<Interior>,
    traits: MaterialTraits,
}

impl Material for Pbr {
    fn scatter(&self, at: &Surface<'_>, bsdf: &mut Bsdf) {
        let mut colored;
        let mut values = &self.values;
        let mut coat = FrameId::MAIN;
        let mut tangent_set = 0;
        if self.vertex_colors {
            let [r, g, b, _] = at.color();
            colored = self.values;
            colored.base_color *= Rgb::new(r, g, b);
            values = &colored;
        }
        if !cfg!(dualight_without = "textures")
            && let Some(textures) = &self.textures
        {
            colored = textures.evaluate(values, at);
            values = &colored;
            tangent_set = textures.tangent_set();
            let shading = textures.normal(at);
            if values.clearcoat > 0.0 && (shading.is_some() || textures.clearcoat_normal.is_some())
            {
                coat = bsdf.add_frame(textures.clearcoat_normal(at).unwrap_or(at.sp.n));
            }
            if let Some(n) = shading {
                bsdf.set_normal(n);
            }
        }
        if !cfg!(dualight_without = "anisotropy")
            && values.anisotropy > 0.0
            && let Some([t, b]) = at.tangents(tangent_set)
        {
            let (s, c) = values.anisotropy_rotation.sin_cos();
            bsdf.set_tangent(t * c + b * s);
        }
        values.stack(at.sp.front, coat, bsdf);
    }

    fn traits(&self) -> MaterialTraits {
        self.traits
    }

    fn interior(&self) -> Option<Interior> {
        self.interior
    }
}

fn build(d: &MaterialDesc) -> Result<Box<dyn Material>, String> {
    let values = Values::from(d);
    // What textures leave of the factors: a metalness of 1 says nothing where an image has 0.
    let bounds = match &d.textures {
        None => [values; 2],
        Some(textures) => textures.bounds(&values),
    };
    let traits = Values::traits(&bounds);
    if traits.transmits && !(d.ior >= 1.0) {
        return Err(format!(
            "ior {} is below 1; a transmitting material needs 1 or more",
            d.ior
        ));
    }
    Ok(Box::new(Pbr {
        values,
        textures: d.textures.clone(),
        vertex_colors: d.vertex_colors,
        interior: interior(d, bounds[0].metallic),
        traits,
    }))
}

/// The registry's line.
pub(super) const ENTRY: MaterialEntry = MaterialEntry {
    name: "pbr",
    doc: "glTF metallic-roughness with all its layers and textures",
    claims: |_| true,
    build,
};
