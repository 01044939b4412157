//! Light from all around: images of the sky, and one colour.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::{ImageDecoder, ImageReader, Limits};

use super::json::Cursor;
use super::{Notes, Problem, extras};
use crate::color::Rgb;
use crate::error::{Error, Result};
use crate::lights::{LightDesc, SkyImage};
use crate::math::{DQuat, DVec3};

/// Most texels of an image of the sky: 32768 × 16384.
const MAX_TEXELS: u64 = 1 << 29;

/// An environment that was asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentOption {
    /// Where the light comes from.
    pub source: EnvironmentSource,
    /// What it is multiplied by.
    pub strength: f64,
    /// Its turn about the vertical axis in radians, counter-clockwise seen from above.
    pub rotation: f64,
    /// Whether camera rays see it.
    pub seen_by_camera: bool,
}

/// What an environment shows.
#[derive(Clone, Debug, PartialEq)]
pub enum EnvironmentSource {
    /// An image in equirectangular projection, `.hdr` or `.exr`.
    Image(PathBuf),
    /// The same radiance everywhere, W/(m²·sr).
    Color([f64; 3]),
}

impl EnvironmentOption {
    /// The light that it makes.
    ///
    /// # Errors
    /// An image that cannot be read.
    pub(super) fn light(&self) -> Result<LightDesc> {
        let (strength, sky, name) = match &self.source {
            EnvironmentSource::Color(c) => {
                (Rgb::new(c[0], c[1], c[2]), None, "environment".to_owned())
            }
            EnvironmentSource::Image(path) => {
                let sky = Arc::new(read(path)?);
                (Rgb::ONE, Some(sky), path.display().to_string())
            }
        };
        Ok(LightDesc {
            kind: "environment",
            name,
            strength: strength * self.strength,
            sky,
            rotation: DQuat::from_axis_angle(DVec3::Y, self.rotation),
            seen_by_camera: self.seen_by_camera,
            ..Default::default()
        })
    }
}

/// The environment that the extras of the glTF scene `scene` describe, if they do; images are
/// looked for beside the file `path`.
pub(super) fn of_scene(
    scene: &Cursor<'_>,
    path: &Path,
    notes: &mut Notes,
) -> Result<Option<EnvironmentOption>, Problem> {
    let ours = extras::of(scene, &["environment"], notes)?;
    let Some(e) = ours.and_then(|o| o.get("environment")) else {
        return Ok(None);
    };
    let names = ["color", "image", "strength", "rotation", "seen_by_camera"];
    extras::check(&e, &names, notes)?;
    let source = match (e.get("image"), extras::color(&e, "color")?) {
        (Some(image), None) => {
            let beside = path.parent().unwrap_or(Path::new(""));
            EnvironmentSource::Image(beside.join(image.str()?))
        }
        (None, Some(color)) => EnvironmentSource::Color(color),
        _ => return Err(e.problem("has not exactly one of 'image' and 'color'")),
    };
    Ok(Some(EnvironmentOption {
        source,
        strength: extras::number(&e, "strength", 0.0..=1e30, "a factor from 0")?.unwrap_or(1.0),
        rotation: e.number_or("rotation", 0.0)?,
        seen_by_camera: extras::flag(&e, "seen_by_camera")?.unwrap_or(true),
    }))
}

fn broken(path: &Path, problem: impl ToString) -> Error {
    Error::File {
        path: path.to_owned(),
        problem: problem.to_string(),
        remedy: "give an equirectangular image in Radiance .hdr or OpenEXR format".into(),
    }
}

/// Reads an image of the sky.
fn read(path: &Path) -> Result<SkyImage> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let image = match extension.to_ascii_lowercase().as_str() {
        "exr" => read_exr(path),
        "hdr" => read_hdr(path),
        other => Err(broken(path, format!("'{other}' is no format of the sky"))),
    }?;
    if image.width() != 2 * image.height() {
        // Not wrong, but rarely meant.
        return Err(broken(
            path,
            format!(
                "{} x {} texels are not twice as wide as high",
                image.width(),
                image.height()
            ),
        ));
    }
    Ok(image)
}

fn check(path: &Path, width: u64, height: u64) -> Result<()> {
    if width.saturating_mul(height) > MAX_TEXELS {
        return Err(broken(
            path,
            format!("{width} x {height} texels are too many"),
        ));
    }
    Ok(())
}

fn read_hdr(path: &Path) -> Result<SkyImage> {
    let mut reader = ImageReader::open(path).map_err(|e| broken(path, e))?;
    reader.set_format(image::ImageFormat::Hdr);
    reader.limits(Limits::no_limits());
    let decoder = reader.into_decoder().map_err(|e| broken(path, e))?;
    let (w, h) = decoder.dimensions();
    check(path, w.into(), h.into())?;
    let pixels = image::DynamicImage::from_decoder(decoder)
        .map_err(|e| broken(path, e))?
        .into_rgb32f();
    let texels = pixels.pixels().map(|p| p.0).collect();
    SkyImage::new(w, h, texels).map_err(|e| broken(path, e))
}

fn read_exr(path: &Path) -> Result<SkyImage> {
    use exr::prelude::*;
    let meta = MetaData::read_from_file(path, false).map_err(|e| broken(path, e))?;
    for header in &meta.headers {
        let size = header.layer_size;
        check(path, size.width() as u64, size.height() as u64)?;
    }
    let image = read_first_rgba_layer_from_file(
        path,
        |size, _| (size.width(), vec![[0f32; 3]; size.area()]),
        |(width, texels): &mut (usize, Vec<[f32; 3]>), at, (r, g, b, _): (f32, f32, f32, f32)| {
            texels[at.y() * *width + at.x()] = [r, g, b];
        },
    )
    .map_err(|e| broken(path, e))?;
    let size = image.layer_data.size;
    let (_, texels) = image.layer_data.channel_data.pixels;
    SkyImage::new(size.width() as u32, size.height() as u32, texels).map_err(|e| broken(path, e))
}
