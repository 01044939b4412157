//! What a material is made from, and what it promises.

use serde_json::Value;

use crate::color::Rgb;

/// Parameters of a glTF material, with the specification's defaults. Colours are linear.
#[derive(Clone, Debug)]
pub struct MaterialDesc {
    /// Name, for messages.
    pub name: String,
    /// `baseColorFactor`, without alpha.
    pub base_color: Rgb,
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
    /// Emitted radiance in W/(m²·sr).
    pub emission: Rgb,
    /// Whether the back face emits too.
    pub double_sided: bool,
    /// The material's `extras`, for kinds of one's own.
    pub extras: Value,
}

impl Default for MaterialDesc {
    fn default() -> Self {
        Self {
            name: "default".into(),
            base_color: Rgb::ONE,
            metallic: 1.0,
            roughness: 1.0,
            ior: 1.5,
            specular: 1.0,
            specular_color: Rgb::ONE,
            transmission: 0.0,
            volume: false,
            attenuation_distance: f64::INFINITY,
            attenuation_color: Rgb::ONE,
            emission: Rgb::ZERO,
            double_sided: false,
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

    /// The enclosed medium, if it absorbs (Beer–Lambert).
    pub fn interior(&self) -> Option<Interior> {
        let absorbs = self.volume
            && self.transmission > 0.0
            && self.attenuation_distance.is_finite()
            && self.attenuation_distance > 0.0;
        absorbs.then(|| Interior {
            absorption: self
                .attenuation_color
                .map(|c| -c.clamp(1e-30, 1.0).ln() / self.attenuation_distance),
        })
    }
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
}
