//! Measuring: every setting several times, in turns, each time with another seed.

use std::time::Instant;

use super::StudyOptions;
use super::layers::Layers;
use super::methods::{CHANGES, MOST_CHANGED, MOST_RUNGS, STEP};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::pipeline::{self, RenderSettings};
use crate::plugins::Registry;
use crate::sampling::{Rng, hash2, stream};
use crate::scene::Scene;
use crate::stats::cpu_seconds;

/// One picture and what it took.
#[derive(Debug)]
pub struct Run {
    /// Index of the setting.
    pub setting: usize,
    /// Which repeat.
    pub repeat: usize,
    /// Seconds on the clock, without import.
    pub seconds: f64,
    /// Seconds of processors, all threads together; 0 where the system does not tell.
    pub cpu_seconds: f64,
    /// The picture.
    pub layers: Layers,
}

/// What a setting belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A rung of a method's ladder.
    Rung {
        /// Index of the method.
        method: usize,
        /// Rung, 0 the coarsest.
        rung: u32,
    },
    /// A preset that is no rung of its method.
    Preset {
        /// Index of the method.
        method: usize,
    },
    /// What the changes are made to.
    Base,
    /// One change to it.
    Change(usize),
    /// The noise of measuring: the same again, to be taken for different.
    Again(bool),
}

/// A setting that is measured.
#[derive(Clone, Debug)]
pub struct Setting {
    /// What for.
    pub kind: Kind,
    /// The preset that it is, if any.
    pub preset: Option<&'static str>,
    /// The settings, but for the seed.
    pub settings: RenderSettings,
    /// Seconds that it will take, by estimate.
    pub expected: f64,
    /// How often it is rendered, each time with another seed.
    pub repeats: usize,
}

/// Renders with what all measurements share.
pub(super) struct Renderer<'a> {
    pub(super) scene: &'a Scene,
    pub(super) registry: &'a Registry,
    pub(super) control: &'a Control,
}

impl Renderer<'_> {
    /// One picture; `None` if the run was stopped meanwhile.
    pub(super) fn render(&self, settings: &RenderSettings) -> Result<Option<(Layers, f64, f64)>> {
        let (start, cpu) = (Instant::now(), cpu_seconds());
        // Progress is told by picture, not by pixel.
        let inner = self.control.silent();
        let rendering = pipeline::render(self.scene, settings, self.registry, &inner)?;
        let seconds = start.elapsed().as_secs_f64();
        let cpu = cpu_seconds().zip(cpu).map_or(0.0, |(b, a)| b - a);
        if self.control.stopped().is_some() {
            return Ok(None);
        }
        let layers = Layers::new(&rendering.film.develop())
            .ok_or_else(|| Error::Usage("the picture has no colours; this is a bug".into()))?;
        Ok(Some((layers, seconds, cpu)))
    }
}

/// `settings` with the seed of one repeat of one setting: all different.
fn seeded(settings: &RenderSettings, setting: usize, repeat: usize) -> RenderSettings {
    let mut s = settings.clone();
    let base = hash2(s.integrator_settings.seed, stream::TOOL);
    s.integrator_settings.seed = hash2(base, hash2(setting as u64, repeat as u64));
    s
}

/// Seconds that a method takes, by its two coarsest rungs: some whatever is asked for, and some for each
/// of the samples.
struct Pace {
    /// Samples of the coarsest rung.
    spp: f64,
    fixed: f64,
    /// Seconds of the coarsest rung's samples.
    samples: f64,
}

impl Pace {
    /// From the seconds of the two coarsest rungs. Their difference is mostly noise where pictures are
    /// small, so some of the time always grows.
    fn new(spp: u32, [first, second]: [f64; 2]) -> Self {
        let samples = ((second - first) / (STEP - 1.0)).clamp(first / STEP, first);
        Self {
            spp: f64::from(spp),
            fixed: first - samples,
            samples,
        }
    }

    fn seconds(&self, spp: u32) -> f64 {
        self.fixed + self.samples * f64::from(spp) / self.spp
    }
}

/// What is to be measured within `budget` seconds: for each method as many rungs as fit its
/// share, the presets, every change, and the A/A pair. The estimates come from the coarsest rungs,
/// rendered once. `presets` holds the method of each preset.
pub(super) fn plan(
    renderer: &Renderer<'_>,
    options: &StudyOptions,
    presets: &[Option<usize>],
    budget: f64,
) -> Result<Option<Vec<Setting>>> {
    let StudyOptions {
        methods,
        base,
        repeats,
        changes,
        ..
    } = options;
    let stage = renderer
        .control
        .stage("pilot", "pictures", methods.len() as u64);
    let mut paces = Vec::new();
    for m in methods {
        let mut seconds = [0.0; 2];
        // First to warm up: caches, the clock of the processor, pages of memory.
        for (k, rung) in [(0, 0), (0, 0), (1, 1)] {
            let Some((_, took, _)) = renderer.render(&m.settings(base, rung))? else {
                return Ok(None);
            };
            seconds[k] = took;
        }
        paces.push(Pace::new(m.settings(base, 0).spp, seconds));
        stage.advance(1);
    }
    let setting = |kind, settings: RenderSettings, pace: &Pace| Setting {
        kind,
        preset: None,
        expected: pace.seconds(settings.spp),
        settings,
        repeats: *repeats,
    };
    // Of one part each: every method, the changes, the A/A pair.
    let shares = methods.len() as f64 + if *changes { 1.5 } else { 0.5 };
    let share = budget / shares / *repeats as f64;
    let mut out = Vec::new();
    for (method, (m, pace)) in methods.iter().zip(&paces).enumerate() {
        let mut spent = 0.0;
        for rung in 0..MOST_RUNGS {
            let next = setting(Kind::Rung { method, rung }, m.settings(base, rung), pace);
            // Two points make a curve, whatever they cost.
            if rung >= 2 && spent + next.expected > share {
                break;
            }
            spent += next.expected;
            out.push(next);
        }
    }
    let of: Vec<_> = options
        .presets
        .iter()
        .zip(presets.iter().copied())
        .collect();
    super::presets::place(&mut out, &of, (budget, *repeats), |m, spp| {
        paces[m].seconds(spp)
    });
    // The finest rung of a method that is had within so many seconds.
    let within = |method: usize, most: u32, seconds: f64| {
        let settings = (0..=most).map(|r| methods[method].settings(base, r));
        let fits = |s: &RenderSettings| paces[method].seconds(s.spp) <= seconds;
        let coarsest = || methods[method].settings(base, 0);
        settings.rev().find(fits).unwrap_or_else(coarsest)
    };
    if !methods.is_empty() {
        let settings = within(0, MOST_RUNGS - 1, share / 4.0);
        for twin in [false, true] {
            out.push(setting(Kind::Again(twin), settings.clone(), &paces[0]));
        }
    }
    // What presets render by, if there are photons in it, else the first that has any.
    let photons = |m: &usize| methods[*m].photons(renderer.registry);
    let of_presets = presets.iter().flatten().copied().find(photons);
    let changed = of_presets.or_else(|| (0..methods.len()).find(photons));
    if let (true, Some(method)) = (*changes, changed) {
        // They have one and a half shares, and on average cost one and a half times as much as
        // what they are made to.
        let share = share / (CHANGES.len() + 1) as f64;
        let settings = within(method, MOST_CHANGED, share);
        let kinds = (0..CHANGES.len()).map(Kind::Change);
        for kind in std::iter::once(Kind::Base).chain(kinds) {
            let mut next = setting(kind, settings.clone(), &paces[method]);
            if let Kind::Change(c) = kind {
                (CHANGES[c].apply)(&mut next.settings);
            }
            out.push(next);
        }
    }
    Ok(Some(out))
}

/// Renders all settings as often as they ask for: first the A/A pair, then the others in turns, in
/// another order each time. `None` if stopped.
pub(super) fn run(renderer: &Renderer<'_>, settings: &[Setting]) -> Result<Option<Vec<Run>>> {
    let all = |s: &Setting| s.expected * s.repeats as f64;
    let total: f64 = settings.iter().map(all).sum();
    let repeats = settings.iter().map(|s| s.repeats).max().unwrap_or(0);
    // In milliseconds, as pictures take very different times.
    let stage = renderer
        .control
        .stage("measure", "ms", (total * 1e3) as u64);
    let (again, others): (Vec<usize>, Vec<usize>) =
        (0..settings.len()).partition(|&i| matches!(settings[i].kind, Kind::Again(_)));
    let mut runs = Vec::new();
    let mut rng = Rng::new(hash2(stream::TOOL, settings.len() as u64));
    for group in [again, others] {
        for repeat in 0..repeats {
            let mut order = group.clone();
            order.retain(|&i| repeat < settings[i].repeats);
            for i in (1..order.len()).rev() {
                order.swap(i, (rng.next_u64() % (i as u64 + 1)) as usize);
            }
            for setting in order {
                let s = &settings[setting];
                let picture = renderer.render(&seeded(&s.settings, setting, repeat))?;
                let Some((layers, seconds, cpu_seconds)) = picture else {
                    return Ok(None);
                };
                stage.advance((s.expected * 1e3) as u64);
                runs.push(Run {
                    setting,
                    repeat,
                    seconds,
                    cpu_seconds,
                    layers,
                });
            }
        }
    }
    Ok(Some(runs))
}
