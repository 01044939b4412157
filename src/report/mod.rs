//! Reports about images and runs: what numbers say about them.

pub mod accuracy;
pub mod agreement;
pub mod bench;
pub mod diff;
mod error_image;
#[cfg(feature = "flip")]
mod flip;
pub mod photon_view;
pub mod rays;
pub mod reproduction;
pub mod statistics;
pub mod svg;

pub use error_image::{ErrorMap, error_image};
