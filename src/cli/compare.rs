//! `dualight compare`: two ray tracing backends on the same rays, and in the same picture.

use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};

use super::args::CompareArgs;
use super::plan::{default_size, import_options};
use super::{Ending, console, format, progress, signal};
use crate::accel::{Accelerator, CrossCheck};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::import;
use crate::output;
use crate::photons::{EmissionContext, Purpose};
use crate::pipeline::{self, RenderSettings};
use crate::plugins::Registry;
use crate::report::agreement::{self, Agreement, Case};
use crate::report::diff::{Comparison, Pair};
use crate::report::rays::RayMaker;
use crate::scene::Scene;

/// Photons that rays begin as; more would only take longer to number.
const PHOTONS: u64 = 1 << 20;

/// Compares two backends.
pub(super) fn run(args: &CompareArgs) -> Result<Ending> {
    let start = Instant::now();
    let registry = Registry::builtin();
    let names = backends(args, &registry)?;
    if let Some(Some(path)) = &args.json {
        output::check_writable(path)?;
    }
    let cases = args.replay.as_deref().map(read_cases).transpose()?;
    let control = Arc::new(Control::new(progress::reporter(args.quiet), None));
    signal::install(&control, args.quiet);
    let scene = import::load(
        &args.scene.file,
        &import_options(&args.scene),
        registry.scene.clone(),
    )?;
    let settings = settings(args, &scene);
    let mut report = pipeline::in_pool(settings.threads, || {
        compare(args, &scene, &registry, &names, cases, &settings, &control)
    })??;
    if let Some(why) = control.stopped() {
        return Ok(Ending::Empty(why));
    }
    report.seconds = start.elapsed().as_secs_f64();
    match &args.json {
        None => console::print(&report.text())?,
        Some(target) => {
            let text = format!("{:#}\n", report.json());
            match target {
                None => console::print(&text)?,
                Some(path) => {
                    output::write_atomically(path, |sink| sink.write_all(text.as_bytes()))?;
                }
            }
            if !args.quiet {
                console::tell(&report.summary());
            }
        }
    }
    Ok(if report.agreement.total().unexplained == 0 {
        Ending::Done
    } else {
        Ending::Different
    })
}

/// Names of the subject and of the reference.
fn backends(args: &CompareArgs, registry: &Registry) -> Result<[&'static str; 2]> {
    let subject = registry.accelerators.choose(args.accel.as_deref())?.name;
    let default = if subject == "bvh" { "linear" } else { "bvh" };
    let wanted = args.reference.as_deref().unwrap_or(default);
    let reference = registry.accelerators.find(wanted)?.name;
    if subject == reference {
        return Err(Error::Usage(format!(
            "--accel and --reference are both {subject}; name two different ones, see dualight \
             plugins"
        )));
    }
    Ok([subject, reference])
}

/// Settings of both pictures, but for the backend.
fn settings(args: &CompareArgs, scene: &Scene) -> RenderSettings {
    let camera = scene.cameras.first();
    let size = args.size.unwrap_or_else(|| {
        let full = default_size(camera.and_then(|c| c.aspect));
        super::values::Size {
            width: full.width.div_ceil(4),
            height: full.height.div_ceil(4),
        }
    });
    let mut settings = RenderSettings {
        width: size.width,
        height: size.height,
        spp: args.spp.max(1),
        threads: args.threads.map(|n| n as usize),
        ..Default::default()
    };
    settings.integrator_settings.seed = args.seed;
    settings.integrator_settings.photons = 50_000;
    settings.integrator_settings.caustic_photons = 50_000;
    settings
}

fn compare(
    args: &CompareArgs,
    scene: &Scene,
    registry: &Registry,
    names: &[&'static str; 2],
    cases: Option<Vec<agreement::Question>>,
    settings: &RenderSettings,
    control: &Control,
) -> Result<Report> {
    let build = |name: &str| -> Result<Box<dyn Accelerator>> {
        let entry = registry.accelerators.find(name)?;
        (entry.build)(&scene.geometry, rayon::current_num_threads())
    };
    let (subject, reference) = (build(names[0])?, build(names[1])?);
    let check = CrossCheck {
        geometry: &scene.geometry,
        subject: &*subject,
        reference: &*reference,
    };
    let replayed = cases.is_some();
    let agreement = match cases {
        Some(cases) => agreement::replay(&check, &cases),
        None => {
            let camera = pipeline::choose_camera(scene, settings, registry)?;
            let emission = registry.emissions.choose(None)?;
            let photons = [Purpose::Global, Purpose::Caustic].map(|purpose| {
                (emission.build)(&EmissionContext {
                    scene,
                    accel: &*reference,
                    seed: args.seed,
                    purpose,
                    count: PHOTONS,
                    guide: None,
                })
            });
            let maker = RayMaker {
                scene,
                camera: &*camera,
                photons: photons.into(),
                accel: &*reference,
                seed: args.seed,
            };
            agreement::compare(&check, &maker, args.rays, args.worst as usize, control)
        }
    };
    let images = if replayed || args.spp == 0 || control.stopped().is_some() {
        None
    } else {
        let picture = |name: &str| {
            let settings = RenderSettings {
                accelerator: Some(name.into()),
                ..settings.clone()
            };
            pipeline::render(scene, &settings, registry, control).map(|r| r.film.develop())
        };
        let pair = Pair::new(&picture(names[0])?, &picture(names[1])?, None)?;
        Some(pair.compare(0.0))
    };
    Ok(Report {
        scene: args.scene.file.display().to_string(),
        backends: *names,
        objects: scene
            .geometry
            .objects
            .iter()
            .map(|o| o.name.to_string())
            .collect(),
        agreement,
        images,
        replayed,
        seconds: 0.0,
    })
}

/// The rays of an earlier report.
fn read_cases(path: &Path) -> Result<Vec<agreement::Question>> {
    let broken = |problem: String| {
        let remedy = "give a file that dualight compare --json=FILE wrote";
        Error::file(path, problem, remedy)
    };
    let text = std::fs::read_to_string(path).map_err(|e| broken(e.to_string()))?;
    let value: Value = serde_json::from_str(&text).map_err(|e| broken(format!("no JSON ({e})")))?;
    let worst = value["worst"]
        .as_array()
        .ok_or_else(|| broken("no list 'worst' in it".into()))?;
    worst
        .iter()
        .enumerate()
        .map(|(i, v)| agreement::parse_case(v).map_err(|e| broken(format!("worst[{i}]: {e}"))))
        .collect()
}

/// What is told.
struct Report {
    scene: String,
    backends: [&'static str; 2],
    objects: Vec<String>,
    agreement: Agreement,
    images: Option<Comparison>,
    replayed: bool,
    seconds: f64,
}

impl Report {
    /// One line.
    fn summary(&self) -> String {
        let t = self.agreement.total();
        let [a, b] = self.backends;
        let image = self.images.as_ref().map_or(String::new(), |c| {
            format!(", images relMSE {:.1e}", c.rel_mse)
        });
        format!(
            "{}: {a} against {b}: {} rays, {} ties, {} edges, {} unexplained{image}, {:.1} s\n",
            self.scene,
            format::count(t.rays as f64),
            t.ties,
            t.edges,
            t.unexplained,
            self.seconds,
        )
    }

    /// The table, the worst rays, and the line.
    fn text(&self) -> String {
        let mut out = String::new();
        // Writing to a string does not fail.
        let _ = writeln!(
            out,
            "{:>8} {:>10} {:>10} {:>8} {:>8} {:>8} {:>12} {:>7} {:>9}",
            "kind", "rays", "hits", "ties", "edges", "lost", "unexplained", "bound", "distance"
        );
        for (kind, t) in &self.agreement.kinds {
            let _ = writeln!(
                out,
                "{:>8} {:>10} {:>10} {:>8} {:>8} {:>8} {:>12} {:>7.3} {:>9.3}",
                kind.name(),
                t.rays,
                t.hits,
                t.ties,
                t.edges,
                t.lost,
                t.unexplained,
                t.worst_explained,
                t.worst_distance,
            );
        }
        for case in &self.agreement.worst {
            let f = &case.finding;
            if self.replayed || f.class == crate::accel::Class::Unexplained {
                let _ = writeln!(out, "{}", self.line(case));
            }
        }
        out + &self.summary()
    }

    fn line(&self, case: &Case) -> String {
        let f = &case.finding;
        let hit = |h: &Option<crate::geometry::Hit>| match h {
            None => "nothing".to_string(),
            Some(h) => {
                let name = self
                    .objects
                    .get(h.object.index())
                    .map_or("", String::as_str);
                format!("{name} #{} at {}", h.prim, h.t)
            }
        };
        let r = &case.ray;
        format!(
            "{} ({}, {:.3} of the bound): {} ray o {} d {} from {} to {}: {} {}, {} {}",
            f.class.name(),
            f.reason,
            f.ratio,
            case.kind.name(),
            r.o,
            r.d,
            r.tmin,
            r.tmax,
            self.backends[0],
            hit(&f.subject),
            self.backends[1],
            hit(&f.reference),
        )
    }

    fn json(&self) -> Value {
        let kinds: serde_json::Map<String, Value> = self
            .agreement
            .kinds
            .iter()
            .map(|(k, t)| (k.name().into(), json!(t)))
            .collect();
        json!({
            "scene": self.scene,
            "subject": self.backends[0],
            "reference": self.backends[1],
            "total": self.agreement.total(),
            "kinds": kinds,
            "worst": self.agreement.worst.iter().map(agreement::case_to_json).collect::<Vec<_>>(),
            "images": self.images,
            "seconds": self.seconds,
        })
    }
}
