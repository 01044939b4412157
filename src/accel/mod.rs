//! Ray tracing backends. Each answers the same two questions about the same rays; a backend is
//! one file and one line in [`ACCELERATORS`].
//!
//! The contract, which all of them obey:
//! - the segment is `tmin ≤ t ≤ tmax`, `tmin ≥ 0`, both ends included (in Embree up to its
//!   rounding), `t` in units of `|d|`;
//! - an invalid ray ([`Ray::is_valid`]) hits nothing;
//! - every primitive is hit from both sides; a sphere is hit where the ray enters and where it
//!   leaves;
//! - a [`Hit`] names primitive and object; its distance and barycentrics are approximate, and
//!   callers refine them on the primitive
//!   ([`Geometry::surface_point`](crate::geometry::Geometry::surface_point));
//! - of several primitives at the same distance any one may be named, but always the same one
//!   for the same ray.

mod bvh;
mod crosscheck;
#[cfg(feature = "embree")]
mod embree;
mod guard;
mod linear;

pub use crosscheck::{Class, CrossCheck, Finding};
#[cfg(feature = "embree")]
pub use embree::{FAST as EMBREE_FAST, with_instructions as embree_with_instructions};
pub use guard::Guarded;

use std::sync::Arc;

use crate::error::Result;
use crate::geometry::{Geometry, Hit, Ray};

/// What building took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BuildStats {
    /// Name and version of what was built.
    pub backend: String,
    /// Seconds spent building.
    pub seconds: f64,
    /// Bytes held by the structure, without the scene's own buffers where they can be told apart.
    pub bytes: u64,
    /// Primitives that can be hit, instances not multiplied out.
    pub primitives: u64,
}

/// Answers rays.
pub trait Accelerator: Send + Sync {
    /// The nearest hit of the segment.
    fn intersect(&self, ray: &Ray) -> Option<Hit>;

    /// Whether anything at all lies on the segment.
    fn occluded(&self, ray: &Ray) -> bool;

    /// Whether no ray, not even one at a vertex, passes between triangles that share an edge.
    fn watertight(&self) -> bool {
        false
    }

    /// What building took.
    fn stats(&self) -> BuildStats;
}

/// A backend that can be chosen.
#[derive(Clone, Copy, Debug)]
pub struct AcceleratorEntry {
    /// Name, for `--accel`.
    pub name: &'static str,
    /// One sentence.
    pub doc: &'static str,
    /// Builds it over a scene's geometry with the given number of threads.
    pub build: fn(&Arc<Geometry>, threads: usize) -> Result<Box<dyn Accelerator>>,
}

crate::registry::impl_entry!(AcceleratorEntry, "accelerator");

/// The backends; the first is the default, `linear` is the oracle of the tests.
pub static ACCELERATORS: &[AcceleratorEntry] = &[
    #[cfg(feature = "embree")]
    embree::ENTRY,
    bvh::ENTRY,
    linear::ENTRY,
];
