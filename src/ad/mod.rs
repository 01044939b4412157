//! Scalars that algorithms are generic over.
//!
//! An intersection is written once over [`Real`] and runs on `f32`, `f64` or any scalar that
//! carries derivatives. Branches are taken on the primal value ([`Real::re`]); a derivative is
//! that of the branch taken.

mod dual;
mod real;
mod vec3;

pub use dual::Dual;
pub use real::Real;
pub use vec3::V3;
