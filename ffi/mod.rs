//! Embree 4 behind a safe interface: the one module with unsafe code.
//!
//! It reads float triples, spheres and transforms, and makes a [`CommittedScene`] that
//! answers ray queries: [`Device`] → [`Geometry`] → [`SceneBuilder`] → [`CommittedScene`].
//! What callers may rely on, and what Embree itself promises, is in `ffi/README.md`.
//!
//! Building returns [`EmbreeError`]; queries cannot fail, and a malformed ray is a miss.

mod abi;
mod device;
mod filter;
mod geometry;
mod scene;

#[cfg(test)]
mod tests;

pub use device::{Device, EmbreeError, ErrorCode, MemoryUse};
pub use filter::HitFilter;
pub use geometry::Geometry;
pub use scene::{CommittedScene, INVALID_ID, RawHit, SceneBuilder};

/// The declarations bindgen makes of `ffi/shim.h`.
#[allow(
    missing_docs,
    unreachable_pub,
    non_camel_case_types,
    reason = "generated"
)]
mod shim {
    include!(concat!(env!("OUT_DIR"), "/shim.rs"));
}
