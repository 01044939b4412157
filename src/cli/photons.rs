//! `dualight photons`: stored photons as the camera sees them.

use std::sync::Arc;

use super::photon_args::PhotonsArgs;
use super::plan::{camera_note, default_size, import_options};
use super::{Ending, console, format, progress, signal};
use crate::control::Control;
use crate::error::Result;
use crate::import;
use crate::output::{self, Metadata, OutputSettings};
use crate::photons::PhotonSettings;
use crate::pipeline::{self, RenderSettings};
use crate::plugins::Registry;
use crate::report::photon_view::{PhotonView, View};
use crate::scene::Scene;

/// Draws the photons.
pub(super) fn run(args: &PhotonsArgs) -> Result<Ending> {
    let registry = Registry::builtin();
    output::format_of(&registry.outputs, &args.output)?;
    output::check_writable(&args.output)?;
    let control = Arc::new(Control::new(progress::reporter(args.quiet), None));
    signal::install(&control, args.quiet);
    let scene = import::load(
        &args.scene.file,
        &import_options(&args.scene),
        registry.scene.clone(),
    )?;
    if let Some(note) = camera_note(&scene, args.camera.as_deref()).filter(|_| !args.quiet) {
        console::say(format_args!("note: {note}"));
    }
    let threads = args.threads.map(|n| n as usize);
    let view = pipeline::in_pool(threads, || look(args, &scene, &registry, &control))??;
    if let Some(why) = control.stopped() {
        return Ok(Ending::Empty(why));
    }
    let metadata = Metadata {
        command_line: super::render::command_line(),
        seed: args.seed,
        ..Metadata::default()
    };
    output::write(
        &registry.outputs,
        &view.image(),
        &OutputSettings::default(),
        &metadata,
        &args.output,
    )?;
    if !args.quiet {
        console::tell(&table(&view));
    }
    Ok(Ending::Done)
}

fn look(
    args: &PhotonsArgs,
    scene: &Scene,
    registry: &Registry,
    control: &Control,
) -> Result<PhotonView> {
    let emission = registry.emissions.choose(args.emission.as_deref())?;
    let backend = registry.accelerators.choose(args.accel.as_deref())?;
    let aspect = match &args.camera {
        None => scene.cameras.first(),
        Some(name) => scene.cameras.iter().find(|c| c.name == *name),
    }
    .and_then(|c| c.aspect);
    let size = args.size.unwrap_or_else(|| default_size(aspect));
    let settings = RenderSettings {
        camera: args.camera.clone(),
        width: size.width,
        height: size.height,
        ..RenderSettings::default()
    };
    let camera = pipeline::choose_camera(scene, &settings, registry)?;
    let accel = (backend.build)(&scene.geometry, rayon::current_num_threads())?;
    let photons = PhotonSettings {
        seed: args.seed,
        global: args.photons,
        caustic: args.caustic_photons,
        nearest: settings.integrator_settings.nearest,
        max_depth: None,
        roulette: true,
        guidance: crate::photons::Guidance::Off,
    };
    let view = View {
        scene,
        accel: &*accel,
        camera: &*camera,
        width: size.width,
        height: size.height,
    };
    Ok(view.photons(emission, &photons, args.first, control))
}

fn table(view: &PhotonView) -> String {
    let mut out = format!(
        "{:>8} {:>9} {:>11} {:>8} {:>9} {:>9}\n",
        "map", "emitted", "check rays", "cells", "stored", "seen"
    );
    for (name, (counts, seen)) in ["global", "caustic"]
        .iter()
        .zip(view.counts.iter().zip(&view.seen))
    {
        let n = |n: u64| format::count(n as f64);
        let seen = seen.iter().map(|n| u64::from(*n)).sum();
        out += &format!(
            "{name:>8} {:>9} {:>11} {:>8} {:>9} {:>9}\n",
            n(counts.emitted),
            n(counts.checked),
            n(counts.cells),
            n(counts.stored),
            n(seen)
        );
    }
    out
}
