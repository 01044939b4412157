//! A picture as what is measured of it: the whole and its components.

use crate::film::{Component, Image};

/// Names of the layers: the whole, then the components.
pub(super) fn names() -> Vec<&'static str> {
    let mut all = vec![""];
    all.extend(Component::ALL.map(Component::name));
    all
}

/// The pixels of some layers: the whole, then the components in the order of [`Component::ALL`].
#[derive(Clone, Debug)]
pub struct Layers {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixels of each layer; `None` for one that the file does not have.
    pub pixels: Vec<Option<Vec<[f32; 3]>>>,
}

impl Layers {
    /// Takes them from an image; `None` without a colour image.
    pub fn new(image: &Image) -> Option<Self> {
        image.rgb("")?;
        Some(Self {
            width: image.width,
            height: image.height,
            pixels: names().into_iter().map(|n| image.rgb(n)).collect(),
        })
    }

    /// The whole picture.
    pub fn beauty(&self) -> &[[f32; 3]] {
        self.pixels[0].as_deref().unwrap_or_default()
    }
}

/// Mean and variance of every value over independent pictures (Welford 1962).
#[derive(Clone, Debug)]
pub(super) struct Moments {
    /// Pictures so far.
    pub(super) count: u32,
    mean: Vec<Vec<[f64; 3]>>,
    squares: Vec<Vec<[f64; 3]>>,
}

impl Moments {
    /// Of pictures of so many pixels.
    pub(super) fn new(pixels: usize) -> Self {
        let zero = vec![vec![[0.0; 3]; pixels]; names().len()];
        Self {
            count: 0,
            mean: zero.clone(),
            squares: zero,
        }
    }

    /// Adds a picture; a layer that it lacks counts as black.
    pub(super) fn add(&mut self, layers: &Layers) {
        self.count += 1;
        let n = f64::from(self.count);
        for (k, pixels) in layers.pixels.iter().enumerate() {
            for (i, p) in pixels.iter().flatten().enumerate() {
                for (c, &v) in p.iter().enumerate() {
                    let d = f64::from(v) - self.mean[k][i][c];
                    self.mean[k][i][c] += d / n;
                    self.squares[k][i][c] += d * (f64::from(v) - self.mean[k][i][c]);
                }
            }
        }
    }

    /// The mean of a layer.
    pub(super) fn mean(&self, layer: usize) -> &[[f64; 3]] {
        &self.mean[layer]
    }

    /// The mean picture.
    pub(super) fn mean_layers(&self, width: u32, height: u32) -> Layers {
        let single = |v: &Vec<[f64; 3]>| v.iter().map(|p| p.map(|x| x as f32)).collect();
        Layers {
            width,
            height,
            pixels: self.mean.iter().map(|v| Some(single(v))).collect(),
        }
    }

    /// Mean over pixels and channels of the variance of one picture, over `reference² + ε`:
    /// the noise in the measure of relative squared errors. 0 of a single picture.
    pub(super) fn noise(&self, layer: usize, scale: &Scale) -> f64 {
        if self.count < 2 {
            return 0.0;
        }
        let variance = |i: usize, c: usize| self.squares[layer][i][c] / f64::from(self.count - 1);
        scale.mean(variance)
    }
}

/// What squared errors are divided by: the whole reference squared, plus a little.
///
/// Errors of components are divided by the same, so that they tell what they do to the picture.
#[derive(Clone, Debug)]
pub(super) struct Scale {
    inverse: Vec<[f64; 3]>,
}

impl Scale {
    /// By this reference.
    pub(super) fn new(reference: &[[f32; 3]]) -> Self {
        let one = |v: f32| 1.0 / (f64::from(v).powi(2) + super::super::diff::EPSILON);
        Self {
            inverse: reference.iter().map(|p| p.map(one)).collect(),
        }
    }

    /// Mean over pixels and channels of squares, each divided; what is not finite is left out.
    pub(super) fn mean(&self, square: impl Fn(usize, usize) -> f64) -> f64 {
        let (mut sum, mut n) = (0.0, 0_u64);
        for (i, inverse) in self.inverse.iter().enumerate() {
            for (c, w) in inverse.iter().enumerate() {
                let v = square(i, c) * w;
                if v.is_finite() {
                    sum += v;
                    n += 1;
                }
            }
        }
        sum / n.max(1) as f64
    }

    /// The relative mean squared difference of two pictures.
    pub(super) fn rel_mse(&self, a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
        self.mean(|i, c| (f64::from(a[i][c]) - f64::from(b[i][c])).powi(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(v: f32) -> Layers {
        let mut pixels = vec![None; names().len()];
        pixels[0] = Some(vec![[v; 3]; 2]);
        Layers {
            width: 2,
            height: 1,
            pixels,
        }
    }

    #[test]
    fn moments_are_those_of_textbooks() {
        let mut m = Moments::new(2);
        for v in [1.0, 2.0, 4.0, 5.0] {
            m.add(&picture(v));
        }
        let scale = Scale::new(&[[3.0; 3]; 2]);
        assert_eq!(m.mean(0)[1], [3.0; 3]);
        // (4 + 1 + 1 + 4) / 3.
        assert!((m.noise(0, &scale) - 10.0 / 3.0 / 9.01).abs() < 1e-12);
        assert_eq!(m.noise(1, &scale), 0.0);
        let (a, b) = (picture(1.0), picture(3.0));
        assert!((scale.rel_mse(a.beauty(), b.beauty()) - 4.0 / 9.01).abs() < 1e-12);
    }
}
