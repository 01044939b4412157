//! What pictures are judged by: a file, or a long run of path tracing.

use std::path::Path;
use std::time::Instant;

use super::layers::{Layers, Moments, Scale};
use super::measure::Renderer;
use crate::error::{Error, Result};
use crate::output;
use crate::pipeline::RenderSettings;
use crate::sampling::hash2;
use crate::scene::Census;

/// Pictures that a computed reference is the mean of, at least: their spread is its error.
const LEAST: u32 = 8;

/// Samples per pixel of each of these pictures.
const SAMPLES: u32 = 64;

/// A reference and how good it is.
#[derive(Debug)]
pub struct Reference {
    /// Its pixels.
    pub layers: Layers,
    /// Its own relative mean squared error in each layer, 0 if unknown.
    pub error: Vec<f64>,
    /// What it is, for the report.
    pub origin: String,
    /// Whether its error is as small as was asked for.
    pub good: bool,
}

/// Reads a reference of the given size.
pub(super) fn read(path: &Path, width: u32, height: u32) -> Result<Reference> {
    let refuse = |problem: String, remedy: &str| Error::file(path, problem, remedy);
    let image = output::read(path)?;
    let layers = Layers::new(&image)
        .ok_or_else(|| refuse("has no channels R, G, B".into(), "give a colour image"))?;
    if (layers.width, layers.height) != (width, height) {
        return Err(refuse(
            format!(
                "is {}x{}, not {width}x{height}",
                layers.width, layers.height
            ),
            "give the size of the reference with --size",
        ));
    }
    let mut error = vec![0.0; layers.pixels.len()];
    let own = image.rgb("error").map(|half| own_error(&layers, &half));
    error[0] = own.unwrap_or(0.0);
    let told = match own {
        Some(e) => format!("its own relMSE is {e:.1e}"),
        None => "its own error is not known".into(),
    };
    Ok(Reference {
        layers,
        error,
        origin: format!("{}; {told}", path.display()),
        good: true,
    })
}

/// Half the width of a 90 % interval over the deviation, of many passes.
const HALF_WIDTH: f64 = 1.645;

/// The relative mean squared error that a picture in passes tells of itself, by its layer `error`.
fn own_error(layers: &Layers, half_widths: &[[f32; 3]]) -> f64 {
    let variance = |i: usize, c: usize| (f64::from(half_widths[i][c]) / HALF_WIDTH).powi(2);
    Scale::new(layers.beauty()).mean(variance)
}

/// How a reference is computed: by `path`, but for what no path from the camera finds.
fn integrator(census: &Census) -> (&'static str, String) {
    if census.delta_lights == 0 || census.sharp_objects == 0 {
        return ("path", "path".into());
    }
    let why = format!(
        "hybrid (paths do not find what mirrors and glass make of {} lights without extent)",
        census.delta_lights
    );
    ("hybrid", why)
}

/// Caustic photons of each picture of a reference, if it has any.
const PHOTONS: u64 = 1_000_000;

/// Computes a reference, by `path` where that finds all light, until its own error is at most `goal` or `seconds` are over;
/// `None` if stopped.
///
/// `goal` is asked with the mean so far, once there is one: what it is a fraction of depends on
/// the reference itself.
pub(super) fn compute(
    renderer: &Renderer<'_>,
    base: &RenderSettings,
    seconds: f64,
    goal: impl Fn(&Layers) -> f64,
) -> Result<Option<Reference>> {
    let start = Instant::now();
    let stage = renderer
        .control
        .stage("reference", "ms", (seconds * 1e3) as u64);
    let (name, origin) = integrator(&Census::new(renderer.scene));
    let mut settings = RenderSettings {
        integrator: Some(name.into()),
        spp: SAMPLES,
        ..base.clone()
    };
    settings.integrator_settings.caustic_photons = PHOTONS;
    let (width, height) = (base.width, base.height);
    let mut moments = Moments::new(width as usize * height as usize);
    let (mut told, mut next) = (0, LEAST);
    loop {
        // No measured picture has one of these seeds.
        settings.integrator_settings.seed = hash2(
            base.integrator_settings.seed ^ 0x5eed_0f4e_fe4e_9ce5,
            u64::from(moments.count),
        );
        let Some((layers, ..)) = renderer.render(&settings)? else {
            return Ok(None);
        };
        moments.add(&layers);
        let now = (start.elapsed().as_secs_f64() * 1e3) as u64;
        stage.advance(now - told);
        told = now;
        let over = start.elapsed().as_secs_f64() >= seconds;
        if moments.count < next && !(over && moments.count >= LEAST) {
            continue;
        }
        // Looking costs about as much as a picture of a few samples.
        next = moments.count + moments.count.div_ceil(8);
        let layers = moments.mean_layers(width, height);
        let scale = Scale::new(layers.beauty());
        let error: Vec<f64> = (0..layers.pixels.len())
            .map(|k| moments.noise(k, &scale) / f64::from(moments.count))
            .collect();
        let good = error[0] <= goal(&layers);
        if good || over {
            let spp = u64::from(SAMPLES) * u64::from(moments.count);
            return Ok(Some(Reference {
                layers,
                origin: format!(
                    "{origin}, {spp} samples per pixel; its own relMSE is {:.1e}",
                    error[0]
                ),
                error,
                good,
            }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::import::{self, ImportOptions};
    use crate::output::{Metadata, OutputSettings};
    use crate::pipeline::{self, Progressive};
    use crate::plugins::Registry;

    #[test]
    fn a_reference_in_passes_tells_its_own_error() {
        let registry = Registry::builtin();
        let options = ImportOptions::default();
        let file = Path::new("scenes/box.gltf");
        let scene = import::load(file, &options, registry.scene.clone()).unwrap();
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("reference.exr");
        for progressive in [None, Some(Progressive::default())] {
            let settings = RenderSettings {
                integrator: Some("path".into()),
                width: 12,
                height: 10,
                spp: 400,
                progressive,
                ..Default::default()
            };
            let control = Control::default();
            let film = pipeline::render(&scene, &settings, &registry, &control);
            let film = film.unwrap().film;
            let (settings, metadata) = (OutputSettings::default(), Metadata::default());
            output::write(
                &registry.outputs,
                &film.develop(),
                &settings,
                &metadata,
                &path,
            )
            .unwrap();
            let own = read(&path, 12, 10).unwrap().error[0];
            match film.estimated_error() {
                // Of as many passes, the interval is not much wider than that of a normal
                // distribution; neighbours share their relative variances.
                Some(e) => assert!((0.5..2.0).contains(&(own / e)), "{own} {e}"),
                None => assert_eq!(own, 0.0),
            }
        }
    }
}
