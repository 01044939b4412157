//! `dualight accuracy`: error against time, measured.

use std::sync::Arc;

use clap::ValueEnum;

use super::choice::suited_to;
use super::measure_args::AccuracyArgs;
use super::plan::{default_size, import_options};
use super::render::command_line;
use super::values::Size;
use super::{Ending, console, machine, progress, signal};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::import;
use crate::integrators::with_photons;
use crate::output;
use crate::photons::GuideBy;
use crate::pipeline::{Quality, RenderSettings};
use crate::plugins::Registry;
use crate::report::accuracy::{
    self, Analysis, Circumstances, Method, Preset, Study, StudyOptions, methods,
};
use crate::scene::{Census, Scene};

/// Kinds of files that a report can be, by how their names end; the first that fits is taken.
const FORMATS: &[(&str, Writer)] = &[
    ("html", |r| {
        accuracy::page(r.study, r.analysis, r.circumstances, r.registry)
    }),
    ("svg", |r| {
        let title = format!("Accuracy against time: {}", r.circumstances.scene);
        Ok(accuracy::overview(r.analysis, r.study.clock, &title).svg())
    }),
    ("md", |r| Ok(accuracy::markdown(r.analysis))),
    ("times.csv", |r| Ok(accuracy::times_csv(r.analysis))),
    ("csv", |r| Ok(accuracy::csv(r.analysis))),
    ("json", |r| {
        let value = accuracy::json(r.study, r.analysis, r.circumstances);
        Ok(format!("{value:#}\n"))
    }),
];

type Writer = fn(&Report<'_>) -> Result<String>;

struct Report<'a> {
    study: &'a Study,
    analysis: &'a Analysis,
    circumstances: &'a Circumstances,
    registry: &'a Registry,
}

/// Measures error against time.
pub(super) fn run(args: &AccuracyArgs) -> Result<Ending> {
    let registry = accuracy::with_measured_backends(Registry::builtin())?;
    let chosen = choose(&args.methods, &registry)?;
    let writers = writers(args)?;
    let control = Arc::new(Control::new(progress::reporter(args.quiet), None));
    signal::install(&control, args.quiet);
    let load = machine::load();
    let scene = import::load(
        &args.scene.file,
        &import_options(&args.scene),
        registry.scene.clone(),
    )?;
    let base = base(args, &scene);
    let options = StudyOptions {
        methods: chosen,
        base: base.clone(),
        repeats: args.seeds as usize,
        budget: args.budget.as_secs_f64(),
        changes: !args.no_changes,
        presets: presets(&scene, &base, &registry, &control)?,
        reference: args.reference.clone(),
        reference_error: args.reference_error,
        exposure: args.exposure,
        clock: args.clock,
    };
    let study = accuracy::study(&scene, &registry, options, &control)?;
    let (Some(study), None) = (study, control.stopped()) else {
        let why = control
            .stopped()
            .unwrap_or(crate::control::Stopped::Interrupted);
        return Ok(Ending::Empty(why));
    };
    let analysis = study.analyse();
    let circumstances = circumstances(args, &scene, &base, &registry, load)?;
    let report = Report {
        study: &study,
        analysis: &analysis,
        circumstances: &circumstances,
        registry: &registry,
    };
    for (path, write) in args.outputs.iter().zip(writers) {
        let text = write(&report)?;
        output::write_atomically(path, |sink| sink.write_all(text.as_bytes()))?;
    }
    if !args.quiet {
        console::print(&accuracy::text(&analysis))?;
        console::say(format_args!("reference: {}", study.reference.origin));
    }
    Ok(Ending::Done)
}

/// The methods that were named, or all.
fn choose(names: &[String], registry: &Registry) -> Result<Vec<Method>> {
    let all = methods(registry);
    if names.is_empty() {
        return Ok(all);
    }
    names
        .iter()
        .map(|name| {
            all.iter()
                .find(|m| m.name == *name)
                .cloned()
                .ok_or_else(|| Error::UnknownPlugin {
                    kind: "method",
                    name: name.clone(),
                    known: all
                        .iter()
                        .map(|m| m.name.as_str())
                        .collect::<Vec<_>>()
                        .join(", "),
                })
        })
        .collect()
}

/// What `render --quality` would do with the scene.
fn presets(
    scene: &Scene,
    base: &RenderSettings,
    registry: &Registry,
    control: &Control,
) -> Result<Vec<Preset>> {
    let table = &registry.integrators;
    let photons = with_photons(table).unwrap_or(table.choose(None)?);
    let mut prepared = None;
    Quality::value_variants()
        .iter()
        .map(|quality| {
            let settings = quality.apply(base, photons);
            let (name, reason) = suited_to(scene, &settings, registry, &mut prepared, control)?;
            Ok(Preset {
                quality: *quality,
                settings: quality.apply(base, table.find(name)?),
                reason,
            })
        })
        .collect()
}

/// How each output is written; found out before any work is done.
fn writers(args: &AccuracyArgs) -> Result<Vec<Writer>> {
    args.outputs
        .iter()
        .map(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let name = name.to_lowercase();
            let fits = |end: &str| name.strip_suffix(end).is_some_and(|n| n.ends_with('.'));
            let found = FORMATS.iter().find(|f| fits(f.0));
            output::check_writable(path)?;
            found.map(|f| f.1).ok_or_else(|| {
                Error::Usage(format!(
                    "{}: the extension chooses the format and must be one of .html, .svg, .md, .csv, .times.csv, .json",
                    path.display()
                ))
            })
        })
        .collect()
}

fn base(args: &AccuracyArgs, scene: &Scene) -> RenderSettings {
    let camera = scene.cameras.first();
    let size = args.size.unwrap_or_else(|| {
        let full = default_size(camera.and_then(|c| c.aspect));
        Size {
            width: full.width.div_ceil(4),
            height: full.height.div_ceil(4),
        }
    });
    let mut base = RenderSettings {
        camera: args.camera.clone(),
        width: size.width,
        height: size.height,
        threads: args.threads.map(|n| n as usize),
        ..Default::default()
    };
    base.integrator_settings.seed = args.seed;
    // As `render` has still pictures guided.
    base.integrator_settings.guide = GuideBy::View;
    base
}

fn circumstances(
    args: &AccuracyArgs,
    scene: &Scene,
    base: &RenderSettings,
    registry: &Registry,
    load: Option<f64>,
) -> Result<Circumstances> {
    let census = Census::new(scene);
    let threads = accuracy::threads(base)?;
    let name = args.scene.file.file_name().unwrap_or_default();
    Ok(Circumstances {
        scene: name.to_string_lossy().into_owned(),
        contents: format!(
            "{} triangles, {} spheres, {} lights; {}x{} pixels",
            census.placed_triangles,
            census.spheres,
            scene.lights.len(),
            base.width,
            base.height
        ),
        effects: accuracy::effect_lines(scene, registry)?,
        command: command_line(),
        machine: machine::lines(threads, load),
    })
}
