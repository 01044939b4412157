//! Light from all around as `EXT_lights_image_based` gives it: a cube map with its blurred sizes,
//! and spherical harmonics of the irradiance, both for renderers that cannot integrate. Here the
//! sharp cube is the sky, and what it sheds on a surface follows from it.

use std::f64::consts::PI;
use std::sync::Arc;

use super::image::Images;
use super::json::Cursor;
use super::{Notes, Problem};
use crate::color::Rgb;
use crate::lights::{CubeMap, LightDesc};
use crate::math::DQuat;
use crate::textures::{Content, Image};

/// The name of the extension.
pub(super) const NAME: &str = "EXT_lights_image_based";

/// The first spherical harmonic, √(1/4π), which is the same everywhere.
const Y00: f64 = 0.282_094_791_773_878_14;

/// Most texels along an edge of the cube: its faces become floating point, 1.2 GB for these, even if
/// one flat image of a few kilobytes is all six.
const MOST: usize = 4096;

/// How far the irradiance may be from that of the images before the user is told: they are of
/// 8 bits, and exporters integrate coarsely.
const ALIKE: f64 = 0.1;

/// The light that a scene refers to.
fn light_of<'a>(scene: &Cursor<'a>, root: &Cursor<'a>) -> Result<Option<Cursor<'a>>, Problem> {
    let Some(e) = scene.extension(NAME) else {
        return Ok(None);
    };
    let at = e.need("light")?;
    let lights = match root.extension(NAME) {
        Some(e) => e.items("lights")?,
        None => Vec::new(),
    };
    let light = lights.get(at.index()?).cloned();
    light
        .map(Some)
        .ok_or_else(|| at.problem("names an image-based light that does not exist"))
}

/// The six images of the sharp cube, with their places; `None` if one is in a format that cannot
/// be read.
fn faces<'a>(
    light: &Cursor<'a>,
    images: &mut Images<'a>,
    notes: &mut Notes,
) -> Result<Option<Vec<(Cursor<'a>, Arc<Image>)>>, Problem> {
    let size = light.need("specularImageSize")?;
    if size.index()? > MOST {
        return Err(Problem::unsupported(
            size.path(),
            format!("a cube of more than {MOST} texels along its edges takes gigabytes"),
            "make it smaller",
        ));
    }
    let sizes = light.need("specularImages")?;
    let sharp = sizes
        .elements()?
        .into_iter()
        .next()
        .ok_or_else(|| sizes.problem("is empty"))?;
    let places = sharp.elements()?;
    if places.len() != 6 {
        let text = format!("has {} images, a cube has 6 faces", places.len());
        return Err(sharp.problem(text));
    }
    let mut found = Vec::new();
    for at in places {
        match images.get(&at, notes)? {
            Some(image) => found.push((at, image)),
            None => return Ok(None),
        }
    }
    Ok(Some(found))
}

/// Says which images the scene's light needs, before they are decoded.
pub(super) fn want<'a>(
    scene: &Cursor<'a>,
    root: &Cursor<'a>,
    images: &mut Images<'a>,
) -> Result<(), Problem> {
    if let Some(light) = light_of(scene, root)? {
        faces(&light, images, &mut Notes::default())?;
    }
    Ok(())
}

/// The scene's image-based light, if it has one, its images decoded.
pub(super) fn of_scene<'a>(
    scene: &Cursor<'a>,
    root: &Cursor<'a>,
    images: &mut Images<'a>,
    notes: &mut Notes,
) -> Result<Option<LightDesc>, Problem> {
    let Some(light) = light_of(scene, root)? else {
        return Ok(None);
    };
    let Some(faces) = faces(&light, images, notes)? else {
        return Ok(None);
    };
    let size = light.need("specularImageSize")?;
    let n = u32::try_from(size.index()?).map_err(|_| size.problem("is too large"))?;
    let mut decoded = Vec::new();
    for (at, image) in &faces {
        if (image.width(), image.height()) != (n, n) {
            return Err(at.problem(format!(
                "is an image of {} × {} texels, not of {n} × {n} as 'specularImageSize' says",
                image.width(),
                image.height()
            )));
        }
        decoded.push(radiance(image));
    }
    let cube = <[_; 6]>::try_from(decoded)
        .ok()
        .and_then(|faces| CubeMap::new(n, faces))
        .ok_or_else(|| size.problem("is no size of an image"))?;
    compare(&light, &cube, notes)?;
    let intensity = light.number_or("intensity", 1.0)?;
    if intensity < 0.0 {
        return Err(light.problem(format!("intensity {intensity} is negative")));
    }
    let rotation = DQuat::from_array(light.numbers_or("rotation", [0.0, 0.0, 0.0, 1.0])?);
    if !(rotation.length() > 1e-6) {
        return Err(light.problem("rotation has no length"));
    }
    Ok(Some(LightDesc {
        kind: "environment",
        name: light.name(),
        strength: Rgb::splat(intensity),
        sky: Some(Arc::new(cube.to_sky().map_err(|e| light.problem(e))?)),
        rotation: rotation.normalize(),
        ..Default::default()
    }))
}

/// The radiance of an image. Alpha, where there is any, is the divisor of RGBD; colours are sRGB
/// as all colours of glTF are, since the extension says nothing else.
fn radiance(image: &Image) -> Vec<[f32; 3]> {
    // No divisor at all would be infinitely bright: the smallest of 8 bits stands for it.
    let least = 1.0 / 255.0;
    let rows = 0..image.height();
    rows.flat_map(|y| (0..image.width()).map(move |x| (x, y)))
        .map(|(x, y)| {
            let [r, g, b, d] = image.texel(x, y, Content::Color);
            [r, g, b].map(|c| (c / d.max(least)) as f32)
        })
        .collect()
}

/// Checks the coefficients, and tells if they speak of another light than the images.
fn compare(light: &Cursor<'_>, cube: &CubeMap, notes: &mut Notes) -> Result<(), Problem> {
    let at = light.need("irradianceCoefficients")?;
    let bands = at.elements()?;
    if bands.len() != 9 {
        return Err(at.problem(format!("has {} coefficients, not 9", bands.len())));
    }
    let mut first = None;
    for band in &bands {
        let values = band.elements()?;
        if values.len() != 3 {
            return Err(band.problem(format!("has {} numbers, not 3", values.len())));
        }
        let [r, g, b] = [values[0].f64()?, values[1].f64()?, values[2].f64()?];
        first.get_or_insert(Rgb::new(r, g, b));
    }
    // The mean irradiance over all normals is π times the mean radiance.
    let said = first.unwrap_or(Rgb::ZERO).luminance() * Y00;
    let [r, g, b] = cube.mean();
    let shed = Rgb::new(r, g, b).luminance() * PI;
    if (said - shed).abs() > ALIKE * shed.max(said) {
        notes.add(
            format!(
                "{}: its irradiance is {:.3} times that of its images, by which alone the light \
                 goes",
                light.path(),
                said / shed
            ),
            1,
        );
    }
    Ok(())
}
