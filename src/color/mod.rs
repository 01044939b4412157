//! Linear Rec.709 colours and the one place where units and transfer curves are converted.

mod rgb;
mod transfer;
pub mod units;

pub use rgb::Rgb;
pub use transfer::{linear_to_srgb, srgb_to_linear};
