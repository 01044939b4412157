//! Reports about images and runs: what numbers say about them.

pub mod diff;
mod error_image;
#[cfg(feature = "flip")]
mod flip;

pub use error_image::{ErrorMap, error_image};
