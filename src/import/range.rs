//! What a file says beyond what the schema allows and can be shown all the same: numbers out of their
//! range, and textures whose coordinates a mesh lacks. It is told with its place.

use std::collections::BTreeSet;

use serde_json::Value;

use super::Notes;
use super::json::Cursor;

type Ranges = &'static [(&'static str, f64, f64)];

/// No upper bound.
const FREE: f64 = f64::INFINITY;

/// The ranges of numbers, and of those of colours, of a material and its extensions; the first are
/// those of the material itself.
const MATERIAL: &[(&str, Ranges)] = &[
    ("", &[("emissiveFactor", 0.0, FREE)]),
    (
        "pbrMetallicRoughness",
        &[
            ("baseColorFactor", 0.0, 1.0),
            ("metallicFactor", 0.0, 1.0),
            ("roughnessFactor", 0.0, 1.0),
        ],
    ),
    (
        "KHR_materials_anisotropy",
        &[("anisotropyStrength", 0.0, 1.0)],
    ),
    (
        "KHR_materials_clearcoat",
        &[
            ("clearcoatFactor", 0.0, 1.0),
            ("clearcoatRoughnessFactor", 0.0, 1.0),
        ],
    ),
    (
        "KHR_materials_diffuse_transmission",
        &[
            ("diffuseTransmissionFactor", 0.0, 1.0),
            ("diffuseTransmissionColorFactor", 0.0, FREE),
        ],
    ),
    ("KHR_materials_dispersion", &[("dispersion", 0.0, FREE)]),
    (
        "KHR_materials_emissive_strength",
        &[("emissiveStrength", 0.0, FREE)],
    ),
    (
        "KHR_materials_iridescence",
        &[
            ("iridescenceFactor", 0.0, 1.0),
            ("iridescenceIor", 1.0, FREE),
            ("iridescenceThicknessMinimum", 0.0, FREE),
            ("iridescenceThicknessMaximum", 0.0, FREE),
        ],
    ),
    (
        "KHR_materials_pbrSpecularGlossiness",
        &[
            ("diffuseFactor", 0.0, 1.0),
            ("specularFactor", 0.0, 1.0),
            ("glossinessFactor", 0.0, 1.0),
        ],
    ),
    (
        "KHR_materials_sheen",
        &[
            ("sheenColorFactor", 0.0, FREE),
            ("sheenRoughnessFactor", 0.0, 1.0),
        ],
    ),
    (
        "KHR_materials_specular",
        &[
            ("specularFactor", 0.0, 1.0),
            ("specularColorFactor", 0.0, FREE),
        ],
    ),
    (
        "KHR_materials_transmission",
        &[("transmissionFactor", 0.0, 1.0)],
    ),
    ("KHR_materials_volume", &[("attenuationColor", 0.0, FREE)]),
];

/// The ranges of a light.
const LIGHT: Ranges = &[("color", 0.0, FREE), ("intensity", 0.0, FREE)];

/// Notes what is out of range in the material `m`.
pub(super) fn of_material(m: &Cursor<'_>, notes: &mut Notes) {
    for (object, ranges) in MATERIAL {
        let at = match *object {
            "" => Some(m.clone()),
            "pbrMetallicRoughness" => m.get(object),
            extension => m.extension(extension),
        };
        at.iter().for_each(|at| tell(at, ranges, notes));
    }
}

/// Notes what is out of range in the light `light` of `KHR_lights_punctual`.
pub(super) fn of_light(light: &Cursor<'_>, notes: &mut Notes) {
    tell(light, LIGHT, notes);
    let Some(spot) = light.get("spot") else {
        return;
    };
    let angle = |key: &str, default: f64| spot.number_or(key, default).unwrap_or(default);
    let (inner, outer) = (
        angle("innerConeAngle", 0.0),
        angle("outerConeAngle", std::f64::consts::FRAC_PI_4),
    );
    if inner > outer {
        let at = spot.path();
        notes.add(
            format!("{at}: the inner cone, {inner}, is wider than the outer one, {outer}, which is taken for both"),
            1,
        );
    }
}

fn tell(owner: &Cursor<'_>, ranges: Ranges, notes: &mut Notes) {
    for (key, least, most) in ranges {
        let Some(at) = owner.get(key) else {
            continue;
        };
        let numbers = match at.value() {
            Value::Array(list) => list.iter().filter_map(Value::as_f64).collect(),
            one => Vec::from_iter(one.as_f64()),
        };
        let Some(x) = numbers.iter().find(|x| **x < *least || **x > *most) else {
            continue;
        };
        let end = if x < least { least } else { most };
        notes.add(
            format!("{}: {x} is out of range and taken for {end}", at.path()),
            1,
        );
    }
}

/// Notes that the primitive `p` lacks coordinates of textures of the material `m`.
pub(super) fn of_coordinates(p: &Cursor<'_>, m: &Cursor<'_>, notes: &mut Notes) {
    let mut sets = BTreeSet::new();
    collect(m.value(), &mut sets);
    let has = |set: &u64| {
        let attributes = p.get("attributes");
        attributes.is_some_and(|a| a.get(&format!("TEXCOORD_{set}")).is_some())
    };
    // Spheres have coordinates of their own.
    let is_sphere = p.extension(super::implicit::NAME).is_some()
        || p.index_or("mode", 4).is_ok_and(|mode| mode == 0);
    if is_sphere {
        return;
    }
    for set in sets.iter().filter(|set| !has(set)) {
        notes.add(
            format!(
                "material '{}' has textures that need TEXCOORD_{set}, which {} lacks: one texel \
                 of them covers it",
                m.name(),
                p.path()
            ),
            1,
        );
    }
}

/// The sets of coordinates that the textures in `v` use, at any depth.
fn collect(v: &Value, sets: &mut BTreeSet<u64>) {
    for (key, value) in v.as_object().into_iter().flatten() {
        let is_slot = key.ends_with("Texture") && value.get("index").is_some();
        if !is_slot {
            collect(value, sets);
        } else if !matches!(key.as_str(), "occlusionTexture" | "thicknessTexture") {
            let moved = value.pointer("/extensions/KHR_texture_transform/texCoord");
            let set = moved.or_else(|| value.get("texCoord"));
            sets.insert(set.and_then(Value::as_u64).unwrap_or(0));
        }
    }
}
