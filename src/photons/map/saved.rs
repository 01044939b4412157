//! Maps as they are written to a file: what cannot be computed anew from the rest. Reading takes
//! nothing on trust: an index beyond what it points into, and there is no map.

use std::borrow::Cow;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::clearing::Clearing;
use super::kdtree::Plane;
use super::kernels::Decision;
use super::{IrradianceMap, IrradianceSample, KdTree, Kernels, Photon, PhotonMap};

/// A [`PhotonMap`] that estimates with kernels.
#[derive(Serialize, Deserialize)]
pub(in crate::photons) struct SavedMap<'a> {
    photons: Cow<'a, [Photon]>,
    planes: Cow<'a, [Plane]>,
    nearest: u64,
    max_radius: f32,
    kernels: SavedKernels<'a>,
}

/// [`Kernels`].
#[derive(Serialize, Deserialize)]
pub(in crate::photons) struct SavedKernels<'a> {
    positions: Vec<[f32; 3]>,
    planes: Cow<'a, [Plane]>,
    decisions: Cow<'a, [Decision]>,
    clearings: Cow<'a, [Clearing]>,
    widest: f32,
}

/// An [`IrradianceMap`] without its kernels.
#[derive(Serialize, Deserialize)]
pub(in crate::photons) struct SavedSamples<'a>(Cow<'a, [IrradianceSample]>);

impl PhotonMap {
    /// For writing; `None` without kernels.
    pub(in crate::photons) fn save(&self) -> Option<SavedMap<'_>> {
        Some(SavedMap {
            photons: Cow::Borrowed(&self.photons),
            planes: Cow::Borrowed(self.tree.planes()),
            nearest: self.nearest as u64,
            max_radius: self.max_radius,
            kernels: self.kernels()?.save(),
        })
    }
}

impl SavedMap<'_> {
    /// The map, if it is one.
    pub(in crate::photons) fn restore(self) -> Option<PhotonMap> {
        let photons = self.photons.into_owned();
        Some(PhotonMap {
            tree: KdTree::from_planes(self.planes.into_owned(), &photons, |p| p.p)?,
            photons,
            nearest: usize::try_from(self.nearest).ok()?.max(2),
            max_radius: self.max_radius,
            kernels: Some(Arc::new(self.kernels.restore()?)),
        })
    }
}

impl Kernels {
    fn save(&self) -> SavedKernels<'_> {
        SavedKernels {
            positions: (0..self.len())
                .map(|i| self.tree.position(i).into())
                .collect(),
            planes: Cow::Borrowed(self.tree.planes()),
            decisions: Cow::Borrowed(&self.decisions),
            clearings: Cow::Borrowed(&self.clearings),
            widest: self.widest,
        }
    }
}

impl SavedKernels<'_> {
    fn restore(self) -> Option<Kernels> {
        let tree = KdTree::from_planes(self.planes.into_owned(), &self.positions, |p| *p)?;
        let decisions = self.decisions.into_owned();
        (decisions.len() == self.positions.len())
            .then(|| Kernels::new(tree, decisions, self.clearings.into_owned(), self.widest))
    }
}

impl IrradianceMap {
    /// For writing beside the kernels.
    pub(in crate::photons) fn save_samples(&self) -> SavedSamples<'_> {
        SavedSamples(Cow::Borrowed(&self.samples))
    }

    /// For writing.
    pub(in crate::photons) fn save(&self) -> (SavedKernels<'_>, SavedSamples<'_>) {
        (self.kernels.save(), self.save_samples())
    }
}

impl SavedSamples<'_> {
    /// The map at the sites of these kernels, if there are as many.
    pub(in crate::photons) fn restore(self, kernels: Arc<Kernels>) -> Option<IrradianceMap> {
        let samples = self.0.into_owned();
        (samples.len() == kernels.len()).then_some(IrradianceMap { kernels, samples })
    }

    /// As [`restore`](Self::restore), with kernels that were written, too.
    pub(in crate::photons) fn restore_with(
        self,
        kernels: SavedKernels<'_>,
    ) -> Option<IrradianceMap> {
        self.restore(Arc::new(kernels.restore()?))
    }
}
