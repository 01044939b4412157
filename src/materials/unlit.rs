//! `unlit`: shown in its base colour, whatever the light (`KHR_materials_unlit`).

use std::sync::Arc;

use super::{Bsdf, Material, MaterialEntry, MaterialTraits, TextureSlots};
use crate::color::Rgb;
use crate::geometry::Surface;
use crate::stats::tally::{self, Part};

/// Seen directly or by way of specular surfaces it has its colour; it takes part in no other
/// transport: it neither reflects nor lights anything.
struct Unlit {
    color: Rgb,
    textures: Option<Arc<TextureSlots>>,
    vertex_colors: bool,
}

impl Material for Unlit {
    fn scatter(&self, at: &Surface<'_>, bsdf: &mut Bsdf) {
        let mut color = self.color;
        if let Some(texture) = self.textures.as_ref().and_then(|t| t.base_color.as_ref()) {
            let _scope = tally::enter(Part::Textures);
            let [r, g, b, _] = texture.sample(at);
            color *= Rgb::new(r, g, b);
        }
        if self.vertex_colors {
            let [r, g, b, _] = at.color();
            color *= Rgb::new(r, g, b);
        }
        bsdf.show(color);
    }

    fn traits(&self) -> MaterialTraits {
        MaterialTraits::default()
    }
}

/// The registry's line.
pub(super) const ENTRY: MaterialEntry = MaterialEntry {
    name: "unlit",
    doc: "shown in its base colour, whatever the light",
    claims: |d| d.unlit,
    build: |d| {
        Ok(Box::new(Unlit {
            color: d.base_color,
            textures: d.textures.clone(),
            vertex_colors: d.vertex_colors,
        }))
    },
};
