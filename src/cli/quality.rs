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

    /// Photons and how many of them make an estimate, on top of the defaults, for an image of so
    /// many pixels. Photons grow with the samples, by more passes where a pixel has many; kernels
    /// follow from the photons.
    pub(super) fn settings(self, pixels: u64) -> IntegratorSettings {
        let defaults = IntegratorSettings::default();
        let share = f64::from(self.spp().min(SAMPLES_PER_PASS)) / f64::from(SAMPLES_PER_PASS)
            * (pixels as f64 / DEFAULT_PIXELS).clamp(LEAST_SHARE, MOST_SHARE);
        let part = |n: u64| (n as f64 * share) as u64;
        IntegratorSettings {
            photons: part(defaults.photons),
            caustic_photons: part(defaults.caustic_photons),
            // Balances noise, 1/k, and bias, (k/N)². More than the default would cost time only.
            nearest: (defaults.nearest as f64 * share.min(1.0).powf(2.0 / 3.0)).round() as usize,
            ..defaults
        }
    }
}

/// Pixels of the image that the default settings are meant for.
const DEFAULT_PIXELS: f64 = 512.0 * 512.0;

/// Fewest and most photons of an image, in those of the default image: the first so that there are
/// enough for any kernel, the second so that they fit into a gigabyte.
const LEAST_SHARE: f64 = 0.05;
const MOST_SHARE: f64 = 8.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_is_the_default_of_the_library_and_others_lie_around_it() {
        let default = DEFAULT_PIXELS as u64;
        assert_eq!(
            Quality::Normal.settings(default),
            IntegratorSettings::default()
        );
        let spp = Quality::value_variants().iter().map(|q| q.spp());
        assert!(spp.is_sorted());
        let draft = Quality::Draft.settings(default);
        assert_eq!((draft.photons, draft.nearest), (250_000, 20));
        let photons = |pixels| Quality::Normal.settings(pixels).photons;
        assert_eq!(photons(default / 4), 250_000);
        assert_eq!((photons(1), photons(1 << 40)), (50_000, 8_000_000));
        assert_eq!(Quality::Normal.settings(1 << 40).nearest, 50);
    }
}
