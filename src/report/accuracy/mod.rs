//! Error against time: every method at a ladder of settings, several seeds each, judged by a
//! reference; as one page, as a plot, as tables.
//!
//! The protocol: settings take turns in a random order, so that what else the machine does
//! disturbs all alike; the same setting measured twice as if it were two (A/A) gives the noise
//! floor, and differences below it are no differences; intervals are bootstrapped over seeds,
//! not over pixels, which share photons.

mod analysis;
mod clock;
mod curves;
mod layers;
mod measure;
mod methods;
mod page;
mod plots;
mod precision;
mod presets;
mod reference;
mod tables;

pub use analysis::{Analysis, Effect, LayerError, Point};
pub use clock::Clock;
pub use curves::{Curve, LayerTimes, Level};
pub use layers::Layers;
pub use measure::{Kind, Run, Setting};
pub use methods::{CHANGES, Change, Method, methods};
pub use page::page;
pub use plots::overview;
pub use precision::with_measured_backends;
pub use presets::{Preset, Standing};
pub use reference::Reference;
pub use tables::{csv, json, markdown, text, times_csv};

use std::path::PathBuf;

use crate::control::Control;
use crate::error::Result;
use crate::integrators::PhotonNeeds;
use crate::pipeline::{self, RenderSettings};
use crate::plugins::Registry;
use crate::scene::Scene;

/// Part of the budget that a reference gets which has to be computed.
const REFERENCE_SHARE: f64 = 0.5;

/// What is to be studied.
#[derive(Clone, Debug)]
pub struct StudyOptions {
    /// The methods; the first is what the others are compared with.
    pub methods: Vec<Method>,
    /// Settings that all share.
    pub base: RenderSettings,
    /// Seeds per setting, at least 2.
    pub repeats: usize,
    /// Seconds that it all may take, about.
    pub budget: f64,
    /// Whether to measure single changes too.
    pub changes: bool,
    /// The presets, by settings that suit the scene: which points of the curves they are.
    pub presets: Vec<Preset>,
    /// The reference's file, if it is not to be computed.
    pub reference: Option<PathBuf>,
    /// The error of a computed reference, as a part of the smallest error measured.
    pub reference_error: f64,
    /// Stops at which FLIP and the page look at pictures.
    pub exposure: f64,
    /// Which time counts.
    pub clock: Clock,
}

/// What was measured.
#[derive(Debug)]
pub struct Study {
    /// The methods.
    pub methods: Vec<Method>,
    /// The settings.
    pub settings: Vec<Setting>,
    /// The pictures.
    pub runs: Vec<Run>,
    /// What they are judged by.
    pub reference: Reference,
    /// Stops at which pictures are looked at.
    pub exposure: f64,
    /// Which time counts.
    pub clock: Clock,
    /// The presets, and of each the index of its method.
    presets: Vec<(Preset, Option<usize>)>,
    photon_integrators: Vec<&'static str>,
}

impl Study {
    /// Says what the pictures say.
    pub fn analyse(&self) -> Analysis {
        analysis::analyse(self)
    }

    fn uses_photons(&self, settings: &RenderSettings) -> bool {
        let name = settings.integrator.as_deref().unwrap_or_default();
        self.photon_integrators.contains(&name)
    }
}

/// Measures; `None` if it was stopped.
///
/// # Errors
/// As [`pipeline::render`]; a reference that cannot be read or has another size.
pub fn study(
    scene: &Scene,
    registry: &Registry,
    options: StudyOptions,
    control: &Control,
) -> Result<Option<Study>> {
    let base = &options.base;
    let renderer = measure::Renderer {
        scene,
        registry,
        control,
    };
    // A file that does not fit is told at once.
    let file = options
        .reference
        .as_deref()
        .map(|path| reference::read(path, base.width, base.height))
        .transpose()?;
    let budget = match &file {
        Some(_) => options.budget,
        None => options.budget * (1.0 - REFERENCE_SHARE),
    };
    let of = presets::methods_of(&options.presets, &options.methods, base, registry)?;
    let plan = measure::plan(&renderer, &options, &of, budget)?;
    let Some(settings) = plan else {
        return Ok(None);
    };
    let Some(runs) = measure::run(&renderer, &settings)? else {
        return Ok(None);
    };
    let reference = match file {
        Some(file) => Some(file),
        None => {
            let smallest = |layers: &Layers| {
                let scale = layers::Scale::new(layers.beauty());
                let of = |s: usize| {
                    let mine: Vec<&Run> = runs.iter().filter(|r| r.setting == s).collect();
                    analysis::errors(&mine, layers, &scale).smallest()
                };
                (0..settings.len()).map(of).fold(f64::INFINITY, f64::min)
            };
            let goal = |layers: &Layers| options.reference_error * smallest(layers);
            let seconds = options.budget * REFERENCE_SHARE;
            reference::compute(&renderer, base, seconds, goal)?
        }
    };
    let photon_integrators = registry.integrators.entries().iter();
    Ok(reference.map(|reference| Study {
        methods: options.methods,
        settings,
        runs,
        reference,
        exposure: options.exposure,
        clock: options.clock,
        presets: options.presets.into_iter().zip(of).collect(),
        photon_integrators: photon_integrators
            .filter(|e| e.photons != PhotonNeeds::None)
            .map(|e| e.name)
            .collect(),
    }))
}

/// What the page tells about the scene and the machine besides the measurements.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Circumstances {
    /// The scene's file.
    pub scene: String,
    /// What it holds, in a line.
    pub contents: String,
    /// Its effects, and why.
    pub effects: Vec<String>,
    /// The command that measures it again.
    pub command: String,
    /// Processor, threads, load, version, commit.
    pub machine: Vec<String>,
}

/// What to write about a scene's effects: name, whether it is simulated, and why.
pub fn effect_lines(scene: &Scene, registry: &Registry) -> Result<Vec<String>> {
    let survey = crate::effects::survey(scene, "auto", &registry.effects)?;
    Ok(survey
        .decisions
        .iter()
        .map(|d| {
            format!(
                "{} {}: {}",
                d.name,
                if d.on { "on" } else { "skipped" },
                d.reason
            )
        })
        .collect())
}

/// Threads that a study with these settings uses.
pub fn threads(settings: &RenderSettings) -> Result<usize> {
    pipeline::in_pool(settings.threads, rayon::current_num_threads)
}
