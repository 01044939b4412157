//! How far an image is from a reference, in numbers.

use serde::Serialize;

use crate::error::{Error, Result};
use crate::film::Image;

/// Added to the squared reference, so that black pixels of the reference do not rule the mean.
pub(super) const EPSILON: f64 = 0.01;

/// One pixel in so many is left out of the trimmed mean.
const TRIM: usize = 1000;

/// Distances between an image and a reference, over pixels that are finite in both.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// Mean of the image, per channel.
    pub mean: [f64; 3],
    /// Mean of the reference, per channel.
    pub reference_mean: [f64; 3],
    /// Mean of the image over all channels, divided by that of the reference; `None` if the
    /// reference is black.
    pub mean_ratio: Option<f64>,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// Mean over pixels and channels of `(a − b)² / (b² + 0.01)`.
    pub rel_mse: f64,
    /// The same without the worst 0.1 % of the pixels.
    pub rel_mse_trimmed: f64,
    /// Largest difference of a channel.
    pub max_error: f64,
    /// Index of the pixel, row by row, with the largest difference.
    pub max_error_pixel: usize,
    /// Pixels that were left out because one of the two is not a finite number there.
    pub not_finite: usize,
    /// Mean FLIP of the two as a display shows them; `None` if this build knows no FLIP.
    pub flip: Option<f64>,
}

/// The relative squared error of each channel of a pixel.
pub fn relative_squared_error(a: [f32; 3], b: [f32; 3]) -> [f64; 3] {
    std::array::from_fn(|c| {
        let (a, b) = (f64::from(a[c]), f64::from(b[c]));
        (a - b).powi(2) / (b * b + EPSILON)
    })
}

/// Compares pixel by pixel; of slices of different lengths the longer one's rest is ignored.
/// Everything but FLIP, which needs to know neighbours.
pub fn compare(image: &[[f32; 3]], reference: &[[f32; 3]]) -> Comparison {
    let mut out = Comparison::default();
    let mut squares = 0.0;
    let mut relative = Vec::with_capacity(image.len());
    for (i, (&a, &b)) in image.iter().zip(reference).enumerate() {
        if !a.iter().chain(&b).all(|v| v.is_finite()) {
            out.not_finite += 1;
            continue;
        }
        for c in 0..3 {
            let (x, y) = (f64::from(a[c]), f64::from(b[c]));
            out.mean[c] += x;
            out.reference_mean[c] += y;
            squares += (x - y).powi(2);
            if (x - y).abs() > out.max_error {
                out.max_error = (x - y).abs();
                out.max_error_pixel = i;
            }
        }
        relative.push(relative_squared_error(a, b).iter().sum::<f64>() / 3.0);
    }
    let n = relative.len();
    if n == 0 {
        return out;
    }
    for m in out.mean.iter_mut().chain(&mut out.reference_mean) {
        *m /= n as f64;
    }
    let total: f64 = out.reference_mean.iter().sum();
    out.mean_ratio = (total != 0.0).then(|| out.mean.iter().sum::<f64>() / total);
    out.rmse = (squares / (3 * n) as f64).sqrt();
    // Summed from the smallest on, so that the two means are consistent.
    relative.sort_by(f64::total_cmp);
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    out.rel_mse = mean(&relative);
    out.rel_mse_trimmed = mean(&relative[..n - n / TRIM]);
    out
}

/// The pixels of one layer of two images of the same size.
#[derive(Clone, Debug)]
pub struct Pair {
    /// Name of the layer in the image.
    pub layer: String,
    /// Width of both in pixels.
    pub width: u32,
    /// Height of both in pixels.
    pub height: u32,
    /// The image.
    pub image: Vec<[f32; 3]>,
    /// The reference.
    pub reference: Vec<[f32; 3]>,
}

impl Pair {
    /// Takes layer `layer` of both, or, if `None`, of each its main colour layer.
    ///
    /// # Errors
    /// [`Error::Usage`] if the sizes differ or a layer is missing.
    pub fn new(image: &Image, reference: &Image, layer: Option<&str>) -> Result<Self> {
        if (image.width, image.height) != (reference.width, reference.height) {
            return Err(Error::Usage(format!(
                "the image is {}x{} and the reference {}x{}; render both with the same --size",
                image.width, image.height, reference.width, reference.height
            )));
        }
        let (name, a) = colours(image, layer, "image")?;
        let (_, b) = colours(reference, layer, "reference")?;
        Ok(Self {
            layer: name,
            width: image.width,
            height: image.height,
            image: a,
            reference: b,
        })
    }

    /// All distances; FLIP sees both at `exposure` stops.
    pub fn compare(&self, exposure: f64) -> Comparison {
        Comparison {
            flip: self
                .flip(exposure)
                .map(|map| map.iter().map(|&v| f64::from(v)).sum::<f64>() / map.len() as f64),
            ..compare(&self.image, &self.reference)
        }
    }

    /// FLIP of each pixel; `None` if this build knows no FLIP.
    pub fn flip(&self, exposure: f64) -> Option<Vec<f32>> {
        #[cfg(feature = "flip")]
        return Some(super::flip::map(self, exposure));
        #[cfg(not(feature = "flip"))]
        {
            let _ = exposure;
            None
        }
    }
}

/// The layer that was asked for, or the main image, or the first layer of colours.
fn colours(image: &Image, wish: Option<&str>, role: &str) -> Result<(String, Vec<[f32; 3]>)> {
    let mut known: Vec<&str> = Vec::new();
    for l in &image.layers {
        if !known.contains(&l.name.as_str()) && image.rgb(&l.name).is_some() {
            known.push(&l.name);
        }
    }
    let chosen = match wish {
        Some(name) => known.iter().find(|k| **k == name),
        None => known.iter().find(|k| k.is_empty()).or(known.first()),
    };
    chosen
        .and_then(|name| Some((name.to_string(), image.rgb(name)?)))
        .ok_or_else(|| {
            let named: Vec<&str> = known.iter().filter(|k| !k.is_empty()).copied().collect();
            Error::Usage(match (wish, named.is_empty()) {
                (None, _) => format!("the {role} has no channels R, G, B; give a colour image"),
                (Some(w), true) => format!(
                    "the {role} has no layer '{w}' and no other named one; leave out --layer"
                ),
                (Some(w), false) => {
                    format!("the {role} has no layer '{w}'; it has {}", named.join(", "))
                }
            })
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Channel, Layer};

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-12 * b.abs().max(1.0), "{a} ≠ {b}");
    }

    #[test]
    fn numbers_computed_by_hand() {
        // Pixel 0: equal. Pixel 1: off by 1, 0, −2 from (1, 2, 3).
        let a = [[0.5; 3], [2.0, 2.0, 1.0]];
        let b = [[0.5; 3], [1.0, 2.0, 3.0]];
        let c = compare(&a, &b);
        assert_eq!(c.mean, [1.25, 1.25, 0.75]);
        assert_eq!(c.reference_mean, [0.75, 1.25, 1.75]);
        close(c.mean_ratio.unwrap(), 3.25 / 3.75);
        close(c.rmse, (5.0_f64 / 6.0).sqrt());
        close(c.rel_mse, (1.0 / 1.01 + 4.0 / 9.01) / 6.0);
        close(c.rel_mse_trimmed, c.rel_mse);
        assert_eq!((c.max_error, c.max_error_pixel), (2.0, 1));
        assert_eq!(c.not_finite, 0);
    }

    #[test]
    fn the_worst_thousandth_is_left_out_of_the_trimmed_mean() {
        let b = vec![[1.0; 3]; 2000];
        let mut a = b.clone();
        a[7] = [1001.0; 3];
        a[8] = [11.0; 3];
        a[9] = [2.0; 3];
        let c = compare(&a, &b);
        close(c.rel_mse, (1e6 + 100.0 + 1.0) / 1.01 / 2000.0);
        close(c.rel_mse_trimmed, 1.0 / 1.01 / 1998.0);
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted_and_left_out() {
        let a = [[f32::NAN, 0.0, 0.0], [1.0; 3], [1.0; 3]];
        let b = [[1.0; 3], [1.0; 3], [f32::INFINITY; 3]];
        let c = compare(&a, &b);
        assert_eq!((c.not_finite, c.rmse, c.mean), (2, 0.0, [1.0; 3]));
        assert_eq!(compare(&[], &[]), Comparison::default());
    }

    #[test]
    fn a_black_reference_has_no_ratio() {
        assert_eq!(compare(&[[1.0; 3]], &[[0.0; 3]]).mean_ratio, None);
    }

    fn image(width: u32, layers: &[&str]) -> Image {
        Image {
            width,
            height: 1,
            layers: layers
                .iter()
                .map(|name| Layer {
                    name: (*name).into(),
                    channels: ["R", "G", "B"]
                        .map(|c| Channel {
                            name: c.into(),
                            half: false,
                            data: vec![1.0; width as usize],
                        })
                        .to_vec(),
                })
                .collect(),
        }
    }

    #[test]
    fn layers_are_found_and_misfits_named() {
        let a = image(2, &["Combined", "direct"]);
        assert_eq!(Pair::new(&a, &a, None).unwrap().layer, "Combined");
        assert_eq!(Pair::new(&a, &a, Some("direct")).unwrap().layer, "direct");
        let fail = |x: &Image, layer| Pair::new(x, &a, layer).unwrap_err().to_string();
        assert!(fail(&a, Some("z")).contains("it has Combined, direct"));
        assert!(fail(&image(3, &[""]), None).contains("3x1"));
        assert!(fail(&image(2, &[]), None).contains("no channels R, G, B"));
    }
}
