//! What is known of a scene before an integrator is chosen for it.

use crate::effects::EffectSet;
use crate::film::Component;
use crate::scene::{Census, Scene};

/// Least share of the light that reaches diffuse surfaces as caustics, of those that are worth a photon
/// map. Below it they are faint beside the rest.
const LEAST_CAUSTICS: f64 = 0.02;

/// Indirect light and caustics make so many times the noise that all else makes in paths where
/// photons pay. A sample with photons takes three to five times as long; the noise of indirect light
/// falls by the gather rays and by interpolation, that of the rest hardly.
const NOISE_OF_INDIRECT: f64 = 2.0;

/// The same where indirect light is not interpolated.
const NOISE_OF_INDIRECT_ALONE: f64 = 4.0;

/// A trial that is off by more than this factor is clear.
const CLEAR: f64 = 3.0;

/// A scene, and how its light behaves.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlook {
    /// What is in it.
    pub census: Census,
    /// Which effects are simulated.
    pub effects: EffectSet,
    /// What a trial told of its light, if there was one.
    pub trial: Option<Trial>,
}

/// What a few paths and photons tell of a scene's light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trial {
    /// Share of the light on diffuse surfaces in sight that comes by way of mirrors and glass.
    pub caustics: f64,
    /// Relative variance of a path's sample, by [`Component`]; zero where caustics alone decide.
    pub noise: [f64; 4],
    /// Whether indirect light would be interpolated if it came from photons.
    pub interpolated: bool,
}

impl Outlook {
    /// Of a scene, before any trial.
    pub fn new(scene: &Scene, effects: EffectSet) -> Self {
        Self {
            census: Census::new(scene),
            effects,
            trial: None,
        }
    }

    /// Whether a trial can change which integrator suits the scene.
    pub fn is_open(&self) -> bool {
        self.trial.is_none()
            && self
                .effects
                .intersects(EffectSet::CAUSTICS | EffectSet::INDIRECT)
    }

    /// Whether photons pay for the sake of caustics, whatever the noise of paths.
    pub fn pays_by_caustics(&self) -> bool {
        let caustics = self.trial.map(|t| Trial {
            noise: [0.0; 4],
            ..t
        });
        let outlook = Self {
            trial: caustics,
            ..self.clone()
        };
        caustics.is_some() && outlook.wants_photons().is_some()
    }

    /// Why photons should be traced; `None` if paths from the camera do as well.
    pub(super) fn wants_photons(&self) -> Option<String> {
        let sharp = self.census.sharp_objects;
        let caustics = self.effects.contains(EffectSet::CAUSTICS) && sharp > 0;
        let throw = || format!("{sharp} sharp mirrors or glasses throw caustics");
        let Some(trial) = self.trial else {
            return caustics.then(throw);
        };
        // Of a light without extent paths find no caustic at all.
        let least = match self.census.delta_lights {
            0 => LEAST_CAUSTICS,
            _ => 0.0,
        };
        let share = 100.0 * trial.caustics;
        if caustics && trial.caustics > least {
            return Some(format!("{}, {share:.1} % of the light", throw()));
        }
        let noise = 100.0 * trial.noise_of_indirect();
        (trial.noise_brought() > trial.most())
            .then(|| format!("indirect light makes {noise:.0} % of the noise of paths"))
    }

    /// Why paths from the camera do.
    pub(super) fn wants_paths(&self) -> String {
        let sharp = self.census.sharp_objects;
        match (self.trial, sharp) {
            (Some(t), 0) => format!(
                "indirect light makes but {:.0} % of the noise of paths",
                100.0 * t.noise_of_indirect()
            ),
            (Some(t), _) => format!(
                "caustics are {:.1} % of the light, and indirect light makes {:.0} % of the noise of paths",
                100.0 * t.caustics,
                100.0 * t.noise_of_indirect()
            ),
            (None, 0) => "no mirror or glass is sharp enough for photons to help".into(),
            (None, n) => {
                format!("{n} sharp mirrors or glasses throw no caustics that are simulated")
            }
        }
    }
}

impl Trial {
    /// Whether noise is so far from where photons begin to pay that more samples would tell the same.
    pub fn is_clear(&self) -> bool {
        let ratio = self.noise_brought() / self.most();
        !(1.0 / CLEAR..=CLEAR).contains(&ratio)
    }

    /// Noise brought from which on photons pay.
    fn most(&self) -> f64 {
        match self.interpolated {
            true => NOISE_OF_INDIRECT,
            false => NOISE_OF_INDIRECT_ALONE,
        }
    }

    fn noise_by(&self, c: Component) -> f64 {
        self.noise[c as usize]
    }

    /// Noise of what photons bring over the noise of all else.
    fn noise_brought(&self) -> f64 {
        let rest = self.noise_by(Component::Direct) + self.noise_by(Component::Specular);
        let brought = self.noise_by(Component::Indirect) + self.noise_by(Component::Caustics);
        brought / rest.max(f64::MIN_POSITIVE)
    }

    /// Share of the noise that indirect light and caustics make.
    fn noise_of_indirect(&self) -> f64 {
        let ratio = self.noise_brought();
        ratio.min(f64::MAX) / (1.0 + ratio.min(f64::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outlook(sharp: usize, delta: usize, trial: Option<Trial>) -> Outlook {
        Outlook {
            census: Census {
                sharp_objects: sharp,
                delta_lights: delta,
                ..Census::default()
            },
            effects: EffectSet::CAUSTICS | EffectSet::INDIRECT,
            trial,
        }
    }

    #[test]
    fn photons_are_for_caustics_and_for_indirect_light_that_makes_most_of_the_noise() {
        let trial = |caustics, indirect, interpolated| {
            Some(Trial {
                caustics,
                noise: [1.0, 0.0, 0.0, indirect],
                interpolated,
            })
        };
        for (sharp, delta, trial, want) in [
            (1, 0, None, true),
            (0, 0, None, false),
            (1, 0, trial(0.03, 0.0, true), true),
            (1, 0, trial(0.01, 0.0, true), false),
            (1, 1, trial(0.01, 0.0, true), true),
            (1, 1, trial(0.0, 0.0, true), false),
            (0, 0, trial(0.0, 3.0, true), true),
            (0, 0, trial(0.0, 3.0, false), false),
            (0, 0, trial(0.0, 5.0, false), true),
            (0, 0, trial(0.0, 1.0, true), false),
        ] {
            let outlook = outlook(sharp, delta, trial);
            let why = outlook.wants_photons();
            assert_eq!(why.is_some(), want, "{outlook:?}");
            // Whatever noise there is, the reason is a sentence.
            assert!(!why.unwrap_or_else(|| outlook.wants_paths()).contains("NaN"));
        }
        let dark = Trial::default();
        assert!(outlook(0, 0, Some(dark)).wants_paths().contains("0 %"));
    }
}
