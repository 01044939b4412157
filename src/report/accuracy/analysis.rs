//! What the measured pictures say: error against time, bias and noise apart, what changes do.

use serde::Serialize;

use super::Study;
use super::curves::{Curve, curves, floor, resolved};
use super::layers::{Moments, Scale, names};
use super::measure::{Kind, Run};
use super::methods::CHANGES;
use super::presets::{Standing, standings};
use crate::report::diff::Pair;
use crate::report::statistics::{Interval, bootstrap, mean, mean_interval, median};

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
    /// What each repeat took and how good it was.
    #[serde(skip)]
    pub(super) repeats: Vec<Repeat>,
    /// Index of its setting.
    #[serde(skip)]
    index: usize,
}

/// One picture of a setting.
#[derive(Clone, Debug)]
pub(super) struct Repeat {
    /// Seconds on the chosen clock.
    pub(super) seconds: f64,
    /// Relative mean squared error of each layer in the order of [`names`], without that of the
    /// reference; NaN where the reference has no such layer.
    pub(super) errors: Vec<f64>,
}

impl Point {
    /// The relative mean squared error of the whole picture.
    pub fn error(&self) -> Interval {
        self.layers[0].total
    }

    /// The same of a layer, by its index in [`names`].
    pub(super) fn error_of(&self, layer: usize) -> f64 {
        let sum: f64 = self.repeats.iter().map(|r| r.errors[layer]).sum();
        sum / self.repeats.len() as f64
    }

    /// Index of its setting.
    pub(super) fn setting(&self) -> usize {
        self.index
    }
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
    /// Factors that an A/A comparison keeps below: of seconds, of errors, of their product. No
    /// time is told from another by less than the clock's step.
    pub floor: [f64; 3],
    /// All points: methods by rung, presets that are no rung, the base of the changes and the changes.
    pub points: Vec<Point>,
    /// A curve per method.
    pub curves: Vec<Curve>,
    /// What the changes do.
    pub effects: Vec<Effect>,
    /// What the changes are made to.
    pub base: Option<String>,
    /// What the presets are.
    pub presets: Vec<Standing>,
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

    /// Errors of all layers in one repeat, without the reference's `own`.
    fn of(&self, repeat: usize, own: &[f64]) -> Vec<f64> {
        let layers = self.raw.iter().zip(own);
        layers.map(|(raw, own)| raw[repeat] - own).collect()
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
    let errors = errors(&runs, &reference.layers, scale);
    let layers = errors.layers(&reference.error);
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
    let repeats = seconds
        .iter()
        .enumerate()
        .map(|(i, &seconds)| Repeat {
            seconds,
            errors: errors.of(i, &reference.error),
        })
        .collect();
    let flip: Option<Vec<f64>> = compared.iter().map(|c| c.flip).collect();
    let trimmed: Vec<f64> = compared.iter().map(|c| c.rel_mse_trimmed).collect();
    let (name, rung) = match s.kind {
        Kind::Rung { method, rung } => (study.methods[method].name.clone(), Some(rung)),
        Kind::Preset { method } => (study.methods[method].name.clone(), None),
        Kind::Base => ("unchanged".into(), None),
        Kind::Change(c) => (CHANGES[c].name.into(), None),
        Kind::Again(_) => ("again".into(), None),
    };
    let i = &s.settings.integrator_settings;
    let photons = study.uses_photons(&s.settings);
    Point {
        name,
        rung,
        preset: s.preset,
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

/// Factors between two settings, repeat by repeat: of seconds, of errors in a layer, of both.
pub(super) fn factors(a: &Point, b: &Point, layer: usize) -> [Option<Interval>; 3] {
    let n = a.repeats.len().min(b.repeats.len());
    let time = |p: &[usize]| {
        let logs: Vec<f64> = p
            .iter()
            .map(|&i| (b.repeats[i].seconds / a.repeats[i].seconds).ln())
            .collect();
        Some(median(&logs))
    };
    let error = |p: &[usize]| {
        let sum = |q: &Point| p.iter().map(|&i| q.repeats[i].errors[layer]).sum::<f64>();
        let (x, y) = (sum(a), sum(b));
        (x > 0.0 && y > 0.0).then(|| (y / x).ln())
    };
    let both = |p: &[usize]| Some(time(p)? + error(p)?);
    [bootstrap(n, time), bootstrap(n, error), bootstrap(n, both)].map(|i| i.map(exp))
}

pub(super) fn exp(i: Interval) -> Interval {
    Interval {
        value: i.value.exp(),
        low: i.low.exp(),
        high: i.high.exp(),
    }
}

/// Whether a factor is told from 1.
pub(super) fn differs(i: &Interval, floor: f64) -> bool {
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
    let twins = twin(false).zip(twin(true));
    let tick = study.clock.resolution();
    let told = |a: &Point, b: &Point| resolved(a.seconds.value, b.seconds.value, tick);
    let floors = match twins {
        Some((a, b)) => {
            let [time, error, both] = factors(a, b, 0);
            let least = told(a, b);
            [floor(&time, least), floor(&error, 1.0), floor(&both, least)]
        }
        None => [1.0; 3],
    };
    let base = all.iter().find(|p| kind(p) == Kind::Base);
    let effects = all
        .iter()
        .filter_map(|p| match kind(p) {
            Kind::Change(c) => Some((c, p)),
            _ => None,
        })
        .filter_map(|(c, p)| {
            let [time, error, cost] = factors(base?, p, 0);
            let all = [time?, error?, cost?];
            let least = told(base?, p);
            let floors = [floors[0].max(least), floors[1], floors[2].max(least)];
            Some(Effect {
                change: CHANGES[c].name,
                doc: CHANGES[c].doc,
                time: all[0],
                error: all[1],
                cost: all[2],
                differs: std::array::from_fn(|k| differs(&all[k], floors[k])),
            })
        })
        .collect();
    let of_method = |m: usize| -> Vec<&Point> {
        all.iter()
            .filter(|p| matches!(kind(p), Kind::Rung { method, .. } if method == m))
            .collect()
    };
    let ladders: Vec<Vec<&Point>> = (0..study.methods.len()).map(of_method).collect();
    let curves = curves(
        &study.methods,
        &ladders,
        &study.reference.error,
        twins,
        tick,
    );
    let base = base.map(describe);
    let shown = |p: &Point| !matches!(kind(p), Kind::Again(_));
    let points: Vec<Point> = all.iter().filter(|p| shown(p)).cloned().collect();
    let presets = study.presets.iter().map(|(preset, of)| {
        let method = of.map(|m| study.methods[m].name.as_str());
        (preset, method)
    });
    let presets = standings(presets, &points);
    Analysis {
        presets,
        floor: floors,
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
