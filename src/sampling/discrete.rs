//! Discrete distributions.

/// A distribution over `0..n`, proportional to given weights, sampled by bisection.
#[derive(Clone, Debug, Default)]
pub struct Discrete {
    /// Sums of the weights before each index and, last, of all, normalised to end at 1; empty if
    /// the total is zero.
    cdf: Vec<f64>,
    /// One over each probability.
    inverse: Vec<f64>,
    total: f64,
}

impl Discrete {
    /// The distribution proportional to `weights`; weights that are not positive and finite
    /// count as zero.
    pub fn new(weights: impl IntoIterator<Item = f64>) -> Self {
        let mut sum = 0.0;
        let mut cdf = vec![0.0];
        cdf.extend(weights.into_iter().map(|w| {
            if w.is_finite() && w > 0.0 {
                sum += w;
            }
            sum
        }));
        if sum > 0.0 && sum.is_finite() {
            for c in &mut cdf {
                *c /= sum;
            }
        } else {
            cdf.clear();
        }
        Self {
            inverse: cdf.windows(2).map(|c| 1.0 / (c[1] - c[0])).collect(),
            cdf,
            total: sum,
        }
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Whether no index has a positive probability.
    pub fn is_empty(&self) -> bool {
        self.cdf.is_empty()
    }

    /// Probability of index `i`.
    #[inline]
    pub fn probability(&self, i: usize) -> f64 {
        self.cdf[i + 1] - self.cdf[i]
    }

    /// Index chosen by `u` in `[0, 1)`, its probability, and `u` rescaled to `[0, 1)` within it.
    /// `None` for an empty distribution.
    #[inline(always)]
    pub fn sample(&self, u: f64) -> Option<(usize, f64, f64)> {
        let n = self.inverse.len();
        if n <= 1 {
            return (n == 1).then_some((0, 1.0, u));
        }
        let inner = &self.cdf[1..n];
        let i = if n <= 8 {
            // Faster than bisection for the few entries of most scenes; counting all of them
            // leaves no branch to mispredict.
            inner.iter().map(|&c| usize::from(c <= u)).sum()
        } else {
            inner.partition_point(|&c| c <= u)
        };
        let lo = self.cdf[i];
        let p = self.cdf[i + 1] - lo;
        (p > 0.0).then(|| {
            (
                i,
                p,
                ((u - lo) * self.inverse[i]).clamp(0.0, 1.0 - f64::EPSILON),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sampling_follows_the_weights_and_rescales() {
        let d = Discrete::new([1.0, 0.0, 3.0, f64::NAN, 4.0]);
        assert!((d.total() - 8.0).abs() < 1e-15);
        let n = 80_000;
        let mut count = [0; 5];
        for k in 0..n {
            let u = (f64::from(k) + 0.5) / f64::from(n);
            let (i, p, v) = d.sample(u).expect("not empty");
            assert!((p - d.probability(i)).abs() < 1e-15);
            assert!((0.0..1.0).contains(&v));
            count[i] += 1;
        }
        assert_eq!(count, [10_000, 0, 30_000, 0, 40_000]);
    }

    #[test]
    fn no_weight_means_no_sample() {
        assert!(Discrete::new([0.0, -1.0]).sample(0.5).is_none());
        assert!(Discrete::new([]).is_empty());
    }
}
