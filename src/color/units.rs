//! The one place where photometric units become radiometric ones.
//!
//! `KHR_lights_punctual` gives candela and lux. Blender's exporter writes `W/(4π) · 683` candela
//! for point and spot lamps and `W/m² · 683` lux for suns, so that dividing by 683 gives back
//! what Blender renders with; emissive materials it leaves alone. 683 lm/W is also the luminous
//! efficacy of monochromatic light at 555 nm, which glTF's photometric convention (like Blender)
//! takes for all light: both conventions come to the same factor. A photometric file gives the
//! emission of its surfaces and of its surroundings in cd/m², which is divided alike.

/// In which units a file gives what shines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightUnits {
    /// By the file: as Blender exports them if its exporter wrote it, photometric if it has lamps.
    /// Without lamps radiometric: nothing is there that the rest would have to be in proportion to.
    #[default]
    Auto,
    /// As Blender exports them: candela and lux at 683 lm/W, spots with Cycles' falloff.
    Blender,
    /// Candela and lux, as the specification says, and cd/m² of surfaces and surroundings; taken
    /// at 683 lm/W too.
    Photometric,
    /// W/sr and W/m², as Blender's "Unitless" mode writes them, and W/(m²·sr).
    Radiometric,
}

/// Luminous efficacy in lm/W.
pub const LUMENS_PER_WATT: f64 = 683.0;

/// What an intensity or irradiance of the file is multiplied by.
pub fn radiometric_factor(units: LightUnits) -> f64 {
    match units {
        LightUnits::Auto | LightUnits::Blender | LightUnits::Photometric => 1.0 / LUMENS_PER_WATT,
        LightUnits::Radiometric => 1.0,
    }
}

/// What the radiance of the file's surfaces and of its image-based light is multiplied by.
pub fn radiance_factor(units: LightUnits) -> f64 {
    match units {
        LightUnits::Photometric => 1.0 / LUMENS_PER_WATT,
        LightUnits::Auto | LightUnits::Blender | LightUnits::Radiometric => 1.0,
    }
}
