//! `exr`: everything the film knows, in one part of an OpenEXR file.
//!
//! Layers are dotted channel names (`direct.R`) of a single part: the convention that Blender,
//! Nuke and OpenImageIO read alike. The beauty image has no layer name, so that viewers that
//! know no layers show it.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;

use exr::meta::attribute::Chromaticities;
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Compression, Encoding, FlatImage, FlatSamples,
    IntegerBounds, LayerAttributes, LineOrder, ReadChannels, ReadLayers, Text, Vec2, WritableImage,
    f16,
};

use super::{Metadata, OutputEntry, OutputSettings, Sink};
use crate::error::{Error, Result};
use crate::film::{Channel, Image, Layer};

/// Largest image that is read, in pixels: a broken header must not exhaust the memory.
const MAX_PIXELS: u64 = 1 << 28;

/// Below this, half precision is coarser than its eleven bits already at a thousandth of the
/// layer's largest value.
const HALF_FLOOR: f32 = 0.0625;

fn encode(
    image: &Image,
    _settings: &OutputSettings,
    metadata: &Metadata,
    sink: &mut dyn Sink,
) -> io::Result<()> {
    let list = image.layers.iter().flat_map(channels).collect();
    let mut attributes = LayerAttributes {
        software_name: Some(text(Metadata::SOFTWARE)),
        ..Default::default()
    };
    let mut own = |name: &str, value| attributes.other.insert(text(name), value);
    own(
        "commit",
        AttributeValue::Text(text(Metadata::COMMIT.unwrap_or("unknown"))),
    );
    own(
        "commandLine",
        AttributeValue::Text(text(&metadata.command_line)),
    );
    // OpenEXR has no 64-bit integer.
    own(
        "seed",
        AttributeValue::Text(text(&metadata.seed.to_string())),
    );
    own(
        "samplesPerPixel",
        AttributeValue::I32(i32::try_from(metadata.spp).unwrap_or(i32::MAX)),
    );
    own(
        "renderSeconds",
        AttributeValue::F64(metadata.render_seconds),
    );
    let layer = exr::prelude::Layer::new(
        (image.width as usize, image.height as usize),
        attributes,
        Encoding {
            compression: Compression::ZIP16,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        },
        AnyChannels::sort(list),
    );
    let mut file = exr::prelude::Image::from_layer(layer);
    // Rec.709 primaries and D65.
    file.attributes.chromaticities = Some(Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    });
    file.write().to_buffered(sink).map_err(io::Error::other)
}

/// The channels of a layer under their full names.
fn channels(layer: &Layer) -> impl Iterator<Item = AnyChannel<FlatSamples>> {
    let half = fits_half(layer);
    layer.channels.iter().map(move |c| {
        let name = match layer.name.as_str() {
            "" => c.name.clone(),
            layer => format!("{layer}.{}", c.name),
        };
        let samples = if c.half && half {
            FlatSamples::F16(c.data.iter().map(|&v| f16::from_f32(v)).collect())
        } else {
            FlatSamples::F32(c.data.clone())
        };
        AnyChannel::new(text(&name), samples)
    })
}

/// Whether the colours of a layer survive half precision. Radiance of the sun or of a
/// candle-lit room does not; such a layer is stored in full.
fn fits_half(layer: &Layer) -> bool {
    let max = layer
        .channels
        .iter()
        .filter(|c| c.half && c.name != "A")
        .flat_map(|c| &c.data)
        .fold(0.0_f32, |m, v| m.max(v.abs()));
    max == 0.0 || (HALF_FLOOR..=f16::MAX.to_f32()).contains(&max)
}

/// Text in UTF-8, which is how the official library's Python binding decodes it.
fn text(s: &str) -> Text {
    Text::from_bytes_unchecked(s.bytes().collect())
}

/// Reads an OpenEXR file of any flat kind: scan lines or tiles, half, float or integer, one or
/// several parts. Channels are grouped by what is before the last dot of their names; a part's
/// name comes before that, except for the first part with R, G and B, which is the main image.
/// Pixels of the display window that the file does not hold are black.
///
/// # Errors
/// [`Error::File`] for a file that is missing, no OpenEXR, damaged or deep.
pub fn read(path: &Path) -> Result<Image> {
    let broken = |problem: String| {
        Error::file(
            path,
            problem,
            "give a flat OpenEXR image, for instance one that dualight render wrote",
        )
    };
    let file = File::open(path).map_err(|e| {
        Error::file(
            path,
            format!("cannot be opened ({})", e.kind()),
            "check the name",
        )
    })?;
    let file: FlatImage = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(BufReader::new(file))
        .map_err(|e| broken(format!("is no readable OpenEXR image ({e})")))?;
    let window = file.attributes.display_window;
    let (width, height) = (window.size.0, window.size.1);
    if width == 0 || height == 0 || width as u64 * height as u64 > MAX_PIXELS {
        return Err(broken(format!("has an odd size of {width}x{height}")));
    }

    let mut main_taken = false;
    // By name; each layer's channels are in the order of the file.
    let mut layers: BTreeMap<String, Layer> = BTreeMap::new();
    for part in file.layer_data {
        let has = |n: &str| part.channel_data.list.iter().any(|c| c.name.eq(n));
        let is_main = !main_taken && has("R") && has("G") && has("B");
        main_taken |= is_main;
        let prefix = match &part.attributes.layer_name {
            Some(name) if !is_main => name.to_string(),
            _ => String::new(),
        };
        let bounds = part.absolute_bounds();
        for c in part.channel_data.list {
            if c.sampling != Vec2(1, 1) {
                return Err(broken(format!("channel {} is subsampled", c.name)));
            }
            let half = matches!(c.sample_data, FlatSamples::F16(_));
            let values: Vec<f32> = c.sample_data.values_as_f32().collect();
            let full = c.name.to_string();
            let (own, name) = full.rsplit_once('.').unwrap_or(("", &full));
            let layer = [prefix.as_str(), own]
                .iter()
                .filter(|s| !s.is_empty())
                .copied()
                .collect::<Vec<_>>()
                .join(".");
            layers
                .entry(layer.clone())
                .or_insert_with(|| Layer {
                    name: layer,
                    channels: Vec::new(),
                })
                .channels
                .push(Channel {
                    name: name.into(),
                    half,
                    data: place(values, bounds, window),
                });
        }
    }
    Ok(Image {
        width: width as u32,
        height: height as u32,
        layers: layers.into_values().collect(),
    })
}

/// The values of a data window within the display window.
fn place(values: Vec<f32>, data: IntegerBounds, display: IntegerBounds) -> Vec<f32> {
    if data == display {
        return values;
    }
    let at = |v: i32, origin: i32| i64::from(v) - i64::from(origin);
    let x0 = at(data.position.0, display.position.0);
    let y0 = at(data.position.1, display.position.1);
    let mut out = vec![0.0; display.size.area()];
    for (k, v) in values.into_iter().enumerate() {
        let x = x0 + (k % data.size.0) as i64;
        let y = y0 + (k / data.size.0) as i64;
        if (0..display.size.0 as i64).contains(&x) && (0..display.size.1 as i64).contains(&y) {
            out[y as usize * display.size.0 + x as usize] = v;
        }
    }
    out
}

/// The registry's line.
pub(super) const ENTRY: OutputEntry = OutputEntry {
    name: "exr",
    doc: "OpenEXR: beauty, components and data channels in one part, linear, ZIP-compressed",
    extensions: &["exr"],
    encode,
};

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(values: &[f32]) -> Layer {
        Layer {
            name: "direct".into(),
            channels: vec![Channel {
                name: "R".into(),
                half: true,
                data: values.to_vec(),
            }],
        }
    }

    #[test]
    fn half_is_used_where_it_suffices() {
        assert!(fits_half(&layer(&[0.0, 0.0])));
        assert!(fits_half(&layer(&[0.001, 65504.0])));
        assert!(!fits_half(&layer(&[0.5, 65505.0])));
        assert!(!fits_half(&layer(&[1e-4, 2e-6])));
    }

    #[test]
    fn a_data_window_is_placed_in_the_display_window() {
        let b = |x, y, w, h| IntegerBounds::new((x, y), (w, h));
        let out = place(vec![1.0, 2.0, 3.0, 4.0], b(4, 5, 2, 2), b(3, 5, 2, 3));
        assert_eq!(out, [0.0, 1.0, 0.0, 3.0, 0.0, 0.0]);
    }
}
