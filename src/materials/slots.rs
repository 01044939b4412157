//! The textures of a glTF material, and the values they give at a point.

use super::values::Values;
use crate::color::Rgb;
use crate::geometry::Surface;
use crate::math::DVec3;
use crate::stats::tally::{self, Event, Part};
use crate::textures::Texture;

macro_rules! slots {
    ($($(#[$doc:meta])* $field:ident = $key:literal),* $(,)?) => {
        /// Every texture that a material can have, under the names of its keys in the file.
        #[derive(Clone, Debug, Default)]
        pub struct TextureSlots {
            $($(#[$doc])* pub $field: Option<Texture>,)*
            /// `normalTexture.scale`.
            pub normal_scale: f64,
            /// `clearcoatNormalTexture.scale`.
            pub clearcoat_normal_scale: f64,
        }

        impl TextureSlots {
            /// The textures that are there, with their keys.
            pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Texture)> {
                [$(($key, self.$field.as_ref())),*]
                    .into_iter()
                    .filter_map(|(key, t)| Some((key, t?)))
            }
        }
    };
}

slots! {
    /// Colour and alpha, sRGB.
    base_color = "baseColorTexture",
    /// Roughness in green, metalness in blue.
    metallic_roughness = "metallicRoughnessTexture",
    /// Tangent-space normals.
    normal = "normalTexture",
    /// Emitted colour, sRGB.
    emissive = "emissiveTexture",
    /// Strength in alpha.
    specular = "specularTexture",
    /// Colour, sRGB.
    specular_color = "specularColorTexture",
    /// Share in red.
    transmission = "transmissionTexture",
    /// Share in alpha.
    diffuse_transmission = "diffuseTransmissionTexture",
    /// Colour, sRGB.
    diffuse_transmission_color = "diffuseTransmissionColorTexture",
    /// Strength in red.
    clearcoat = "clearcoatTexture",
    /// Roughness in green.
    clearcoat_roughness = "clearcoatRoughnessTexture",
    /// Tangent-space normals of the coat.
    clearcoat_normal = "clearcoatNormalTexture",
    /// Colour, sRGB.
    sheen_color = "sheenColorTexture",
    /// Roughness in alpha.
    sheen_roughness = "sheenRoughnessTexture",
    /// Direction in red and green, strength in blue.
    anisotropy = "anisotropyTexture",
    /// Strength in red.
    iridescence = "iridescenceTexture",
    /// Thickness in green, between its bounds.
    iridescence_thickness = "iridescenceThicknessTexture",
    /// Colour and alpha, sRGB.
    diffuse = "diffuseTexture",
    /// Reflectance, sRGB, and glossiness in alpha.
    specular_glossiness = "specularGlossinessTexture",
}

fn rgb(t: [f64; 4]) -> Rgb {
    Rgb::new(t[0], t[1], t[2])
}

impl TextureSlots {
    /// `values` multiplied by what the textures say at a point.
    pub(super) fn evaluate(&self, values: &Values, at: &Surface<'_>) -> Values {
        let _scope = tally::enter(Part::Textures);
        self.apply(values, |t| t.sample(at))
    }

    /// The least and the largest that each of `values` can become, save the angle of anisotropy.
    pub(super) fn bounds(&self, values: &Values) -> [Values; 2] {
        let [mut low, mut high] = [0, 1].map(|end| self.apply(values, |t| t.range()[end]));
        if self.specular_glossiness.is_some() {
            // More gloss is less roughness.
            std::mem::swap(&mut low.roughness, &mut high.roughness);
        }
        [low, high]
    }

    /// `values` multiplied by what `lookup` says of each texture.
    #[inline]
    fn apply(&self, values: &Values, lookup: impl Fn(&Texture) -> [f64; 4]) -> Values {
        let mut v = *values;
        let look = |t: &Option<Texture>| t.as_ref().map(&lookup);
        if let Some(t) = look(&self.base_color).or_else(|| look(&self.diffuse)) {
            v.base_color *= rgb(t);
        }
        if let Some(t) = look(&self.metallic_roughness) {
            v.roughness *= t[1];
            v.metallic *= t[2];
        }
        if let Some(t) = look(&self.specular_glossiness) {
            if let Some(f0) = &mut v.specular_reflectance {
                *f0 *= rgb(t);
            }
            v.roughness = 1.0 - (1.0 - v.roughness) * t[3];
        }
        if let Some(t) = look(&self.specular) {
            v.specular *= t[3];
        }
        if let Some(t) = look(&self.specular_color) {
            v.specular_color *= rgb(t);
        }
        if let Some(t) = look(&self.transmission) {
            v.transmission *= t[0];
        }
        if let Some(t) = look(&self.diffuse_transmission) {
            v.diffuse_transmission *= t[3];
        }
        if let Some(t) = look(&self.diffuse_transmission_color) {
            v.diffuse_transmission_color *= rgb(t);
        }
        if let Some(t) = look(&self.clearcoat) {
            v.clearcoat *= t[0];
        }
        if let Some(t) = look(&self.clearcoat_roughness) {
            v.clearcoat_roughness *= t[1];
        }
        if let Some(t) = look(&self.sheen_color) {
            v.sheen_color *= rgb(t);
        }
        if let Some(t) = look(&self.sheen_roughness) {
            v.sheen_roughness *= t[3];
        }
        if let Some(t) = look(&self.anisotropy) {
            let angle = (2.0 * t[1] - 1.0).atan2(2.0 * t[0] - 1.0);
            v.anisotropy_rotation += angle;
            v.anisotropy *= t[2];
        }
        if let Some(t) = look(&self.iridescence) {
            v.iridescence *= t[0];
        }
        if let Some(t) = look(&self.iridescence_thickness) {
            let [lo, hi] = v.iridescence_range;
            v.iridescence_thickness = lo + (hi - lo) * t[1];
        }
        v
    }

    /// The shading normal that the normal map gives, on the front side.
    pub(super) fn normal(&self, at: &Surface<'_>) -> Option<DVec3> {
        mapped(self.normal.as_ref()?, self.normal_scale, at)
    }

    /// The normal of the clear coat.
    pub(super) fn clearcoat_normal(&self, at: &Surface<'_>) -> Option<DVec3> {
        mapped(
            self.clearcoat_normal.as_ref()?,
            self.clearcoat_normal_scale,
            at,
        )
    }

    /// The set of texture coordinates whose tangent anisotropy follows: that of its own texture,
    /// or of the normal map.
    pub(super) fn tangent_set(&self) -> usize {
        let set = |t: &Option<Texture>| t.as_ref().map(|t| t.uv_set);
        set(&self.normal).or(set(&self.anisotropy)).unwrap_or(0)
    }
}

/// A tangent-space normal in world space (glTF 2.0, 3.9.3).
fn mapped(texture: &Texture, scale: f64, at: &Surface<'_>) -> Option<DVec3> {
    let _scope = tally::enter(Part::Normals);
    let [t, b] = at.tangents(texture.uv_set)?;
    let s = texture.sample(at);
    let (x, y, z) = (2.0 * s[0] - 1.0, 2.0 * s[1] - 1.0, 2.0 * s[2] - 1.0);
    tally::count(Event::PerturbedFrames);
    (t * (x * scale) + b * (y * scale) + at.sp.n * z).try_normalize()
}
