//! Random numbers as a pure function of where they are used, and warps with their densities.
//!
//! A [`Sampler`] is made from (seed, stream, index): the image does not depend on the number of
//! threads or on how the work was split.

mod discrete;
mod rng;
mod sampler;
pub mod warp;

pub use discrete::Discrete;
pub use rng::{Rng, hash2};
pub use sampler::{Sampler, Sequence, stream};
