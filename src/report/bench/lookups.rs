//! How fast the photon map answers, apart from everything around it.

use std::time::Instant;

use rayon::prelude::*;

use super::BenchOptions;
use crate::accel::Accelerator;
use crate::color::Rgb;
use crate::control::Control;
use crate::effects::EffectSet;
use crate::error::Result;
use crate::geometry::Ray;
use crate::photons::map::{Nearest, Site, Surroundings};
use crate::photons::{PhotonMap, PhotonMaps, PhotonSettings, trace_photons};
use crate::plugins::Registry;
use crate::scene::Scene;

/// Photons in the map that is asked.
pub(super) const PHOTONS: u64 = 200_000;

/// Photons in a density estimate.
const NEAREST: usize = 50;

/// Sites that one task asks about.
const BATCH: usize = 1024;

/// The maps, and where they are asked.
pub(super) struct Lookups<'a> {
    around: Surroundings<'a>,
    maps: PhotonMaps,
    sites: Vec<Site>,
}

/// What is asked.
#[derive(Clone, Copy, Debug)]
pub(super) enum Question {
    /// The density of photons, as pixels ask for it.
    Density,
    /// The nearest irradiance that was estimated before, as gather rays ask for it.
    Irradiance,
}

impl Question {
    pub(super) const ALL: [Self; 2] = [Self::Density, Self::Irradiance];

    /// Name of its rate.
    pub(super) fn metric(self) -> &'static str {
        match self {
            Self::Density => "density lookups",
            Self::Irradiance => "irradiance lookups",
        }
    }
}

impl<'a> Lookups<'a> {
    /// Fills the maps of a scene; they are asked where `rays` end.
    ///
    /// # Errors
    /// No emission of the usual name.
    pub(super) fn new(
        scene: &'a Scene,
        accel: &'a dyn Accelerator,
        rays: &[Ray],
        options: &BenchOptions,
        registry: &Registry,
        control: &Control,
    ) -> Result<Self> {
        let settings = PhotonSettings {
            seed: options.seed,
            global: PHOTONS,
            caustic: 0,
            nearest: NEAREST,
            max_depth: None,
            roulette: true,
            guidance: crate::photons::Guidance::Off,
        };
        let emission = registry.emissions.find("uniform")?;
        let effects = EffectSet::all();
        let maps = trace_photons(scene, accel, emission, effects, &settings, true, control);
        let site = |ray: &Ray| {
            let sp = scene.surface_point(ray, &accel.intersect(ray)?);
            Some(Site::new(sp.p, if sp.front { sp.ng } else { -sp.ng }))
        };
        Ok(Self {
            around: Surroundings { scene, accel },
            maps,
            sites: rays.par_iter().filter_map(site).collect(),
        })
    }

    /// Lookups per second of all threads; `None` if there is no map or nowhere to ask.
    pub(super) fn rate(&self, question: Question) -> Option<f64> {
        let global = self.maps.global.as_ref().filter(|m| !m.is_empty())?;
        let irradiance = self.maps.irradiance.as_ref()?;
        if self.sites.is_empty() {
            return None;
        }
        let ask = |part: &[Site]| -> f64 {
            match question {
                Question::Density => self.densities(global, part),
                Question::Irradiance => {
                    let found = part.iter().filter_map(|s| irradiance.nearest(s));
                    found.map(|s| f64::from(s.density)).sum()
                }
            }
        };
        let start = Instant::now();
        let sum: f64 = self.sites.par_chunks(BATCH).map(ask).sum();
        std::hint::black_box(sum);
        Some(self.sites.len() as f64 / start.elapsed().as_secs_f64())
    }

    fn densities(&self, map: &PhotonMap, sites: &[Site]) -> f64 {
        let mut found = Nearest::new();
        let mut estimate =
            |s: &Site| map.estimate(s, self.around, &mut found, |_| true, |_| Rgb::ONE);
        sites.iter().map(|s| estimate(s).density).sum()
    }
}
