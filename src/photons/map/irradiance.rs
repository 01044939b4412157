//! Irradiance estimated once at some sites, so that a final-gather ray needs only the
//! nearest of them.
//!
//! Source: Christensen, *Faster Photon Map Global Illumination*, JGT 4(3), 1999.

use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Kernels, PhotonMap, Site};
use crate::color::Rgb;
use crate::control::Control;
use crate::photons::PhotonClass;

/// Estimates that are reported together.
const BLOCK: usize = 1024;

/// Irradiance at a point.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct IrradianceSample {
    /// Irradiance in W/m².
    irradiance: [f32; 3],
    /// Radius of the kernel it was estimated with.
    pub radius: f32,
    /// Photons per square metre.
    pub density: f32,
}

impl IrradianceSample {
    /// Irradiance in W/m².
    #[inline]
    pub fn irradiance(&self) -> Rgb {
        self.irradiance.into()
    }
}

/// Irradiance at the sites where kernels were decided.
#[derive(Debug)]
pub struct IrradianceMap {
    pub(super) kernels: Arc<Kernels>,
    pub(super) samples: Vec<IrradianceSample>,
}

impl IrradianceMap {
    /// Estimates irradiance at the sites of `kernels` over the photons of `map` that `keep`
    /// accepts.
    pub fn build(
        map: &PhotonMap,
        kernels: Arc<Kernels>,
        keep: impl Fn(PhotonClass) -> bool + Sync,
        control: &Control,
    ) -> Self {
        let stage = control.stage("irradiance", "estimates", kernels.len() as u64);
        let samples = kernels
            .sites()
            .enumerate()
            .map(|(i, site)| {
                let e = map.estimate_within(&site, kernels.at(i), &keep, |_| Rgb::ONE);
                if i % BLOCK == 0 {
                    stage.advance(BLOCK as u64);
                }
                IrradianceSample {
                    irradiance: e.value.to_f32(),
                    radius: e.radius as f32,
                    density: e.density.min(f64::from(f32::MAX)) as f32,
                }
            })
            .collect();
        Self { kernels, samples }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// The nearest sample on the same side of the same surface.
    #[inline]
    pub fn nearest(&self, site: &Site) -> Option<&IrradianceSample> {
        self.kernels.nearest(site).map(|i| &self.samples[i])
    }
}
