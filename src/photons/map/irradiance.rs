//! Irradiance estimated once at some of the photons, so that a final-gather ray needs only the
//! nearest of them.
//!
//! Source: Christensen, *Faster Photon Map Global Illumination*, JGT 4(3), 1999.

use rayon::prelude::*;

use super::{KdTree, Nearest, PhotonMap, Site};
use crate::color::Rgb;
use crate::control::Control;
use crate::math::Vec3;
use crate::photons::PhotonClass;

/// One photon in this many gets an irradiance.
const STRIDE: usize = 4;

/// Irradiance at a point.
#[derive(Clone, Copy, Debug)]
pub struct IrradianceSample {
    /// Position.
    pub p: [f32; 3],
    /// Geometric normal on the lit side.
    ng: [f32; 3],
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

/// Irradiance samples in a tree.
#[derive(Debug)]
pub struct IrradianceMap {
    tree: KdTree,
    samples: Vec<IrradianceSample>,
    max_radius: f32,
}

impl IrradianceMap {
    /// Estimates irradiance at every fourth photon of `map`, over the photons that `keep`
    /// accepts.
    pub fn build(
        map: &PhotonMap,
        keep: impl Fn(PhotonClass) -> bool + Sync,
        control: &Control,
    ) -> Self {
        let sites = map.photons().len().div_ceil(STRIDE);
        let stage = control.stage("irradiance", "estimates", sites as u64);
        let mut samples: Vec<IrradianceSample> = map
            .photons()
            .par_chunks(STRIDE * 1024)
            .flat_map_iter(|chunk| {
                let mut found = Nearest::new();
                let part: Vec<_> = chunk
                    .iter()
                    .step_by(STRIDE)
                    .map(|photon| {
                        let site = Site {
                            p: Vec3::from(photon.p),
                            ng: photon.ng(),
                        };
                        let e = map.estimate(&site, &mut found, &keep, |_| Rgb::ONE);
                        IrradianceSample {
                            p: photon.p,
                            ng: site.ng.into(),
                            irradiance: e.value.to_f32(),
                            radius: e.radius as f32,
                            density: e.density as f32,
                        }
                    })
                    .collect();
                stage.advance(part.len() as u64);
                part
            })
            .collect();
        let tree = KdTree::build(&mut samples, |s| s.p);
        Self {
            tree,
            samples,
            max_radius: map.max_radius,
        }
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
    pub fn nearest(&self, site: &Site, found: &mut Nearest) -> Option<&IrradianceSample> {
        // Nearly always something lies close by; the wide search is for dark regions.
        for reach in [0.25, 1.0] {
            let r = self.max_radius * reach;
            found.reset(1, r * r);
            self.tree.visit_near(site.p, found, |i, _| {
                let s = &self.samples[i];
                site.accepts(s.p, Vec3::from(s.ng), r * r)
            });
            if let Some((i, _)) = found.iter().next() {
                return Some(&self.samples[i]);
            }
        }
        None
    }
}
