//! What a file holds besides what is rendered: its scenes, animations, variants, images,
//! materials and extensions, told without decoding them.

use std::collections::HashSet;
use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use super::accessor::Source;
use super::buffer::Bytes;
use super::container;
use super::image;
use super::json::Cursor;
use super::uri::Uris;
use super::{Problem, SUPPORTED};
use crate::error::Result;

/// What a glTF file holds, in the order of the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Inventory {
    /// The program that wrote it, as far as it says.
    pub generator: Option<String>,
    /// Bytes of the file and of all buffers beside it.
    pub bytes: u64,
    /// Names of its scenes.
    pub scenes: Vec<String>,
    /// The scene that is shown if none is chosen.
    pub default_scene: Option<String>,
    /// Its animations.
    pub animations: Vec<AnimationInfo>,
    /// Names of the variants of its materials.
    pub variants: Vec<String>,
    /// Its materials.
    pub materials: Vec<MaterialInfo>,
    /// Its images.
    pub images: Vec<ImageInfo>,
    /// Its extensions.
    pub extensions: Extensions,
}

/// An animation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AnimationInfo {
    /// Its name, or its place in the file.
    pub name: String,
    /// Time of the first key, in seconds.
    pub start: f64,
    /// Time of the last key, in seconds.
    pub end: f64,
    /// How many properties it moves.
    pub channels: usize,
}

/// A material.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaterialInfo {
    /// Its name, or its place in the file.
    pub name: String,
    /// How its alpha is meant: `OPAQUE`, `MASK` or `BLEND`.
    pub alpha: String,
    /// Whether both sides of its surfaces are shown.
    pub double_sided: bool,
    /// The slots that hold a texture.
    pub textures: Vec<String>,
    /// Its extensions.
    pub extensions: Vec<String>,
}

/// An image.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageInfo {
    /// Its name, or its place in the file.
    pub name: String,
    /// Its format by its first bytes, for instance `png`; `unknown` where that cannot be told.
    pub format: &'static str,
    /// Columns and rows; `None` where they cannot be told.
    pub size: Option<[u32; 2]>,
    /// Bytes as packed in the file.
    pub bytes: u64,
    /// Why it cannot be read, if so.
    pub problem: Option<String>,
}

/// The extensions of a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Extensions {
    /// Those that it names.
    pub used: Vec<String>,
    /// Those without which it must not be read.
    pub required: Vec<String>,
    /// Those of the used ones that are not supported here: ignored, or the reason to refuse the
    /// file if they are required.
    pub ignored: Vec<String>,
}

/// The extensions of the file at `path`, of which nothing but its JSON need be readable.
///
/// # Errors
/// [`Error::File`](crate::error::Error::File) if it cannot be read,
/// [`Error::Scene`](crate::error::Error::Scene) if it is no JSON, or its lists are no lists of names.
pub fn extensions(path: &Path) -> Result<Extensions> {
    let list = |json| named(&Cursor::root(&json));
    container::json(path)
        .and_then(list)
        .map_err(|p| p.into_error(path))
}

/// Tells what the file at `path` holds, also if it requires what is not supported.
///
/// # Errors
/// As those of [`load`](super::load), as far as they concern what is told.
pub fn inventory(path: &Path) -> Result<Inventory> {
    tell(path).map_err(|p| p.into_error(path))
}

fn tell(path: &Path) -> Result<Inventory, Problem> {
    let document = container::open(path, |_| Ok(()))?;
    let root = Cursor::root(&document.json);
    let source = Source::new(root.clone(), &document.buffers, document.size);
    let names = |list: Vec<Cursor<'_>>| list.iter().map(Cursor::name).collect::<Vec<_>>();
    let scenes = names(root.items("scenes")?);
    let default_scene = match root.get("scene") {
        Some(at) => scenes.get(at.index()?).cloned(),
        None => scenes.first().cloned(),
    };
    let generator = root.get("asset").and_then(|a| a.get("generator"));
    let variants = match root.extension("KHR_materials_variants") {
        Some(e) => names(e.items("variants")?),
        None => Vec::new(),
    };
    let mut animations = Vec::new();
    for a in root.items("animations")? {
        animations.push(animation(&a, &source)?);
    }
    let mut images = Vec::new();
    for i in root.items("images")? {
        images.push(picture(&i, &source, &document.uris));
    }
    Ok(Inventory {
        generator: generator.and_then(|g| g.str().ok().map(str::to_owned)),
        bytes: document.size as u64,
        scenes,
        default_scene,
        animations,
        variants,
        materials: root.items("materials")?.iter().map(material).collect(),
        images,
        extensions: named(&root)?,
    })
}

fn named(root: &Cursor<'_>) -> Result<Extensions, Problem> {
    let list = |key: &str| -> Result<Vec<String>, Problem> {
        let items = root.items(key)?;
        items.iter().map(|e| e.str().map(str::to_owned)).collect()
    };
    let (mut used, required) = (list("extensionsUsed")?, list("extensionsRequired")?);
    // What is required must be listed as used, which some files forget.
    let unlisted = required.iter().filter(|e| !used.contains(*e));
    let unlisted: Vec<String> = unlisted.cloned().collect();
    used.extend(unlisted);
    let ignored = used
        .iter()
        .filter(|e| !SUPPORTED.contains(&e.as_str()))
        .cloned()
        .collect();
    Ok(Extensions {
        used,
        required,
        ignored,
    })
}

fn animation<'a>(a: &Cursor<'a>, source: &Source<'a>) -> Result<AnimationInfo, Problem> {
    let (mut start, mut end) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut seen = HashSet::new();
    for sampler in a.items("samplers")? {
        let input = sampler.need("input")?;
        // Most samplers of an animation share their times.
        if !seen.insert(input.index()?) {
            continue;
        }
        let accessor = source.accessor(&input)?;
        let Some(last) = accessor.count.checked_sub(1) else {
            continue;
        };
        let last = u32::try_from(last).map_err(|_| input.problem("has too many keys"))?;
        let ends: &[u32] = if last == 0 { &[0] } else { &[0, last] };
        for [t] in source.floats::<1>(&accessor, Some(ends))? {
            start = start.min(f64::from(t));
            end = end.max(f64::from(t));
        }
    }
    if !(start.is_finite() && end.is_finite()) {
        (start, end) = (0.0, 0.0);
    }
    Ok(AnimationInfo {
        name: a.name(),
        start,
        end,
        channels: a.items("channels")?.len(),
    })
}

fn material(m: &Cursor<'_>) -> MaterialInfo {
    let mut textures = Vec::new();
    slots(m.value(), &mut textures);
    let extensions = m.get("extensions").and_then(|e| e.value().as_object());
    let alpha = m.get("alphaMode").and_then(|a| a.value().as_str());
    MaterialInfo {
        name: m.name(),
        alpha: alpha.unwrap_or("OPAQUE").to_owned(),
        double_sided: m.flag("doubleSided"),
        textures,
        extensions: extensions
            .map(|e| e.keys().cloned().collect())
            .unwrap_or_default(),
    }
}

/// The texture slots that are filled, at any depth: `baseColorTexture` is `baseColor`.
fn slots(v: &Value, out: &mut Vec<String>) {
    for (key, value) in v.as_object().into_iter().flatten() {
        match key.strip_suffix("Texture") {
            Some(slot) if value.get("index").is_some() => out.push(slot.to_owned()),
            _ => slots(value, out),
        }
    }
}

/// An image, told by its header. One that cannot be read is told as such: whether it matters is
/// another question.
fn picture<'a>(i: &Cursor<'a>, source: &Source<'a>, uris: &Uris) -> ImageInfo {
    let mut out = ImageInfo {
        name: title(i),
        format: "unknown",
        size: None,
        bytes: 0,
        problem: None,
    };
    let bytes = match (i.get("uri"), i.get("bufferView")) {
        (Some(uri), _) => uris.read(&uri).map(Bytes::Owned),
        (None, Some(view)) => source.views.bytes(&view),
        (None, None) => Err(i.problem("has neither a URI nor a buffer view")),
    };
    match bytes {
        Ok(bytes) => {
            out.bytes = bytes.len() as u64;
            (out.format, out.size) = image::header(&bytes);
        }
        Err(p) => out.problem = Some(format!("{}: {}", p.place, p.problem)),
    }
    out
}

/// The name of an image, or that of its file.
fn title(i: &Cursor<'_>) -> String {
    let uri = i.get("uri").and_then(|u| u.value().as_str());
    match uri.filter(|u| !u.starts_with("data:")) {
        Some(uri) if i.get("name").is_none() => uri.to_owned(),
        _ => i.name(),
    }
}
