//! `png`: what a display shows, 8 bits per channel in sRGB.
//!
//! Exposure scales, values outside `0..=1` are clamped; there is no other tone mapping, so equal
//! pixels mean equal radiance. Always opaque.

use std::io;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::{Metadata, OutputEntry, OutputSettings, Sink};
use crate::color::linear_to_srgb;
use crate::film::Image;

/// The sRGB bytes of the main layer, three per pixel, at the given exposure in stops.
pub(crate) fn display_bytes(pixels: &[[f32; 3]], exposure: f64) -> Vec<u8> {
    let scale = exposure.exp2();
    // A float-to-integer cast saturates and takes NaN to 0.
    let byte = |v: f32| (255.0 * linear_to_srgb(f64::from(v) * scale) + 0.5) as u8;
    pixels.iter().flatten().map(|&v| byte(v)).collect()
}

fn encode(
    image: &Image,
    settings: &OutputSettings,
    _metadata: &Metadata,
    sink: &mut dyn Sink,
) -> io::Result<()> {
    let pixels = image
        .rgb("")
        .ok_or_else(|| io::Error::other("the image has no main R, G, B layer"))?;
    PngEncoder::new(sink)
        .write_image(
            &display_bytes(&pixels, settings.exposure),
            image.width,
            image.height,
            ExtendedColorType::Rgb8,
        )
        .map_err(io::Error::other)
}

/// The registry's line.
pub(super) const ENTRY: OutputEntry = OutputEntry {
    name: "png",
    doc: "the beauty image in 8-bit sRGB at --exposure, clamped, opaque",
    extensions: &["png"],
    encode,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_follow_the_transfer_curve_and_clamp() {
        let px = [[0.0, 0.214_041_14, 1.0], [7.0, -1.0, f32::NAN]];
        assert_eq!(display_bytes(&px, 0.0), [0, 128, 255, 255, 0, 0]);
        // A stop doubles.
        assert_eq!(
            display_bytes(&[[0.1; 3]], 1.0),
            display_bytes(&[[0.2; 3]], 0.0)
        );
    }
}
