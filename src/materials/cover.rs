//! Layers above other lobes.

use super::layer::{LayerAlbedo, SheenAlbedo};

/// A layer above lobes that takes from them what it scatters itself: light that comes along
/// `wi` and leaves along `wo` keeps `min(1 − E(wo), 1 − E(wi))`, with the layer's directional
/// albedo `E` (`KHR_materials_sheen`, albedo scaling). That is reciprocal and returns no more
/// than comes in.
#[derive(Clone, Copy, Debug)]
pub(super) enum Cover {
    /// A clear coat.
    Coat(LayerAlbedo),
    /// Sheen.
    Sheen(SheenAlbedo),
}

impl Cover {
    pub(super) fn coat(albedo: LayerAlbedo) -> Self {
        Self::Coat(albedo)
    }

    pub(super) fn sheen(lobe: &super::lobes::Sheen) -> Self {
        Self::Sheen(lobe.cover())
    }

    /// What passes the layer along a direction of the given cosine.
    pub(super) fn passes(&self, cos: f64) -> f64 {
        let e = match self {
            Self::Coat(a) => a.at(cos.abs()),
            Self::Sheen(a) => a.at(cos.abs()),
        };
        (1.0 - e).max(0.0)
    }
}
