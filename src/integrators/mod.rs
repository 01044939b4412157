//! Integrators: how the radiance of a camera sample is estimated. An integrator is one file and
//! one line in [`INTEGRATORS`].

mod camera_pass;
mod footprint;
mod gather;
mod hybrid;
mod light_sampling;
mod noise;
mod outlook;
mod path;
mod photon;
mod pixel_edges;
mod pixel_glints;
mod pixel_plan;
mod pixel_shares;
mod settings;
mod sights;
mod stored_light;
mod trials;
mod visibility;

pub use camera_pass::{Region, camera_pass};
pub use footprint::Spacing;
pub use noise::noise;
pub use outlook::{Outlook, Trial};
pub use pixel_plan::{PixelPlan, planned_camera_pass};
pub use settings::IntegratorSettings;
pub use sights::sights;
pub use trials::{enclosed, none_meets_another};
pub use visibility::Visibility;

use crate::accel::Accelerator;
use crate::effects::EffectSet;
use crate::error::Result;
use crate::film::{Component, PixelSample};
use crate::geometry::{Differential, LightId, Ray, SurfacePoint};
use crate::math::DVec3;
use crate::photons::PhotonMaps;
use crate::registry::Table;
use crate::sampling::Sampler;
use crate::scene::Scene;
use crate::stats::RayCounts;

/// What integrators see.
#[derive(Clone, Copy)]
pub struct RenderContext<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its ray tracer.
    pub accel: &'a dyn Accelerator,
    /// Which lights reach where.
    pub visibility: &'a Visibility,
    /// The photon maps; empty for integrators that want none.
    pub maps: &'a PhotonMaps,
    /// The effects that are simulated.
    pub effects: EffectSet,
    /// What the integrator is told.
    pub settings: &'a IntegratorSettings,
}

impl RenderContext<'_> {
    /// As [`Scene::pick_light`], by what points see.
    #[inline(always)]
    fn pick_light(&self, p: DVec3, u: f64) -> Option<(LightId, f64, f64)> {
        self.scene.pick_light(p, self.visibility.at(p), u)
    }

    /// As [`Scene::light_probability`], by what points see.
    #[inline]
    fn light_probability(&self, p: DVec3, id: LightId) -> f64 {
        let seen = self.visibility.at(p);
        self.scene.light_probability(p, seen, id)
    }

    /// As [`Scene::pdf_light`], by what points see.
    #[inline]
    fn pdf_light(&self, from: DVec3, on: &SurfacePoint) -> f64 {
        self.scene.pdf_light(from, on, self.visibility.at(from))
    }
}

/// Whether a component of the image is left by the effects that are simulated.
#[inline]
pub fn keeps(effects: EffectSet, component: Component) -> bool {
    effects.intersects(match component {
        Component::Direct => EffectSet::DIRECT,
        Component::Specular => EffectSet::SPECULAR.union(EffectSet::REFRACTION),
        Component::Caustics => EffectSet::CAUSTICS,
        Component::Indirect => EffectSet::INDIRECT,
    })
}

/// Estimates radiance along camera rays.
pub trait Integrator: Send + Sync {
    /// Takes samples and adds each to the sum of its pixel; `scratch` is the calling thread's
    /// own. The samples have nothing to do with each other: an integrator may walk their paths
    /// side by side.
    fn sample(&self, batch: &mut [Sample], sums: &mut [PixelSample], scratch: &mut Scratch);
}

/// Most samples that are taken side by side.
const BATCH: usize = 16;

/// A sample that is to be taken.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Where it begins.
    pub camera: CameraRay,
    /// Its random numbers.
    pub sampler: Sampler,
    /// Index of the sum that it is added to.
    pub pixel: usize,
    /// Share of the rays that gather indirect light at what it sees first: less where that light is
    /// interpolated.
    pub gathering: f64,
}

/// A ray from the camera.
#[derive(Clone, Copy, Debug)]
pub struct CameraRay {
    /// The ray.
    pub ray: Ray,
    /// How it changes with the pixel; `None` where no texture asks for it.
    pub differential: Option<Differential>,
}

/// What a thread keeps between samples.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Rays traced.
    pub rays: RayCounts,
    /// Space for nearest-neighbour searches.
    pub nearest: crate::photons::map::Nearest,
}

/// Which photons an integrator has use for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhotonNeeds {
    /// None: it follows paths from the camera alone.
    None,
    /// Those that come by way of specular surfaces.
    Caustic,
    /// All.
    All,
}

/// An integrator that can be chosen.
#[derive(Clone, Copy, Debug)]
pub struct IntegratorEntry {
    /// Name, for `--integrator`.
    pub name: &'static str,
    /// One sentence.
    pub doc: &'static str,
    /// Which photon maps it reads.
    pub photons: PhotonNeeds,
    /// Why a scene of which this is known should be rendered by it if nobody says how; `None` if it
    /// should not.
    pub suits: fn(&Outlook) -> Option<String>,
    /// Makes it.
    pub build: for<'a> fn(RenderContext<'a>) -> Box<dyn Integrator + 'a>,
}

crate::registry::impl_entry!(IntegratorEntry, "integrator");

/// The integrator that suits a scene, and why: the first of the table that says so.
///
/// # Errors
/// An empty table.
pub fn suited<'t>(
    table: &'t Table<IntegratorEntry>,
    outlook: &Outlook,
) -> Result<(&'t IntegratorEntry, String)> {
    let mut entries = table.entries().iter();
    if let Some(found) = entries.find_map(|e| Some((e, (e.suits)(outlook)?))) {
        return Ok(found);
    }
    Ok((table.choose(None)?, "the first of the table".into()))
}

/// The first integrator that reads all photon maps, for who asks for photons.
pub fn with_photons(table: &Table<IntegratorEntry>) -> Option<&IntegratorEntry> {
    let mut entries = table.entries().iter();
    entries.find(|e| e.photons == PhotonNeeds::All)
}

/// The integrators; the first is the default of the library, where nobody looks at the scene.
pub static INTEGRATORS: &[IntegratorEntry] = &[photon::ENTRY, hybrid::ENTRY, path::ENTRY];
