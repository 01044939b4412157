//! `hybrid`: path tracing, but for caustics, which come from photons.
//!
//! What no path from the camera finds well, and none at all if the light has no extent, is
//! `D S⁺ L`: a diffuse surface that light reaches by way of specular ones. These paths, and no
//! others, are left out and taken from the photon maps: at the first diffuse surface from the
//! caustic map; where another diffuse one comes before, `D S* D S⁺ L`, from the glow map at that
//! one. Where there are no caustic photons, it is `path` to the bit.

use super::path::Path;
use super::{IntegratorEntry, PhotonNeeds};

/// The table's line.
pub(super) const ENTRY: IntegratorEntry = IntegratorEntry {
    name: "hybrid",
    doc: "path tracing, with caustics from photons",
    photons: PhotonNeeds::Caustic,
    // Where photons are worth having, those of the final gather are too.
    suits: |_| None,
    build: |cx| match cx.maps.caustic {
        None => Box::new(Path::<false>::new(cx)),
        Some(_) => Box::new(Path::<true>::new(cx)),
    },
};
