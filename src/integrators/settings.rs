//! What integrators are told.

use crate::photons::GuideBy;

/// Settings of an integrator and of the photon pass it may need.
#[derive(Clone, Debug, PartialEq)]
pub struct IntegratorSettings {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Most scattering events along a path from the camera to a light; `None` for no limit.
    pub max_depth: Option<u32>,
    /// Whether long paths are ended by Russian roulette.
    pub roulette: bool,
    /// Photons emitted for the global map.
    pub photons: u64,
    /// Photons emitted for the caustic map.
    pub caustic_photons: u64,
    /// Photons in a density estimate.
    pub nearest: usize,
    /// What the emission of photons is guided by.
    pub guide: GuideBy,
    /// Final-gather rays per camera sample; 0 shows the global map directly.
    pub gather_rays: u32,
    /// Shadow rays per camera sample at the first diffuse surface.
    pub shadow_rays: u32,
    /// Whether the camera sees the sky behind everything; it lights the scene all the same.
    pub background: bool,
}

impl Default for IntegratorSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            max_depth: None,
            roulette: true,
            photons: 1_000_000,
            caustic_photons: 1_000_000,
            nearest: 50,
            guide: GuideBy::default(),
            gather_rays: 4,
            shadow_rays: 2,
            background: true,
        }
    }
}
