//! Finished maps as bytes, and which scene and settings they are of.

use serde::{Deserialize, Serialize};

use super::map::{SavedKernels, SavedMap, SavedSamples};
use super::{EmissionEntry, PhotonMaps, PhotonSettings};
use crate::effects::EffectSet;
use crate::scene::Scene;
use crate::stats::PhotonCounts;

/// Raised when the same scene and settings would give other photons than before.
const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), ".5");

/// All that decides what the maps hold: photons of the same key are the same to the bit on the same
/// kind of machine. The camera is not in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhotonKey {
    /// Parts of the scene with their fingerprints.
    scene: Vec<(String, u128)>,
    /// Settings with what they were, as the command line has them.
    settings: Vec<(String, String)>,
}

impl PhotonKey {
    /// The key of what [`trace_photons`](super::trace_photons) would make; `backend` is the name of
    /// the ray tracer.
    pub fn new(
        scene: &Scene,
        backend: &str,
        emission: &EmissionEntry,
        effects: EffectSet,
        settings: &PhotonSettings,
        gather: bool,
    ) -> Self {
        let prints = scene.fingerprints();
        let scene = [
            ("geometry", prints.geometry),
            ("materials", prints.materials),
            ("textures", prints.textures),
            ("lights", prints.lights),
        ];
        // The others are part of the scene.
        let traced =
            EffectSet::SPECULAR | EffectSet::REFRACTION | EffectSet::CAUSTICS | EffectSet::INDIRECT;
        let traced = effects & traced;
        let on_off = |on: bool| if on { "on" } else { "off" }.to_string();
        let number = |n: u64| n.to_string();
        let depth = settings
            .max_depth
            .map_or("none".into(), |n| number(n.into()));
        let settings = [
            ("version", VERSION.into()),
            ("--photons", number(settings.global)),
            ("--caustic-photons", number(settings.caustic)),
            ("--nearest", number(settings.nearest as u64)),
            ("--seed", number(settings.seed)),
            ("--emission", emission.name.into()),
            ("--gather", on_off(gather)),
            ("--max-depth", depth),
            ("roulette", on_off(settings.roulette)),
            ("--guide", settings.guidance.by().name().into()),
            (
                "--effects",
                traced
                    .iter_names()
                    .map(|e| e.0.to_lowercase())
                    .collect::<Vec<_>>()
                    .join(","),
            ),
            ("--accel", backend.into()),
        ];
        Self {
            scene: scene.map(|(k, v)| (k.into(), v)).into(),
            settings: settings.map(|(k, v)| (k.into(), v)).into(),
        }
    }

    /// What these photons, found in a file, have different from those that are wanted; `None` if
    /// they are the same.
    pub fn difference(&self, wanted: &Self) -> Option<String> {
        if self.scene != wanted.scene {
            let names: Vec<&str> = (self.scene.iter().zip(&wanted.scene))
                .filter(|(a, b)| a != b)
                .map(|(_, b)| b.0.as_str())
                .collect();
            return Some(format!("another scene: {} differ", names.join(", ")));
        }
        if self.settings != wanted.settings {
            let other: Vec<String> = (self.settings.iter().zip(&wanted.settings))
                .filter(|(a, b)| a != b)
                .map(|(a, b)| format!("{} {} instead of {}", b.0, a.1, b.1))
                .collect();
            return Some(format!("other settings: {}", other.join(", ")));
        }
        None
    }
}

/// The maps, without what can be computed anew.
#[derive(Serialize, Deserialize)]
struct Saved<'a> {
    global: Option<SavedMap<'a>>,
    irradiance: Option<SavedSamples<'a>>,
    caustic: Option<SavedMap<'a>>,
    glow: Option<(SavedKernels<'a>, SavedSamples<'a>)>,
    counts: [PhotonCounts; 2],
}

impl PhotonMaps {
    /// Writes the maps.
    ///
    /// # Errors
    /// Those of `to`.
    pub fn write(&self, to: impl std::io::Write) -> postcard::Result<()> {
        let saved = Saved {
            global: self.global.as_ref().and_then(|m| m.save()),
            irradiance: self.irradiance.as_ref().map(|m| m.save_samples()),
            caustic: self.caustic.as_ref().and_then(|m| m.save()),
            glow: self.glow.as_ref().map(|m| m.save()),
            counts: [self.global_counts, self.caustic_counts],
        };
        postcard::to_io(&saved, to).map(|_| ())
    }

    /// The maps that were written, for which no ray was traced now; `None` if the bytes are no maps.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let saved: Saved<'_> = postcard::from_bytes(bytes).ok()?;
        let global = match saved.global {
            Some(map) => Some(map.restore()?),
            None => None,
        };
        let irradiance = match (saved.irradiance, &global) {
            (Some(samples), Some(map)) => Some(samples.restore(map.kernels()?.clone())?),
            (None, _) => None,
            (Some(_), None) => return None,
        };
        let caustic = match saved.caustic {
            Some(map) => Some(map.restore()?),
            None => None,
        };
        let glow = match saved.glow {
            Some((kernels, samples)) => Some(samples.restore_with(kernels)?),
            None => None,
        };
        let [global_counts, caustic_counts] = saved.counts;
        Some(Self {
            global,
            irradiance,
            caustic,
            glow,
            global_counts,
            caustic_counts,
            ..Self::default()
        })
    }
}
