//! Materials: factors and textures of the metallic-roughness model and of the extensions that
//! Dualight knows.

use std::collections::HashSet;
use std::sync::Arc;

use super::image::Images;
use super::json::Cursor;
use super::{Notes, Problem, texture};
use crate::color::Rgb;
use crate::materials::{AlphaMode, MaterialDesc, TextureSlots};
use crate::textures::{Content, Texture};

fn rgb(c: [f64; 3]) -> Rgb {
    Rgb::new(c[0], c[1], c[2])
}

/// Reads textures of one material.
struct Slots<'a, 'b> {
    images: &'b mut Images<'a>,
    notes: &'b mut Notes,
    found: TextureSlots,
}

impl<'a> Slots<'a, '_> {
    /// The texture `key` of `owner`.
    fn read(
        &mut self,
        owner: &Cursor<'a>,
        key: &str,
        content: Content,
    ) -> Result<Option<Texture>, Problem> {
        match owner.get(key) {
            None => Ok(None),
            Some(info) => texture::read(&info, content, self.images, self.notes),
        }
    }

    fn color(&mut self, owner: &Cursor<'a>, key: &str) -> Result<Option<Texture>, Problem> {
        self.read(owner, key, Content::Color)
    }

    fn data(&mut self, owner: &Cursor<'a>, key: &str) -> Result<Option<Texture>, Problem> {
        self.read(owner, key, Content::Data)
    }

    /// A normal map with its scale.
    fn normal(&mut self, owner: &Cursor<'a>, key: &str) -> Result<(Option<Texture>, f64), Problem> {
        let scale = match owner.get(key) {
            None => 1.0,
            Some(info) => info.number_or("scale", 1.0)?,
        };
        Ok((self.read(owner, key, Content::Normal)?, scale))
    }
}

/// Translates one material.
pub(super) fn read<'a>(
    m: &Cursor<'a>,
    images: &mut Images<'a>,
    notes: &mut Notes,
) -> Result<MaterialDesc, Problem> {
    let mut out = MaterialDesc {
        name: m.name(),
        emission: color(m, "emissiveFactor", [0.0; 3])?,
        double_sided: m.flag("doubleSided"),
        extras: m
            .get("extras")
            .map_or(serde_json::Value::Null, |e| e.value().clone()),
        ..Default::default()
    };
    let mut slots = Slots {
        images,
        notes,
        found: TextureSlots::default(),
    };
    alpha(&mut out, m)?;
    let base = match out.alpha_mode {
        AlphaMode::Opaque => Content::Color,
        _ => Content::Coverage,
    };
    slots.found.emissive = slots.color(m, "emissiveTexture")?;
    (slots.found.normal, slots.found.normal_scale) = slots.normal(m, "normalTexture")?;
    if let Some(pbr) = m.get("pbrMetallicRoughness") {
        base_color(&mut out, &pbr, "baseColorFactor")?;
        out.metallic = unit(&pbr, "metallicFactor", 1.0)?;
        out.roughness = unit(&pbr, "roughnessFactor", 1.0)?;
        slots.found.base_color = slots.read(&pbr, "baseColorTexture", base)?;
        slots.found.metallic_roughness = slots.data(&pbr, "metallicRoughnessTexture")?;
    }
    specular_glossiness(&mut out, m, base, &mut slots)?;
    surface_extensions(&mut out, m, &mut slots)?;
    layer_extensions(&mut out, m, &mut slots)?;
    out.unlit = m.extension("KHR_materials_unlit").is_some();
    if out.unlit {
        // Its colour is all there is of it; what it emits is for readers without the extension.
        out.emission = Rgb::ZERO;
        slots.found.emissive = None;
    }
    if slots.found.iter().next().is_some() {
        out.textures = Some(Arc::new(slots.found));
    }
    Ok(out)
}

/// Whether a material emits, by its factor.
pub(super) fn emits(m: &Cursor<'_>) -> bool {
    let factor = m.numbers_or("emissiveFactor", [0.0; 3]);
    m.extension("KHR_materials_unlit").is_none() && factor.is_ok_and(|f| f != [0.0; 3])
}

fn base_color(out: &mut MaterialDesc, owner: &Cursor<'_>, key: &str) -> Result<(), Problem> {
    let [r, g, b, a] = owner.numbers_or(key, [1.0; 4])?;
    out.base_color = Rgb::new(r, g, b).map(|c| c.clamp(0.0, 1.0));
    out.base_alpha = a.clamp(0.0, 1.0);
    Ok(())
}

fn alpha(out: &mut MaterialDesc, m: &Cursor<'_>) -> Result<(), Problem> {
    let Some(mode) = m.get("alphaMode") else {
        return Ok(());
    };
    out.alpha_mode = match mode.str()? {
        "OPAQUE" => AlphaMode::Opaque,
        "MASK" => AlphaMode::Mask {
            cutoff: m.number_or("alphaCutoff", 0.5)?,
        },
        "BLEND" => AlphaMode::Blend,
        other => {
            let text = format!("'{other}' is no alpha mode");
            return Err(mode.problem(text));
        }
    };
    Ok(())
}

/// The archived `KHR_materials_pbrSpecularGlossiness`, which replaces metal and roughness.
fn specular_glossiness<'a>(
    out: &mut MaterialDesc,
    m: &Cursor<'a>,
    base: Content,
    slots: &mut Slots<'a, '_>,
) -> Result<(), Problem> {
    let Some(e) = m.extension("KHR_materials_pbrSpecularGlossiness") else {
        return Ok(());
    };
    base_color(out, &e, "diffuseFactor")?;
    out.metallic = 0.0;
    out.specular_reflectance = Some(color(&e, "specularFactor", [1.0; 3])?.map(|x| x.min(1.0)));
    out.roughness = 1.0 - unit(&e, "glossinessFactor", 1.0)?;
    slots.found.base_color = None;
    slots.found.metallic_roughness = None;
    slots.found.diffuse = slots.read(&e, "diffuseTexture", base)?;
    slots.found.specular_glossiness = slots.color(&e, "specularGlossinessTexture")?;
    Ok(())
}

/// What changes the base: emission, index, reflection, transmission, volume.
fn surface_extensions<'a>(
    out: &mut MaterialDesc,
    m: &Cursor<'a>,
    slots: &mut Slots<'a, '_>,
) -> Result<(), Problem> {
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
        out.specular_color = color(&e, "specularColorFactor", [1.0; 3])?;
        slots.found.specular = slots.data(&e, "specularTexture")?;
        slots.found.specular_color = slots.color(&e, "specularColorTexture")?;
    }
    if let Some(e) = m.extension("KHR_materials_transmission") {
        out.transmission = unit(&e, "transmissionFactor", 0.0)?;
        slots.found.transmission = slots.data(&e, "transmissionTexture")?;
    }
    if let Some(e) = m.extension("KHR_materials_diffuse_transmission") {
        out.diffuse_transmission = unit(&e, "diffuseTransmissionFactor", 0.0)?;
        out.diffuse_transmission_color = color(&e, "diffuseTransmissionColorFactor", [1.0; 3])?;
        slots.found.diffuse_transmission = slots.data(&e, "diffuseTransmissionTexture")?;
        slots.found.diffuse_transmission_color =
            slots.color(&e, "diffuseTransmissionColorTexture")?;
    }
    if let Some(e) = m.extension("KHR_materials_volume") {
        out.volume = e.number_or("thicknessFactor", 0.0)? > 0.0;
        out.attenuation_distance = e.number_or("attenuationDistance", f64::INFINITY)?;
        out.attenuation_color = color(&e, "attenuationColor", [1.0; 3])?;
    }
    if let Some(e) = m.extension("KHR_materials_dispersion") {
        out.dispersion = e.number_or("dispersion", 0.0)?.max(0.0);
    }
    Ok(())
}

/// What lies above the base, or shapes its reflection.
fn layer_extensions<'a>(
    out: &mut MaterialDesc,
    m: &Cursor<'a>,
    slots: &mut Slots<'a, '_>,
) -> Result<(), Problem> {
    slots.found.clearcoat_normal_scale = 1.0;
    if let Some(e) = m.extension("KHR_materials_clearcoat") {
        out.clearcoat = unit(&e, "clearcoatFactor", 0.0)?;
        out.clearcoat_roughness = unit(&e, "clearcoatRoughnessFactor", 0.0)?;
        slots.found.clearcoat = slots.data(&e, "clearcoatTexture")?;
        slots.found.clearcoat_roughness = slots.data(&e, "clearcoatRoughnessTexture")?;
        (
            slots.found.clearcoat_normal,
            slots.found.clearcoat_normal_scale,
        ) = slots.normal(&e, "clearcoatNormalTexture")?;
    }
    if let Some(e) = m.extension("KHR_materials_sheen") {
        out.sheen_color = color(&e, "sheenColorFactor", [0.0; 3])?;
        out.sheen_roughness = unit(&e, "sheenRoughnessFactor", 0.0)?;
        slots.found.sheen_color = slots.color(&e, "sheenColorTexture")?;
        slots.found.sheen_roughness = slots.data(&e, "sheenRoughnessTexture")?;
    }
    if let Some(e) = m.extension("KHR_materials_anisotropy") {
        out.anisotropy = unit(&e, "anisotropyStrength", 0.0)?;
        out.anisotropy_rotation = e.number_or("anisotropyRotation", 0.0)?;
        slots.found.anisotropy = slots.data(&e, "anisotropyTexture")?;
    }
    if let Some(e) = m.extension("KHR_materials_iridescence") {
        out.iridescence = unit(&e, "iridescenceFactor", 0.0)?;
        out.iridescence_ior = e.number_or("iridescenceIor", 1.3)?.max(1.0);
        out.iridescence_thickness = [
            e.number_or("iridescenceThicknessMinimum", 100.0)?.max(0.0),
            e.number_or("iridescenceThicknessMaximum", 400.0)?.max(0.0),
        ];
        slots.found.iridescence = slots.data(&e, "iridescenceTexture")?;
        slots.found.iridescence_thickness = slots.data(&e, "iridescenceThicknessTexture")?;
    }
    Ok(())
}

/// A factor between 0 and 1.
fn unit(c: &Cursor<'_>, key: &str, default: f64) -> Result<f64, Problem> {
    Ok(c.number_or(key, default)?.clamp(0.0, 1.0))
}

/// A colour without negative channels.
fn color(c: &Cursor<'_>, key: &str, default: [f64; 3]) -> Result<Rgb, Problem> {
    Ok(rgb(c.numbers_or(key, default)?).map(|x| x.max(0.0)))
}

/// The materials that some primitive with vertex colours shows; `None` is the default material.
/// Primitives without colours are white, so one flag per material serves.
pub(super) fn with_vertex_colors(root: &Cursor<'_>) -> Result<HashSet<Option<usize>>, Problem> {
    let mut colored = HashSet::new();
    for mesh in root.items("meshes")? {
        for p in mesh.items("primitives")? {
            let colors = p.get("attributes").and_then(|a| a.get("COLOR_0"));
            if colors.is_none() {
                continue;
            }
            colored.insert(p.get("material").map(|m| m.index()).transpose()?);
            if let Some(variants) = p.extension("KHR_materials_variants") {
                for mapping in variants.items("mappings")? {
                    colored.insert(mapping.get("material").map(|m| m.index()).transpose()?);
                }
            }
        }
    }
    Ok(colored)
}
