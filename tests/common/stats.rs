//! Statistics for tests: means with their errors, and chi-squared tests of histograms.

/// Samples of a random number, one per seed.
#[derive(Clone, Debug, Default)]
pub struct Samples(pub Vec<f64>);

impl Samples {
    /// Evaluates `f` for the seeds `0..n`.
    pub fn over_seeds(n: u64, f: impl FnMut(u64) -> f64) -> Self {
        Self((0..n).map(f).collect())
    }

    /// Mean.
    pub fn mean(&self) -> f64 {
        self.0.iter().sum::<f64>() / self.0.len() as f64
    }

    /// Standard error of the mean.
    pub fn sigma(&self) -> f64 {
        let (n, m) = (self.0.len() as f64, self.mean());
        let sum: f64 = self.0.iter().map(|x| (x - m).powi(2)).sum();
        (sum / (n * (n - 1.0))).sqrt()
    }

    /// The mean lies within four standard errors of `expected` (a false alarm in about a
    /// thousand, with 16 seeds), and the error itself is at most `teeth` of it: a test that
    /// could not fail is a failure. Films hold single precision: `1e-6` is granted for that.
    #[track_caller]
    pub fn assert_mean(&self, what: &str, expected: f64, teeth: f64) {
        self.assert_mean_with_bias(what, expected, teeth, 0.0);
    }

    /// As [`assert_mean`](Self::assert_mean) for an estimator with a known bias of up to `bias`,
    /// relative.
    #[track_caller]
    pub fn assert_mean_with_bias(&self, what: &str, expected: f64, teeth: f64, bias: f64) {
        let (mean, sigma) = (self.mean(), self.sigma());
        let report = format!(
            "{what}: measured {mean:.6e} ± {sigma:.1e} ({:.3} %), expected {expected:.6e}, \
             off by {:+.3} % = {:+.2} sigma",
            100.0 * sigma / expected.abs(),
            100.0 * (mean / expected - 1.0),
            (mean - expected) / sigma,
        );
        println!("{report}");
        assert!(self.0.iter().all(|x| x.is_finite()), "{report}");
        assert!(
            sigma <= teeth * expected.abs(),
            "{report}: too noisy to prove it to {teeth}"
        );
        let granted = 4.0 * sigma + (bias + 1e-6) * expected.abs();
        assert!((mean - expected).abs() <= granted, "{report}");
    }

    /// The means of two estimators of one number agree within four standard errors of their
    /// difference plus `bias`, relative to this one; the error is at most `teeth`.
    #[track_caller]
    pub fn assert_agrees(&self, other: &Self, what: &str, teeth: f64, bias: f64) {
        let (a, b) = (self.mean(), other.mean());
        let sigma = self.sigma().hypot(other.sigma());
        let report = format!(
            "{what}: {a:.6e} ± {:.1e} against {b:.6e} ± {:.1e}, {:+.3} % = {:+.2} sigma",
            self.sigma(),
            other.sigma(),
            100.0 * (b / a - 1.0),
            (b - a) / sigma
        );
        println!("{report}");
        assert!(
            sigma <= teeth * a.abs(),
            "{report}: too noisy to prove it to {teeth}"
        );
        assert!((a - b).abs() <= 4.0 * sigma + bias * a.abs(), "{report}");
    }
}

/// p-value of Pearson's test that the counts `seen` of `n` independent draws follow the
/// probabilities `expected`. Cells that expect less than five are pooled, and what the cells
/// leave of a probability of one is a cell of its own.
pub fn chi_squared(seen: &[u64], expected: &[f64], n: u64) -> f64 {
    assert_eq!(seen.len(), expected.len());
    let mut cells: Vec<(f64, f64)> = seen
        .iter()
        .zip(expected)
        .map(|(&s, &e)| (s as f64, e * n as f64))
        .collect();
    let rest = (n - seen.iter().sum::<u64>()) as f64;
    let expected_rest = (1.0 - expected.iter().sum::<f64>()).max(0.0) * n as f64;
    cells.push((rest, expected_rest));
    cells.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (mut pool, mut statistic, mut freedom) = ((0.0, 0.0), 0.0, -1.0);
    for (i, cell) in cells.iter().enumerate() {
        pool.0 += cell.0;
        pool.1 += cell.1;
        let left: f64 = cells[i + 1..].iter().map(|c| c.1).sum();
        // The last cell takes what would be too small on its own.
        if pool.1 < 5.0 || (left > 0.0 && left < 5.0) {
            continue;
        }
        statistic += (pool.0 - pool.1).powi(2) / pool.1;
        freedom += 1.0;
        pool = (0.0, 0.0);
    }
    // A few draws where none are expected at all refute the claim on their own.
    if pool.0 > pool.1 + 5.0 + 5.0 * pool.1.sqrt() {
        return 0.0;
    }
    assert!(freedom >= 1.0, "too few cells for a test");
    upper_gamma(0.5 * freedom, 0.5 * statistic)
}

/// Regularised upper incomplete gamma function `Q(a, x)` (Press et al., *Numerical Recipes*,
/// 6.2: series below `a + 1`, Lentz's continued fraction above).
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for k in 1..10_000 {
            term *= x / (a + f64::from(k));
            sum += term;
            if term < sum * 1e-16 {
                break;
            }
        }
        return 1.0 - front * sum;
    }
    let mut b = x + 1.0 - a;
    let mut c = 1e300;
    let mut d = 1.0 / b;
    let mut h = d;
    for k in 1..10_000 {
        let k = f64::from(k);
        let an = -k * (k - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        let step = d * c;
        h *= step;
        if (step - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * h
}

/// Stirling's series after shifting the argument above 10.
fn ln_gamma(mut x: f64) -> f64 {
    let mut shift = 0.0;
    while x < 10.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let tail = 1.0 / (12.0 * x) - 1.0 / (360.0 * x.powi(3)) + 1.0 / (1260.0 * x.powi(5));
    shift + (x - 0.5) * x.ln() - x + 0.5 * (2.0 * std::f64::consts::PI).ln() + tail
}

#[test]
fn tail_probabilities_are_those_of_the_tables() {
    for (freedom, x, p) in [
        (1.0, 3.841_459, 0.05),
        (10.0, 23.209_251, 0.01),
        (100.0, 135.806_723, 0.01),
    ] {
        let q = upper_gamma(0.5 * freedom, 0.5 * x);
        assert!((q - p).abs() < 1e-6, "{freedom}: {q} against {p}");
    }
    // A histogram that is right, and one that is 3 % wrong in one half.
    let even = [25_000u64; 4];
    assert!(chi_squared(&even, &[0.25; 4], 100_000) > 0.99);
    assert!(chi_squared(&[26_000, 25_500, 24_500, 24_000], &[0.25; 4], 100_000) < 1e-9);
}
