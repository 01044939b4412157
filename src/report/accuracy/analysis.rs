//! What the measured pictures say: error against time, bias and noise apart, times to an error.

use serde::Serialize;

use super::Study;
use super::layers::{Moments, Scale, names};
use super::measure::{Kind, Run};
use super::methods::{CHANGES, Method, preset};
use crate::report::diff::Pair;
use crate::report::statistics::{
    Interval, Reach, bootstrap, mean, mean_interval, median, reach, slope,
};

/// Errors of one layer at one setting, relative to the whole reference.
#[derive(Clone, Debug, Serialize)]
pub struct LayerError {
    /// Name; empty for the whole picture.
    pub layer: &'static str,
    /// Mean squared error of a picture, without that of the reference.
    pub total: Interval,
    /// Its part that differs from seed to seed.
    pub noise: Interval,
    /// Its part that does not, squared bias; may come out below zero where noise hides it.
    pub bias: Interval,
}

/// What was measured at one setting.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// What it belongs to: a method, or a change.
    pub name: String,
    /// Rung of the ladder; `None` for changes.
    pub rung: Option<u32>,
    /// The preset that it stands for, if any.
    pub preset: Option<&'static str>,
    /// Samples per pixel.
    pub spp: u32,
    /// Photons, if there are any.
    pub photons: Option<u64>,
    /// Photons in a kernel, likewise.
    pub nearest: Option<usize>,
    /// Seconds on the chosen clock.
    pub seconds: Interval,
    /// Errors of the whole picture, then of its components.
    pub layers: Vec<LayerError>,
    /// The same measure without the worst 0.1 % of the pixels.
    pub trimmed: Interval,
    /// Mean FLIP; `None` if this build knows none.
    pub flip: Option<Interval>,
    /// Seconds and error of the whole picture by repeat.
    #[serde(skip)]
    repeats: Vec<(f64, f64)>,
    /// FLIP by repeat.
    #[serde(skip)]
    index: usize,
}

impl Point {
    /// The relative mean squared error of the whole picture.
    pub fn error(&self) -> Interval {
        self.layers[0].total
    }

    /// Index of its setting.
    pub(super) fn setting(&self) -> usize {
        self.index
    }
}

/// A curve: what a method makes of its time.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// Name of the method.
    pub method: String,
    /// Slope of error over time in logarithms: −1 halves the error in twice the time.
    pub slope: Option<Interval>,
    /// For each of the levels of the report: seconds to reach it.
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

/// A change and what it does, as factors.
#[derive(Clone, Debug, Serialize)]
pub struct Effect {
    /// Name of the change.
    pub change: &'static str,
    /// What it is about.
    pub doc: &'static str,
    /// Seconds with it over seconds without.
    pub time: Interval,
    /// Error with it over error without.
    pub error: Interval,
    /// The product: below 1 it is worth its price, if errors fall as time grows.
    pub cost: Interval,
    /// Whether time, error and cost are told from 1.
    pub differs: [bool; 3],
}

/// Everything the report shows.
#[derive(Clone, Debug, Serialize)]
pub struct Analysis {
    /// Factors that an A/A comparison keeps below: of seconds, of errors, of their product.
    pub floor: [f64; 3],
    /// All points: methods by rung, then the base of the changes and the changes.
    pub points: Vec<Point>,
    /// A curve per method.
    pub curves: Vec<Curve>,
    /// What the changes do.
    pub effects: Vec<Effect>,
    /// What the changes are made to.
    pub base: Option<String>,
}

impl Analysis {
    /// The points of a method, by rung.
    pub fn curve(&self, method: &str) -> impl Iterator<Item = &Point> {
        let of = move |p: &&Point| p.rung.is_some() && p.name == method;
        self.points.iter().filter(of)
    }
}

/// Errors of one setting against a reference, before anything else is known.
pub(super) struct Errors {
    /// Relative mean squared error of each repeat and layer, the reference's own error in it.
    raw: Vec<Vec<f64>>,
    /// Of it, the part that differs from the mean of all repeats.
    noise: Vec<Vec<f64>>,
}

/// Compares the runs of a setting with a reference.
pub(super) fn errors(runs: &[&Run], reference: &super::layers::Layers, scale: &Scale) -> Errors {
    let mut moments = Moments::new(reference.beauty().len());
    for r in runs {
        moments.add(&r.layers);
    }
    let n = runs.len() as f64;
    // The repeats vary less about their own mean than about the true one.
    let unbiased = n / (n - 1.0).max(1.0);
    let layers = 0..names().len();
    let of = |r: &&Run, k: usize| -> (f64, f64) {
        match (&r.layers.pixels[k], &reference.pixels[k]) {
            (Some(a), Some(b)) => {
                let m = moments.mean(k);
                let noise = scale.mean(|i, c| (f64::from(a[i][c]) - m[i][c]).powi(2));
                (scale.rel_mse(a, b), noise * unbiased)
            }
            _ => (f64::NAN, f64::NAN),
        }
    };
    let both: Vec<Vec<(f64, f64)>> = layers
        .map(|k| runs.iter().map(|r| of(r, k)).collect())
        .collect();
    let part = |f: fn(&(f64, f64)) -> f64| both.iter().map(|v| v.iter().map(f).collect()).collect();
    Errors {
        raw: part(|p| p.0),
        noise: part(|p| p.1),
    }
}

impl Errors {
    /// The error of the whole picture, the mean over the seeds.
    pub(super) fn smallest(&self) -> f64 {
        mean(&self.raw[0])
    }

    fn layers(&self, own: &[f64]) -> Vec<LayerError> {
        names()
            .into_iter()
            .enumerate()
            .filter(|(k, _)| self.raw[*k].iter().all(|v| v.is_finite()))
            .map(|(k, layer)| {
                let total: Vec<f64> = self.raw[k].iter().map(|e| e - own[k]).collect();
                let noise = &self.noise[k];
                let bias: Vec<f64> = total.iter().zip(noise).map(|(t, n)| t - n).collect();
                // Bias may lie on both sides of zero: its interval is one of sums, not of factors.
                let pick =
                    |p: &[usize]| Some(p.iter().map(|&i| bias[i]).sum::<f64>() / p.len() as f64);
                let middle = mean(&bias);
                LayerError {
                    layer,
                    total: mean_interval(&total),
                    noise: mean_interval(noise),
                    bias: bootstrap(bias.len(), pick).unwrap_or(Interval {
                        value: middle,
                        low: middle,
                        high: middle,
                    }),
                }
            })
            .collect()
    }
}

fn of_setting(study: &Study, setting: usize) -> Vec<&Run> {
    let mut runs: Vec<&Run> = study.runs.iter().filter(|r| r.setting == setting).collect();
    runs.sort_by_key(|r| r.repeat);
    runs
}

fn point(study: &Study, setting: usize, scale: &Scale) -> Point {
    let s = &study.settings[setting];
    let runs = of_setting(study, setting);
    let reference = &study.reference;
    let layers = errors(&runs, &reference.layers, scale).layers(&reference.error);
    let seconds: Vec<f64> = runs.iter().map(|r| study.clock.of(r)).collect();
    let compared: Vec<_> = runs
        .iter()
        .map(|r| {
            Pair {
                layer: String::new(),
                width: r.layers.width,
                height: r.layers.height,
                image: r.layers.beauty().to_vec(),
                reference: reference.layers.beauty().to_vec(),
            }
            .compare(study.exposure)
        })
        .collect();
    let total = |r: &&Run| scale.rel_mse(r.layers.beauty(), reference.layers.beauty());
    let repeats = runs
        .iter()
        .zip(&seconds)
        .map(|(r, t)| (*t, total(r) - reference.error[0]))
        .collect();
    let flip: Option<Vec<f64>> = compared.iter().map(|c| c.flip).collect();
    let trimmed: Vec<f64> = compared.iter().map(|c| c.rel_mse_trimmed).collect();
    let (name, rung) = match s.kind {
        Kind::Rung { method, rung } => (study.methods[method].name.clone(), Some(rung)),
        Kind::Base => ("unchanged".into(), None),
        Kind::Change(c) => (CHANGES[c].name.into(), None),
        Kind::Again(_) => ("again".into(), None),
    };
    let i = &s.settings.integrator_settings;
    let photons = study.uses_photons(&s.settings);
    Point {
        name,
        rung,
        preset: rung.filter(|_| photons).and_then(preset),
        spp: s.settings.spp,
        photons: photons.then_some(i.photons),
        nearest: photons.then_some(i.nearest),
        seconds: Interval {
            value: median(&seconds),
            ..mean_interval(&seconds)
        },
        layers,
        trimmed: mean_interval(&trimmed),
        flip: flip.map(|f| mean_interval(&f)),
        repeats,
        index: setting,
    }
}

/// Factors between two settings, repeat by repeat: of seconds, of errors, of both.
fn factors(a: &Point, b: &Point) -> [Option<Interval>; 3] {
    let n = a.repeats.len().min(b.repeats.len());
    let time = |p: &[usize]| {
        let logs: Vec<f64> = p
            .iter()
            .map(|&i| (b.repeats[i].0 / a.repeats[i].0).ln())
            .collect();
        Some(median(&logs))
    };
    let error = |p: &[usize]| {
        let sum = |q: &Point| p.iter().map(|&i| q.repeats[i].1).sum::<f64>();
        let (x, y) = (sum(a), sum(b));
        (x > 0.0 && y > 0.0).then(|| (y / x).ln())
    };
    let both = |p: &[usize]| Some(time(p)? + error(p)?);
    [bootstrap(n, time), bootstrap(n, error), bootstrap(n, both)].map(|i| i.map(exp))
}

fn exp(i: Interval) -> Interval {
    Interval {
        value: i.value.exp(),
        low: i.low.exp(),
        high: i.high.exp(),
    }
}

/// Whether a factor is told from 1.
fn differs(i: &Interval, floor: f64) -> bool {
    !i.contains(1.0) && i.value.ln().abs() > floor.ln()
}

/// Says what the measured pictures say.
pub(super) fn analyse(study: &Study) -> Analysis {
    let scale = Scale::new(study.reference.layers.beauty());
    let all: Vec<Point> = (0..study.settings.len())
        .map(|s| point(study, s, &scale))
        .collect();
    let kind = |p: &Point| study.settings[p.index].kind;
    let twin = |second: bool| all.iter().find(|p| kind(p) == Kind::Again(second));
    let floor = match (twin(false), twin(true)) {
        (Some(a), Some(b)) => factors(a, b).map(|i| {
            // Whichever way chance went, it could have gone the other way.
            i.map_or(1.0, |i| i.high.max(1.0 / i.low.max(1e-9)))
        }),
        _ => [1.0; 3],
    };
    let base = all.iter().find(|p| kind(p) == Kind::Base);
    let effects = all
        .iter()
        .filter_map(|p| match kind(p) {
            Kind::Change(c) => Some((c, p)),
            _ => None,
        })
        .filter_map(|(c, p)| {
            let [time, error, cost] = factors(base?, p);
            let all = [time?, error?, cost?];
            Some(Effect {
                change: CHANGES[c].name,
                doc: CHANGES[c].doc,
                time: all[0],
                error: all[1],
                cost: all[2],
                differs: std::array::from_fn(|k| differs(&all[k], floor[k])),
            })
        })
        .collect();
    let levels = levels(&all);
    let of_method = |m: usize| -> Vec<&Point> {
        all.iter()
            .filter(|p| matches!(kind(p), Kind::Rung { method, .. } if method == m))
            .collect()
    };
    let ladders: Vec<Vec<&Point>> = (0..study.methods.len()).map(of_method).collect();
    let curves = ladders
        .iter()
        .zip(&study.methods)
        .map(|(ladder, method)| curve(method, ladder, &ladders[0], &levels, floor[2]))
        .collect();
    let base = base.map(describe);
    let shown = |p: &Point| !matches!(kind(p), Kind::Again(_));
    let points = all.iter().filter(|p| shown(p)).cloned().collect();
    Analysis {
        floor,
        points,
        curves,
        effects,
        base,
    }
}

/// A setting in a few words.
pub(super) fn describe(p: &Point) -> String {
    let mut out = p.preset.map_or(String::new(), |name| format!("{name}: "));
    out += &format!("{} samples", p.spp);
    if let (Some(n), Some(k)) = (p.photons, p.nearest) {
        out += &format!(", {n} photons, {k} in a kernel");
    }
    out
}

/// Levels of error, 1 and 3 of each power of ten, that some curve passes.
fn levels(points: &[Point]) -> Vec<f64> {
    let errors = || {
        points
            .iter()
            .filter(|p| p.rung.is_some())
            .map(|p| p.error().value)
    };
    let (lo, hi) = errors()
        .filter(|e| *e > 0.0)
        .fold((f64::INFINITY, 0.0_f64), |(lo, hi), e| {
            (lo.min(e), hi.max(e))
        });
    (-7..=2)
        .flat_map(|p| [1.0, 3.0].map(|m| m * 10_f64.powi(p)))
        .filter(|l| (lo..hi).contains(l))
        .collect()
}

/// Time and error of a ladder over some of the repeats.
fn over(ladder: &[&Point], picks: &[usize]) -> Vec<(f64, f64)> {
    ladder
        .iter()
        .map(|p| {
            let t: Vec<f64> = picks.iter().map(|&i| p.repeats[i].0).collect();
            let e = picks.iter().map(|&i| p.repeats[i].1).sum::<f64>() / picks.len() as f64;
            (median(&t), e)
        })
        .collect()
}

fn curve(
    method: &Method,
    ladder: &[&Point],
    first: &[&Point],
    levels: &[f64],
    floor: f64,
) -> Curve {
    let n = ladder.iter().map(|p| p.repeats.len()).min().unwrap_or(0);
    let all: Vec<usize> = (0..n).collect();
    let logs = |picks: &[usize]| {
        let points: Vec<(f64, f64)> = over(ladder, picks)
            .into_iter()
            .filter(|p| p.1 > 0.0)
            .map(|(t, e)| (t.ln(), e.ln()))
            .collect();
        slope(&points)
    };
    let times = levels.iter().map(|&error| {
        let time = |of: &[&Point], picks: &[usize]| reach(&over(of, picks), error);
        let log = |of: &[&Point], picks: &[usize]| time(of, picks).known().map(f64::ln);
        let ratio = bootstrap(n, |p| Some(log(first, p)? - log(ladder, p)?)).map(exp);
        let [of_first, mine] = [first, ladder].map(|of| time(of, &all));
        let last = |of: &[&Point]| over(of, &all).last().map(|p| p.0);
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
    });
    Curve {
        method: method.name.clone(),
        slope: bootstrap(n, logs),
        times: times.collect(),
    }
}
