//! Presets: how many samples and photons, in one word. A preset is one line.

use clap::ValueEnum;

use super::{PixelSampling, RenderSettings};
use crate::integrators::{IntegratorEntry, IntegratorSettings, PhotonNeeds};
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
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Normal => "normal",
            Self::High => "high",
            Self::Reference => "reference",
        }
    }

    /// Samples per pixel.
    pub fn spp(self) -> u32 {
        match self {
            Self::Draft => 4,
            Self::Normal => 16,
            Self::High => 64,
            Self::Reference => 1024,
        }
    }

    /// `base` as this preset has it rendered by an integrator.
    pub fn apply(self, base: &RenderSettings, integrator: &IntegratorEntry) -> RenderSettings {
        let pixels = u64::from(base.width) * u64::from(base.height);
        RenderSettings {
            integrator: Some(integrator.name.into()),
            spp: self.spp(),
            pixel_sampling: sampling_for(integrator),
            integrator_settings: IntegratorSettings {
                seed: base.integrator_settings.seed,
                guide: base.integrator_settings.guide,
                ..settings_for(self.spp(), pixels)
            },
            ..base.clone()
        }
    }
}

/// How pixels are sampled if nobody says so: adaptively where that is faster to the same error.
pub fn sampling_for(integrator: &IntegratorEntry) -> PixelSampling {
    match integrator.photons {
        PhotonNeeds::All => PixelSampling::Adaptive,
        PhotonNeeds::None | PhotonNeeds::Caustic => PixelSampling::Uniform,
    }
}

/// Photons and how many of them make an estimate, on top of the defaults, for an image of so many
/// pixels and samples in each. Photons grow with the samples, by more passes where a pixel has many;
/// kernels follow from the photons.
pub fn settings_for(spp: u32, pixels: u64) -> IntegratorSettings {
    let defaults = IntegratorSettings::default();
    let share = f64::from(spp.min(SAMPLES_PER_PASS)) / f64::from(SAMPLES_PER_PASS)
        * (pixels as f64 / DEFAULT_PIXELS).clamp(LEAST_SHARE, MOST_SHARE);
    let part = |n: u64| (n as f64 * share) as u64;
    // Balances noise, 1/k, and bias, (k/N)². More than the default would cost time only.
    let nearest = (defaults.nearest as f64 * share.min(1.0).powf(2.0 / 3.0)).round() as usize;
    IntegratorSettings {
        photons: part(defaults.photons),
        caustic_photons: part(defaults.caustic_photons),
        nearest: nearest.max(LEAST_NEAREST),
        ..defaults
    }
}

/// Pixels of the image that the default settings are meant for.
const DEFAULT_PIXELS: f64 = 512.0 * 512.0;

/// Fewest and most photons of an image, in those of the default image: the first so that there are
/// enough for any kernel, the second so that they fit into a gigabyte.
const LEAST_SHARE: f64 = 0.05;
const MOST_SHARE: f64 = 8.0;

/// Fewest photons in a kernel: fewer make noise that stands out.
const LEAST_NEAREST: usize = 8;

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(quality: Quality, pixels: u64) -> IntegratorSettings {
        settings_for(quality.spp(), pixels)
    }

    #[test]
    fn normal_is_the_default_of_the_library_and_others_lie_around_it() {
        let default = DEFAULT_PIXELS as u64;
        assert_eq!(
            settings(Quality::Normal, default),
            IntegratorSettings::default()
        );
        let spp = Quality::value_variants().iter().map(|q| q.spp());
        assert!(spp.is_sorted());
        let draft = settings(Quality::Draft, default);
        assert_eq!((draft.photons, draft.nearest), (250_000, 20));
        let photons = |pixels| settings(Quality::Normal, pixels).photons;
        assert_eq!(photons(default / 4), 250_000);
        assert_eq!((photons(1), photons(1 << 40)), (50_000, 8_000_000));
        assert_eq!(settings(Quality::Normal, 1 << 40).nearest, 50);
        assert_eq!(settings(Quality::Draft, 1).nearest, 8);
    }
}
