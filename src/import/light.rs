//! Lights (`KHR_lights_punctual`), and what our extras say about their extent.

use std::f64::consts::{FRAC_PI_4, PI};

use super::dialect::{self, Dialect};
use super::json::Cursor;
use super::node::Walker;
use super::{Notes, Problem, extras, range};
use crate::color::Rgb;
use crate::color::units::{self, LightUnits};
use crate::lights::LightDesc;
use crate::math::{DAffine3, DVec3};
use crate::scene::SceneBuilder;

/// What our extras say about a punctual light.
#[derive(Default)]
struct Extent {
    /// Of a point or spot.
    radius: f64,
    /// Under which a sun is seen, from rim to rim.
    angle: f64,
    seen_by_camera: bool,
}

/// The units of what shines in a file: those asked for, or by who wrote it and what is in it.
/// Tells the user what was chosen, why, and what else could be asked for.
pub(super) fn resolve(
    asked: LightUnits,
    dialect: Dialect,
    root: &Cursor<'_>,
    builder: &mut SceneBuilder,
) -> Result<LightUnits, Problem> {
    if asked != LightUnits::Auto {
        return Ok(asked);
    }
    let lamps = match root.extension("KHR_lights_punctual") {
        Some(e) => !e.items("lights")?.is_empty(),
        None => false,
    };
    if let (true, Some((units, why))) = (lamps, dialect.lamps()) {
        builder.inform(why);
        return Ok(units);
    }
    if lamps {
        builder.inform(
            "lamps are taken as candela and lux and emission as cd/m², at 683 lm/W, as the \
             specification says; --light-units radiometric takes them as watts",
        );
        return Ok(LightUnits::Photometric);
    }
    // Blender's emission is in watts in any case.
    if dialect.is_blender() {
        return Ok(LightUnits::Blender);
    }
    if dialect::emits(root) {
        builder.inform(
            "no lamp is in the file: what surfaces emit is taken as W/(m²·sr), for which \
             --light-units photometric would read cd/m²",
        );
    }
    Ok(LightUnits::Radiometric)
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
    range::of_light(light, walker.notes);
    let names: &[&str] = if kind == "directional" {
        &["angle", "seen_by_camera"]
    } else {
        &["radius", "seen_by_camera"]
    };
    let ours = extras::of(light, names, walker.notes)?;
    let mut extent = Extent::default();
    if let Some(ours) = &ours {
        extent = Extent {
            radius: extras::number(ours, "radius", 0.0..=1e15, "a length in metres from 0")?
                .unwrap_or(0.0),
            angle: extras::number(ours, "angle", 0.0..PI, "an angle in radians from 0 to π")?
                .unwrap_or(0.0),
            seen_by_camera: extras::flag(ours, "seen_by_camera")?.unwrap_or(false),
        };
    }
    let color: [f64; 3] = light.numbers_or("color", [1.0; 3])?;
    let mut scale = light.number_or("intensity", 1.0)?.max(0.0)
        * units::lamp_factor(walker.light_units, kind == "directional");
    let spot = light.get("spot");
    let angle = |key: &str, default: f64| match &spot {
        Some(s) => s.number_or(key, default),
        None => Ok(default),
    };
    let outer = angle("outerConeAngle", FRAC_PI_4)?.clamp(0.0, PI);
    if kind == "spot" && outer == 0.0 {
        walker
            .notes
            .add("spot lights whose cone is closed shine nowhere", 1);
        scale = 0.0;
    }
    let reach = match light.get("range") {
        Some(r) if kind != "directional" && walker.lamps.has_ranges() => r.f64()?,
        _ => f64::INFINITY,
    };
    if !(reach > 0.0) {
        return Err(light.problem(format!("range {reach} is not positive")));
    }
    Ok(LightDesc {
        kind,
        name,
        position: world.translation,
        direction: world
            .transform_vector3(DVec3::NEG_Z)
            .normalize_or(DVec3::NEG_Z),
        strength: Rgb::new(color[0], color[1], color[2]).map(|c| c.max(0.0)) * scale,
        inner_cone: angle("innerConeAngle", 0.0)?.clamp(0.0, outer),
        outer_cone: outer,
        spot_curve: walker.lamps.spot_curve(),
        range: reach,
        radius: extent.radius,
        angular_radius: 0.5 * extent.angle,
        seen_by_camera: extent.seen_by_camera,
        ..Default::default()
    })
}

/// Reads the area light that the extras of a node describe, if they do.
pub(super) fn area(
    node: &Cursor<'_>,
    name: &str,
    world: DAffine3,
    notes: &mut Notes,
) -> Result<Option<LightDesc>, Problem> {
    let ours = extras::of(node, &["area_light"], notes)?;
    let Some(area) = ours.and_then(|o| o.get("area_light")) else {
        return Ok(None);
    };
    let names = ["shape", "size", "power", "color", "seen_by_camera"];
    extras::check(&area, &names, notes)?;
    let shape = area.need("shape")?;
    let (round, square) = match shape.str()? {
        "square" => (false, true),
        "rectangle" => (false, false),
        "disk" => (true, true),
        "ellipse" => (true, false),
        other => {
            let text = format!("'{other}' is neither square, rectangle, disk nor ellipse");
            return Err(shape.problem(text));
        }
    };
    let missing = || area.problem("'size' is missing");
    let [width, height] = if square {
        [extras::length(&area, "size")?.ok_or_else(missing)?; 2]
    } else {
        let at = area.need("size")?;
        let size: [f64; 2] = area.numbers_or("size", [0.0; 2])?;
        if !size.iter().all(|x| *x > 0.0) {
            return Err(at.problem("is not a width and a height in metres above 0"));
        }
        size
    };
    let power = extras::number(&area, "power", 0.0..=1e30, "a power in watts from 0")?
        .ok_or_else(|| area.problem("'power' is missing"))?;
    let color = extras::color(&area, "color")?.unwrap_or([1.0; 3]);
    let edges = [
        world.transform_vector3(DVec3::X * width),
        world.transform_vector3(DVec3::Y * height),
    ];
    let surface = edges[0].cross(edges[1]).length() * if round { FRAC_PI_4 } else { 1.0 };
    // Lambertian emission from one side: P = π A L.
    let radiance = power / (PI * surface);
    if !radiance.is_finite() {
        notes.add("area lights without area are left out", 1);
        return Ok(None);
    }
    Ok(Some(LightDesc {
        kind: "panel",
        name: name.to_owned(),
        position: world.translation,
        direction: world
            .transform_vector3(DVec3::NEG_Z)
            .normalize_or(DVec3::NEG_Z),
        strength: Rgb::new(color[0], color[1], color[2]) * radiance,
        edges,
        round,
        seen_by_camera: extras::flag(&area, "seen_by_camera")?.unwrap_or(false),
        ..Default::default()
    }))
}
