//! Indirect light interpolated where nothing changes: in pixels without an edge it comes from all
//! pixels around that see the same surface, not from their own samples alone.
//!
//! What is interpolated is irradiance (indirect light over albedo), which is smooth where the
//! picture is not. A plane fitted to the pixels around gives its value and its derivative. How far
//! around is decided by what that derivative cannot follow: by the error that windows of each size
//! make ([`windows`]), which is that of the noise they leave and of the bend they miss together. So
//! both vanish as samples are added.
//!
//! Each half of the samples is averaged over windows that were chosen by what windows over the
//! other half say: those that went by the means they make themselves would stop before a rare
//! bright sample, and its light would be lost, 1 % of all in the box by paths. (Two halves for the
//! same reason: Rousselle, Knaus and Zwicker, *Adaptive Rendering with Non-Local Means Filtering*,
//! ACM TOG 31(6), 2012.)
//!
//! Local planes in rendering: Moon, Carr and Yoon, *Adaptive Rendering Based on Weighted Local
//! Regression*, ACM TOG 33(5), 2014.

mod fit;
mod windows;

use arrayvec::ArrayVec;
use rayon::prelude::*;

use self::fit::{Moments, Normal};
use super::Film;

/// Half widths of the windows, in pixels.
const REACHES: [i32; 7] = [0, 1, 2, 3, 5, 8, 12];

/// Least cosine between the normals of pixels that see one surface.
const AGREEMENT: f32 = 0.9;

/// Least albedo that light can be divided by.
const DARKEST: f32 = 1e-3;

/// What became of the indirect light of a film.
#[derive(Clone, Debug)]
pub(super) struct Interpolated {
    /// Indirect radiance of each pixel that was interpolated.
    pub(super) radiance: Vec<Option<[f32; 3]>>,
    /// Half width of the window, in pixels; 0 where it was not.
    pub(super) reach: Vec<f32>,
}

/// One pixel, by half of its samples.
#[derive(Clone, Copy, Debug, Default)]
struct Pixel {
    /// Its surface, among those that edges divide; 0 for none.
    surface: u32,
    /// Samples; 0 if nothing can be learnt from it.
    samples: f32,
    albedo: [f32; 3],
    /// Indirect light over albedo, and the mean of its channels.
    light: [f32; 3],
    mean: f32,
    normal: [f32; 3],
}

impl Pixel {
    fn sees_as(&self, o: &Self) -> bool {
        let cos: f32 = self.normal.iter().zip(o.normal).map(|(a, b)| a * b).sum();
        o.samples > 0.0 && self.surface == o.surface && cos >= AGREEMENT
    }
}

struct View {
    width: i32,
    height: i32,
    pixels: Vec<Pixel>,
}

impl View {
    /// By the samples of each half of the film.
    fn halves(film: &Film, edges: &[bool]) -> [Self; 2] {
        let image = film.develop();
        let width = film.width() as usize;
        let albedo = image.rgb("albedo").unwrap_or_default();
        let normal = |i: usize| {
            ["X", "Y", "Z"].map(|c| image.channel("N", c).map_or(0.0, |channel| channel[i]))
        };
        let surfaces = surfaces(width, edges);
        [0, 1].map(|half| {
            let pixel = |(i, sums): (usize, [([f32; 3], u32); 2])| {
                let ((sum, n), a) = (sums[half], albedo[i]);
                let least = a.iter().copied().fold(f32::INFINITY, f32::min);
                let known = surfaces[i] > 0 && least >= DARKEST && sums.iter().all(|s| s.1 > 0);
                let light = [0, 1, 2].map(|c| match known {
                    true => sum[c] / (n as f32 * a[c]),
                    false => 0.0,
                });
                Pixel {
                    surface: surfaces[i],
                    samples: if known { n as f32 } else { 0.0 },
                    albedo: a,
                    light,
                    mean: light.iter().sum::<f32>() / 3.0,
                    normal: normal(i),
                }
            };
            Self {
                width: width as i32,
                height: film.height() as i32,
                pixels: film.halves().enumerate().map(pixel).collect(),
            }
        })
    }

    /// Calls `f` with the pixels that see what pixel `i` sees, farther than `inner` and up to
    /// `outer` away: number, pixel, and where it lies from there.
    #[inline]
    fn around(&self, i: usize, inner: i32, outer: i32, mut f: impl FnMut(usize, &Pixel, f64, f64)) {
        let (x, y) = (i as i32 % self.width, i as i32 / self.width);
        let own = &self.pixels[i];
        for dy in (-outer).max(-y)..=outer.min(self.height - 1 - y) {
            let row = (y + dy) * self.width + x;
            for dx in (-outer).max(-x)..=outer.min(self.width - 1 - x) {
                if dx.abs().max(dy.abs()) <= inner {
                    continue;
                }
                let k = (row + dx) as usize;
                if own.sees_as(&self.pixels[k]) {
                    f(k, &self.pixels[k], f64::from(dx), f64::from(dy));
                }
            }
        }
    }

    /// The median of what is known of the pixels about `i`: the luck of one must not show as a speck.
    fn median(&self, known: &[usize], i: usize) -> usize {
        let mut near = ArrayVec::<usize, 9>::new();
        self.around(i, -1, 1, |k, _, _, _| near.push(known[k]));
        near.sort_unstable();
        near.get(near.len() / 2).copied().unwrap_or(0)
    }

    /// The light of a pixel by a window; `None` if nothing is to be learnt from it.
    fn fit(&self, i: usize, reach: i32) -> Option<[f32; 3]> {
        if self.pixels[i].samples == 0.0 {
            return None;
        }
        let (mut matrix, mut moments) = (Normal::default(), [Moments::default(); 3]);
        self.around(i, -1, reach, |_, o, x, y| {
            let w = f64::from(o.samples);
            matrix.add(w, x, y);
            for (m, v) in moments.iter_mut().zip(o.light) {
                m.add(w, x, y, f64::from(v));
            }
        });
        let inverse = matrix.inverse()?;
        Some(moments.map(|m| m.dot(inverse[0]) as f32))
    }
}

/// Numbers of the surfaces that edges divide, from 1; 0 for pixels with an edge.
fn surfaces(width: usize, edges: &[bool]) -> Vec<u32> {
    let mut out = vec![0; edges.len()];
    let mut next = 0;
    let mut open = Vec::new();
    for start in 0..edges.len() {
        if edges[start] || out[start] > 0 {
            continue;
        }
        next += 1;
        out[start] = next;
        open.push(start);
        while let Some(i) = open.pop() {
            let x = i % width;
            let beside = [
                (x > 0).then(|| i - 1),
                (x + 1 < width).then_some(i + 1),
                i.checked_sub(width),
                (i + width < edges.len()).then_some(i + width),
            ];
            for k in beside.into_iter().flatten() {
                if !edges[k] && out[k] == 0 {
                    out[k] = next;
                    open.push(k);
                }
            }
        }
    }
    out
}

/// Interpolates the indirect light of a film in all pixels without an edge.
pub(super) fn interpolate(film: &Film, edges: &[bool]) -> Interpolated {
    let views = View::halves(film, edges);
    let all = || (0..edges.len()).into_par_iter();
    let fits = [0, 1].map(|k: usize| all().map(|i| views[k].fits(i)).collect::<Vec<_>>());
    let reaches = [0, 1].map(|k: usize| {
        let best = |i| views[k].best(i, &fits[1 - k]);
        all().map(best).collect::<Vec<_>>()
    });
    let (radiance, reach) = all()
        .map(|i| {
            let [a, b] = [0, 1].map(|k| {
                let reach = REACHES[views[k].median(&reaches[k], i)];
                (views[k].fit(i, reach), reach)
            });
            match (a, b) {
                ((Some(x), m), (Some(y), n)) if m + n > 0 => {
                    (Some(both(&views, i, [x, y])), 0.5 * (m + n) as f32)
                }
                _ => (None, 0.0),
            }
        })
        .unzip();
    let mut out = Interpolated { radiance, reach };
    keep_flux(&mut out.radiance, &views);
    out
}

/// The radiance of pixel `i` by the light that each half tells.
fn both(views: &[View; 2], i: usize, light: [[f32; 3]; 2]) -> [f32; 3] {
    let [p, q] = [&views[0].pixels[i], &views[1].pixels[i]];
    let share = p.samples / (p.samples + q.samples);
    [0, 1, 2].map(|c| {
        let mean = share * light[0][c] + (1.0 - share) * light[1][c];
        mean.max(0.0) * p.albedo[c]
    })
}

/// What windows cut off the peaks of the irradiance is less than its noise, but it is always cut
/// off: each surface gets back what it had in all.
fn keep_flux(radiance: &mut [Option<[f32; 3]>], views: &[View; 2]) {
    let pixels = &views[0].pixels;
    let surfaces = pixels.iter().map(|p| p.surface as usize + 1).max();
    // Of each surface: what its pixels had, and what they have now.
    let mut sums = vec![[[0.0_f64; 3]; 2]; surfaces.unwrap_or(0)];
    for (i, new) in radiance.iter().enumerate() {
        let Some(new) = *new else { continue };
        let own = both(views, i, [0, 1].map(|k: usize| views[k].pixels[i].light));
        for (sum, values) in sums[pixels[i].surface as usize].iter_mut().zip([own, new]) {
            for (a, v) in sum.iter_mut().zip(values) {
                *a += f64::from(v);
            }
        }
    }
    for (radiance, pixel) in radiance.iter_mut().zip(pixels) {
        let [had, have] = sums[pixel.surface as usize];
        for (c, v) in radiance.iter_mut().flatten().enumerate() {
            if have[c] > 0.0 {
                *v *= (had[c] / have[c]) as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests;
