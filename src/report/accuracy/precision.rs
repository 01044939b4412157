//! Backends that exist to be measured: one without a precision that the others pay for, one that
//! pays for it twice.

use std::hint::black_box;
use std::sync::Arc;

use crate::accel::{Accelerator, AcceleratorEntry, BuildStats};
use crate::error::Result;
use crate::geometry::{Geometry, Hit, Ray};
use crate::plugins::Registry;

/// A registry that knows these backends as well.
///
/// # Errors
/// If a plugin has one of their names.
pub fn with_measured_backends(mut registry: Registry) -> Result<Registry> {
    #[cfg(feature = "embree")]
    registry.accelerators.add(crate::accel::EMBREE_FAST)?;
    registry.accelerators.add(TWICE)?;
    Ok(registry)
}

/// The name of [`TWICE`].
pub(super) const REFINED_TWICE: &str = "refined-twice";

/// The default backend, but every hit is computed in double precision once more than need be:
/// what that adds is what it costs.
const TWICE: AcceleratorEntry = AcceleratorEntry {
    name: REFINED_TWICE,
    doc: "the default backend, each hit refined in double precision twice",
    build: |geometry, threads| {
        let inner = (crate::accel::ACCELERATORS[0].build)(geometry, threads)?;
        Ok(Box::new(Twice {
            inner,
            geometry: geometry.clone(),
        }))
    },
};

struct Twice {
    inner: Box<dyn Accelerator>,
    geometry: Arc<Geometry>,
}

impl Accelerator for Twice {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.inner.intersect(ray)?;
        black_box(self.geometry.surface_point(ray, &hit));
        Some(hit)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.inner.occluded(ray)
    }

    fn stats(&self) -> BuildStats {
        self.inner.stats()
    }
}
