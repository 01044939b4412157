//! Pass 1 of photon mapping: photons leave the lights, are followed through the scene and stored
//! where they meet diffuse surfaces, in three maps (after Jensen 1996).
//!
//! Path space, written from the camera E to the light L with D for a diffuse scattering and S
//! for any other:
//! - the **global** map stores every photon that arrives at a diffuse surface, with its class:
//!   `L D` (direct), `L S⁺ D` (caustic), or any path with an earlier D (indirect);
//! - the **caustic** map stores `L S⁺ D` only, from photons sent toward specular objects alone;
//! - the **glow** map stores the same photons one diffuse surface further, `L S⁺ D S* D`: the
//!   light that a caustic sheds on its surroundings. It is smooth where it arrives, but its
//!   source is small and bright, which final-gather rays hit by chance only.
//!
//! Emission is a plugin family: one file and one line in [`EMISSIONS`].

mod adaptive;
mod adaptive_linear;
mod departure;
mod emit;
mod guide;
mod in_order;
mod ledger;
pub mod map;
mod photon;
mod progress;
mod saved;
mod targets;
mod trace;
mod uniform;

pub(crate) use adaptive::{Beam, Caster, Sight, casters};
pub use emit::{EMISSIONS, EmissionContext, EmissionEntry, EmittedPhoton, PhotonSource, Purpose};
use guide::Teacher;
pub use guide::{Guidance, Guide, GuideBy, Sights};
pub use ledger::Ledger;
pub use map::{IrradianceMap, PhotonMap};
use map::{Pilot, Surroundings};
pub use photon::{Photon, PhotonClass};
pub use progress::{PhotonPass, SAMPLES as SAMPLES_PER_PASS};
pub use saved::PhotonKey;
pub use targets::Targets;
pub use trace::{StoredPhotons, follow_photons};

use std::sync::Arc;
use std::time::Instant;

use crate::accel::Accelerator;
use crate::control::Control;
use crate::effects::EffectSet;
use crate::sampling::{hash2, stream};
use crate::scene::Scene;
use crate::stats::tally::{self, Part};
use crate::stats::{PhotonCounts, RayCounts};

/// What the photon pass is told.
#[derive(Clone, Debug)]
pub struct PhotonSettings {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Photons emitted for the global map.
    pub global: u64,
    /// Photons emitted for the caustic map.
    pub caustic: u64,
    /// Photons in a density estimate.
    pub nearest: usize,
    /// Most surfaces a photon may meet.
    pub max_depth: Option<u32>,
    /// Whether paths end by Russian roulette; otherwise by the depth limit alone.
    pub roulette: bool,
    /// What emission is guided by.
    pub guidance: Guidance,
}

/// Most photons of a map for each one of its pilot emission, which decides the kernels.
const PILOT_SHARE: u64 = 8;

/// Fewest photons of the pilot emission in a kernel. A kernel serves as far as it reaches, so where
/// there are `n` in the mean, a share of `e⁻ⁿ` of all places has none.
const PILOTS_IN_KERNEL: u64 = 4;

impl PhotonSettings {
    /// Those of the pilot emission.
    fn pilot(&self) -> Self {
        let share = (self.nearest as u64 / PILOTS_IN_KERNEL).clamp(1, PILOT_SHARE);
        Self {
            seed: hash2(self.seed, stream::PILOT),
            global: self.global.div_ceil(share),
            caustic: self.caustic.div_ceil(share),
            ..self.clone()
        }
    }
}

/// The finished maps; a map that the effects do not call for is absent.
#[derive(Debug, Default)]
pub struct PhotonMaps {
    /// All photons on diffuse surfaces.
    pub global: Option<PhotonMap>,
    /// Irradiance at some of the global photons, for the final gather.
    pub irradiance: Option<IrradianceMap>,
    /// Photons that came by specular surfaces only.
    pub caustic: Option<PhotonMap>,
    /// Irradiance from caustics one diffuse surface away; the irradiance of the global photons
    /// always leaves those out that are caustic themselves.
    pub glow: Option<IrradianceMap>,
    /// What became of the global photons.
    pub global_counts: PhotonCounts,
    /// What became of the caustic photons.
    pub caustic_counts: PhotonCounts,
    /// Rays traced.
    pub rays: RayCounts,
    /// Seconds spent emitting and following photons.
    pub tracing: f64,
    /// Seconds spent building maps and estimating irradiance.
    pub building: f64,
}

/// Emits, follows and stores photons, and builds the maps that `effects` call for.
pub fn trace_photons(
    scene: &Scene,
    accel: &dyn Accelerator,
    emission: &EmissionEntry,
    effects: EffectSet,
    settings: &PhotonSettings,
    gather: bool,
    control: &Control,
) -> PhotonMaps {
    let mut maps = PhotonMaps::default();
    let area = map::surface_area(scene);
    let teach = |purpose, maps: &mut PhotonMaps| {
        let start = Instant::now();
        let teacher = Teacher {
            scene,
            accel,
            effects,
            settings,
            purpose,
            gathers: gather,
        };
        let (guide, sent, rays) = teacher.teach(control);
        maps.rays.add(&rays);
        maps.tracing += start.elapsed().as_secs_f64();
        (guide, sent)
    };
    let run = |purpose, settings: &PhotonSettings, guide: Option<&Guide>, maps: &mut PhotonMaps| {
        let start = Instant::now();
        let source = (emission.build)(&EmissionContext {
            scene,
            accel,
            seed: settings.seed,
            purpose,
            count: match purpose {
                Purpose::Global => settings.global,
                Purpose::Caustic => settings.caustic,
            },
            guide,
        });
        let pass = follow_photons(scene, accel, &*source, purpose, effects, settings, control);
        maps.rays.add(&pass.rays);
        maps.tracing += start.elapsed().as_secs_f64();
        pass
    };
    let pilot = settings.pilot();
    let deciding = |whole: u64, part: u64| Pilot {
        around: Surroundings { scene, accel },
        nearest: settings.nearest,
        ratio: whole as f64 / part as f64,
    };
    let start = Instant::now();
    let caustics = |maps: &mut PhotonMaps| {
        let (guide, sent) = teach(Purpose::Caustic, maps);
        let scout = run(Purpose::Caustic, &pilot, guide.as_ref(), maps);
        let pass = run(Purpose::Caustic, settings, guide.as_ref(), maps);
        maps.caustic_counts = pass.counts;
        maps.caustic_counts.pilot = pilot.caustic + sent;
        let deciding = deciding(settings.caustic, pilot.caustic);
        let all = |_| true;
        let kernels = Arc::new(deciding.kernels(scout.photons, area, all, control));
        let map = PhotonMap::build(pass.photons, settings.nearest, area);
        maps.caustic = Some(map.with_kernels(kernels));
        if gather && effects.contains(EffectSet::INDIRECT) {
            let kernels = Arc::new(deciding.kernels(scout.glow, area, all, control));
            let glow = PhotonMap::build(pass.glow, settings.nearest, area);
            maps.glow = Some(IrradianceMap::build(&glow, kernels, all, control));
        }
    };
    let global = |maps: &mut PhotonMaps| {
        let (guide, sent) = teach(Purpose::Global, maps);
        let scout = run(Purpose::Global, &pilot, guide.as_ref(), maps);
        let pass = run(Purpose::Global, settings, guide.as_ref(), maps);
        maps.global_counts = pass.counts;
        maps.global_counts.pilot = pilot.global + sent;
        let map = PhotonMap::build(pass.photons, settings.nearest, area);
        let keep = |class| match gather {
            true => class != PhotonClass::Caustic,
            false => class == PhotonClass::Indirect,
        };
        let deciding = deciding(settings.global, pilot.global);
        let kernels = Arc::new(deciding.kernels(scout.photons, area, keep, control));
        let map = map.with_kernels(Arc::clone(&kernels));
        if gather {
            maps.irradiance = Some(IrradianceMap::build(&map, kernels, keep, control));
        }
        maps.global = Some(map);
    };
    if effects.contains(EffectSet::CAUSTICS) && settings.caustic > 0 {
        tally::stage(Part::Caustics, || caustics(&mut maps));
    }
    if effects.contains(EffectSet::INDIRECT) && settings.global > 0 {
        tally::stage(Part::Indirect, || global(&mut maps));
    }
    maps.building = start.elapsed().as_secs_f64() - maps.tracing;
    maps
}
