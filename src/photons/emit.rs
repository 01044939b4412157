//! How photons leave the lights: the trait and its table.

use super::{Guide, adaptive, adaptive_linear, uniform};
use crate::accel::Accelerator;
use crate::color::Rgb;
use crate::geometry::Ray;
use crate::scene::Scene;

/// What photons are emitted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The global map: in all directions.
    Global,
    /// The caustic map: toward specular objects only.
    Caustic,
}

/// A photon as it leaves a light.
#[derive(Clone, Copy, Debug)]
pub struct EmittedPhoton {
    /// Its first segment.
    pub ray: Ray,
    /// Its flux in W.
    pub power: Rgb,
    /// The range of its light in metres.
    pub range: f64,
}

/// What an emission is made for.
pub struct EmissionContext<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its ray tracer.
    pub accel: &'a dyn Accelerator,
    /// Seed of all random numbers.
    pub seed: u64,
    /// What the photons are for.
    pub purpose: Purpose,
    /// How many photons to emit, about.
    pub count: u64,
    /// Where photons bring most, if that was learnt. An emission that follows it divides powers by its
    /// density.
    pub guide: Option<&'a Guide>,
}

/// A numbered set of photons whose powers sum to the flux of the lights in expectation. Photon
/// `i` depends on `i` alone, so that they can be emitted in any order, by any thread.
pub trait PhotonSource: Sync {
    /// How many photons there are.
    fn len(&self) -> u64;

    /// Whether there is none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Photon `i`; `None` if the light sends nothing in the chosen direction.
    fn emit(&self, i: u64) -> Option<EmittedPhoton>;

    /// Rays traced to plan the emission, which carry no flux.
    fn checks(&self) -> u64 {
        0
    }

    /// Cells that it is planned in; none if it is not.
    fn cells(&self) -> u64 {
        0
    }

    /// How often the cell that photon `i` leaves from was divided; `None` if there are no cells.
    fn level(&self, i: u64) -> Option<u32> {
        let _ = i;
        None
    }
}

/// An emission that can be chosen.
#[derive(Clone, Copy, Debug)]
pub struct EmissionEntry {
    /// Name, for `--emission`.
    pub name: &'static str,
    /// One sentence.
    pub doc: &'static str,
    /// Makes it.
    pub build: for<'a> fn(&EmissionContext<'a>) -> Box<dyn PhotonSource + 'a>,
}

crate::registry::impl_entry!(EmissionEntry, "emission");

/// The emissions.
pub static EMISSIONS: &[EmissionEntry] = &[uniform::ENTRY, adaptive::ENTRY, adaptive_linear::ENTRY];
