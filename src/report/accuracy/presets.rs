//! Where the presets of `--quality` stand: settings as `render` would take them for the scene, each at
//! the rung of the method that it is, or measured for itself.

use serde::Serialize;

use super::measure::{Kind, Setting};
use super::methods::Method;
use super::tables::{interval, short};
use super::{Analysis, Point};
use crate::error::Result;
use crate::pipeline::{Quality, RenderSettings};
use crate::plugins::Registry;
use crate::report::statistics::Interval;

/// Part of the budget that a preset may take which is no rung of a ladder.
const SHARE: f64 = 0.2;

/// Fewest pictures of a setting: from one, nothing is known of its spread.
const FEWEST: f64 = 2.0;

/// What a preset renders a scene by.
#[derive(Clone, Debug)]
pub struct Preset {
    /// Which.
    pub quality: Quality,
    /// Its settings for this scene.
    pub settings: RenderSettings,
    /// Why these.
    pub reason: String,
}

/// Whether two settings are of one method: they may differ in how fine they are.
fn alike(a: &RenderSettings, b: &RenderSettings, registry: &Registry) -> Result<bool> {
    let names = |s: &RenderSettings| -> Result<[&'static str; 2]> {
        Ok([
            registry.integrators.choose(s.integrator.as_deref())?.name,
            registry.emissions.choose(s.emission.as_deref())?.name,
        ])
    };
    Ok(names(a)? == names(b)? && a.pixel_sampling == b.pixel_sampling)
}

/// The method that each preset renders by, if it is one of these.
pub(super) fn methods_of(
    presets: &[Preset],
    methods: &[Method],
    base: &RenderSettings,
    registry: &Registry,
) -> Result<Vec<Option<usize>>> {
    let of = |preset: &Preset| {
        for (i, m) in methods.iter().enumerate() {
            if alike(&m.settings(base, 0), &preset.settings, registry)? {
                return Ok(Some(i));
            }
        }
        Ok(None)
    };
    presets.iter().map(of).collect()
}

/// Names the presets among the settings, and adds those that are none of them but belong to a method,
/// if they can be had within a part of `budget`. `expected` tells the seconds of a method with so many
/// samples.
pub(super) fn place(
    settings: &mut Vec<Setting>,
    presets: &[(&Preset, Option<usize>)],
    (budget, repeats): (f64, usize),
    expected: impl Fn(usize, u32) -> f64,
) {
    for (preset, of) in presets {
        let Some(of) = *of else {
            continue;
        };
        let name = Some(preset.quality.name());
        let spp = preset.settings.spp;
        let rung = settings.iter_mut().find(|s| {
            matches!(s.kind, Kind::Rung { method, .. } if method == of) && s.settings.spp == spp
        });
        if let Some(rung) = rung {
            rung.preset = name;
            continue;
        }
        let expected = expected(of, spp);
        let fit = (budget * SHARE / expected).floor();
        if fit >= FEWEST {
            settings.push(Setting {
                kind: Kind::Preset { method: of },
                preset: name,
                settings: preset.settings.clone(),
                expected,
                repeats: repeats.min(fit as usize),
            });
        }
    }
}

/// A preset and what it was measured to take and to bring.
#[derive(Clone, Debug, Serialize)]
pub struct Standing {
    /// Its name.
    pub preset: &'static str,
    /// The method that it is on this scene; `None` if that was not measured.
    pub method: Option<String>,
    /// Why it is this one.
    pub reason: String,
    /// Samples per pixel.
    pub spp: u32,
    /// Seconds and error, if it was measured.
    pub measured: Option<(Interval, Interval)>,
    /// Seconds over those of the preset before.
    pub times_longer: Option<f64>,
    /// Error of the preset before over this one's.
    pub times_better: Option<f64>,
}

/// Every preset in turn, with the name of its method.
pub(super) fn standings<'a>(
    presets: impl IntoIterator<Item = (&'a Preset, Option<&'a str>)>,
    points: &[Point],
) -> Vec<Standing> {
    let mut out: Vec<Standing> = Vec::new();
    for (p, method) in presets {
        let name = p.quality.name();
        let point = points.iter().find(|q| q.preset == Some(name));
        let measured = point.map(|q| (q.seconds, q.error()));
        let before = out.last().and_then(|b| b.measured);
        let factor = |of: fn(&(Interval, Interval)) -> Interval| {
            let factor = of(&measured?).value / of(&before?).value;
            Some(factor).filter(|f| f.is_finite() && *f > 0.0)
        };
        out.push(Standing {
            preset: name,
            method: method.map(Into::into),
            reason: p.reason.clone(),
            spp: p.settings.spp,
            times_longer: factor(|m| m.0),
            times_better: factor(|m| m.1).map(|f| 1.0 / f),
            measured,
        });
    }
    out
}

impl Standing {
    /// Seconds, error, and factors to the preset before, in words.
    pub(super) fn cells(&self) -> [String; 6] {
        let method = self.method.as_deref().unwrap_or("not measured here");
        let factor = |f: Option<f64>| f.map_or(String::new(), short);
        let (seconds, error) = match &self.measured {
            Some((t, e)) => (interval(t), interval(e)),
            None => ("not measured".into(), "not measured".into()),
        };
        [
            format!("{}, {} samples", self.preset, self.spp),
            method.into(),
            seconds,
            factor(self.times_longer),
            error,
            factor(self.times_better),
        ]
    }
}

/// Heads of the columns of [`Standing::cells`].
pub(super) const COLUMNS: [&str; 6] = [
    "preset",
    "method",
    "seconds",
    "times longer",
    "relMSE",
    "times better",
];

/// Why the presets render by what they do, in a sentence; `None` if nobody asked for presets.
pub(super) fn reason(analysis: &Analysis) -> Option<String> {
    let normal = analysis
        .presets
        .iter()
        .find(|p| p.preset == Quality::Normal.name());
    let p = normal.or(analysis.presets.first())?;
    let method = p
        .method
        .as_deref()
        .unwrap_or("a method that is not measured here");
    Some(format!(
        "`--quality` renders this scene by {method}: {}.",
        p.reason
    ))
}
