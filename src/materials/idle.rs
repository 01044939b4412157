//! Textures that nothing can be seen of, because what they vary is zero.

use std::borrow::Cow;
use std::sync::Arc;

use super::{MaterialDesc, TextureSlots};
use crate::color::Rgb;

impl MaterialDesc {
    /// The same without the textures that nothing can be seen of: those of a coat that is not
    /// there, of emission that is black, or of anything but colour on a surface that is not lit.
    /// Nobody need decode, filter or look them up.
    ///
    /// Only for the kinds of materials that take a texture as what glTF says it is.
    pub fn without_idle_textures(&self) -> Cow<'_, Self> {
        let Some(textures) = &self.textures else {
            return Cow::Borrowed(self);
        };
        let mut left = (**textures).clone();
        self.drop_idle(&mut left);
        let count = |t: &TextureSlots| t.iter().count();
        match (count(&left), count(textures)) {
            (n, before) if n == before => Cow::Borrowed(self),
            (n, _) => Cow::Owned(Self {
                textures: (n > 0).then(|| Arc::new(left)),
                ..self.clone()
            }),
        }
    }

    fn drop_idle(&self, t: &mut TextureSlots) {
        let none = |x: f64| x == 0.0;
        if self.emission.is_black() {
            t.emissive = None;
        }
        if self.unlit {
            *t = TextureSlots {
                base_color: t.base_color.take(),
                // Alpha comes from here where there is no colour.
                diffuse: t.diffuse.take(),
                emissive: t.emissive.take(),
                ..TextureSlots::default()
            };
            return;
        }
        if none(self.transmission) {
            t.transmission = None;
        }
        if none(self.diffuse_transmission) {
            (t.diffuse_transmission, t.diffuse_transmission_color) = (None, None);
        }
        if none(self.specular) {
            (t.specular, t.specular_color) = (None, None);
        }
        if none(self.clearcoat) {
            (t.clearcoat, t.clearcoat_roughness, t.clearcoat_normal) = (None, None, None);
        }
        if self.sheen_color.is_black() {
            (t.sheen_color, t.sheen_roughness) = (None, None);
        }
        if none(self.iridescence) {
            (t.iridescence, t.iridescence_thickness) = (None, None);
        }
        if none(self.anisotropy) {
            t.anisotropy = None;
            // Bumps without height, unless they point into the surface. They also say which way
            // brushing runs.
            let upward = |map: &crate::textures::Texture| map.range()[0][2] > 0.5;
            if none(t.normal_scale) && t.normal.as_ref().is_some_and(upward) {
                t.normal = None;
            }
        }
    }
}

impl TextureSlots {
    /// Whether some of them is averaged over what a sample sees, on a surface whose colour has the
    /// factor `base_color`: alpha is looked up in points, so that what else the image of a black
    /// colour holds does not matter.
    pub fn are_filtered(&self, base_color: Rgb) -> bool {
        let colour = |key: &str| key == "baseColorTexture" || key == "diffuseTexture";
        self.iter()
            .any(|(key, _)| !(base_color.is_black() && colour(key)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::textures::{Content, Image, Texture};

    fn with(t: TextureSlots) -> MaterialDesc {
        MaterialDesc {
            textures: Some(Arc::new(t)),
            ..MaterialDesc::default()
        }
    }

    fn white() -> Option<Texture> {
        Some(Texture::new(Arc::new(Image::white()), Content::Data))
    }

    #[test]
    fn what_varies_nothing_is_dropped_and_the_rest_stays() {
        let slots = || TextureSlots {
            base_color: white(),
            emissive: white(),
            clearcoat: white(),
            clearcoat_normal: white(),
            normal: white(),
            normal_scale: 0.0,
            ..Default::default()
        };
        let left = |d: &MaterialDesc| -> Vec<&'static str> {
            let seen = d.without_idle_textures();
            let all = seen
                .textures
                .as_ref()
                .map(|t| t.iter().map(|(key, _)| key).collect());
            all.unwrap_or_default()
        };
        let idle = with(slots());
        assert_eq!(left(&idle), ["baseColorTexture"]);
        let coated = MaterialDesc {
            clearcoat: 1.0,
            ..with(slots())
        };
        let names = [
            "baseColorTexture",
            "clearcoatTexture",
            "clearcoatNormalTexture",
        ];
        assert_eq!(left(&coated), names);
        let bumpy = with(TextureSlots {
            normal_scale: 1.0,
            ..slots()
        });
        assert_eq!(left(&bumpy), ["baseColorTexture", "normalTexture"]);
        let dark = MaterialDesc {
            base_color: Rgb::ZERO,
            emission: Rgb::ONE,
            ..with(slots())
        };
        assert_eq!(left(&dark), ["baseColorTexture", "emissiveTexture"]);
        let only = |d: &MaterialDesc| {
            let t = d.without_idle_textures();
            t.textures
                .as_ref()
                .is_some_and(|t| t.are_filtered(d.base_color))
        };
        assert!(only(&dark) && only(&idle));
        let alpha = MaterialDesc {
            base_color: Rgb::ZERO,
            ..with(slots())
        };
        assert!(!only(&alpha), "only alpha looks there");
    }
}
