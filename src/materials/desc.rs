//! What a material is made from, and what it promises.

use std::sync::Arc;

use serde_json::Value;

use super::alpha::Alpha;
use super::slots::TextureSlots;
use crate::color::Rgb;
use crate::geometry::Coverage;

/// What a material's alpha means (glTF 2.0, 3.9.4).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing: the surface is whole.
    #[default]
    Opaque,
    /// The surface is missing where alpha is below the cutoff.
    Mask {
        /// `alphaCutoff`.
        cutoff: f64,
    },
    /// Alpha is the share of light that the surface stops.
    Blend,
}

/// Parameters of a glTF material, with the specification's defaults. Colours are linear.
/// Factors multiply the textures of [`textures`](Self::textures), where there are any.
#[derive(Clone, Debug)]
pub struct MaterialDesc {
    /// Name, for messages.
    pub name: String,
    /// `baseColorFactor`, without alpha.
    pub base_color: Rgb,
    /// Alpha of `baseColorFactor`.
    pub base_alpha: f64,
    /// What alpha means.
    pub alpha_mode: AlphaMode,
    /// Whether the vertices' colours multiply the base colour.
    pub vertex_colors: bool,
    /// `metallicFactor`, 0 to 1.
    pub metallic: f64,
    /// `roughnessFactor`, 0 to 1; the microfacet width is its square.
    pub roughness: f64,
    /// `KHR_materials_ior`, at least 1 (or 0: a reflector for all angles).
    pub ior: f64,
    /// `KHR_materials_specular`: strength of the dielectric reflection.
    pub specular: f64,
    /// `KHR_materials_specular`: colour of the dielectric reflection at normal incidence.
    pub specular_color: Rgb,
    /// `KHR_materials_pbrSpecularGlossiness`: reflectance at normal incidence; `base_color` is
    /// then the diffuse colour and `roughness` one less the glossiness.
    pub specular_reflectance: Option<Rgb>,
    /// `KHR_materials_transmission`: share of the base that transmits.
    pub transmission: f64,
    /// `KHR_materials_volume`: whether the surface bounds a volume (thickness above zero);
    /// otherwise transmission is thin-walled and does not bend light.
    pub volume: bool,
    /// `KHR_materials_volume`: distance in metres after which white has become
    /// [`attenuation_color`](Self::attenuation_color); infinite for no absorption.
    pub attenuation_distance: f64,
    /// `KHR_materials_volume`: see above.
    pub attenuation_color: Rgb,
    /// `KHR_materials_dispersion`: 20 over the Abbe number; 0 for none.
    pub dispersion: f64,
    /// `KHR_materials_diffuse_transmission`: share of the diffuse base that goes through.
    pub diffuse_transmission: f64,
    /// `KHR_materials_diffuse_transmission`: its colour.
    pub diffuse_transmission_color: Rgb,
    /// `KHR_materials_clearcoat`: strength.
    pub clearcoat: f64,
    /// `KHR_materials_clearcoat`: roughness.
    pub clearcoat_roughness: f64,
    /// `KHR_materials_sheen`: colour; black for none.
    pub sheen_color: Rgb,
    /// `KHR_materials_sheen`: roughness.
    pub sheen_roughness: f64,
    /// `KHR_materials_anisotropy`: strength.
    pub anisotropy: f64,
    /// `KHR_materials_anisotropy`: rotation from the tangent, counter-clockwise, in radians.
    pub anisotropy_rotation: f64,
    /// What the strength of anisotropy means.
    pub brushing: Brushing,
    /// `KHR_materials_iridescence`: strength.
    pub iridescence: f64,
    /// `KHR_materials_iridescence`: index of refraction of the film.
    pub iridescence_ior: f64,
    /// `KHR_materials_iridescence`: least and greatest thickness of the film in nanometres.
    pub iridescence_thickness: [f64; 2],
    /// Emitted radiance in W/(m²·sr).
    pub emission: Rgb,
    /// Whether the back face emits too.
    pub double_sided: bool,
    /// `KHR_materials_unlit`: shown in its base colour, whatever the light.
    pub unlit: bool,
    /// The textures, if there are any.
    pub textures: Option<Arc<TextureSlots>>,
    /// The material's `extras`, for kinds of one's own.
    pub extras: Value,
}

/// What a strength of anisotropy does to the two widths of a surface of the width α, which is the
/// square of its roughness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Brushing {
    /// By `KHR_materials_anisotropy`: along the tangent `mix(α, 1, strength²)`, across it α.
    #[default]
    Gltf,
    /// As Cycles' Principled BSDF has it: with `a = √(1 − 0.9 strength)` α/a along the tangent, 1 at
    /// most, and α·a across it.
    Cycles,
}

impl Brushing {
    /// The widths along the tangent and across it.
    pub fn widths(self, alpha: f64, strength: f64) -> [f64; 2] {
        match self {
            Self::Gltf => [alpha + (1.0 - alpha) * strength * strength, alpha],
            Self::Cycles => {
                let aspect = (1.0 - 0.9 * strength).sqrt();
                [(alpha / aspect).min(1.0), alpha * aspect]
            }
        }
    }
}

impl Default for MaterialDesc {
    fn default() -> Self {
        Self {
            name: "default".into(),
            base_color: Rgb::ONE,
            base_alpha: 1.0,
            alpha_mode: AlphaMode::Opaque,
            vertex_colors: false,
            metallic: 1.0,
            roughness: 1.0,
            ior: 1.5,
            specular: 1.0,
            specular_color: Rgb::ONE,
            specular_reflectance: None,
            transmission: 0.0,
            volume: false,
            attenuation_distance: f64::INFINITY,
            attenuation_color: Rgb::ONE,
            dispersion: 0.0,
            diffuse_transmission: 0.0,
            diffuse_transmission_color: Rgb::ONE,
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            sheen_color: Rgb::ZERO,
            sheen_roughness: 0.0,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            brushing: Brushing::Gltf,
            iridescence: 0.0,
            iridescence_ior: 1.3,
            iridescence_thickness: [100.0, 400.0],
            emission: Rgb::ZERO,
            double_sided: false,
            unlit: false,
            textures: None,
            extras: Value::Null,
        }
    }
}

impl MaterialDesc {
    /// Roughness below which a surface is perfectly smooth: its highlight is then narrower than
    /// 1e-6 of the hemisphere, and a delta lobe is exact to well below the noise.
    pub const SMOOTH: f64 = 1e-3;

    /// Whether the surface is perfectly smooth.
    pub fn is_smooth(&self) -> bool {
        self.roughness < Self::SMOOTH
    }

    /// Whether it is the same everywhere and has none of the layers that only the general
    /// material knows.
    pub fn is_plain(&self) -> bool {
        let textured = self
            .textures
            .as_ref()
            .is_some_and(|t| t.iter().any(|(slot, _)| slot != "emissiveTexture"));
        !textured
            && !self.unlit
            && !self.vertex_colors
            && self.specular_reflectance.is_none()
            && self.dispersion == 0.0
            && self.diffuse_transmission == 0.0
            && self.clearcoat == 0.0
            && self.sheen_color.is_black()
            && self.anisotropy == 0.0
            && self.iridescence == 0.0
    }

    /// How much of the surface is there, if not all of it.
    pub fn coverage(&self) -> Option<Arc<dyn Coverage>> {
        Alpha::new(self).map(|a| Arc::new(a) as Arc<dyn Coverage>)
    }

    /// The enclosed medium, if light can get in.
    ///
    /// # Errors
    /// A priority that is no number.
    pub fn medium(&self) -> Result<Option<Medium>, String> {
        let ours = self.extras.get("dualight");
        let priority = match ours.and_then(|o| o.get("priority")) {
            None => 0.0,
            Some(value) => value
                .as_f64()
                .ok_or_else(|| format!("extras.dualight.priority {value} is no number"))?,
        };
        let open = self.volume && self.transmission > 0.0;
        Ok(open.then_some(Medium {
            ior: self.ior,
            priority,
        }))
    }

    /// The enclosed medium, if it absorbs (Beer–Lambert).
    pub fn interior(&self) -> Option<Interior> {
        let absorbs = self.volume
            && self.transmission.max(self.diffuse_transmission) > 0.0
            && self.attenuation_distance.is_finite()
            && self.attenuation_distance > 0.0
            // White is what is left of light that is not absorbed.
            && !(self.attenuation_color - Rgb::ONE).map(|c| c.min(0.0)).is_black();
        absorbs.then(|| Interior {
            absorption: self
                .attenuation_color
                .map(|c| -c.clamp(1e-30, 1.0).ln() / self.attenuation_distance),
        })
    }
}

/// What a body holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Index of refraction.
    pub ior: f64,
    /// Which body fills the space that several share: that of the highest priority.
    pub priority: f64,
}

/// A homogeneous absorbing medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interior {
    /// Absorption coefficient in 1/m.
    pub absorption: Rgb,
}

impl Interior {
    /// Transmittance `exp(−σ d)` over `d` metres.
    #[inline]
    pub fn transmittance(&self, d: f64) -> Rgb {
        self.absorption.map(|s| (-s * d).exp())
    }
}

/// What a material can do; upper bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MaterialTraits {
    /// Largest diffuse albedo.
    pub diffuse: f64,
    /// Whether it has a mirror-like or glossy reflection.
    pub reflects: bool,
    /// Whether light passes through, bent or straight.
    pub transmits: bool,
    /// Whether passing light is bent.
    pub refracts: bool,
    /// Least roughness of what reflects or transmits.
    pub roughness: f64,
}

impl MaterialTraits {
    /// Roughness (glTF's) below which reflections and refractions are sharp: wider ones are found by
    /// shadow rays and by chance, and throw nothing that one would call a caustic.
    const SHARP: f64 = 0.3;

    /// Whether it reflects or transmits sharply.
    pub fn is_sharp(&self) -> bool {
        (self.reflects || self.transmits) && self.roughness < Self::SHARP
    }
}
