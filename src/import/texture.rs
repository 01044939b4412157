//! Textures: an image, how it is looked up, and where it lies on the surface.

use super::image::Images;
use super::json::Cursor;
use super::{Notes, Problem};
use crate::textures::{Content, Filter, Sampler, Texture, UvTransform, Wrap};

/// Reads a `textureInfo` (glTF 2.0, 5.30), for instance the `baseColorTexture` of a material,
/// with its sampler and `KHR_texture_transform`. `content` says what the slot holds: colour is
/// sRGB and everything else is not, whatever the image says. `None`, with a note, if the texture
/// has no image in a format that can be read.
///
/// Before [`Images::decode`] the texture has a placeholder for its image.
pub(super) fn read<'a>(
    info: &Cursor<'a>,
    content: Content,
    images: &mut Images<'a>,
    notes: &mut Notes,
) -> Result<Option<Texture>, Problem> {
    let index = info.need("index")?;
    let texture = images.root().element("textures", index.index()?, &index)?;
    let Some(at) = source(&texture) else {
        notes.add(
            "textures without an image that could be read are ignored: their factors alone are used",
            1,
        );
        return Ok(None);
    };
    let Some(image) = images.get(&at, notes)? else {
        return Ok(None);
    };
    let sampler = match texture.get("sampler") {
        Some(at) => sampler(&images.root().element("samplers", at.index()?, &at)?)?,
        None => Sampler::default(),
    };
    let mut uv_set = info.index_or("texCoord", 0)?;
    let mut transform = None;
    if let Some(e) = info.extension("KHR_texture_transform") {
        uv_set = e.index_or("texCoord", uv_set)?;
        let map = UvTransform::new(
            e.numbers_or("offset", [0.0; 2])?,
            e.number_or("rotation", 0.0)?,
            e.numbers_or("scale", [1.0; 2])?,
        );
        transform = (map != UvTransform::IDENTITY).then_some(map);
    }
    Ok(Some(Texture {
        image,
        content,
        sampler,
        uv_set,
        transform,
    }))
}

/// Where the index of the texture's image stands. An extension's image goes before the plain
/// one, which is there for readers that do not know the extension.
fn source<'a>(texture: &Cursor<'a>) -> Option<Cursor<'a>> {
    ["KHR_texture_basisu", "EXT_texture_webp"]
        .into_iter()
        .filter(|name| super::SUPPORTED.contains(name))
        .find_map(|name| texture.extension(name)?.get("source"))
        .or_else(|| texture.get("source"))
}

/// Reads a sampler (glTF 2.0, 5.26). The filter for minification says how much a rasteriser may
/// save; here a texture that is seen from afar is always averaged over the area seen.
fn sampler(s: &Cursor<'_>) -> Result<Sampler, Problem> {
    let wrap = |key: &str| match s.get(key) {
        None => Ok(Wrap::Repeat),
        Some(c) => match c.index()? {
            10497 => Ok(Wrap::Repeat),
            33071 => Ok(Wrap::Clamp),
            33648 => Ok(Wrap::Mirror),
            other => Err(c.problem(format!("{other} is not a wrapping mode"))),
        },
    };
    if let Some(c) = s.get("minFilter") {
        match c.index()? {
            9728 | 9729 | 9984..=9987 => {}
            other => return Err(c.problem(format!("{other} is not a filter"))),
        }
    }
    Ok(Sampler {
        wrap_u: wrap("wrapS")?,
        wrap_v: wrap("wrapT")?,
        filter: match s.get("magFilter") {
            None => Filter::Linear,
            Some(c) => match c.index()? {
                9728 => Filter::Nearest,
                9729 => Filter::Linear,
                other => return Err(c.problem(format!("{other} is not a filter"))),
            },
        },
    })
}

#[cfg(test)]
mod tests;
