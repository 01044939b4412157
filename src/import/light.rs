//! Lights (`KHR_lights_punctual`).

use super::Problem;
use super::json::Cursor;
use super::node::Walker;
use crate::color::Rgb;
use crate::color::units::{self, LightUnits};
use crate::lights::{LightDesc, SpotCurve};
use crate::math::{DAffine3, DVec3};

/// Whether the file was written by Blender's own exporter.
pub(super) fn from_blender(root: &Cursor<'_>) -> bool {
    root.get("asset")
        .and_then(|a| a.get("generator"))
        .and_then(|g| g.str().ok().map(|g| g.contains("Khronos glTF Blender I/O")))
        .unwrap_or(false)
}

/// The units of a file's lights: those asked for, or by who wrote the file.
pub(super) fn resolve(asked: LightUnits, root: &Cursor<'_>) -> LightUnits {
    match asked {
        LightUnits::Auto if from_blender(root) => LightUnits::Blender,
        LightUnits::Auto => LightUnits::Photometric,
        chosen => chosen,
    }
}

/// Reads the light that `at` refers to, for a node that stands at `world`.
pub(super) fn read(
    walker: &mut Walker<'_, '_>,
    at: &Cursor<'_>,
    name: String,
    world: DAffine3,
) -> Result<LightDesc, Problem> {
    let root = &walker.source.root;
    let list = root
        .extension("KHR_lights_punctual")
        .ok_or_else(|| at.problem("the file declares no lights"))?;
    let lights = list.items("lights")?;
    let light = lights
        .get(at.index()?)
        .ok_or_else(|| at.problem("names a light that does not exist"))?;
    let kind = light.need("type")?;
    let kind = match kind.str()? {
        "point" => "point",
        "spot" => "spot",
        "directional" => "directional",
        other => {
            let text = format!("'{other}' is no kind of light");
            return Err(kind.problem(text));
        }
    };
    let blender = walker.light_units == LightUnits::Blender;
    let color: [f64; 3] = light.numbers_or("color", [1.0; 3])?;
    let scale =
        light.number_or("intensity", 1.0)?.max(0.0) * units::radiometric_factor(walker.light_units);
    let spot = light.get("spot");
    let angle = |key: &str, default: f64| match &spot {
        Some(s) => s.number_or(key, default),
        None => Ok(default),
    };
    let outer = angle("outerConeAngle", std::f64::consts::FRAC_PI_4)?;
    let range = match light.get("range") {
        // In Blender the custom distance is for its rasteriser alone; Cycles takes no heed of it.
        Some(_) if blender => f64::INFINITY,
        Some(r) if kind != "directional" => r.f64()?,
        _ => f64::INFINITY,
    };
    if !(range > 0.0) {
        return Err(light.problem(format!("range {range} is not positive")));
    }
    Ok(LightDesc {
        kind,
        name,
        position: world.translation,
        direction: world
            .transform_vector3(DVec3::NEG_Z)
            .normalize_or(DVec3::NEG_Z),
        strength: Rgb::new(color[0], color[1], color[2]).map(|c| c.max(0.0)) * scale,
        inner_cone: angle("innerConeAngle", 0.0)?.clamp(0.0, outer.max(0.0)),
        outer_cone: outer.clamp(0.0, std::f64::consts::PI),
        spot_curve: if blender {
            SpotCurve::Cycles
        } else {
            SpotCurve::Gltf
        },
        range,
        ..Default::default()
    })
}
