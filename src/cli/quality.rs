//! Presets: how many samples and photons, in one word. A preset is one line.

use clap::ValueEnum;

use crate::integrators::IntegratorSettings;
use crate::photons::SAMPLES_PER_PASS;

/// How good a picture is to be. Each costs about four times the one before, but for the last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Quality {
    /// To see what is there
    Draft,
    /// To look at
    #[default]
    Normal,
    /// To keep
    High,
    /// To judge others by
    Reference,
}

impl Quality {
    /// Samples per pixel.
    pub(super) fn spp(self) -> u32 {
        match self {
            Self::Draft => 4,
            Self::Normal => 16,
            Self::High => 64,
            Self::Reference => 1024,
        }
    }

    /// Photons and how many of them make an estimate, on top of the defaults. Photons grow with
    /// the samples, by more passes where there are many samples; kernels follow from the photons.
    pub(super) fn settings(self) -> IntegratorSettings {
        let defaults = IntegratorSettings::default();
        let share = f64::from(self.spp().min(SAMPLES_PER_PASS)) / f64::from(SAMPLES_PER_PASS);
        let part = |n: u64| (n as f64 * share) as u64;
        IntegratorSettings {
            photons: part(defaults.photons),
            caustic_photons: part(defaults.caustic_photons),
            // Balances noise, 1/k, and bias, (k/N)².
            nearest: (defaults.nearest as f64 * share.powf(2.0 / 3.0)).round() as usize,
            ..defaults
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_is_the_default_of_the_library_and_others_lie_around_it() {
        assert_eq!(Quality::Normal.settings(), IntegratorSettings::default());
        let spp = Quality::value_variants().iter().map(|q| q.spp());
        assert!(spp.is_sorted());
        let draft = Quality::Draft.settings();
        assert_eq!((draft.photons, draft.nearest), (250_000, 20));
    }
}
