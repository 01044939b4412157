//! Keeping what there is of a rendering: images and film, now and then and at the end.

use std::fmt::Write;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::time::Instant;

use super::console;
use super::plan::Plan;
use super::render::command_line;
use crate::error::{Error, Result};
use crate::film::Film;
use crate::import;
use crate::output::{self, Checkpoint, Metadata, fingerprint};
use crate::pipeline::{RenderSettings, Standing};
use crate::plugins::Registry;

/// Writes a rendering.
pub(super) struct Keeper<'a> {
    plan: &'a Plan,
    registry: &'a Registry,
    seed: u64,
    integrator: String,
    identity: u64,
    start: Instant,
    written: Instant,
    /// Seconds of rendering in the film, for the one that goes on.
    seconds: f64,
}

impl<'a> Keeper<'a> {
    /// Keeps the rendering of a plan that began at `start`.
    pub(super) fn new(
        plan: &'a Plan,
        settings: &RenderSettings,
        registry: &'a Registry,
        start: Instant,
    ) -> Result<Self> {
        let identity = match &plan.resume {
            Some(_) => identity(plan, settings)?,
            None => 0,
        };
        Ok(Self {
            plan,
            registry,
            seed: settings.integrator_settings.seed,
            integrator: settings.integrator.clone().unwrap_or_default(),
            identity,
            start,
            written: start,
            seconds: 0.0,
        })
    }

    /// The film to go on from, if there is one.
    pub(super) fn earlier(&mut self) -> Result<Option<Checkpoint>> {
        let Some(path) = &self.plan.resume else {
            return Ok(None);
        };
        let found = Checkpoint::read(path, self.identity)?;
        if let Some(c) = &found {
            self.seconds = c.seconds;
        }
        if !self.plan.quiet {
            let path = path.display();
            console::say(match &found {
                None => format!("{path} is not there yet: the rendering begins"),
                Some(c) => {
                    let n = c.film.finished_samples();
                    format!("{path}: goes on from {n} samples per pixel")
                }
            });
        }
        Ok(found)
    }

    /// Sees the film as it is, and writes it if that is due.
    pub(super) fn watch(&mut self, film: &Film, standing: &Standing) {
        self.seconds = standing.seconds;
        if self.written.elapsed() < self.plan.write_every {
            return;
        }
        // What cannot be written now may be later; the end is what counts.
        if let Err(e) = self.write(film) {
            console::say(format_args!("warning: {e}"));
        }
        self.written = Instant::now();
    }

    /// Writes all that is to be written of a film.
    pub(super) fn write(&self, film: &Film) -> Result<Metadata> {
        let metadata = Metadata {
            command_line: command_line(),
            seed: self.seed,
            spp: film.sample_range().1,
            render_seconds: self.start.elapsed().as_secs_f64(),
        };
        if let Some(path) = &self.plan.resume {
            let (by, identity) = (&self.integrator, self.identity);
            Checkpoint::write(path, by, identity, self.seconds, film)?;
        }
        let image = film.develop();
        let (outputs, settings) = (&self.registry.outputs, &self.plan.output_settings);
        for path in &self.plan.outputs {
            output::write(outputs, &image, settings, &metadata, path)?;
        }
        Ok(metadata)
    }
}

/// Says which scene and settings a film is of: the bytes of all files of the scene, how it is read,
/// and all settings but those that say when to end and with how many threads.
fn identity(plan: &Plan, settings: &RenderSettings) -> Result<u64> {
    let same = RenderSettings {
        spp: 0,
        progressive: None,
        threads: None,
        ..settings.clone()
    };
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = write!(text, "{:?} {same:?}", plan.import);
    let mut print = fingerprint(0, text.as_bytes());
    for path in import::sources(&plan.scene, &plan.import)? {
        print = contents(&path, print)
            .map_err(|e| Error::file(&path, e, "name a file that can be read"))?;
    }
    Ok(print)
}

/// The fingerprint of a file, piece by piece, on top of another.
fn contents(path: &Path, mut print: u64) -> io::Result<u64> {
    let mut file = File::open(path)?;
    let mut piece = vec![0; 1 << 16];
    loop {
        match file.read(&mut piece)? {
            0 => return Ok(print),
            n => print = fingerprint(print, &piece[..n]),
        }
    }
}
