//! The film: what pixels have gathered, as named layers. Knows radiance, nothing of scenes.

mod interpolation;
mod layer;
mod passes;
mod state;
#[cfg(test)]
mod tests;

pub use layer::{Channel, Image, Layer};

use crate::color::Rgb;
use crate::math::DVec3;

/// The parts of the radiance of a pixel; their sum is the beauty image.
///
/// A path is written from the camera E to the light L with D for a diffuse and S for any other
/// scattering.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// `E L` and `E D L`: what a light shows of itself, and lights directly.
    Direct,
    /// `E S …`: everything seen in mirrors and through glass.
    Specular,
    /// `E D S⁺ L`: light focused onto a diffuse surface.
    Caustics,
    /// `E D S* D …`: light that comes by way of another diffuse surface.
    Indirect,
}

impl Component {
    /// All of them, in the order of their indices.
    pub const ALL: [Self; 4] = [Self::Direct, Self::Specular, Self::Caustics, Self::Indirect];

    /// The layer's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Specular => "specular",
            Self::Caustics => "caustics",
            Self::Indirect => "indirect",
        }
    }
}

/// What one camera sample, or the mean of several, brought.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSample {
    /// Radiance by [`Component`], W/(m²·sr).
    pub radiance: [Rgb; 4],
    /// Share of samples that hit something.
    pub alpha: f64,
    /// Albedo of what is seen first.
    pub albedo: Rgb,
    /// Shading normal of what is seen first, world space.
    pub normal: DVec3,
    /// Position of what is seen first, in the file's coordinates.
    pub position: DVec3,
    /// Distance along the viewing ray in metres.
    pub depth: f64,
    /// Photons per square metre at the first diffuse surface: global, caustic.
    pub photons: [f64; 2],
}

impl PixelSample {
    /// Adds radiance to a component.
    #[inline]
    pub fn add(&mut self, component: Component, radiance: Rgb) {
        self.radiance[component as usize] += radiance;
    }

    /// Adds another sum of samples.
    pub fn merge(&mut self, o: &Self) {
        for (a, b) in self.radiance.iter_mut().zip(o.radiance) {
            *a += b;
        }
        self.alpha += o.alpha;
        self.albedo += o.albedo;
        self.normal += o.normal;
        self.position += o.position;
        self.depth += o.depth;
        for (a, b) in self.photons.iter_mut().zip(o.photons) {
            *a += b;
        }
    }

    /// Sum over the components.
    pub fn beauty(&self) -> Rgb {
        self.radiance.iter().copied().sum()
    }

    fn values(&self) -> [f32; VALUES] {
        let mut out = [0.0; VALUES];
        for (c, rgb) in self.radiance.iter().enumerate() {
            out[3 * c..3 * c + 3].copy_from_slice(&rgb.to_f32());
        }
        let ([n, p], [global, caustic]) = ([self.normal, self.position], self.photons);
        let a = self.albedo;
        let data = [
            a.r, a.g, a.b, n.x, n.y, n.z, p.x, p.y, p.z, self.depth, global, caustic, self.alpha,
        ];
        for (single, value) in out[DATA..].iter_mut().zip(data) {
            *single = largest(value as f32, value.is_finite());
        }
        out
    }
}

/// Values of a pixel: the radiance of each component, then data.
const VALUES: usize = 25;

/// The first of the values that are no radiance.
const DATA: usize = 12;

/// A number, but where a finite one has left single precision, the largest that this holds. In
/// scenes of 1e-17 m photons lie as dense as that, and in others places are as far from the origin:
/// the picture is as good there as any.
fn largest(value: f32, finite: bool) -> f32 {
    match finite {
        true => value.clamp(f32::MIN, f32::MAX),
        false => value,
    }
}

/// A rectangle of pixels and the sums over the samples that one pass took there.
#[derive(Clone, Debug)]
pub struct Tile {
    /// Left edge in pixels.
    pub x: u32,
    /// Upper edge in pixels.
    pub y: u32,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Sum of the samples of each pixel, row by row.
    pub sums: Vec<PixelSample>,
    /// Samples taken in each pixel.
    pub samples: u32,
}

/// Sums of samples per pixel.
#[derive(Clone, Debug)]
pub struct Film {
    width: u32,
    height: u32,
    sums: Vec<[f32; VALUES]>,
    counts: Vec<u32>,
    rejected: u64,
    /// Row and column, so that the smallest is the first.
    first_rejected: Option<[u32; 2]>,
    kept: [bool; 4],
    passes: Option<passes::Passes>,
    attached: Vec<Layer>,
    /// Indirect radiance of one half of each pixel's samples, summed, and how many they are.
    half: Vec<([f32; 3], u32)>,
    interpolated: Option<interpolation::Interpolated>,
}

impl Film {
    /// A black film.
    pub fn new(width: u32, height: u32) -> Self {
        let n = width as usize * height as usize;
        Self {
            width,
            height,
            sums: vec![[0.0; VALUES]; n],
            counts: vec![0; n],
            rejected: 0,
            first_rejected: None,
            kept: [true; 4],
            passes: None,
            attached: Vec::new(),
            half: Vec::new(),
            interpolated: None,
        }
    }

    /// Indirect radiance of both halves of the samples of each pixel, summed, and how many they
    /// are.
    fn halves(&self) -> impl Iterator<Item = [([f32; 3], u32); 2]> {
        let at = 3 * Component::Indirect as usize;
        let own = self.sums.iter().zip(&self.counts).enumerate();
        own.map(move |(i, (sums, all))| {
            let (half, n) = self.half.get(i).copied().unwrap_or_default();
            let rest = [0, 1, 2].map(|c| sums[at + c] - half[c]);
            [(half, n), (rest, all.saturating_sub(n))]
        })
    }

    /// Interpolates the indirect light of what was [added by halves](Self::add_halves), in all pixels
    /// without an edge: one flag a pixel, row by row. Images developed from now on show it.
    pub fn interpolate(&mut self, edges: &[bool]) {
        self.interpolated = None;
        self.interpolated = Some(interpolation::interpolate(self, edges));
    }

    /// How far around each pixel its indirect light was interpolated from, in pixels; 0 where it
    /// is the pixel's own. `None` if it was not interpolated.
    pub fn reach(&self) -> Option<&[f32]> {
        self.interpolated.as_ref().map(|i| i.reach.as_slice())
    }

    /// Develops with another layer, row by row as wide and high as the film, beside its own.
    pub fn attach(&mut self, layer: Layer) {
        self.attached.push(layer);
    }

    /// Keeps only these components of what is added from now on.
    pub fn keep(&mut self, components: &[Component]) {
        self.kept = Component::ALL.map(|c| components.contains(&c));
    }

    /// Keeps passes apart from now on, which tells the error of the image.
    pub fn count_passes(&mut self) {
        self.passes
            .get_or_insert_with(|| passes::Passes::new(self.counts.len()));
    }

    /// Ends a pass: what is added from now on is independent of what was added so far.
    pub fn finish_pass(&mut self) {
        if let Some(p) = &mut self.passes {
            p.finish(&self.sums, &self.counts);
        }
    }

    /// Finished passes.
    pub fn passes(&self) -> u32 {
        self.passes.as_ref().map_or(0, |p| p.finished)
    }

    /// Samples per pixel of the finished passes.
    pub fn finished_samples(&self) -> u32 {
        let Some(p) = &self.passes else {
            return 0;
        };
        let own = self.counts.iter().zip(&p.current);
        // A pixel that lacks some had a sum that was no number.
        own.map(|(all, (_, n))| all.saturating_sub(*n))
            .max()
            .unwrap_or(0)
    }

    /// Samples that a pixel has of the pass under way.
    pub fn samples_of_pass(&self, x: u32, y: u32) -> u32 {
        let i = y as usize * self.width as usize + x as usize;
        self.passes.as_ref().map_or(0, |p| p.current[i].1)
    }

    /// Estimated relative mean squared error, as far as passes differ; `None` before the second.
    pub fn estimated_error(&self) -> Option<f64> {
        let passes = self.passes.as_ref()?;
        passes.relative_error(&self.all_sums())
    }

    fn all_sums(&self) -> passes::Sums<'_> {
        passes::Sums {
            totals: &self.sums,
            counts: &self.counts,
            width: self.width as usize,
        }
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Sums of a pixel over a tile's samples that were left out, since they or the pixel's sum with
    /// them were not finite: a bug if ever above zero.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }

    /// The first pixel (column, row), row by row, of which a sum was left out.
    pub fn first_rejected(&self) -> Option<[u32; 2]> {
        self.first_rejected.map(|[row, column]| [column, row])
    }

    /// Adds the samples of a tile.
    pub fn add(&mut self, tile: &Tile) {
        for (k, sum) in tile.sums.iter().enumerate() {
            let (dx, dy) = (k as u32 % tile.width, k as u32 / tile.width);
            self.add_pixel([tile.x + dx, tile.y + dy], sum, tile.samples);
        }
    }

    /// Adds the samples of one pixel by halves, each with its sum and number: what
    /// [`interpolate`](Self::interpolate) goes by.
    pub fn add_halves(&mut self, at: [u32; 2], [(mut sum, n), (rest, m)]: [(PixelSample, u32); 2]) {
        let indirect = sum.radiance[Component::Indirect as usize].to_f32();
        sum.merge(&rest);
        if self.add_pixel(at, &sum, n + m) {
            self.half.resize(self.counts.len(), Default::default());
            let (half, samples) =
                &mut self.half[self.width as usize * at[1] as usize + at[0] as usize];
            for (a, v) in half.iter_mut().zip(indirect) {
                *a += v;
            }
            *samples += n;
        }
    }

    /// Whether the sum of a pixel was finite and was added.
    fn add_pixel(&mut self, [x, y]: [u32; 2], sum: &PixelSample, samples: u32) -> bool {
        let i = y as usize * self.width as usize + x as usize;
        let mut values = sum.values();
        for (k, kept) in self.kept.into_iter().enumerate() {
            if !kept {
                values[3 * k..3 * k + 3].fill(0.0);
            }
        }
        let mut with = self.sums[i];
        for (a, v) in with.iter_mut().zip(values) {
            *a += v;
        }
        for (a, v) in with.iter_mut().zip(values).skip(DATA) {
            *a = largest(*a, v.is_finite());
        }
        let finite = with.iter().all(|v| v.is_finite());
        if finite {
            self.sums[i] = with;
            self.counts[i] += samples;
            if let Some(p) = &mut self.passes {
                p.add(i, &values, samples);
            }
        } else {
            self.rejected += 1;
            let at = [y, x];
            self.first_rejected = Some(self.first_rejected.map_or(at, |first| first.min(at)));
        }
        finite
    }

    /// Smallest and largest number of samples of a pixel.
    pub fn sample_range(&self) -> (u32, u32) {
        let lo = self.counts.iter().copied().min().unwrap_or(0);
        (lo, self.counts.iter().copied().max().unwrap_or(0))
    }

    /// Samples taken in each pixel, row by row.
    pub fn samples(&self) -> &[u32] {
        &self.counts
    }

    /// The developed image: means per pixel, as layers.
    pub fn develop(&self) -> Image {
        let channel = |name: &str, half: bool, f: &dyn Fn(&[f32; VALUES]) -> f32| Channel {
            name: name.into(),
            half,
            data: self
                .sums
                .iter()
                .zip(&self.counts)
                .map(|(s, &n)| if n == 0 { 0.0 } else { f(s) / n as f32 })
                .collect(),
        };
        let rgb = |name: &str, f: &dyn Fn(&[f32; VALUES], usize) -> f32| Layer {
            name: name.into(),
            channels: ["R", "G", "B"]
                .iter()
                .enumerate()
                .map(|(c, n)| channel(n, true, &|s| f(s, c)))
                .collect(),
        };
        let mut beauty = rgb("", &|s, c| passes::beauty(s)[c]);
        beauty.channels.push(channel("A", true, &|s| s[24]));
        let mut layers = vec![beauty];
        for (k, component) in Component::ALL.into_iter().enumerate() {
            layers.push(rgb(component.name(), &|s, c| s[3 * k + c]));
        }
        if let Some(i) = &self.interpolated {
            let indirect = 1 + Component::Indirect as usize;
            let own = i.radiance.iter().enumerate();
            for (pixel, radiance) in own.filter_map(|(k, r)| Some((k, (*r)?))) {
                for (c, new) in radiance.into_iter().enumerate() {
                    layers[indirect].channels[c].data[pixel] = new;
                    let parts = layers[1..=indirect].iter();
                    let sum = parts.map(|l| l.channels[c].data[pixel]).sum();
                    layers[0].channels[c].data[pixel] = sum;
                }
            }
        }
        layers.push(rgb("albedo", &|s, c| s[12 + c]));
        let xyz = |name: &str, at: usize| Layer {
            name: name.into(),
            channels: ["X", "Y", "Z"]
                .iter()
                .enumerate()
                .map(|(c, n)| channel(n, false, &|s| s[at + c]))
                .collect(),
        };
        layers.push(xyz("N", 15));
        layers.push(xyz("P", 18));
        layers.push(Layer {
            name: String::new(),
            channels: vec![channel("Z", false, &|s| s[21])],
        });
        layers.push(Layer {
            name: "photons".into(),
            channels: vec![
                channel("global", false, &|s| s[22]),
                channel("caustic", false, &|s| s[23]),
            ],
        });
        let passes = self.passes.as_ref();
        let half_widths = passes.and_then(|p| p.half_widths(&self.all_sums()));
        layers.extend(half_widths.map(|w| {
            Layer {
                name: "error".into(),
                channels: ["R", "G", "B"]
                    .iter()
                    .enumerate()
                    .map(|(c, name)| Channel {
                        name: (*name).into(),
                        half: false,
                        data: w.iter().map(|v| v[c]).collect(),
                    })
                    .collect(),
            }
        }));
        layers.extend(self.attached.iter().cloned());
        Image {
            width: self.width,
            height: self.height,
            layers,
        }
    }
}
