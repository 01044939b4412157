//! What rendering needs of a scene besides the scene, made once; and a trial of it.

use super::clock::Clock;
use super::foreseen::hindrance;
use super::{PixelSampling, RenderSettings, choose_camera, in_pool};
use crate::accel::Accelerator;
use crate::control::Control;
use crate::effects::{self, EffectSet};
use crate::error::Result;
use crate::integrators::{
    Outlook, PhotonNeeds, RenderContext, Spacing, Trial, Visibility, noise, sights,
};
use crate::photons::{
    EmissionContext, Guidance, PhotonMaps, PhotonSettings, Purpose, follow_photons,
};
use crate::plugins::Registry;
use crate::scene::Scene;
use crate::stats::StageTime;
use crate::stats::tally::{self, Part};

/// Samples of a pixel in a trial.
const SAMPLES: u32 = 4;

/// Samples of the picture for each one of a trial.
const SHARE: f64 = 50.0;

/// Fewest and most pixels of a trial.
const PIXELS: [f64; 2] = [256.0, 4096.0];

/// Fewest and most photons of each map in a trial, of which there are as few as of pixels.
const PHOTONS: [u64; 2] = [1024, 4096];

/// Paths through the image, along each edge, that tell where light is seen.
const VIEWS: u32 = 48;

/// The ray tracer of a scene, and what it took.
pub struct Prepared {
    pub(super) accel: Box<dyn Accelerator>,
    pub(super) laps: Vec<StageTime>,
}

/// Builds what rendering by these settings needs; [`Session::prepared`](super::Session::prepared)
/// takes it.
///
/// # Errors
/// Names that no plugin has, a backend that fails.
pub fn prepare(
    scene: &Scene,
    settings: &RenderSettings,
    registry: &Registry,
    control: &Control,
) -> Result<Prepared> {
    in_pool(settings.threads, || {
        build(scene, settings, registry, control)
    })?
}

pub(super) fn build(
    scene: &Scene,
    settings: &RenderSettings,
    registry: &Registry,
    control: &Control,
) -> Result<Prepared> {
    let mut clock = Clock::default();
    let backend = registry
        .accelerators
        .choose(settings.accelerator.as_deref())?;
    let accel = {
        let _stage = control.stage("build", "primitives", 0);
        scene.geometry.prepare();
        (backend.build)(&scene.geometry, rayon::current_num_threads())?
    };
    clock.lap("build");
    if !scene.textures.is_empty() {
        tally::stage(Part::Textures, || scene.prepare_textures());
        clock.lap("textures");
    }
    Ok(Prepared {
        accel,
        laps: clock.laps,
    })
}

impl Prepared {
    /// Follows a few paths and photons, to see which integrator suits the scene. The same settings
    /// tell the same every time.
    ///
    /// # Errors
    /// As [`render`](super::render).
    pub fn try_out(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        registry: &Registry,
        control: &Control,
    ) -> Result<Trial> {
        let mut clock = Clock::default();
        let accel = &*self.accel;
        let trial = in_pool(settings.threads, || {
            try_out(scene, accel, settings, registry, control)
        })??;
        clock.lap("trial");
        self.laps.append(&mut clock.laps);
        Ok(trial)
    }
}

fn try_out(
    scene: &Scene,
    accel: &dyn Accelerator,
    settings: &RenderSettings,
    registry: &Registry,
    control: &Control,
) -> Result<Trial> {
    let options = &settings.integrator_settings;
    let effects = effects::survey(scene, &settings.effects, &registry.effects)?.set;
    let all = options.photons.min(options.caustic_photons);
    let photons = ((all as f64 / SHARE) as u64).clamp(PHOTONS[0], PHOTONS[1]);
    let first = PhotonSettings {
        seed: options.seed,
        global: photons,
        caustic: photons,
        nearest: options.nearest,
        max_depth: options.max_depth,
        roulette: options.roulette,
        guidance: Guidance::Off,
    };
    let emission = registry.emissions.choose(settings.emission.as_deref())?;
    let silent = control.silent();
    let camera = choose_camera(scene, settings, registry)?;
    let caustics = match effects.contains(EffectSet::CAUSTICS) {
        false => 0.0,
        true => {
            let spacing = Spacing::new(settings.width, settings.height, settings.spp);
            let seen = sights(scene, accel, &*camera, &spacing, options.seed, VIEWS);
            let both = effects | EffectSet::CAUSTICS | EffectSet::INDIRECT;
            let light = |purpose| {
                let source = (emission.build)(&EmissionContext {
                    scene,
                    accel,
                    seed: options.seed,
                    purpose,
                    count: photons,
                    guide: None,
                });
                let stored = follow_photons(scene, accel, &*source, purpose, both, &first, &silent);
                seen.light(&stored.photons)
            };
            let all = light(Purpose::Global);
            match all > 0.0 {
                true => (light(Purpose::Caustic) / all).min(1.0),
                false => 0.0,
            }
        }
    };
    let adaptive = settings.pixel_sampling == PixelSampling::Adaptive;
    let interpolated = hindrance(adaptive, settings.interpolation, effects).is_none();
    let known = Trial {
        caustics,
        interpolated,
        ..Trial::default()
    };
    let mut outlook = Outlook::new(scene, effects);
    outlook.trial = Some(known);
    let entries = registry.integrators.entries().iter();
    let mut by_paths = entries.filter(|e| e.photons == PhotonNeeds::None);
    let paths = match by_paths.next() {
        Some(paths) if !outlook.pays_by_caustics() => paths,
        _ => return Ok(known),
    };
    let all = f64::from(settings.width) * f64::from(settings.height);
    let wanted = all * f64::from(settings.spp) / SHARE / f64::from(SAMPLES);
    let wanted = wanted.clamp(PIXELS[0], PIXELS[1]);
    let visibility = Visibility::learn(
        scene,
        accel,
        &*camera,
        &Spacing::new(settings.width, settings.height, SAMPLES),
        options.seed,
    );
    let context = RenderContext {
        scene,
        accel,
        visibility: &visibility,
        maps: &PhotonMaps::default(),
        effects,
        settings: options,
    };
    let integrator = (paths.build)(context);
    let differentials = !scene.textures.is_empty();
    let mut trial = known;
    // A quarter of the pixels tells enough where the answer is clear.
    for part in [0.25, 1.0] {
        let scale = ((part * wanted).max(PIXELS[0]) / all.max(1.0))
            .sqrt()
            .min(1.0);
        let size = [settings.width, settings.height]
            .map(|n| ((f64::from(n) * scale).round() as u32).max(1));
        trial.noise = noise(
            &*integrator,
            &*camera,
            (&Spacing::new(size[0], size[1], SAMPLES), differentials),
            options.seed,
            size,
            SAMPLES,
        );
        if trial.is_clear() {
            break;
        }
    }
    Ok(trial)
}
