//! Which window leaves the least error about a pixel.
//!
//! Of two halves of the samples, what a window says by one is judged by the other: the mean square
//! of their difference is that of the window's error and of the judge's own noise, and the latter is
//! the same for all windows (cross-validation; Stone 1974). One pixel tells little, so it is
//! averaged over those around.

use super::fit::{Moments, Normal};
use super::{REACHES, View};

/// Half width in pixels of the neighbourhood in which errors are averaged. By 2 a fifth more noise is
/// left in the box, by 8 no less error.
const POOL: i32 = 5;

/// What windows of every reach say about a pixel.
pub(super) type Fits = [f32; REACHES.len()];

impl View {
    /// What windows of every reach say about a pixel, by their mean over the channels; infinity
    /// where a window says nothing.
    pub(super) fn fits(&self, i: usize) -> Fits {
        let mut out = [f32::INFINITY; REACHES.len()];
        if self.pixels[i].samples == 0.0 {
            return out;
        }
        let (mut matrix, mut moments) = (Normal::default(), Moments::default());
        let mut inner = -1;
        for (value, reach) in out.iter_mut().zip(REACHES) {
            self.around(i, inner, reach, |_, o, x, y| {
                let w = f64::from(o.samples);
                matrix.add(w, x, y);
                moments.add(w, x, y, f64::from(o.mean));
            });
            inner = reach;
            if let Some(inverse) = matrix.inverse() {
                *value = moments.dot(inverse[0]) as f32;
            }
        }
        out
    }

    /// The reach, as an index of [`REACHES`], that leaves the least error about a pixel in `fits`,
    /// those of the other half, as judged by this one. It serves this half: what windows over this
    /// one say had no part in the choice.
    pub(super) fn best(&self, i: usize, fits: &[Fits]) -> usize {
        let mut errors = [0.0f64; REACHES.len()];
        self.around(i, -1, POOL, |k, judge, _, _| {
            for (sum, fit) in errors.iter_mut().zip(fits[k]) {
                *sum += f64::from(judge.samples * (fit - judge.mean).powi(2));
            }
        });
        let all = errors.iter().enumerate();
        // Of equals the first, which blurs least.
        all.min_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |(k, _)| k)
    }
}
