//! Radiance from infinity over the sphere of directions, with directions drawn in proportion
//! to it.

use std::f64::consts::{FRAC_1_PI, PI, TAU};
use std::sync::Arc;

use crate::color::Rgb;
use crate::math::DVec3;
use crate::sampling::Discrete;

/// Most rows of the grid that directions are drawn from.
const MOST_ROWS: u32 = 256;

/// An image of the sky in equirectangular projection: the row runs from the zenith (`+y`) down,
/// the column from `−x` by way of `−z`, `+x` and `+z` back to `−x`, so that the middle of the
/// image lies along `+x`, as Blender has it.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyImage {
    width: u32,
    height: u32,
    texels: Vec<[f32; 3]>,
}

impl SkyImage {
    /// An image of `width × height` texels of radiance, W/(m²·sr).
    ///
    /// # Errors
    /// A number of texels that does not fit, or a texel that is no radiance.
    pub fn new(width: u32, height: u32, texels: Vec<[f32; 3]>) -> Result<Self, String> {
        let n = u64::from(width) * u64::from(height);
        if n == 0 || n != texels.len() as u64 {
            return Err(format!(
                "{} texels are not {width} x {height}",
                texels.len()
            ));
        }
        let bad = |t: &[f32; 3]| t.iter().any(|c| !(0.0..=1e30).contains(c));
        if let Some(i) = texels.iter().position(bad) {
            let (x, y) = (i % width as usize, i / width as usize);
            return Err(format!(
                "the texel in column {x} of row {y} is negative, NaN or infinite"
            ));
        }
        Ok(Self {
            width,
            height,
            texels,
        })
    }

    /// Width in texels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in texels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Radiance of all texels, row by row.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    fn texel(&self, x: i64, y: i64) -> Rgb {
        let x = x.rem_euclid(i64::from(self.width)) as usize;
        let y = y.clamp(0, i64::from(self.height) - 1) as usize;
        self.texels[y * self.width as usize + x].into()
    }

    /// Radiance at image coordinates from 0 to 1, blended between texels.
    fn at(&self, u: f64, v: f64) -> Rgb {
        let x = u * f64::from(self.width) - 0.5;
        let y = v * f64::from(self.height) - 0.5;
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let (x, y) = (x.floor() as i64, y.floor() as i64);
        let top = self.texel(x, y) * (1.0 - fx) + self.texel(x + 1, y) * fx;
        let bottom = self.texel(x, y + 1) * (1.0 - fx) + self.texel(x + 1, y + 1) * fx;
        top * (1.0 - fy) + bottom * fy
    }
}

/// Image coordinates of a unit direction.
fn coordinates(d: DVec3) -> (f64, f64) {
    let u = d.z.atan2(d.x) / TAU + 0.5;
    let v = d.y.clamp(-1.0, 1.0).acos() * FRAC_1_PI;
    (u.clamp(0.0, 1.0), v)
}

/// The direction at image coordinates.
pub(super) fn direction(u: f64, v: f64) -> DVec3 {
    let (s, c) = ((u - 0.5) * TAU).sin_cos();
    let (sin, cos) = (v * PI).sin_cos();
    DVec3::new(sin * c, cos, sin * s)
}

/// Directions over a grid of the sphere, in proportion to what the sky sheds from them.
#[derive(Clone, Debug)]
pub(super) struct Sky {
    image: Arc<SkyImage>,
    columns: u32,
    rows: u32,
    row: Discrete,
    column: Vec<Discrete>,
    /// `∫ L dω`, W/m².
    pub(super) total: Rgb,
}

impl Sky {
    pub(super) fn new(image: Arc<SkyImage>) -> Self {
        let rows = image.height.min(MOST_ROWS);
        let columns = image.width.min(2 * MOST_ROWS);
        // A direction within a cell sees blends of all texels the cell touches and their
        // neighbours; the brightest mean of these bounds the cell from neither side, but is
        // positive wherever a blend is, which is all that unbiasedness asks for.
        let (w, h) = (i64::from(image.width), i64::from(image.height));
        let mut total = Rgb::ZERO;
        let mut column = Vec::with_capacity(rows as usize);
        let mut heights = Vec::with_capacity(rows as usize);
        for j in 0..i64::from(rows) {
            let span = |k: i64, n: u32, size: i64| {
                let n = i64::from(n);
                (k * size / n, ((k + 1) * size - 1) / n)
            };
            let (y0, y1) = span(j, rows, h);
            // Solid angle of a cell: Δφ (cos θ₀ − cos θ₁).
            let edge = |j: i64| (PI * j as f64 / f64::from(rows)).cos();
            let area = TAU / f64::from(columns) * (edge(j) - edge(j + 1));
            let mut weights = Vec::with_capacity(columns as usize);
            for i in 0..i64::from(columns) {
                let (x0, x1) = span(i, columns, w);
                let (mut mean, mut around, mut n) = (Rgb::ZERO, 0.0, 0.0);
                for y in y0 - 1..=y1 + 1 {
                    for x in x0 - 1..=x1 + 1 {
                        let t = image.texel(x, y);
                        around += t.luminance();
                        if (x0..=x1).contains(&x) && (y0..=y1).contains(&y) {
                            mean += t;
                            n += 1.0;
                        }
                    }
                }
                let mean = mean / n;
                total += mean * area;
                let count = ((x1 - x0 + 3) * (y1 - y0 + 3)) as f64;
                weights.push((0.5 * mean.luminance() + 0.5 * around / count) * area);
            }
            let d = Discrete::new(weights);
            heights.push(d.total());
            column.push(d);
        }
        Self {
            row: Discrete::new(heights),
            column,
            columns,
            rows,
            image,
            total,
        }
    }

    pub(super) fn radiance(&self, d: DVec3) -> Rgb {
        let (u, v) = coordinates(d);
        self.image.at(u, v)
    }

    /// A direction, and its density in solid angle.
    pub(super) fn sample(&self, u: [f64; 2]) -> Option<(DVec3, f64)> {
        let (j, pj, y) = self.row.sample(u[0])?;
        let (i, pi, x) = self.column[j].sample(u[1])?;
        // Uniform in the cosine within the row.
        let edge = |j: usize| (PI * j as f64 / f64::from(self.rows)).cos();
        let (c0, c1) = (edge(j), edge(j + 1));
        let cos = c0 + (c1 - c0) * y;
        let v = cos.clamp(-1.0, 1.0).acos() * FRAC_1_PI;
        let d = direction((i as f64 + x) / f64::from(self.columns), v);
        Some((d, pj * pi * f64::from(self.columns) / (TAU * (c0 - c1))))
    }

    /// The density of [`sample`](Self::sample).
    pub(super) fn pdf(&self, d: DVec3) -> f64 {
        if self.row.is_empty() {
            return 0.0;
        }
        let (u, v) = coordinates(d);
        let j = ((v * f64::from(self.rows)) as usize).min(self.rows as usize - 1);
        let i = ((u * f64::from(self.columns)) as usize).min(self.columns as usize - 1);
        let column = &self.column[j];
        if column.is_empty() {
            return 0.0;
        }
        let edge = |j: usize| (PI * j as f64 / f64::from(self.rows)).cos();
        let p = self.row.probability(j) * column.probability(i);
        p * f64::from(self.columns) / (TAU * (edge(j) - edge(j + 1)))
    }
}
