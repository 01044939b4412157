//! What is measured: methods, each a ladder of settings, and single changes to one setting. A
//! method or a change is one line.

use crate::integrators::{IntegratorSettings, PhotonNeeds};
use crate::photons::GuideBy;
use crate::pipeline::{PixelSampling, RenderSettings, settings_for};
use crate::plugins::Registry;

/// Each rung of a ladder costs about so many times the one below.
pub(super) const STEP: f64 = 4.0;

/// Rungs of the longest ladder.
pub(super) const MOST_RUNGS: u32 = 7;

/// Finest rung that single changes are made to: of photon mapping, the preset `normal`.
pub(super) const MOST_CHANGED: u32 = 2;

/// A way to render, with settings from coarse to fine.
#[derive(Clone, Debug)]
pub struct Method {
    /// Name, for `--methods` and the plots.
    pub name: String,
    /// One sentence.
    pub doc: String,
    /// Changes settings to those of a rung; 0 is the coarsest.
    pub apply: fn(&mut RenderSettings, u32),
    /// Name of the integrator.
    integrator: String,
    /// Name of the emission, if it is not the first.
    emission: Option<&'static str>,
}

impl Method {
    /// `base` with this method at a rung.
    pub fn settings(&self, base: &RenderSettings, rung: u32) -> RenderSettings {
        let mut s = RenderSettings {
            integrator: Some(self.integrator.clone()),
            emission: self.emission.map(Into::into),
            ..base.clone()
        };
        (self.apply)(&mut s, rung);
        s
    }

    /// Whether it reads photon maps.
    pub(super) fn photons(&self, registry: &Registry) -> bool {
        let entry = registry.integrators.choose(Some(&self.integrator));
        entry.is_ok_and(|e| e.photons != PhotonNeeds::None)
    }
}

/// Name, sentence, integrator, emission, ladder.
type Line = (
    &'static str,
    &'static str,
    &'static str,
    Option<&'static str>,
    fn(&mut RenderSettings, u32),
);

/// The methods; the first is what the others are compared with.
const METHODS: &[Line] = &[
    ("path", "path tracing, unbiased", "path", None, path_ladder),
    (
        "hybrid",
        "path tracing, caustics from photons",
        "hybrid",
        Some("uniform"),
        hybrid_ladder,
    ),
    (
        "photon",
        "photon mapping, photons spread evenly",
        "photon",
        Some("uniform"),
        photon_ladder,
    ),
    (
        "photon+adaptive",
        "photon mapping, photons in cells refined where forecasts see a change",
        "photon",
        Some("adaptive"),
        photon_ladder,
    ),
    (
        "photon+pixels",
        "photon mapping, more samples at edges, indirect light interpolated elsewhere",
        "photon",
        Some("uniform"),
        |s, rung| at_pixels(s, rung, photon_ladder),
    ),
    (
        "photon+adaptive+pixels",
        "both: the paper's whole method",
        "photon",
        Some("adaptive"),
        |s, rung| at_pixels(s, rung, photon_ladder),
    ),
    (
        "path+pixels",
        "path tracing, more samples at edges, indirect light interpolated elsewhere",
        "path",
        None,
        |s, rung| at_pixels(s, rung, path_ladder),
    ),
];

/// All methods: those above, and integrators that none of them uses, by their own names.
pub fn methods(registry: &Registry) -> Vec<Method> {
    let known = METHODS
        .iter()
        .map(|&(name, doc, integrator, emission, apply)| Method {
            name: name.into(),
            doc: doc.into(),
            apply,
            integrator: integrator.into(),
            emission,
        });
    let others = registry
        .integrators
        .entries()
        .iter()
        .filter(|e| METHODS.iter().all(|m| m.2 != e.name))
        .map(|e| Method {
            name: e.name.into(),
            doc: e.doc.into(),
            apply: match e.photons {
                PhotonNeeds::All => photon_ladder,
                PhotonNeeds::Caustic => hybrid_ladder,
                PhotonNeeds::None => path_ladder,
            },
            integrator: e.name.into(),
            emission: None,
        });
    known.chain(others).collect()
}

/// A ladder with samples shared out among pixels.
fn at_pixels(s: &mut RenderSettings, rung: u32, ladder: fn(&mut RenderSettings, u32)) {
    ladder(s, rung);
    s.pixel_sampling = PixelSampling::Adaptive;
}

fn path_ladder(s: &mut RenderSettings, rung: u32) {
    s.spp = 4 << (2 * rung);
}

/// Samples and photons grow alike, as the presets' do.
fn photon_ladder(s: &mut RenderSettings, rung: u32) {
    s.spp = 1 << (2 * rung);
    set_photons(s);
}

/// As many samples as path tracing, and photons for these.
fn hybrid_ladder(s: &mut RenderSettings, rung: u32) {
    path_ladder(s, rung);
    set_photons(s);
}

fn set_photons(s: &mut RenderSettings) {
    let pixels = u64::from(s.width) * u64::from(s.height);
    let IntegratorSettings { seed, guide, .. } = s.integrator_settings;
    s.integrator_settings = IntegratorSettings {
        seed,
        guide,
        ..settings_for(s.spp, pixels)
    };
}

/// One change to the settings of photon mapping.
#[derive(Clone, Copy, Debug)]
pub struct Change {
    /// Name in tables.
    pub name: &'static str,
    /// What it costs and buys, in a few words.
    pub doc: &'static str,
    /// Makes it.
    pub apply: fn(&mut RenderSettings),
}

/// The changes, one at a time.
pub const CHANGES: &[Change] = &[
    Change {
        name: "4 times the photons",
        doc: "kernels half as wide",
        apply: |s| {
            s.integrator_settings.photons *= 4;
            s.integrator_settings.caustic_photons *= 4;
        },
    },
    Change {
        name: "a quarter of the photons",
        doc: "kernels twice as wide",
        apply: |s| {
            s.integrator_settings.photons /= 4;
            s.integrator_settings.caustic_photons /= 4;
        },
    },
    Change {
        name: "4 times as many in a kernel",
        doc: "kernels twice as wide, half the noise in them",
        apply: |s| s.integrator_settings.nearest *= 4,
    },
    Change {
        name: "a quarter as many in a kernel",
        doc: "kernels half as wide, twice the noise in them",
        apply: |s| s.integrator_settings.nearest = (s.integrator_settings.nearest / 4).max(2),
    },
    Change {
        name: "photons unguided",
        doc: "shared by the flux of the lamps",
        apply: |s| s.integrator_settings.guide = GuideBy::Off,
    },
    Change {
        name: "4 times the gather rays",
        doc: "less noise in indirect light",
        apply: |s| s.integrator_settings.gather_rays *= 4,
    },
    Change {
        name: "one gather ray",
        doc: "more noise in indirect light",
        apply: |s| s.integrator_settings.gather_rays = 1,
    },
    Change {
        name: "no gather rays",
        doc: "the photon map seen as it is",
        apply: |s| s.integrator_settings.gather_rays = 0,
    },
    Change {
        name: "4 times the shadow rays",
        doc: "less noise in direct light",
        apply: |s| s.integrator_settings.shadow_rays *= 4,
    },
    Change {
        name: "4 times the samples",
        doc: "half the noise of all that is sampled at pixels",
        apply: |s| s.spp *= 4,
    },
    #[cfg(feature = "embree")]
    Change {
        name: "not robust",
        doc: "Embree without its robust mode: rays slip between triangles that share an edge",
        apply: |s| s.accelerator = Some(crate::accel::EMBREE_FAST.name.into()),
    },
    Change {
        name: "hits refined twice",
        doc: "what computing each hit in double precision costs, paid once more for nothing",
        apply: |s| s.accelerator = Some(super::precision::REFINED_TWICE.into()),
    },
    Change {
        name: "rays by bvh",
        doc: "the hierarchy in Rust: no ray slips between triangles",
        apply: |s| s.accelerator = Some("bvh".into()),
    },
];

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

    use super::*;
    use crate::pipeline::Quality;

    #[test]
    fn every_method_and_change_names_plugins_there_are_and_rungs_grow() {
        let registry = super::super::with_measured_backends(Registry::builtin()).unwrap();
        let base = RenderSettings::default();
        let all = methods(&registry);
        assert_eq!(all[0].name, "path");
        for m in &all {
            let [a, b] = [0, 1].map(|k| m.settings(&base, k));
            assert!(registry.integrators.choose(a.integrator.as_deref()).is_ok());
            assert!(registry.emissions.choose(a.emission.as_deref()).is_ok());
            assert_eq!(f64::from(b.spp), STEP * f64::from(a.spp), "{}", m.name);
            // The finest rung fits its types.
            assert!(m.settings(&base, MOST_RUNGS - 1).spp > b.spp);
        }
        // Whatever integrator a preset renders by, it is a rung of a method.
        for integrator in registry.integrators.entries() {
            for quality in Quality::value_variants() {
                let preset = quality.apply(&base, integrator);
                let is = |m: &Method| {
                    (0..MOST_RUNGS).any(|k| {
                        RenderSettings {
                            emission: None,
                            ..m.settings(&base, k)
                        } == preset
                    })
                };
                // Path tracing has no use for photons, so its ladder says nothing of them.
                let named = |m: &&Method| m.integrator == integrator.name && is(m);
                let found = all.iter().find(named);
                let photons = integrator.photons != PhotonNeeds::None;
                assert!(found.is_some() || !photons, "{preset:?}");
            }
        }
        for c in CHANGES {
            let mut s = base.clone();
            (c.apply)(&mut s);
            assert_ne!(s, base, "{} changes nothing", c.name);
            assert!(
                registry
                    .accelerators
                    .choose(s.accelerator.as_deref())
                    .is_ok()
            );
        }
    }
}
