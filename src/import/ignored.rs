//! What a material says that has no effect here, named instead of passed over.

use super::json::Cursor;
use super::{Notes, Problem, SUPPORTED};

/// The properties that are read of a material and of its extensions, by the object they stand in;
/// the first is the material itself.
const READ: &[(&str, &[&str])] = &[
    (
        "",
        &[
            "name",
            "pbrMetallicRoughness",
            "normalTexture",
            "emissiveTexture",
            "emissiveFactor",
            "alphaMode",
            "alphaCutoff",
            "doubleSided",
        ],
    ),
    (
        "pbrMetallicRoughness",
        &[
            "baseColorFactor",
            "baseColorTexture",
            "metallicFactor",
            "roughnessFactor",
            "metallicRoughnessTexture",
        ],
    ),
    (
        "KHR_materials_anisotropy",
        &[
            "anisotropyStrength",
            "anisotropyRotation",
            "anisotropyTexture",
        ],
    ),
    (
        "KHR_materials_clearcoat",
        &[
            "clearcoatFactor",
            "clearcoatTexture",
            "clearcoatRoughnessFactor",
            "clearcoatRoughnessTexture",
            "clearcoatNormalTexture",
        ],
    ),
    (
        "KHR_materials_diffuse_transmission",
        &[
            "diffuseTransmissionFactor",
            "diffuseTransmissionTexture",
            "diffuseTransmissionColorFactor",
            "diffuseTransmissionColorTexture",
        ],
    ),
    ("KHR_materials_dispersion", &["dispersion"]),
    ("KHR_materials_emissive_strength", &["emissiveStrength"]),
    ("KHR_materials_ior", &["ior"]),
    (
        "KHR_materials_iridescence",
        &[
            "iridescenceFactor",
            "iridescenceTexture",
            "iridescenceIor",
            "iridescenceThicknessMinimum",
            "iridescenceThicknessMaximum",
            "iridescenceThicknessTexture",
        ],
    ),
    (
        "KHR_materials_pbrSpecularGlossiness",
        &[
            "diffuseFactor",
            "diffuseTexture",
            "specularFactor",
            "glossinessFactor",
            "specularGlossinessTexture",
        ],
    ),
    (
        "KHR_materials_sheen",
        &[
            "sheenColorFactor",
            "sheenColorTexture",
            "sheenRoughnessFactor",
            "sheenRoughnessTexture",
        ],
    ),
    (
        "KHR_materials_specular",
        &[
            "specularFactor",
            "specularTexture",
            "specularColorFactor",
            "specularColorTexture",
        ],
    ),
    (
        "KHR_materials_transmission",
        &["transmissionFactor", "transmissionTexture"],
    ),
    ("KHR_materials_unlit", &[]),
    (
        "KHR_materials_volume",
        &["thicknessFactor", "attenuationDistance", "attenuationColor"],
    ),
];

/// Notes the properties of the material `m` that have no effect, by its name, and extensions that
/// the file does not declare: of those that it declares the user has been told.
pub(super) fn tell(m: &Cursor<'_>, root: &Cursor<'_>, notes: &mut Notes) -> Result<(), Problem> {
    for (object, read) in READ {
        let (at, of) = match *object {
            "" => (Some(m.clone()), String::new()),
            "pbrMetallicRoughness" => (m.get(object), format!(" of {object}")),
            extension => (m.extension(extension), format!(" of {extension}")),
        };
        let fields = at.as_ref().and_then(|at| at.value().as_object());
        for key in fields.into_iter().flat_map(|f| f.keys()) {
            if read.contains(&key.as_str()) || matches!(key.as_str(), "extensions" | "extras") {
                continue;
            }
            let why = match key.as_str() {
                "occlusionTexture" => {
                    // Usual and no fault: once for all materials.
                    notes.add(
                        "occlusionTexture is not used: what it bakes, global illumination computes",
                        1,
                    );
                    continue;
                }
                "thicknessTexture" => {
                    "light is absorbed along its way through the mesh, and thicknessFactor alone \
                     says whether the body is solid"
                }
                _ => "no property of this name is known",
            };
            let name = m.name();
            notes.add(format!("material '{name}': {key}{of} is ignored: {why}"), 1);
        }
    }
    let extensions = m.get("extensions");
    let names = extensions.as_ref().and_then(|e| e.value().as_object());
    let declared = root.items("extensionsUsed")?;
    for extension in names.into_iter().flat_map(|e| e.keys()) {
        let told = declared.iter().any(|d| d.value() == extension.as_str());
        if !told && !SUPPORTED.contains(&extension.as_str()) {
            let name = m.name();
            notes.add(
                format!("material '{name}': {extension} is not supported and ignored"),
                1,
            );
        }
    }
    Ok(())
}
