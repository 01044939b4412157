//! What a material may have beyond a plain surface, each of which can be left out.

use std::sync::Arc;

use bitflags::bitflags;

use super::slots::TextureSlots;
use super::values::Values;
use super::{AlphaMode, MaterialDesc};
use crate::color::Rgb;

bitflags! {
    /// Features of materials that cost something.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Features: u32 {
        /// Values from images.
        const TEXTURES = 1;
        /// Shading normals from images.
        const NORMAL_MAPS = 2;
        /// Surfaces that are not whole.
        const ALPHA = 4;
        /// Bodies that absorb light.
        const ABSORPTION = 8;
        /// An index of refraction that depends on the wavelength.
        const DISPERSION = 16;
        /// A clear coat.
        const COAT = 32;
        /// A sheen.
        const SHEEN = 64;
        /// A thin film.
        const IRIDESCENCE = 128;
        /// Highlights that are longer than wide.
        const ANISOTROPY = 256;
        /// Diffuse light that comes through.
        const TRANSLUCENCY = 512;
    }
}

impl MaterialDesc {
    /// What it has: factors with what textures leave of them.
    pub fn features(&self) -> Features {
        let values = Values::from(self);
        let high = match &self.textures {
            None => values,
            Some(textures) => textures.bounds(&values)[1],
        };
        let textures = |f: fn(&TextureSlots) -> bool| self.textures.as_deref().is_some_and(f);
        let mut out = Features::empty();
        for (feature, has) in [
            (Features::TEXTURES, textures(|t| t.iter().next().is_some())),
            (
                Features::NORMAL_MAPS,
                textures(|t| t.normal.is_some() || t.clearcoat_normal.is_some()),
            ),
            (Features::ALPHA, self.coverage().is_some()),
            (Features::ABSORPTION, self.interior().is_some()),
            (
                Features::DISPERSION,
                high.dispersion > 0.0 && high.transmission > 0.0 && self.volume,
            ),
            (Features::COAT, high.clearcoat > 0.0),
            (Features::SHEEN, !high.sheen_color.is_black()),
            (Features::IRIDESCENCE, high.iridescence > 0.0),
            (Features::ANISOTROPY, high.anisotropy > 0.0),
            (Features::TRANSLUCENCY, high.diffuse_transmission > 0.0),
        ] {
            out.set(feature, has && (!self.unlit || feature.survives_unlit()));
        }
        out
    }

    /// The same without some features.
    pub fn without(&self, features: Features) -> Self {
        let mut d = self.clone();
        for feature in features.iter() {
            match feature {
                Features::TEXTURES => d.textures = None,
                Features::NORMAL_MAPS => {
                    if let Some(textures) = &mut d.textures {
                        let textures = Arc::make_mut(textures);
                        (textures.normal, textures.clearcoat_normal) = (None, None);
                    }
                }
                Features::ALPHA => d.alpha_mode = AlphaMode::Opaque,
                Features::ABSORPTION => d.attenuation_distance = f64::INFINITY,
                Features::DISPERSION => d.dispersion = 0.0,
                Features::COAT => d.clearcoat = 0.0,
                Features::SHEEN => d.sheen_color = Rgb::ZERO,
                Features::IRIDESCENCE => d.iridescence = 0.0,
                Features::ANISOTROPY => d.anisotropy = 0.0,
                Features::TRANSLUCENCY => d.diffuse_transmission = 0.0,
                _ => {}
            }
        }
        d
    }
}

impl Features {
    /// Whether it shows on a surface that is shown in its colour, whatever the light.
    fn survives_unlit(self) -> bool {
        self == Self::TEXTURES || self == Self::ALPHA
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::textures::{Content, Image, Texture};

    #[test]
    fn every_feature_is_told_and_can_be_left_out() {
        let white = || Some(Texture::new(Arc::new(Image::white()), Content::Data));
        let all = MaterialDesc {
            metallic: 0.0,
            alpha_mode: AlphaMode::Blend,
            base_alpha: 0.5,
            transmission: 0.5,
            volume: true,
            attenuation_distance: 1.0,
            attenuation_color: Rgb::splat(0.5),
            dispersion: 1.0,
            clearcoat: 1.0,
            sheen_color: Rgb::ONE,
            iridescence: 1.0,
            anisotropy: 0.5,
            diffuse_transmission: 0.5,
            textures: Some(Arc::new(TextureSlots {
                base_color: white(),
                normal: white(),
                ..Default::default()
            })),
            ..Default::default()
        };
        assert_eq!(all.features(), Features::all());
        assert_eq!(MaterialDesc::default().features(), Features::empty());
        for feature in Features::all().iter() {
            let gone = match feature {
                // A normal map is a texture.
                Features::TEXTURES => feature | Features::NORMAL_MAPS,
                _ => feature,
            };
            let left = all.without(feature).features();
            assert_eq!(left, Features::all() - gone, "{feature:?}");
        }
    }
}
