//! Measuring: every setting several times, in turns, each time with another seed.

use std::time::Instant;

use super::layers::Layers;
use super::methods::{CHANGES, MOST_RUNGS, Method, STEP};
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
    /// The settings, but for the seed.
    pub settings: RenderSettings,
    /// Seconds that it will take, by estimate.
    pub expected: f64,
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

/// What is to be measured within `budget` seconds: for each method as many rungs as fit its
/// share, every change, and the A/A pair. The estimates come from the coarsest rungs, rendered
/// once.
pub(super) fn plan(
    renderer: &Renderer<'_>,
    methods: &[Method],
    base: &RenderSettings,
    repeats: usize,
    changes: bool,
    budget: f64,
) -> Result<Option<Vec<Setting>>> {
    let stage = renderer
        .control
        .stage("pilot", "pictures", methods.len() as u64);
    let mut ladders = Vec::new();
    for (method, m) in methods.iter().enumerate() {
        // Once to warm up: caches, the clock of the processor, pages of memory.
        for _ in 0..2 {
            let settings = m.settings(base, 0);
            let Some((_, seconds, _)) = renderer.render(&settings)? else {
                return Ok(None);
            };
            ladders.truncate(method);
            ladders.push(seconds);
        }
        stage.advance(1);
    }
    // Of one part each: every method, the changes, the A/A pair.
    let shares = methods.len() as f64 + if changes { 1.5 } else { 0.5 };
    let share = budget / shares / repeats as f64;
    let mut out = Vec::new();
    for (method, (m, first)) in methods.iter().zip(&ladders).enumerate() {
        let mut spent = 0.0;
        for rung in 0..MOST_RUNGS {
            let expected = first * STEP.powi(rung as i32);
            // Two points make a curve, whatever they cost.
            if rung >= 2 && spent + expected > share {
                break;
            }
            spent += expected;
            out.push(Setting {
                kind: Kind::Rung { method, rung },
                settings: m.settings(base, rung),
                expected,
            });
        }
    }
    let rung_within = |first: f64, seconds: f64| {
        (0..MOST_RUNGS).rfind(|&r| first * STEP.powi(r as i32) <= seconds)
    };
    if let Some(first) = ladders.first() {
        let rung = rung_within(*first, share / 4.0).unwrap_or(0);
        for twin in [false, true] {
            out.push(Setting {
                kind: Kind::Again(twin),
                settings: methods[0].settings(base, rung),
                expected: first * STEP.powi(rung as i32),
            });
        }
    }
    let photons = methods
        .iter()
        .zip(&ladders)
        .find(|(m, _)| m.photons(renderer.registry));
    if let (true, Some((m, first))) = (changes, photons) {
        // They have one and a half shares, and on average cost one and a half times as much as
        // what they are made to.
        let rung = rung_within(*first, share / (CHANGES.len() + 1) as f64).unwrap_or(0);
        let settings = m.settings(base, rung);
        let expected = first * STEP.powi(rung as i32);
        let kinds = (0..CHANGES.len()).map(Kind::Change);
        for kind in std::iter::once(Kind::Base).chain(kinds) {
            let mut changed = settings.clone();
            if let Kind::Change(c) = kind {
                (CHANGES[c].apply)(&mut changed);
            }
            out.push(Setting {
                kind,
                settings: changed,
                expected,
            });
        }
    }
    Ok(Some(out))
}

/// Renders all settings `repeats` times: first the A/A pair, then the others in turns, in
/// another order each time. `None` if stopped.
pub(super) fn run(
    renderer: &Renderer<'_>,
    settings: &[Setting],
    repeats: usize,
) -> Result<Option<Vec<Run>>> {
    let total: f64 = settings.iter().map(|s| s.expected).sum::<f64>() * repeats as f64;
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
