//! What methods make of their time: seconds to a fixed error, of the whole picture and of each
//! component.

use serde::Serialize;

use super::analysis::{Point, differs, exp, factors};
use super::layers::names;
use super::methods::Method;
use crate::report::statistics::{Interval, Reach, bootstrap, median, reach, slope};

/// A curve: what a method makes of its time.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// Name of the method.
    pub method: String,
    /// Slope of error over time in logarithms: −1 halves the error in twice the time.
    pub slope: Option<Interval>,
    /// The same over samples: what does not grow with them counts for nothing in it.
    pub fall: Option<Interval>,
    /// For each of the levels of the report: seconds to reach it.
    pub times: Vec<Level>,
    /// The same for each component that the scene has.
    pub components: Vec<LayerTimes>,
}

/// Seconds until one component is good, of renderings of the whole picture.
#[derive(Clone, Debug, Serialize)]
pub struct LayerTimes {
    /// Name of the layer.
    pub layer: &'static str,
    /// For each of the levels of this component: seconds to reach it.
    pub times: Vec<Level>,
}

/// A method and a level.
#[derive(Clone, Debug, Serialize)]
pub struct Level {
    /// Relative mean squared error.
    pub error: f64,
    /// Seconds, where the curve passes the level.
    pub seconds: Option<Interval>,
    /// Seconds of its first point, where that is below the level already.
    pub at_most: Option<f64>,
    /// Seconds of its last point, where that is above the level still.
    pub more_than: Option<f64>,
    /// Seconds of the first method over seconds of this one.
    pub ratio: Option<Interval>,
    /// Where one of the two is only bounded: what this ratio is at least.
    pub ratio_at_least: Option<f64>,
    /// Whether this ratio is told from 1: beyond its interval and beyond the noise floor.
    pub differs: bool,
}

/// One row of the report's tables.
pub(super) struct Row<'a> {
    /// Component; empty for the whole picture.
    pub(super) layer: &'static str,
    /// Name of the method.
    pub(super) method: &'a str,
    /// Seconds to an error.
    pub(super) level: &'a Level,
}

/// Times of the whole picture by error, so that methods stand beside each other.
pub(super) fn whole(curves: &[Curve]) -> Vec<Row<'_>> {
    rows(curves, "", |c| &c.times)
}

/// Times of the components, likewise.
pub(super) fn components(curves: &[Curve]) -> Vec<Row<'_>> {
    let all = curves.first().map_or(&[][..], |c| &c.components);
    let of = |(k, c): (usize, &LayerTimes)| rows(curves, c.layer, move |c| &c.components[k].times);
    all.iter().enumerate().flat_map(of).collect()
}

/// All curves have the same levels.
fn rows<'a>(
    curves: &'a [Curve],
    layer: &'static str,
    times: impl Fn(&'a Curve) -> &'a [Level],
) -> Vec<Row<'a>> {
    let levels = curves.first().map_or(0, |c| times(c).len());
    let row = |k: usize, c: &'a Curve| Row {
        layer,
        method: &c.method,
        level: &times(c)[k],
    };
    (0..levels)
        .flat_map(|k| curves.iter().map(|c| row(k, c)).collect::<Vec<_>>())
        .collect()
}

/// One layer as the curves see it.
struct Layer {
    /// Index in [`names`].
    index: usize,
    /// Errors that some curve passes.
    levels: Vec<f64>,
    /// The reference's own error: nothing below it is known.
    own: f64,
    /// Factor of time × error that an A/A comparison of this layer keeps below.
    floor: f64,
    /// Least time that the clock tells from another, in seconds.
    tick: f64,
}

/// The curves of all methods; `ladders` holds the points of each, `own` the reference's error in
/// each layer, `twins` the A/A pair, `tick` the least time that the clock tells.
pub(super) fn curves(
    methods: &[Method],
    ladders: &[Vec<&Point>],
    own: &[f64],
    twins: Option<(&Point, &Point)>,
    tick: f64,
) -> Vec<Curve> {
    let Some(first) = ladders.first() else {
        return Vec::new();
    };
    let layers: Vec<Layer> = (0..names().len())
        .map(|index| Layer {
            index,
            levels: levels(ladders, index, own[index]),
            own: own[index],
            floor: twins.map_or(1.0, |(a, b)| floor(&factors(a, b, index)[2], 1.0)),
            tick,
        })
        .collect();
    methods
        .iter()
        .zip(ladders)
        .map(|(method, ladder)| {
            let mut times = layers.iter().map(|l| LayerTimes {
                layer: names()[l.index],
                times: times(ladder, first, l),
            });
            let whole = times.next().map(|c| c.times).unwrap_or_default();
            Curve {
                method: method.name.clone(),
                slope: slope_over(ladder, |_, seconds| seconds),
                fall: slope_over(ladder, |p, _| f64::from(p.spp)),
                times: whole,
                components: times.filter(|c| !c.times.is_empty()).collect(),
            }
        })
        .collect()
}

/// Slope of the error over something, in logarithms.
fn slope_over(ladder: &[&Point], x: impl Fn(&Point, f64) -> f64) -> Option<Interval> {
    bootstrap(repeats(ladder), |picks| {
        let points: Vec<(f64, f64)> = ladder
            .iter()
            .zip(over(ladder, 0, picks))
            .filter(|(_, (_, error))| *error > 0.0)
            .map(|(p, (seconds, error))| (x(p, seconds).ln(), error.ln()))
            .collect();
        slope(&points)
    })
}

/// The factor that two measurements of the same keep below. Whichever way chance went, it could
/// have gone the other way; and it may have been chance that they agree to less than `least`, the
/// factor by which what measures them may be off.
pub(super) fn floor(factor: &Option<Interval>, least: f64) -> f64 {
    factor.map_or(1.0, |i| i.high.max(1.0 / i.low.max(1e-9)).max(least))
}

/// The factor by which two times of the same may differ by the clock's step alone.
pub(super) fn resolved(a: f64, b: f64, tick: f64) -> f64 {
    1.0 + tick / a.min(b).max(f64::MIN_POSITIVE)
}

/// Levels of error, 1 and 3 of each power of ten, that some curve passes and the reference tells.
fn levels(ladders: &[Vec<&Point>], layer: usize, own: f64) -> Vec<f64> {
    let (lo, hi) = ladders
        .iter()
        .flatten()
        .map(|p| p.error_of(layer))
        .filter(|e| *e > 0.0)
        .fold((f64::INFINITY, 0.0_f64), |(lo, hi), e| {
            (lo.min(e), hi.max(e))
        });
    let lo = lo.max(own);
    (-7..=2)
        .flat_map(|p| [1.0, 3.0].map(|m| m * 10_f64.powi(p)))
        .filter(|l| (lo..hi).contains(l))
        .collect()
}

/// Repeats that all points of a ladder have.
fn repeats(ladder: &[&Point]) -> usize {
    ladder.iter().map(|p| p.repeats.len()).min().unwrap_or(0)
}

/// Time and error of a ladder over some of the repeats.
fn over(ladder: &[&Point], layer: usize, picks: &[usize]) -> Vec<(f64, f64)> {
    ladder
        .iter()
        .map(|p| {
            let t: Vec<f64> = picks.iter().map(|&i| p.repeats[i].seconds).collect();
            let e = picks.iter().map(|&i| p.repeats[i].errors[layer]);
            (median(&t), e.sum::<f64>() / picks.len() as f64)
        })
        .collect()
}

/// Seconds of a method to each level of a layer, beside those of the first method.
fn times(ladder: &[&Point], first: &[&Point], layer: &Layer) -> Vec<Level> {
    let n = repeats(ladder).min(repeats(first));
    let all: Vec<usize> = (0..n).collect();
    let level = |&error: &f64| {
        let time = |of: &[&Point], picks: &[usize]| {
            // What is smaller than the reference's own error may be anything below it.
            let known = |(t, e): (f64, f64)| (t, e.max(layer.own));
            let points = over(of, layer.index, picks);
            reach(&points.into_iter().map(known).collect::<Vec<_>>(), error)
        };
        let log = |of: &[&Point], picks: &[usize]| time(of, picks).known().map(f64::ln);
        let ratio = bootstrap(n, |p| Some(log(first, p)? - log(ladder, p)?)).map(exp);
        let [of_first, mine] = [first, ladder].map(|of| time(of, &all));
        let last = |of: &[&Point]| over(of, layer.index, &all).last().map(|p| p.0);
        // From below for the first method, from above for this one.
        let slow = match of_first {
            Reach::At(t) => Some(t),
            Reach::Never => last(first),
            Reach::Before(_) => None,
        };
        let fast = match mine {
            Reach::At(t) | Reach::Before(t) => Some(t),
            Reach::Never => None,
        };
        let bound = slow.zip(fast).map(|(s, f)| s / f);
        let floor = match (of_first, mine) {
            (Reach::At(a), Reach::At(b)) => layer.floor.max(resolved(a, b, layer.tick)),
            _ => (slow.zip(fast)).map_or(layer.floor, |(s, f)| {
                layer.floor.max(resolved(s, f, layer.tick))
            }),
        };
        Level {
            error,
            seconds: bootstrap(n, |p| log(ladder, p)).map(exp),
            at_most: match mine {
                Reach::Before(t) => Some(t),
                _ => None,
            },
            more_than: match mine {
                Reach::Never => last(ladder),
                _ => None,
            },
            differs: ratio.as_ref().is_some_and(|r| differs(r, floor)),
            ratio_at_least: bound.filter(|b| ratio.is_none() && *b > floor),
            ratio,
        }
    };
    layer.levels.iter().map(level).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_floor_lies_below_what_the_clock_tells() {
        let same = Some(Interval {
            value: 1.0,
            low: 1.0,
            high: 1.0,
        });
        // Two times of 50 ms by a clock that goes on every 10 ms: either may be a fifth longer.
        let least = resolved(0.06, 0.05, 0.01);
        assert!((least - 1.2).abs() < 1e-12);
        assert_eq!(floor(&same, least), least);
        assert_eq!(floor(&same, 1.0), 1.0);
        // Noise beyond that counts, whichever way it went.
        for (low, high) in [(0.5, 1.1), (0.9, 2.0)] {
            let noisy = Some(Interval {
                value: 1.0,
                low,
                high,
            });
            assert_eq!(floor(&noisy, least), 2.0);
        }
    }
}
