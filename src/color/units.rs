//! The one place where photometric units become radiometric ones.
//!
//! `KHR_lights_punctual` gives candela and lux. Blender's exporter writes `W/(4π) · 683` candela
//! for point and spot lamps and `W/m² · 683` lux for suns, so that dividing by 683 gives back
//! what Blender renders with; emissive materials it leaves alone. 683 lm/W is also the luminous
//! efficacy of monochromatic light at 555 nm, which glTF's photometric convention (like Blender)
//! takes for all light: both conventions come to the same factor. A photometric file gives the
//! emission of its surfaces and of its surroundings in cd/m², which is divided alike.

use std::f64::consts::PI;

/// In which units a file gives what shines. How a lamp's light is spread is another question.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightUnits {
    /// By the file: as Blender exports them if its exporter wrote it (watts before its version 3.4),
    /// photometric if it has lamps. Without lamps radiometric: nothing is there that the rest would
    /// have to be in proportion to.
    #[default]
    Auto,
    /// As Blender exports them: candela and lux at 683 lm/W, but W/(m²·sr) of surfaces. Who asks for
    /// this says that the lamps are Blender's, which spread their light as Cycles has it.
    Blender,
    /// Candela and lux, as the specification says, and cd/m² of surfaces and surroundings; taken
    /// at 683 lm/W too.
    Photometric,
    /// W/sr and W/m², as Blender's "Unitless" mode writes them, and W/(m²·sr).
    Radiometric,
    /// Blender's own numbers, as its exporter wrote them before 3.4 and its "Raw" mode does: the power
    /// of points and spots in W, suns in W/m², and W/(m²·sr).
    Watts,
}

/// Luminous efficacy in lm/W.
pub const LUMENS_PER_WATT: f64 = 683.0;

/// What the intensity of a lamp of the file is multiplied by to be in W/sr, or in W/m² for a sun.
pub fn lamp_factor(units: LightUnits, sun: bool) -> f64 {
    match units {
        LightUnits::Auto | LightUnits::Blender | LightUnits::Photometric => 1.0 / LUMENS_PER_WATT,
        LightUnits::Radiometric => 1.0,
        LightUnits::Watts if sun => 1.0,
        // Of spots, too: the cone takes from it and does not gather it.
        LightUnits::Watts => 1.0 / (4.0 * PI),
    }
}

/// What the radiance of the file's surfaces and of its image-based light is multiplied by.
pub fn radiance_factor(units: LightUnits) -> f64 {
    match units {
        LightUnits::Photometric => 1.0 / LUMENS_PER_WATT,
        LightUnits::Auto | LightUnits::Blender | LightUnits::Radiometric | LightUnits::Watts => 1.0,
    }
}
