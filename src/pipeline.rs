//! From a scene to an image: one call per stage, each with its time.

mod clock;
mod foreseen;
mod photon_file;
mod pilot;
mod prepared;
mod progressive;
mod quality;
mod view;

pub use photon_file::{PhotonFile, load_photons, save_photons};
pub use prepared::{Prepared, prepare};
pub use progressive::{Progressive, Session, Standing};
pub use quality::{Quality, sampling_for, settings_for};
pub use view::{AUTO_CAMERA, choose_camera};

use std::sync::Arc;

use clock::Clock;
use foreseen::{hindrance, plan_layer};
use progressive::Forecast;
use view::region;

use crate::accel::{Accelerator, Guarded};
use crate::control::{Control, Stopped};
use crate::effects::{self, Decision, EffectSet};
use crate::error::{Error, Result};
use crate::film::{Component, Film};
use crate::integrators::{
    IntegratorSettings, PhotonNeeds, PixelPlan, RenderContext, Spacing, Visibility, camera_pass,
    enclosed, keeps, planned_camera_pass, sights,
};
use crate::photons::{
    Guidance, GuideBy, PhotonKey, PhotonMaps, PhotonPass, PhotonSettings, SAMPLES_PER_PASS,
    trace_photons,
};
use crate::plugins::Registry;
use crate::sampling::hash2;
use crate::scene::Scene;
use crate::stats::tally::Meter;
use crate::stats::{PhotonCounts, RayCounts, Statistics, peak_memory};

/// Paths through the image, along each edge, that tell photons what is seen.
const VIEWS: u32 = 96;

/// How camera samples are shared among pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum PixelSampling {
    /// Each pixel has as many.
    #[default]
    Uniform,
    /// More where edges are forecast or samples differ; not with [`Progressive`].
    Adaptive,
}

impl PixelSampling {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Adaptive => "adaptive",
        }
    }
}

/// What to render, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderSettings {
    /// Name of the integrator; `None` for the first of the table.
    pub integrator: Option<String>,
    /// Name of the ray tracing backend; `None` for the first of the table.
    pub accelerator: Option<String>,
    /// Name of the photon emission; `None` for the first of the table.
    pub emission: Option<String>,
    /// Which effects to simulate: `auto`, `all`, or `+name,-name` on top of the survey.
    pub effects: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Camera samples per pixel.
    pub spp: u32,
    /// How samples are shared among pixels.
    pub pixel_sampling: PixelSampling,
    /// Whether adaptive sampling also interpolates indirect light where no edge is.
    pub interpolation: bool,
    /// Whether to render in independent passes, whose spread tells the error, and when to end.
    pub progressive: Option<Progressive>,
    /// Part of the image to render: left, top, right, bottom in pixels; the rest stays black.
    pub crop: Option<[u32; 4]>,
    /// Name of the camera; `None` for the first, or one that frames the scene if it has none.
    pub camera: Option<String>,
    /// Threads; `None` for one per processor.
    pub threads: Option<usize>,
    /// What the integrator is told.
    pub integrator_settings: IntegratorSettings,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            integrator: None,
            accelerator: None,
            emission: None,
            effects: "auto".into(),
            width: 512,
            height: 512,
            spp: 16,
            pixel_sampling: PixelSampling::Uniform,
            interpolation: true,
            progressive: None,
            crop: None,
            camera: None,
            threads: None,
            integrator_settings: IntegratorSettings::default(),
        }
    }
}

/// A rendered image with what it took.
#[derive(Debug)]
pub struct Rendering {
    /// The image.
    pub film: Film,
    /// Rays, photons, seconds.
    pub statistics: Statistics,
    /// Whether the run ended early.
    pub stopped: Option<Stopped>,
    /// What was simulated and what was skipped, with reasons.
    pub effects: Vec<Decision>,
    /// Why indirect light was not interpolated in pixels without an edge, if it was not.
    pub not_interpolated: Option<&'static str>,
}

/// Renders a scene.
///
/// # Errors
/// Names that no plugin or camera has, a backend that fails.
pub fn render(
    scene: &Scene,
    settings: &RenderSettings,
    registry: &Registry,
    control: &Control,
) -> Result<Rendering> {
    let session = Session {
        film: None,
        seconds: 0.0,
        watch: &mut |_, _| {},
        photons: None,
        prepared: None,
    };
    render_session(scene, settings, registry, control, session)
}

/// Renders a scene, going on from a film if there is one, and lets the film be seen meanwhile.
///
/// # Errors
/// As [`render`]; a film of another size.
pub fn render_session(
    scene: &Scene,
    settings: &RenderSettings,
    registry: &Registry,
    control: &Control,
    session: Session<'_>,
) -> Result<Rendering> {
    in_pool(settings.threads, || {
        render_in_pool(scene, settings, registry, control, session)
    })?
}

/// Does work with a number of threads, one per processor if none is given.
///
/// # Errors
/// More threads than the system has room for.
pub fn in_pool<T: Send>(threads: Option<usize>, work: impl FnOnce() -> T + Send) -> Result<T> {
    let threads = threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::Usage(format!("--threads {threads}: {e}; ask for fewer")))?;
    Ok(pool.install(work))
}

fn render_in_pool(
    scene: &Scene,
    settings: &RenderSettings,
    registry: &Registry,
    control: &Control,
    session: Session<'_>,
) -> Result<Rendering> {
    let mut clock = Clock::default();
    let meter = Meter::new();
    let options = &settings.integrator_settings;

    let integrator = registry
        .integrators
        .choose(settings.integrator.as_deref())?;
    let emission = registry.emissions.choose(settings.emission.as_deref())?;
    let backend = registry
        .accelerators
        .choose(settings.accelerator.as_deref())?;
    let camera = choose_camera(scene, settings, registry)?;
    let region = region(settings)?;
    let mut effects = effects::survey(scene, &settings.effects, &registry.effects)?;
    clock.lap("survey");

    let Prepared { accel, laps } = match session.prepared {
        Some(prepared) => prepared,
        None => prepared::build(scene, settings, registry, control)?,
    };
    clock.take(laps);
    // What is not known before must not be seen in the filtering of textures.
    let spacing_spp = match &settings.progressive {
        Some(_) => SAMPLES_PER_PASS,
        None => settings.spp,
    };
    let spacing = Spacing::new(settings.width, settings.height, spacing_spp);
    // Photons that are kept in a file must not depend on the camera.
    if session.photons.is_none() {
        let seed = options.seed;
        pilot::bound(
            &mut effects,
            scene,
            &*accel,
            &*camera,
            &spacing,
            seed,
            registry,
        );
        clock.lap("pilot");
    }

    let mut first = PhotonSettings {
        seed: options.seed,
        global: match integrator.photons {
            PhotonNeeds::All => options.photons,
            PhotonNeeds::None | PhotonNeeds::Caustic => 0,
        },
        caustic: options.caustic_photons,
        nearest: options.nearest,
        max_depth: options.max_depth,
        roulette: options.roulette,
        guidance: match options.guide {
            GuideBy::Off => Guidance::Off,
            GuideBy::Light | GuideBy::View => Guidance::Light,
        },
    };
    let wanted = effects.set.intersects(match integrator.photons {
        PhotonNeeds::None => EffectSet::empty(),
        PhotonNeeds::Caustic => EffectSet::CAUSTICS,
        PhotonNeeds::All => EffectSet::CAUSTICS | EffectSet::INDIRECT,
    });
    let mut film = match session.film {
        Some(film) if (film.width(), film.height()) == (settings.width, settings.height) => film,
        Some(_) => {
            return Err(Error::Usage(
                "the film to go on from has another size".into(),
            ));
        }
        None => Film::new(settings.width, settings.height),
    };
    film.keep(&components(effects.set));
    let adaptive = settings.pixel_sampling == PixelSampling::Adaptive;
    if adaptive && settings.progressive.is_some() {
        return Err(Error::Usage(
            "adaptive pixel sampling and independent passes exclude each other; leave one out"
                .into(),
        ));
    }
    let not_interpolated = hindrance(adaptive, settings.interpolation, effects.set);
    if session.photons.is_some() && settings.progressive.is_some() {
        return Err(Error::Usage(
            "independent passes have photons of their own, each other ones; leave out the file of \
             photons"
                .into(),
        ));
    }
    if session.photons.is_some() && options.guide == GuideBy::View {
        return Err(Error::Usage(
            "photons that a file keeps must not depend on the camera; guide them by light".into(),
        ));
    }
    let gather = options.gather_rays > 0 || integrator.photons == PhotonNeeds::Caustic;
    let photons = integrator.photons != PhotonNeeds::None;
    let kept = session.photons.filter(|_| photons).map(|file| {
        let backend = backend.name;
        let key = PhotonKey::new(scene, backend, emission, effects.set, &first, gather);
        (file, key)
    });
    let mut plan: Option<PixelPlan> = None;
    let mut rays = RayCounts::default();
    let [mut global_photons, mut caustic_photons] = [PhotonCounts::default(); 2];
    let target = settings.progressive.as_ref().and_then(|p| p.target_error);
    let in_passes = settings.progressive.is_some();
    if in_passes {
        film.count_passes();
    }
    // Passes of known number have a bar each, others one for all.
    let silent = control.silent();
    let inner = if in_passes { &silent } else { control };
    let whole = in_passes.then(|| control.stage("render", "samples", 0));
    let mut passes = film.passes();
    let mut done = film.finished_samples();
    let forecast = Forecast::new(
        target,
        settings.spp,
        control.deadline(),
        (done, session.seconds),
    );
    let mut standing = forecast.standing(&film, done, true);
    // Photons are traced without the guard: they must not depend on the camera, and of those that
    // leave through a crack nobody sees that they are missing. Not where surfaces are there by chance,
    // which would be tried again.
    let unguarded = &*accel;
    let guard = Guarded::new(unguarded);
    let leaky = !accel.watertight() && scene.geometry.is_whole();
    let accel: &dyn Accelerator =
        match leaky && enclosed(scene, unguarded, &*camera, &spacing, options.seed) {
            true => &guard,
            false => unguarded,
        };
    let visibility = Visibility::learn(scene, accel, &*camera, &spacing, options.seed);
    if wanted && options.guide == GuideBy::View {
        let seen = sights(scene, accel, &*camera, &spacing, options.seed, VIEWS);
        first.guidance = Guidance::View(Arc::new(seen));
        clock.lap("sights");
    }
    while done < settings.spp && control.stopped().is_none() && !standing.reached(target) {
        let mut samples = settings.spp - done;
        let mut maps = PhotonMaps::default();
        let pass = match in_passes {
            true => progressive::pass(&first, passes),
            false => PhotonPass::new(&first, SAMPLES_PER_PASS, passes),
        };
        if wanted || in_passes {
            samples = samples.min(pass.samples);
        }
        if wanted || kept.is_some() {
            let trace = || {
                let photons = &pass.photons;
                trace_photons(
                    scene,
                    unguarded,
                    emission,
                    effects.set,
                    photons,
                    gather,
                    inner,
                )
            };
            let kept = kept.as_ref().filter(|_| passes == 0);
            maps = photon_file::obtain(kept, trace, &mut clock, control)?;
            global_photons.add_pass(&maps.global_counts, passes);
            caustic_photons.add_pass(&maps.caustic_counts, passes);
            rays.add(&maps.rays);
        }
        let context = RenderContext {
            scene,
            accel,
            visibility: &visibility,
            maps: &maps,
            effects: effects.set,
            settings: options,
        };
        let integrator = (integrator.build)(context);
        // The filtering of textures gets as fine as the samples that there are by then.
        let spacing = match in_passes {
            true => {
                let spp = (done + pass.samples).max(SAMPLES_PER_PASS);
                Spacing::new(settings.width, settings.height, spp)
            }
            false => spacing,
        };
        // Independent passes have their own random numbers; others go on in the same sequence.
        let (seed, range) = match in_passes {
            true => (hash2(options.seed, u64::from(passes)), 0..samples),
            false => (options.seed, done..done + samples),
        };
        let differentials = !scene.textures.is_empty();
        let camera_rays = if adaptive {
            planned_camera_pass(
                &mut plan,
                &context,
                &*camera,
                &*integrator,
                samples,
                (&spacing, differentials),
                region,
                not_interpolated.is_none(),
                &mut film,
                inner,
            )
        } else {
            camera_pass(
                &*camera,
                &*integrator,
                seed,
                range,
                &spacing,
                differentials,
                region,
                &mut film,
                &mut |film| (session.watch)(film, &forecast.standing(film, done, false)),
                inner,
            )
        };
        rays.add(&camera_rays);
        clock.lap("pixels");
        if in_passes && control.stopped().is_some() {
            // What the pass lacks can be taken later.
            break;
        }
        done += samples;
        passes += 1;
        if let Some(whole) = &whole {
            film.finish_pass();
            standing = forecast.standing(&film, done, true);
            whole.note(&standing.text());
            (session.watch)(&film, &standing);
        }
    }

    if let Some(plan) = &plan {
        let edges = plan.edges(&film);
        if not_interpolated.is_none() {
            film.interpolate(&edges);
            clock.lap("interpolation");
        }
        film.attach(plan_layer(&edges, &film));
    }
    effects.account(&registry.effects, &meter.finish());
    let built = accel.stats();
    Ok(Rendering {
        statistics: Statistics {
            rays,
            global_photons,
            caustic_photons,
            stages: clock.laps,
            samples_per_pixel: film.sample_range(),
            rejected_pixels: film.rejected(),
            first_rejected_pixel: film.first_rejected(),
            accelerator: built.backend,
            accelerator_bytes: built.bytes,
            peak_memory_bytes: peak_memory(),
            estimated_error: film.estimated_error(),
        },
        film,
        stopped: control.stopped(),
        effects: effects.decisions,
        not_interpolated,
    })
}

/// The components of the image that the effects leave.
fn components(set: EffectSet) -> Vec<Component> {
    let kept = |c: &Component| keeps(set, *c);
    Component::ALL.into_iter().filter(kept).collect()
}
