//! What a few repeats say about a quantity: medians, bootstrap intervals, lines through points.

use crate::sampling::Rng;

/// Resamples of a bootstrap.
const RESAMPLES: usize = 2000;

/// Share of the bootstrap distribution inside an interval.
const COVERAGE: f64 = 0.95;

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Whether `x` lies in it.
    pub fn contains(&self, x: f64) -> bool {
        (self.low..=self.high).contains(&x)
    }
}

/// The arithmetic mean; 0 of nothing.
pub fn mean(v: &[f64]) -> f64 {
    v.iter().sum::<f64>() / v.len().max(1) as f64
}

/// The middle value, of an even number the mean of the two in the middle; NaN of nothing.
pub fn median(v: &[f64]) -> f64 {
    let mut v = v.to_vec();
    v.sort_by(f64::total_cmp);
    match v.len() {
        0 => f64::NAN,
        n => (v[(n - 1) / 2] + v[n / 2]) / 2.0,
    }
}

/// The 95 % percentile interval of `statistic` over resampled repeats. `statistic` gets the
/// indices of the repeats, some of them several times, and `None` from it is left out: no
/// interval if more than a twentieth is.
///
/// Repeats are few, and their spread about their own mean is too small by `√(1 − 1/n)`: the
/// interval is widened by its inverse.
pub fn bootstrap(repeats: usize, statistic: impl Fn(&[usize]) -> Option<f64>) -> Option<Interval> {
    let all: Vec<usize> = (0..repeats).collect();
    let value = statistic(&all).filter(|v| v.is_finite())?;
    if repeats < 2 {
        return None;
    }
    let mut rng = Rng::new(0x05ee_d0fb);
    let mut picks = all;
    let mut values: Vec<f64> = (0..RESAMPLES)
        .filter_map(|_| {
            for p in &mut picks {
                *p = (rng.next_u64() % repeats as u64) as usize;
            }
            statistic(&picks).filter(|v| v.is_finite())
        })
        .collect();
    if values.len() * 20 < RESAMPLES * 19 {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let widen = (repeats as f64 / (repeats - 1) as f64).sqrt();
    let at = |q: f64| {
        let x = values[(q * (values.len() - 1) as f64).round() as usize];
        value + (x - value) * widen
    };
    let tail = (1.0 - COVERAGE) / 2.0;
    Some(Interval {
        value,
        low: at(tail).min(value),
        high: at(1.0 - tail).max(value),
    })
}

/// The 95 % interval of a positive mean; widened as a factor, so that it stays positive.
pub fn mean_interval(v: &[f64]) -> Interval {
    let at = |picks: &[usize]| {
        let m = picks.iter().map(|&i| v[i]).sum::<f64>() / picks.len() as f64;
        (m > 0.0).then(|| m.ln())
    };
    let m = mean(v);
    bootstrap(v.len(), at).map_or(
        Interval {
            value: m,
            low: m,
            high: m,
        },
        |i| Interval {
            value: m,
            low: i.low.exp().min(m),
            high: i.high.exp().max(m),
        },
    )
}

/// Slope of the least-squares line through points; `None` for less than two different abscissae.
pub fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let n = points.len() as f64;
    let (mx, my) = points
        .iter()
        .fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let (sxx, sxy) = points.iter().fold((0.0, 0.0), |(xx, xy), p| {
        (xx + (p.0 - mx).powi(2), xy + (p.0 - mx) * (p.1 - my))
    });
    (sxx > 0.0).then(|| sxy / sxx)
}

/// When a curve reaches a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// At this abscissa.
    At(f64),
    /// Its first point lies below already.
    Before(f64),
    /// Not within what was measured.
    Never,
}

impl Reach {
    /// The abscissa, if it is known.
    pub fn known(self) -> Option<f64> {
        match self {
            Self::At(t) => Some(t),
            _ => None,
        }
    }
}

/// Where a falling curve through positive points, sorted by abscissa, first reaches `level`:
/// straight lines in logarithms.
pub fn reach(curve: &[(f64, f64)], level: f64) -> Reach {
    match curve.first() {
        None => return Reach::Never,
        Some(&(t, e)) if e <= level => return Reach::Before(t),
        _ => {}
    }
    curve
        .windows(2)
        .find(|w| w[1].1 <= level)
        .map_or(Reach::Never, |w| {
            let [(t0, e0), (t1, e1)] = [w[0], w[1]].map(|(t, e)| (t.ln(), e.max(1e-300).ln()));
            let f = (level.ln() - e0) / (e1 - e0);
            Reach::At((t0 + f * (t1 - t0)).exp())
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_slopes_by_hand() {
        assert_eq!((median(&[3.0, 1.0, 2.0]), median(&[4.0, 1.0])), (2.0, 2.5));
        assert!(median(&[]).is_nan());
        assert_eq!(slope(&[(0.0, 1.0), (1.0, 0.0), (2.0, -1.0)]), Some(-1.0));
        assert_eq!(slope(&[(1.0, 1.0), (1.0, 2.0)]), None);
    }

    #[test]
    fn a_curve_is_interpolated_in_logarithms() {
        let curve = [(1.0, 1.0), (4.0, 0.25), (16.0, 0.0625)];
        let Reach::At(t) = reach(&curve, 0.1) else {
            panic!()
        };
        assert!((t - 10.0).abs() < 1e-9, "{t}");
        assert_eq!(reach(&curve, 2.0), Reach::Before(1.0));
        assert_eq!(reach(&curve, 0.01), Reach::Never);
        assert_eq!(reach(&[], 1.0), Reach::Never);
    }

    /// Of intervals about the mean of eight normal numbers, most contain the true mean.
    #[test]
    fn intervals_cover_what_they_claim() {
        let mut rng = Rng::new(1);
        let trials = 400;
        let covered = (0..trials)
            .filter(|_| {
                let v: Vec<f64> = (0..8)
                    .map(|_| 10.0 + (0..12).map(|_| rng.next_1d()).sum::<f64>() - 6.0)
                    .collect();
                mean_interval(&v).contains(10.0)
            })
            .count();
        let share = covered as f64 / f64::from(trials);
        assert!((0.88..=0.98).contains(&share), "{share}");
    }

    #[test]
    fn too_little_has_no_interval() {
        assert_eq!(bootstrap(1, |_| Some(1.0)), None);
        assert_eq!(bootstrap(4, |p| (p[0] == 0).then_some(1.0)), None);
    }
}
