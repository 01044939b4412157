//! `dualight reproduce`: the paper's experiment as one command.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::photon_args::ReproduceArgs;
use super::plan::import_options;
use super::render::command_line;
use super::{Ending, console, machine, progress, signal};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::film::Image;
use crate::import;
use crate::output::{self, Metadata, OutputSettings};
use crate::pipeline::RenderSettings;
use crate::plugins::Registry;
use crate::report::reproduction::{self, Outcome};

/// Does the experiment and writes the report.
pub(super) fn run(args: &ReproduceArgs) -> Result<Ending> {
    let registry = Registry::builtin();
    output::check_writable(&args.output)?;
    let folder = args.output.parent().unwrap_or(Path::new("")).join("images");
    let reference = args.reference.as_deref().map(output::read).transpose()?;
    let control = Arc::new(Control::new(progress::reporter(args.quiet), None));
    signal::install(&control, args.quiet);
    let load = machine::load();
    let scene = import::load(
        &args.scene.file,
        &import_options(&args.scene),
        registry.scene.clone(),
    )?;
    let mut base = RenderSettings {
        width: args.size.width,
        height: args.size.height,
        spp: args.spp,
        threads: args.threads.map(|n| n as usize),
        ..RenderSettings::default()
    };
    base.integrator_settings.seed = args.seed;
    let told = (reference, args.reference_spp);
    let outcomes = reproduction::run(&scene, &registry, &base, told, args.repeats, &control)?;
    let (Some(outcomes), None) = (outcomes, control.stopped()) else {
        let why = control.stopped();
        return Ok(Ending::Empty(
            why.unwrap_or(crate::control::Stopped::Interrupted),
        ));
    };
    std::fs::create_dir_all(&folder).map_err(|e| {
        Error::file(
            &folder,
            format!("could not be made ({e})"),
            "choose another place with -o",
        )
    })?;
    for o in &outcomes {
        for (what, image) in [("photons", &o.photons), ("picture", &o.image)] {
            let path = folder.join(picture(o, what));
            write_png(&registry, image, args.seed, &path)?;
        }
    }
    let text = report(args, &outcomes, base.threads, load);
    output::write_atomically(&args.output, |sink| sink.write_all(text.as_bytes()))?;
    if !args.quiet {
        console::print(&reproduction::table(&outcomes))?;
    }
    Ok(Ending::Done)
}

fn picture(o: &Outcome, what: &str) -> PathBuf {
    format!("reproduction-{what}-{}.png", o.contestant.name).into()
}

fn write_png(registry: &Registry, image: &Image, seed: u64, path: &Path) -> Result<()> {
    let metadata = Metadata {
        command_line: command_line(),
        seed,
        ..Metadata::default()
    };
    let settings = OutputSettings::default();
    output::write(&registry.outputs, image, &settings, &metadata, path)
}

fn report(
    args: &ReproduceArgs,
    outcomes: &[Outcome],
    threads: Option<usize>,
    load: Option<f64>,
) -> String {
    let judged = match &args.reference {
        Some(path) => {
            let name = path.file_name().unwrap_or_default();
            format!("read from `{}`", name.to_string_lossy())
        }
        None => format!(
            "path traced here with {} samples a pixel",
            args.reference_spp
        ),
    };
    let mut out = format!(
        "# The paper's experiment\n\n\
         Written by `dualight reproduce`. The paper's own figures [Namae02] are in brackets; its scene is\n\
         known only by a sentence and its machine not at all, so counts may be set side by side, seconds\n\
         may not. Pictures of {}x{} pixels, {} samples each; relMSE is the mean of {} seeds, seconds are\n\
         medians. The reference was {judged}. Pilot photons decide the width of kernels, check\n\
         rays plan the adaptive emission; neither are stored.\n\n",
        args.size.width, args.size.height, args.spp, args.repeats
    );
    out += &reproduction::table(outcomes);
    out += "\nStored photons as the camera sees them, those of the caustic map in orange (figures 6 \
            and 7), and the pictures (figures 8 and 9):\n\n|";
    for o in outcomes {
        let _ = write!(out, " {} |", o.contestant.title);
    }
    out += "\n|";
    out += &"---|".repeat(outcomes.len());
    for what in ["photons", "picture"] {
        out += "\n|";
        for o in outcomes {
            let path = picture(o, what);
            let _ = write!(
                out,
                " ![{what}, {}](images/{}) |",
                o.contestant.title,
                path.display()
            );
        }
    }
    let threads = threads.unwrap_or_else(|| {
        std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get)
    });
    out += "\n\nMeasured on:\n\n";
    for line in machine::lines(threads, load) {
        let _ = writeln!(out, "- {line}");
    }
    out
}
