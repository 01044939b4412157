//! What independent passes over the image say about its error.
//!
//! A pass gives every pixel the mean of its samples. Passes are independent, also of the photons
//! that their samples share, so their spread about the mean of all is its error; passes of more
//! samples weigh more (West 1979). What all passes have in common, the bias of kernels, is not
//! seen.

use arrayvec::ArrayVec;

use super::VALUES;

/// Share of an interval's two tails.
const TAILS: f64 = 0.1;

/// Student's quantile at 95 %, for 1 to 12 degrees of freedom.
const STUDENT: [f64; 12] = [
    6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860, 1.833, 1.812, 1.796, 1.782,
];

/// Added to the squared mean, as in the relative errors of reports.
const EPSILON: f64 = 0.01;

/// Sums over passes, beside the film's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Passes {
    /// Finished passes.
    pub(super) finished: u32,
    /// Of the pass under way, for each pixel: sum of its samples, and how many.
    pub(super) current: Vec<([f32; 3], u32)>,
    /// For each pixel: weighted squared deviations of the finished passes.
    pub(super) squares: Vec<[f32; 3]>,
}

/// The radiance of a pixel's sum over samples.
pub(super) fn beauty(sums: &[f32; VALUES]) -> [f32; 3] {
    [0, 1, 2].map(|c| sums[c] + sums[3 + c] + sums[6 + c] + sums[9 + c])
}

impl Passes {
    pub(super) fn new(pixels: usize) -> Self {
        Self {
            finished: 0,
            current: vec![([0.0; 3], 0); pixels],
            squares: vec![[0.0; 3]; pixels],
        }
    }

    /// Enters samples of a pixel into the pass under way.
    pub(super) fn add(&mut self, pixel: usize, values: &[f32; VALUES], samples: u32) {
        let (sum, n) = &mut self.current[pixel];
        for (a, v) in sum.iter_mut().zip(beauty(values)) {
            *a += v;
        }
        *n += samples;
    }

    /// Ends the pass under way. `totals` are the film's sums and counts with this pass in them.
    pub(super) fn finish(&mut self, totals: &[[f32; VALUES]], counts: &[u32]) {
        let pixels = self.current.iter_mut().zip(&mut self.squares);
        for (((sum, n), squares), (total, all)) in pixels.zip(totals.iter().zip(counts)) {
            let before = f64::from(all.saturating_sub(*n));
            if *n > 0 && before > 0.0 {
                let own = f64::from(*n);
                for (c, square) in squares.iter_mut().enumerate() {
                    let (sum, total) = (f64::from(sum[c]), f64::from(beauty(total)[c]));
                    let pass = sum / own;
                    let [old, new] = [(total - sum) / before, total / (before + own)];
                    *square += (own * (pass - old) * (pass - new)) as f32;
                }
            }
            (*sum, *n) = ([0.0; 3], 0);
        }
        self.finished += 1;
    }

    /// Variance of a pixel's mean over `samples` samples; `None` before the second pass.
    fn variance(&self, pixel: usize, samples: u32) -> Option<[f64; 3]> {
        let freedom = self.finished.checked_sub(1).filter(|n| *n > 0)?;
        let n = f64::from(freedom) * f64::from(samples.max(1));
        Some(self.squares[pixel].map(|s| f64::from(s).max(0.0) / n))
    }

    /// Half the width of the 90 % interval about each pixel's mean, for an image of this width.
    ///
    /// Relative variances are averaged over a pixel and its neighbours. Where light is found
    /// seldom, a pixel that has not found it yet knows nothing of its variance, but one beside it
    /// may: of single pixels only two thirds would lie within their intervals in such places.
    pub(super) fn half_widths(&self, film: &Sums<'_>) -> Option<Vec<[f32; 3]>> {
        let t = student(self.finished.checked_sub(1).filter(|n| *n > 0)?);
        let squares: Vec<[f64; 3]> = (0..film.counts.len())
            .map(|i| film.mean(i).map(|m| m * m + EPSILON))
            .collect();
        let relative: Option<Vec<[f64; 3]>> = (0..film.counts.len())
            .map(|i| {
                let v = self.variance(i, film.counts[i])?;
                Some([0, 1, 2].map(|c| v[c] / squares[i][c]))
            })
            .collect();
        let relative = relative?;
        let one = |i: usize| {
            let near = film.near(i);
            [0, 1, 2].map(|c| {
                let sum: f64 = near.iter().map(|&k| relative[k][c]).sum();
                let v = sum / near.len().max(1) as f64 * squares[i][c];
                if film.counts[i] > 0 {
                    (t * v.sqrt()) as f32
                } else {
                    0.0
                }
            })
        };
        Some((0..film.counts.len()).map(one).collect())
    }

    /// Estimated relative mean squared error of the image, without what all passes have in
    /// common: over the pixels that have samples.
    ///
    /// A pixel that found something bright by chance would excuse its own variance, and the
    /// estimate would begin far too low: what variances are divided by is the mean over a pixel
    /// and its neighbours.
    pub(super) fn relative_error(&self, film: &Sums<'_>) -> Option<f64> {
        let (mut sum, mut pixels) = (0.0, 0_u64);
        for (i, &n) in film.counts.iter().enumerate().filter(|(_, n)| **n > 0) {
            let variance = self.variance(i, n)?;
            let near = film.near(i);
            for (c, v) in variance.iter().enumerate() {
                let squares: f64 = near.iter().map(|&k| film.mean(k)[c].powi(2)).sum();
                sum += v / (squares / near.len() as f64 + EPSILON) / 3.0;
            }
            pixels += 1;
        }
        (pixels > 0).then(|| sum / pixels as f64)
    }
}

/// The film's own sums.
pub(super) struct Sums<'a> {
    pub(super) totals: &'a [[f32; VALUES]],
    pub(super) counts: &'a [u32],
    pub(super) width: usize,
}

impl Sums<'_> {
    /// The mean radiance of a pixel.
    fn mean(&self, i: usize) -> [f64; 3] {
        let n = f64::from(self.counts[i].max(1));
        beauty(&self.totals[i]).map(|b| f64::from(b) / n)
    }

    /// A pixel and its neighbours, of those that have samples.
    fn near(&self, i: usize) -> ArrayVec<usize, 9> {
        let height = self.counts.len() / self.width.max(1);
        let around = |k: usize, end: usize| k.saturating_sub(1)..(k + 2).min(end);
        let (x, y) = (i % self.width, i / self.width);
        around(y, height)
            .flat_map(|y| around(x, self.width).map(move |x| y * self.width + x))
            .filter(|&k| self.counts[k] > 0)
            .collect()
    }
}

/// Student's quantile that leaves half of [`TAILS`] above it.
fn student(freedom: u32) -> f64 {
    debug_assert!(TAILS == 0.1 && freedom > 0);
    match STUDENT.get(freedom as usize - 1) {
        Some(t) => *t,
        // The first terms of its expansion about the normal quantile (Abramowitz and Stegun
        // 26.7.5).
        None => {
            let (z, n) = (1.644_854_f64, f64::from(freedom));
            let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * n * n);
            z + (z.powi(3) + z) / (4.0 * n) + second
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantiles_go_on_smoothly() {
        assert!((student(13) - 1.771).abs() < 2e-3, "{}", student(13));
        assert!((student(1000) - 1.646).abs() < 1e-3);
    }

    /// Passes of different sizes: the weighted variance of the mean, by hand.
    #[test]
    fn the_spread_of_passes_is_the_error_of_their_mean() {
        let mut p = Passes::new(1);
        let (mut total, mut count) = ([[0.0; VALUES]], [0]);
        for (mean, n) in [(1.0_f32, 2_u32), (4.0, 1), (2.0, 3)] {
            let mut values = [0.0; VALUES];
            values[0] = mean * n as f32;
            p.add(0, &values, n);
            total[0][0] += values[0];
            count[0] += n;
            p.finish(&total, &count);
        }
        // Mean 2: squares 2·1 + 1·4 + 3·0 = 6, over 2 degrees of freedom and 6 samples.
        let v = p.variance(0, 6).unwrap();
        assert!((v[0] - 0.5).abs() < 1e-6 && v[1] == 0.0, "{v:?}");
        let sums = Sums {
            totals: &total,
            counts: &count,
            width: 1,
        };
        let error = p.relative_error(&sums).unwrap();
        assert!((error - 0.5 / 4.01 / 3.0).abs() < 1e-6, "{error}");
        let half = p.half_widths(&sums).unwrap();
        assert!((f64::from(half[0][0]) - 2.920 * 0.5_f64.sqrt()).abs() < 1e-5);
    }

    #[test]
    fn one_pass_says_nothing_of_its_error() {
        let mut p = Passes::new(1);
        p.add(0, &[1.0; VALUES], 1);
        p.finish(&[[1.0; VALUES]], &[1]);
        let sums = Sums {
            totals: &[[1.0; VALUES]],
            counts: &[1],
            width: 1,
        };
        assert_eq!(p.relative_error(&sums), None);
        assert_eq!(p.half_widths(&sums), None);
    }
}
