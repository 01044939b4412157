//! Benchmarks: how long each stage takes and how fast rays are, backends side by side.
//!
//! Backends take turns within one run, so that what else the machine does disturbs them alike:
//! ratios within a run count, absolute numbers depend on the machine and on its load.

mod glb;
mod lookups;
mod rays;
mod record;
mod synthetic;

pub use rays::Order;
pub use record::{Metric, PREFIX, Record, Regression, SCHEMA};
pub use synthetic::{KINDS, Synthetic};

use std::path::Path;
use std::time::Instant;

use lookups::{Lookups, Question};
use record::Collector;

use crate::accel::Accelerator;
use crate::control::Control;
use crate::error::Result;
use crate::import::{self, ImportOptions};
use crate::pipeline::{self, RenderSettings, Rendering};
use crate::plugins::Registry;
use crate::scene::{Census, Scene};
use crate::stats::{peak_memory, reset_peak_memory};

/// What is measured on every scene.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// Names of the backends.
    pub backends: Vec<String>,
    /// Rays of each order.
    pub rays: usize,
    /// How often everything is measured.
    pub repeats: usize,
    /// Threads.
    pub threads: usize,
    /// Seed of rays and photons.
    pub seed: u64,
    /// Width and height of the pictures.
    pub size: u32,
}

/// Units, and whether more is better.
const SECONDS: (&str, bool) = ("s", false);
const RATE: (&str, bool) = ("/s", true);
const BYTES: (&str, bool) = ("B", false);

/// Memory once all is built, by the operating system, without the file's size and what the backend
/// says it holds itself (Embree by its memory monitor).
const BEYOND: &str = "beyond both/primitive";

/// Where [`Order::Bounced`] stands among all.
const BOUNCED: usize = 1;

/// Measures one scene on a number of threads; `None` if stopped. Also the versions of the
/// backends.
///
/// # Errors
/// A file that cannot be read, a backend that fails.
pub fn bench(
    file: &Path,
    name: &str,
    import_options: &ImportOptions,
    options: &BenchOptions,
    registry: &Registry,
    control: &Control,
) -> Result<Option<(Vec<Metric>, Vec<String>)>> {
    let work = || measure(file, name, import_options, options, registry, control);
    pipeline::in_pool(Some(options.threads), work)?
}

fn measure(
    file: &Path,
    name: &str,
    import_options: &ImportOptions,
    options: &BenchOptions,
    registry: &Registry,
    control: &Control,
) -> Result<Option<(Vec<Metric>, Vec<String>)>> {
    let steps = 4 + 3 * (options.repeats * options.backends.len()) as u64;
    let stage = control.stage("bench", "steps", steps);
    let silent = control.silent();
    let mut out = Collector {
        scene: name,
        threads: options.threads,
        results: Vec::new(),
    };
    reset_peak_memory();
    let start = peak_memory();
    let file_bytes = std::fs::metadata(file).map_or(0, |m| m.len());
    let (scene, seconds) = import(file, import_options, options, registry)?;
    stage.advance(1);
    out.add("", "import", SECONDS, &seconds);
    let import_seconds = *seconds.last().unwrap_or(&0.0);
    let primitives = {
        let census = Census::new(&scene);
        (census.triangles + census.spheres).max(1) as f64
    };
    if let (Some(a), Some(b)) = (start, peak_memory()) {
        let peak = b.saturating_sub(a) as f64;
        out.add("", "import peak/primitive", BYTES, &[peak / primitives]);
        let beyond = (peak - file_bytes as f64).max(0.0);
        out.add("", "beyond file/primitive", BYTES, &[beyond / primitives]);
    }

    // Each alone in memory, so that its own peak is seen.
    let mut versions = Vec::new();
    for backend in &options.backends {
        reset_peak_memory();
        let before = peak_memory();
        let built = build(&scene, backend, registry)?;
        let stats = built.stats();
        out.add(
            backend,
            "hierarchy/primitive",
            BYTES,
            &[stats.bytes as f64 / primitives],
        );
        if let (Some(a), Some(b)) = (before, peak_memory()) {
            let peak = b.saturating_sub(a) as f64;
            out.add(backend, "build peak/primitive", BYTES, &[peak / primitives]);
        }
        // What the process holds now, the scene with it, but for what the file and the backend's own
        // structure explain. A peak that begins anew is what is resident.
        reset_peak_memory();
        if let (Some(a), Some(b)) = (start, peak_memory()) {
            let explained = file_bytes + stats.bytes;
            let beyond = b.saturating_sub(a).saturating_sub(explained) as f64;
            out.add(backend, BEYOND, BYTES, &[beyond / primitives]);
        }
        versions.push(stats.backend);
    }
    stage.advance(1);

    // Whole pictures, backends in turns.
    let mut times = vec![Times::default(); options.backends.len()];
    for _ in 0..options.repeats {
        for (backend, times) in options.backends.iter().zip(&mut times) {
            if control.stopped().is_some() {
                return Ok(None);
            }
            let settings = settings(backend, options);
            let first = RenderSettings {
                integrator: Some("path".into()),
                spp: 1,
                ..settings.clone()
            };
            let start = Instant::now();
            let r = pipeline::render(&scene, &first, registry, &silent)?;
            times
                .first
                .push(import_seconds + start.elapsed().as_secs_f64());
            times.build.push(lap(&r, "build"));
            stage.advance(1);
            let start = Instant::now();
            let r = pipeline::render(&scene, &settings, registry, &silent)?;
            times.frame.push(start.elapsed().as_secs_f64());
            times.take(&r);
            stage.advance(1);
        }
    }
    for (backend, times) in options.backends.iter().zip(&times) {
        times.report(backend, import_seconds, &mut out);
    }

    // Rays alone.
    let accels: Vec<Box<dyn Accelerator>> = options
        .backends
        .iter()
        .map(|b| build(&scene, b, registry))
        .collect::<Result<_>>()?;
    let settings = settings("", options);
    let camera = pipeline::choose_camera(&scene, &settings, registry)?;
    let judge = accels.first();
    let sets = Order::ALL.map(|order| {
        judge.map_or(Vec::new(), |a| {
            rays::rays(order, options.rays, options.seed, &scene, &*camera, &**a)
        })
    });
    stage.advance(1);
    if let Some(judge) = judge {
        let lookups = Lookups::new(&scene, &**judge, &sets[BOUNCED], options, registry, &silent)?;
        for question in Question::ALL {
            let rates: Vec<f64> = (0..options.repeats)
                .filter_map(|_| lookups.rate(question))
                .collect();
            out.add("", question.metric(), RATE, &rates);
        }
    }
    stage.advance(1);
    let mut rates = vec![vec![[Vec::new(), Vec::new()]; sets.len()]; accels.len()];
    for _ in 0..options.repeats {
        for (accel, rates) in accels.iter().zip(&mut rates) {
            if control.stopped().is_some() {
                return Ok(None);
            }
            for (set, rates) in sets
                .iter()
                .zip(rates.iter_mut())
                .filter(|(s, _)| !s.is_empty())
            {
                for (any, rates) in [false, true].into_iter().zip(rates) {
                    let start = Instant::now();
                    std::hint::black_box(rays::trace(&**accel, set, any));
                    rates.push(set.len() as f64 / start.elapsed().as_secs_f64());
                }
            }
            stage.advance(1);
        }
    }
    for (backend, rates) in options.backends.iter().zip(&rates) {
        for (order, rates) in Order::ALL.into_iter().zip(rates) {
            for (metric, values) in order.metrics().into_iter().zip(rates) {
                out.add(backend, metric, RATE, values);
            }
        }
    }
    Ok(Some((out.results, versions)))
}

/// Imports once, and again while that is quick.
fn import(
    file: &Path,
    import_options: &ImportOptions,
    options: &BenchOptions,
    registry: &Registry,
) -> Result<(Scene, Vec<f64>)> {
    let mut seconds = Vec::new();
    loop {
        let start = Instant::now();
        let scene = import::load(file, import_options, registry.scene.clone())?;
        seconds.push(start.elapsed().as_secs_f64());
        let spent: f64 = seconds.iter().sum();
        if seconds.len() >= options.repeats || spent > 5.0 {
            return Ok((scene, seconds));
        }
    }
}

fn build(scene: &Scene, backend: &str, registry: &Registry) -> Result<Box<dyn Accelerator>> {
    let entry = registry.accelerators.find(backend)?;
    scene.geometry.prepare();
    (entry.build)(&scene.geometry, rayon::current_num_threads())
}

/// A small picture that goes through every stage.
fn settings(backend: &str, options: &BenchOptions) -> RenderSettings {
    let mut s = RenderSettings {
        accelerator: Some(backend.into()),
        integrator: Some("photon".into()),
        effects: "all".into(),
        width: options.size,
        height: options.size,
        spp: 4,
        threads: Some(options.threads),
        ..Default::default()
    };
    s.integrator_settings.seed = options.seed;
    s.integrator_settings.photons = 200_000;
    s.integrator_settings.caustic_photons = 50_000;
    s
}

fn lap(r: &Rendering, stage: &str) -> f64 {
    let laps = r.statistics.stages.iter();
    laps.filter(|l| l.stage == stage).map(|l| l.seconds).sum()
}

/// What whole pictures took.
#[derive(Clone, Default)]
struct Times {
    build: Vec<f64>,
    first: Vec<f64>,
    frame: Vec<f64>,
    photons: Vec<f64>,
    maps: Vec<f64>,
    samples: Vec<f64>,
    gather: Vec<f64>,
}

impl Times {
    fn take(&mut self, r: &Rendering) {
        let s = &r.statistics;
        self.build.push(lap(r, "build"));
        let emitted = s.global_photons.emitted + s.caustic_photons.emitted;
        if emitted > 0 {
            self.photons.push(emitted as f64 / lap(r, "photons"));
            self.maps.push(lap(r, "photon maps"));
        }
        let pixels = lap(r, "pixels");
        self.samples.push(s.rays.camera as f64 / pixels);
        if s.rays.gather > 0 {
            self.gather.push(s.rays.gather as f64 / pixels);
        }
    }

    fn report(&self, backend: &str, import: f64, out: &mut Collector<'_>) {
        out.add(backend, "build", SECONDS, &self.build);
        let over: Vec<f64> = self.build.iter().map(|b| (import + b) / b).collect();
        out.add(backend, "import+build over build", ("", false), &over);
        out.add(backend, "first image", SECONDS, &self.first);
        out.add(backend, "photons", RATE, &self.photons);
        out.add(backend, "photon maps", SECONDS, &self.maps);
        out.add(backend, "gather rays", RATE, &self.gather);
        out.add(backend, "camera samples", RATE, &self.samples);
        out.add(backend, "frame", SECONDS, &self.frame);
    }
}
