//! Pictures of where two images differ.

use super::diff::{Pair, relative_squared_error};
use crate::color::srgb_to_linear;
use crate::error::{Error, Result};
use crate::film::{Channel, Image, Layer};

/// What an error picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ErrorMap {
    /// Relative squared error.
    #[default]
    Relative,
    /// FLIP.
    Flip,
}

/// Dark to bright, readable in grey too; sRGB code values.
const RAMP: [[u8; 3]; 6] = [
    [0, 0, 4],
    [66, 10, 104],
    [147, 38, 103],
    [221, 81, 58],
    [252, 165, 10],
    [252, 255, 164],
];

/// Relative squared errors at the ends of the ramp: 1 % off and three times as much as it
/// should be.
const RANGE: (f64, f64) = (1e-4, 4.0);

/// Paints the differences of a pair: in false colours, or as the numbers themselves.
///
/// # Errors
/// [`Error::Usage`] if FLIP is asked for and this build knows none.
pub fn error_image(
    pair: &Pair,
    map: ErrorMap,
    exposure: f64,
    false_colours: bool,
) -> Result<Image> {
    // Each pixel as the numbers, and as a place on the ramp.
    let pixels: Vec<([f32; 3], f64)> = match map {
        ErrorMap::Relative => (pair.image.iter().zip(&pair.reference))
            .map(|(&a, &b)| {
                let e = relative_squared_error(a, b);
                (e.map(|v| v as f32), on_ramp(e.iter().sum::<f64>() / 3.0))
            })
            .collect(),
        ErrorMap::Flip => pair
            .flip(exposure)
            .ok_or_else(|| {
                Error::Usage(
                    "this build knows no FLIP; build with --features flip or leave out \
                     --error-map"
                        .into(),
                )
            })?
            .into_iter()
            .map(|v| ([v; 3], f64::from(v)))
            .collect(),
    };
    let value = |(numbers, place): &([f32; 3], f64), c: usize| match false_colours {
        true => ramp(*place)[c],
        false => numbers[c],
    };
    Ok(Image {
        width: pair.width,
        height: pair.height,
        layers: vec![Layer {
            name: String::new(),
            channels: ["R", "G", "B"]
                .iter()
                .enumerate()
                .map(|(c, name)| Channel {
                    name: (*name).into(),
                    half: false,
                    data: pixels.iter().map(|p| value(p, c)).collect(),
                })
                .collect(),
        }],
    })
}

/// Place of a relative squared error on the ramp, by its logarithm; what is not a number is at
/// the top.
fn on_ramp(e: f64) -> f64 {
    if e.is_nan() {
        return 1.0;
    }
    let (lo, hi) = RANGE;
    ((e.max(lo) / lo).ln() / (hi / lo).ln()).min(1.0)
}

/// Linear colour at a place in `0..=1`.
fn ramp(t: f64) -> [f32; 3] {
    let t = t.clamp(0.0, 1.0) * (RAMP.len() - 1) as f64;
    let i = (t as usize).min(RAMP.len() - 2);
    let f = t - i as f64;
    std::array::from_fn(|c| {
        let (a, b) = (f64::from(RAMP[i][c]), f64::from(RAMP[i + 1][c]));
        srgb_to_linear((a + (b - a) * f) / 255.0) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::display_bytes;

    fn pair() -> Pair {
        Pair {
            layer: String::new(),
            width: 3,
            height: 1,
            image: vec![[1.0; 3], [f32::NAN; 3], [3.0, 1.0, 1.0]],
            reference: vec![[1.0; 3]; 3],
        }
    }

    #[test]
    fn the_ramp_runs_from_dark_to_bright() {
        let picture = error_image(&pair(), ErrorMap::Relative, 0.0, true).unwrap();
        let bytes = display_bytes(&picture.rgb("").unwrap(), 0.0);
        assert_eq!(bytes[..3], RAMP[0]);
        assert_eq!(bytes[3..6], RAMP[5]);
        let sum = |c: [u8; 3]| c.iter().map(|&v| u32::from(v)).sum::<u32>();
        assert!(RAMP.is_sorted_by_key(|&c| sum(c)));
    }

    #[test]
    fn numbers_are_the_errors_themselves() {
        let picture = error_image(&pair(), ErrorMap::Relative, 0.0, false).unwrap();
        let p = picture.rgb("").unwrap()[2];
        assert!((p[0] - 4.0 / 1.01).abs() < 1e-6 && p[1] == 0.0);
    }
}
