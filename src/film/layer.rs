//! Named layers of an image, ready to be written.

/// One channel of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name within its layer: `R`, `X`, …
    pub name: String,
    /// Whether half precision suffices (colours; data is stored in full).
    pub half: bool,
    /// Values, row by row from the upper left.
    pub data: Vec<f32>,
}

/// Channels that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Name; empty for the main image.
    pub name: String,
    /// Its channels.
    pub channels: Vec<Channel>,
}

/// A developed image.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Layers; the first is the beauty image.
    pub layers: Vec<Layer>,
}

impl Image {
    /// The values of a channel named as in EXR: `layer.channel`, or `channel` in the main layer.
    pub fn channel(&self, layer: &str, channel: &str) -> Option<&[f32]> {
        self.layers
            .iter()
            .filter(|l| l.name == layer)
            .flat_map(|l| &l.channels)
            .find(|c| c.name == channel)
            .map(|c| c.data.as_slice())
    }

    /// The RGB triples of a layer.
    pub fn rgb(&self, layer: &str) -> Option<Vec<[f32; 3]>> {
        let c = |name| self.channel(layer, name);
        let (r, g, b) = (c("R")?, c("G")?, c("B")?);
        Some(
            r.iter()
                .zip(g)
                .zip(b)
                .map(|((&r, &g), &b)| [r, g, b])
                .collect(),
        )
    }
}
