//! The film: what pixels have gathered, as named layers. Knows radiance, nothing of scenes.

mod interpolation;
mod layer;
mod passes;
mod state;

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
        out[12..15].copy_from_slice(&self.albedo.to_f32());
        out[15..18].copy_from_slice(&self.normal.as_vec3().to_array());
        out[18..21].copy_from_slice(&self.position.as_vec3().to_array());
        out[21] = self.depth as f32;
        out[22] = self.photons[0] as f32;
        out[23] = self.photons[1] as f32;
        out[24] = self.alpha as f32;
        out
    }
}

const VALUES: usize = 25;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_add_up_to_means_and_components_to_the_beauty() {
        let mut film = Film::new(3, 2);
        let mut s = PixelSample {
            alpha: 2.0,
            ..Default::default()
        };
        s.add(Component::Direct, Rgb::new(2.0, 4.0, 6.0));
        s.add(Component::Caustics, Rgb::splat(2.0));
        film.add(&Tile {
            x: 1,
            y: 1,
            width: 2,
            height: 1,
            sums: vec![s, s],
            samples: 2,
        });
        assert_eq!(film.sample_range(), (0, 2));
        let image = film.develop();
        assert_eq!(
            image.rgb(""),
            Some(
                [
                    [0.0; 3],
                    [0.0; 3],
                    [0.0; 3],
                    [0.0; 3],
                    [2.0, 3.0, 4.0],
                    [2.0, 3.0, 4.0]
                ]
                .to_vec()
            )
        );
        assert_eq!(image.rgb("caustics").map(|v| v[4]), Some([1.0; 3]));
    }

    fn tile_of(x: u32, y: u32, radiance: f64) -> Tile {
        let mut s = PixelSample::default();
        s.add(Component::Direct, Rgb::splat(radiance));
        Tile {
            x,
            y,
            width: 1,
            height: 1,
            sums: vec![s],
            samples: 1,
        }
    }

    #[test]
    fn a_sum_that_is_not_finite_is_left_out_and_counted() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e39] {
            let mut film = Film::new(1, 1);
            film.add(&tile_of(0, 0, bad));
            assert_eq!((film.rejected(), film.sample_range()), (1, (0, 0)), "{bad}");
            assert_eq!(film.first_rejected(), Some([0, 0]));
        }
    }

    #[test]
    fn a_pixel_whose_sum_would_overflow_keeps_what_it_has() {
        let mut film = Film::new(1, 1);
        film.add(&tile_of(0, 0, 3e38));
        film.add(&tile_of(0, 0, 3e38));
        assert_eq!((film.rejected(), film.sample_range()), (1, (1, 1)));
        let red = film.develop().rgb("direct").map(|v| v[0][0]);
        assert_eq!(red, Some(3e38));
    }

    #[test]
    fn the_first_pixel_left_out_does_not_depend_on_the_order_of_tiles() {
        let mut film = Film::new(3, 2);
        for [x, y] in [[0, 1], [2, 0], [1, 1]] {
            film.add(&tile_of(x, y, f64::NAN));
        }
        assert_eq!((film.rejected(), film.first_rejected()), (3, Some([2, 0])));
    }
}
