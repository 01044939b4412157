//! Materials: PBR factors and the extensions that Dualight knows.

use super::image::Images;
use super::json::Cursor;
use super::{Notes, Problem};
use crate::color::Rgb;
use crate::materials::MaterialDesc;

fn rgb(c: [f64; 3]) -> Rgb {
    Rgb::new(c[0], c[1], c[2])
}

/// Translates one material.
pub(super) fn read<'a>(
    m: &Cursor<'a>,
    _images: &mut Images<'a>,
    notes: &mut Notes,
) -> Result<MaterialDesc, Problem> {
    let mut out = MaterialDesc {
        name: m.name(),
        emission: rgb(m.numbers_or("emissiveFactor", [0.0; 3])?),
        double_sided: m.flag("doubleSided"),
        extras: m
            .get("extras")
            .map_or(serde_json::Value::Null, |e| e.value().clone()),
        ..Default::default()
    };
    if let Some(pbr) = m.get("pbrMetallicRoughness") {
        out.base_color = rgb(pbr.numbers_or("baseColorFactor", [1.0; 3])?);
        out.metallic = unit(&pbr, "metallicFactor", 1.0)?;
        out.roughness = unit(&pbr, "roughnessFactor", 1.0)?;
    }
    if let Some(e) = m.extension("KHR_materials_emissive_strength") {
        out.emission *= e.number_or("emissiveStrength", 1.0)?.max(0.0);
    }
    if let Some(e) = m.extension("KHR_materials_ior") {
        out.ior = e.number_or("ior", 1.5)?;
        if out.ior != 0.0 && out.ior < 1.0 {
            return Err(e.problem(format!("ior {} is below 1", out.ior)));
        }
    }
    if let Some(e) = m.extension("KHR_materials_specular") {
        out.specular = unit(&e, "specularFactor", 1.0)?;
        out.specular_color = rgb(e.numbers_or("specularColorFactor", [1.0; 3])?);
    }
    if let Some(e) = m.extension("KHR_materials_transmission") {
        out.transmission = unit(&e, "transmissionFactor", 0.0)?;
    }
    if let Some(e) = m.extension("KHR_materials_volume") {
        out.volume = e.number_or("thicknessFactor", 0.0)? > 0.0;
        out.attenuation_distance = e.number_or("attenuationDistance", f64::INFINITY)?;
        out.attenuation_color = rgb(e.numbers_or("attenuationColor", [1.0; 3])?);
    }
    let textures = textures(m.value());
    if textures > 0 {
        notes.add(
            "textures are not read yet: their factors alone are used",
            textures,
        );
    }
    if m.get("alphaMode").is_some_and(|a| a.value() != "OPAQUE") {
        notes.add("alpha is not supported yet: such surfaces are opaque", 1);
    }
    Ok(out)
}

/// A factor between 0 and 1.
fn unit(c: &Cursor<'_>, key: &str, default: f64) -> Result<f64, Problem> {
    Ok(c.number_or(key, default)?.clamp(0.0, 1.0))
}

/// How many texture slots are filled, at any depth.
fn textures(v: &serde_json::Value) -> usize {
    v.as_object().map_or(0, |o| {
        o.iter()
            .map(|(k, v)| usize::from(k.ends_with("Texture")) + textures(v))
            .sum()
    })
}
