//! `dualight render`.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use super::args::RenderArgs;
use super::choice::{self, Choice};
use super::keep::Keeper;
use super::plan::{Plan, StatisticsTarget, camera_note};
use super::summary::{self, Summary};
use super::{Ending, console, progress, signal};
use crate::control::{Control, Stopped};
use crate::error::{Error, Result};
use crate::film::Film;
use crate::import;
use crate::integrators::PhotonNeeds;
use crate::output;
use crate::photons::SAMPLES_PER_PASS;
use crate::pipeline::{self, PhotonFile, RenderSettings, Rendering, Session};
use crate::plugins::Registry;
use crate::scene::Census;
use crate::stats::StageTime;

/// Renders a scene to image files.
pub(super) fn run(args: &RenderArgs) -> Result<Ending> {
    let start = Instant::now();
    let registry = Registry::builtin();
    let plan = Plan::new(args, &registry)?;
    check_targets(&plan)?;

    // A limit beyond what the clock can tell is none.
    let deadline = plan.time_limit.and_then(|limit| start.checked_add(limit));
    let control = Arc::new(Control::new(progress::reporter(plan.quiet), deadline));
    signal::install(&control, plan.quiet);

    let scene = {
        let _stage = control.stage("import", "bytes", 0);
        import::load(&plan.scene, &plan.import, registry.scene.clone())?
    };
    let imported = start.elapsed().as_secs_f64();
    if !plan.quiet {
        for note in &scene.notes {
            console::say(format_args!("note: {note}"));
        }
        for warning in &scene.warnings {
            console::say(format_args!("warning: {warning}"));
        }
    }
    let Choice {
        integrator,
        reason,
        prepared,
    } = choice::choose(&plan, &scene, &registry, &control)?;
    let settings = plan.settings_for(&scene, integrator, &registry)?;
    if !plan.quiet {
        if let Some(note) = camera_note(&scene, settings.camera.as_deref()) {
            console::say(format_args!("note: {note}"));
        }
        let needs = registry.integrators.find(integrator)?.photons;
        if plan.photons.is_some() && needs != PhotonNeeds::None && settings.spp > SAMPLES_PER_PASS {
            console::say(format_args!(
                "note: the file of photons has those of the first {SAMPLES_PER_PASS} samples per \
                 pixel; later samples get others, traced anew each time"
            ));
        }
        for option in plan.idle_options(needs) {
            console::say(format_args!(
                "warning: {option} has no meaning for the integrator {integrator}"
            ));
        }
        let census = Census::new(&scene);
        if integrator == "path" && census.delta_lights > 0 && census.sharp_objects > 0 {
            console::say(format_args!(
                "warning: {} lights have no extent, and paths from the camera do not find what \
                 mirrors and glass make of their light; render with --integrator photon or hybrid",
                census.delta_lights
            ));
        }
    }
    if let Some(why) = control.stopped() {
        return Ok(nothing(why));
    }
    let mut keeper = Keeper::new(&plan, &settings, &registry, start)?;
    let earlier = keeper.earlier()?;
    let session = Session {
        seconds: earlier.as_ref().map_or(0.0, |c| c.seconds),
        film: earlier.map(|c| c.film),
        watch: &mut |film, standing| keeper.watch(film, standing),
        photons: plan.photons.clone(),
        prepared,
    };
    let mut rendering = pipeline::render_session(&scene, &settings, &registry, &control, session)?;
    // Memory is wanted for the image now.
    drop(scene);
    rendering.statistics.stages.insert(
        0,
        StageTime {
            stage: "import",
            seconds: imported,
        },
    );
    let (fewest, most) = rendering.film.sample_range();
    if let (Some(why), 0) = (rendering.stopped, most) {
        return Ok(nothing(why));
    }

    let writing = Instant::now();
    let metadata = keeper.write(&rendering.film)?;
    rendering.statistics.stages.push(StageTime {
        stage: "write",
        seconds: writing.elapsed().as_secs_f64(),
    });

    let summary = Summary {
        scene: &plan.scene,
        settings: &settings,
        integrator_reason: &reason,
        outputs: &plan.outputs,
        metadata: &metadata,
        rendering: &rendering,
        seconds: start.elapsed().as_secs_f64(),
    };
    if !plan.quiet {
        console::tell(&summary::table(&summary));
        if let Some(why) = rendering.stopped {
            console::say(stop_notice(why, (fewest, most), &rendering, &settings));
        }
    }
    match &plan.statistics {
        None => {}
        Some(StatisticsTarget::Stdout) => console::print(&summary::json(&summary))?,
        Some(StatisticsTarget::File(path)) => {
            output::write_atomically(path, |sink| {
                sink.write_all(summary::json(&summary).as_bytes())
            })?;
        }
    }
    Ok(rendering.stopped.map_or(Ending::Done, Ending::Partial))
}

/// Finds out before any work whether everything can be written, and that nothing is written
/// over the scene.
fn check_targets(plan: &Plan) -> Result<()> {
    let files = plan.outputs.iter().chain(match &plan.statistics {
        Some(StatisticsTarget::File(path)) => Some(path),
        _ => None,
    });
    let files = files.chain(&plan.resume).chain(match &plan.photons {
        Some(PhotonFile::Save(path)) => Some(path),
        _ => None,
    });
    let real = |p: &Path| p.canonicalize().ok();
    let scene = real(&plan.scene);
    for path in files {
        if scene.is_some() && real(path) == scene {
            return Err(Error::Usage(format!(
                "{}: would be written over the scene; choose another name",
                path.display()
            )));
        }
        output::check_writable(path)?;
    }
    Ok(())
}

fn nothing(why: Stopped) -> Ending {
    console::say(match why {
        Stopped::Interrupted => "interrupted before the first sample; nothing was written",
        Stopped::TimeLimit => {
            "error: the time was up before the first sample and nothing was written; allow more \
             with --time-limit"
        }
    });
    Ending::Empty(why)
}

/// One line on what the image lacks.
fn stop_notice(
    why: Stopped,
    (fewest, most): (u32, u32),
    rendering: &Rendering,
    settings: &RenderSettings,
) -> String {
    let why = match why {
        Stopped::Interrupted => "interrupted",
        Stopped::TimeLimit => "stopped at the time limit",
    };
    let error = match rendering.statistics.estimated_error {
        Some(e) => format!(", relMSE about {e:.2e}"),
        None => String::new(),
    };
    let asked = match settings.spp {
        u32::MAX => String::new(),
        n => format!(" of {n}"),
    };
    match unsampled(&rendering.film, settings.crop) {
        0 if settings.crop.is_some() => {
            format!("{why}: at most {most}{asked} samples per pixel{error}")
        }
        0 => format!("{why}: {fewest} to {most}{asked} samples per pixel{error}"),
        n => format!("{why}: {n} pixels have no sample and are black"),
    }
}

/// Pixels of the rendered rectangle that have no sample.
fn unsampled(film: &Film, crop: Option<[u32; 4]>) -> usize {
    let [x0, y0, x1, y1] = crop.unwrap_or([0, 0, film.width(), film.height()]);
    let row = |y: u32| {
        let at = |x: u32| y as usize * film.width() as usize + x as usize;
        &film.samples()[at(x0)..at(x1)]
    };
    (y0..y1)
        .map(|y| row(y).iter().filter(|n| **n == 0).count())
        .sum()
}

/// The command as typed, such that a shell would understand it.
pub(super) fn command_line() -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    std::env::args_os()
        .map(|w| {
            let w = w.to_string_lossy();
            if !w.is_empty() && w.chars().all(plain) {
                w.into_owned()
            } else {
                format!("'{}'", w.replace('\'', r"'\''"))
            }
        })
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{PixelSample, Tile};

    #[test]
    fn pixels_without_samples_are_counted_within_the_crop() {
        let mut film = Film::new(4, 3);
        film.add(&Tile {
            x: 1,
            y: 1,
            width: 2,
            height: 1,
            sums: vec![PixelSample::default(); 2],
            samples: 1,
        });
        assert_eq!(unsampled(&film, None), 10);
        assert_eq!(unsampled(&film, Some([1, 1, 3, 2])), 0);
        assert_eq!(unsampled(&film, Some([1, 1, 4, 3])), 4);
    }
}
