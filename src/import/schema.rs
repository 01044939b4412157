//! The types of what a file says, by the schema of glTF 2.0, checked before anything is read: a
//! string where a number belongs is told with its place, whether or not it would be looked at.
//!
//! What is not listed here is not looked at, and what may be missing may be missing: the code that
//! needs it says so.

use super::Problem;
use super::json::Cursor;

/// What a member has to be.
enum Kind {
    Text,
    Flag,
    Number,
    /// A whole number from 0.
    Whole,
    /// Numbers, so many if that is fixed.
    Numbers(Option<usize>),
    Object(&'static [Member]),
    /// An object whose members are all whole numbers from 0.
    Wholes,
    List(&'static Kind),
}

type Member = (&'static str, Kind);

use Kind::{Flag, List, Number, Numbers, Object, Text, Whole, Wholes};

const ROOT: Kind = Object(&[
    ("asset", Object(ASSET)),
    ("extensionsUsed", List(&Text)),
    ("extensionsRequired", List(&Text)),
    ("scene", Whole),
    ("scenes", List(&Object(SCENE))),
    ("nodes", List(&Object(NODE))),
    ("meshes", List(&Object(MESH))),
    ("skins", List(&Object(SKIN))),
    ("animations", List(&Object(ANIMATION))),
    ("cameras", List(&Object(CAMERA))),
    ("materials", List(&Object(MATERIAL))),
    ("textures", List(&Object(TEXTURE))),
    ("samplers", List(&Object(SAMPLER))),
    ("images", List(&Object(IMAGE))),
    ("accessors", List(&Object(ACCESSOR))),
    ("bufferViews", List(&Object(VIEW))),
    ("buffers", List(&Object(BUFFER))),
]);

const ASSET: &[Member] = &[
    ("version", Text),
    ("minVersion", Text),
    ("generator", Text),
    ("copyright", Text),
];

const SCENE: &[Member] = &[("name", Text), ("nodes", List(&Whole))];

const NODE: &[Member] = &[
    ("name", Text),
    ("camera", Whole),
    ("children", List(&Whole)),
    ("skin", Whole),
    ("mesh", Whole),
    ("matrix", Numbers(Some(16))),
    ("rotation", Numbers(Some(4))),
    ("scale", Numbers(Some(3))),
    ("translation", Numbers(Some(3))),
    ("weights", Numbers(None)),
];

const MESH: &[Member] = &[
    ("name", Text),
    ("weights", Numbers(None)),
    (
        "primitives",
        List(&Object(&[
            ("attributes", Wholes),
            ("indices", Whole),
            ("material", Whole),
            ("mode", Whole),
            ("targets", List(&Wholes)),
        ])),
    ),
];

const SKIN: &[Member] = &[
    ("name", Text),
    ("inverseBindMatrices", Whole),
    ("skeleton", Whole),
    ("joints", List(&Whole)),
];

const ANIMATION: &[Member] = &[
    ("name", Text),
    (
        "channels",
        List(&Object(&[
            ("sampler", Whole),
            ("target", Object(&[("node", Whole), ("path", Text)])),
        ])),
    ),
    (
        "samplers",
        List(&Object(&[
            ("input", Whole),
            ("output", Whole),
            ("interpolation", Text),
        ])),
    ),
];

const CAMERA: &[Member] = &[
    ("name", Text),
    ("type", Text),
    (
        "perspective",
        Object(&[
            ("aspectRatio", Number),
            ("yfov", Number),
            ("znear", Number),
            ("zfar", Number),
        ]),
    ),
    (
        "orthographic",
        Object(&[
            ("xmag", Number),
            ("ymag", Number),
            ("znear", Number),
            ("zfar", Number),
        ]),
    ),
];

const TEXTURE_INFO: Kind = Object(&[
    ("index", Whole),
    ("texCoord", Whole),
    ("scale", Number),
    ("strength", Number),
]);

const MATERIAL: &[Member] = &[
    ("name", Text),
    (
        "pbrMetallicRoughness",
        Object(&[
            ("baseColorFactor", Numbers(Some(4))),
            ("baseColorTexture", TEXTURE_INFO),
            ("metallicFactor", Number),
            ("roughnessFactor", Number),
            ("metallicRoughnessTexture", TEXTURE_INFO),
        ]),
    ),
    ("normalTexture", TEXTURE_INFO),
    ("occlusionTexture", TEXTURE_INFO),
    ("emissiveTexture", TEXTURE_INFO),
    ("emissiveFactor", Numbers(Some(3))),
    ("alphaMode", Text),
    ("alphaCutoff", Number),
    ("doubleSided", Flag),
];

const TEXTURE: &[Member] = &[("name", Text), ("sampler", Whole), ("source", Whole)];

const SAMPLER: &[Member] = &[
    ("name", Text),
    ("magFilter", Whole),
    ("minFilter", Whole),
    ("wrapS", Whole),
    ("wrapT", Whole),
];

const IMAGE: &[Member] = &[
    ("name", Text),
    ("uri", Text),
    ("mimeType", Text),
    ("bufferView", Whole),
];

const ACCESSOR: &[Member] = &[
    ("name", Text),
    ("bufferView", Whole),
    ("byteOffset", Whole),
    ("componentType", Whole),
    ("normalized", Flag),
    ("count", Whole),
    ("type", Text),
    ("max", Numbers(None)),
    ("min", Numbers(None)),
    (
        "sparse",
        Object(&[
            ("count", Whole),
            (
                "indices",
                Object(&[
                    ("bufferView", Whole),
                    ("byteOffset", Whole),
                    ("componentType", Whole),
                ]),
            ),
            (
                "values",
                Object(&[("bufferView", Whole), ("byteOffset", Whole)]),
            ),
        ]),
    ),
];

const VIEW: &[Member] = &[
    ("name", Text),
    ("buffer", Whole),
    ("byteOffset", Whole),
    ("byteLength", Whole),
    ("byteStride", Whole),
    ("target", Whole),
];

const BUFFER: &[Member] = &[("name", Text), ("uri", Text), ("byteLength", Whole)];

/// Checks the whole document.
pub(super) fn check(root: &Cursor<'_>) -> Result<(), Problem> {
    is(root, &ROOT)?;
    for accessor in root.items("accessors")? {
        bounds(&accessor)?;
    }
    let buffers = root.items("buffers")?;
    for view in root.items("bufferViews")? {
        within(&view, &buffers)?;
    }
    Ok(())
}

/// A buffer view lies within its buffer, whether or not anything reads it.
fn within(view: &Cursor<'_>, buffers: &[Cursor<'_>]) -> Result<(), Problem> {
    let at = view.need("buffer")?;
    let buffer = buffers
        .get(at.index()?)
        .ok_or_else(|| at.problem("names a buffer that does not exist"))?;
    let (start, len) = (
        view.index_or("byteOffset", 0)?,
        view.need("byteLength")?.index()?,
    );
    let size = buffer.need("byteLength")?.index()?;
    if start.checked_add(len).is_none_or(|end| end > size) {
        return Err(view.problem(format!(
            "covers bytes {start} to {} of a buffer of {size}",
            start.saturating_add(len)
        )));
    }
    Ok(())
}

/// The schema is flat, so this ends after a few levels however deep the file is.
fn is(at: &Cursor<'_>, kind: &Kind) -> Result<(), Problem> {
    let value = at.value();
    match kind {
        Text => at.str().map(|_| ()),
        Flag if value.is_boolean() => Ok(()),
        Flag => Err(at.problem("is not true or false")),
        Number => at.f64().map(|_| ()),
        Whole => at.index().map(|_| ()),
        Numbers(n) => {
            let list = value
                .as_array()
                .ok_or_else(|| at.problem("is not an array"))?;
            if let Some(n) = n.filter(|n| *n != list.len()) {
                return Err(at.problem(format!("has {} numbers, {n} are needed", list.len())));
            }
            match list.iter().position(|v| !v.is_number()) {
                Some(i) => at.elements()?[i].f64().map(|_| ()),
                None => Ok(()),
            }
        }
        List(kind) => {
            // Long lists of plain numbers need no paths unless one of them is wrong.
            if let (Whole, Some(list)) = (kind, value.as_array())
                && list.iter().all(serde_json::Value::is_u64)
            {
                return Ok(());
            }
            at.elements()?.iter().try_for_each(|e| is(e, kind))
        }
        Object(members) => {
            object(at)?;
            let known = members
                .iter()
                .filter_map(|(key, kind)| Some((at.get(key)?, kind)));
            for (member, kind) in known {
                is(&member, kind)?;
            }
            Ok(())
        }
        Wholes => {
            for key in object(at)?.keys() {
                if let Some(member) = at.get(key) {
                    member.index()?;
                }
            }
            Ok(())
        }
    }
}

fn object<'a>(at: &Cursor<'a>) -> Result<&'a serde_json::Map<String, serde_json::Value>, Problem> {
    at.value()
        .as_object()
        .ok_or_else(|| at.problem("is not an object"))
}

/// The bounds of an accessor have as many numbers as its elements.
fn bounds(accessor: &Cursor<'_>) -> Result<(), Problem> {
    let Some(kind) = accessor.get("type") else {
        return Ok(());
    };
    let n = match kind.str()? {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        other => return Err(kind.problem(format!("'{other}' is no type"))),
    };
    for key in ["min", "max"] {
        if let Some(bound) = accessor.get(key) {
            is(&bound, &Numbers(Some(n)))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn wrong_types_are_told_with_their_place() {
        let cases: &[(Value, &str)] = &[
            (json!([]), "the document"),
            (json!({"scene": "a"}), "/scene"),
            (json!({"scenes": [{}, {"name": 4}]}), "/scenes/1/name"),
            (json!({"nodes": [{"matrix": [1, 2]}]}), "/nodes/0/matrix"),
            (
                json!({"nodes": [{"scale": [1, "2", 3]}]}),
                "/nodes/0/scale/1",
            ),
            (
                json!({"meshes": [{"primitives": [{"attributes": {"POSITION": -1}}]}]}),
                "/meshes/0/primitives/0/attributes/POSITION",
            ),
            (
                json!({"materials": [{"normalTexture": {"scale": "x"}}]}),
                "/materials/0/normalTexture/scale",
            ),
            (
                json!({"accessors": [{"type": "VEC3", "max": [1, 2]}]}),
                "/accessors/0/max",
            ),
            (
                json!({"accessors": [{"type": "VEC5"}]}),
                "/accessors/0/type",
            ),
            (
                json!({"materials": [{"doubleSided": 1}]}),
                "/materials/0/doubleSided",
            ),
        ];
        for (document, place) in cases {
            let problem = check(&Cursor::root(document)).unwrap_err();
            assert_eq!(problem.place, *place, "{}", problem.problem);
        }
        let good = json!({
            "scene": 0.0, "scenes": [{"nodes": [0, 1.0]}], "unknown": [],
            "nodes": [{"rotation": [0, 0, 0, 1], "extras": {"name": 3}}, {"name": null}],
        });
        assert!(check(&Cursor::root(&good)).is_ok());
    }
}
