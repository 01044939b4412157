//! Textures: images over a surface. They answer what colour a surface point has, and never
//! read files.

mod filter;
mod image;
mod pyramid;
mod sampler;
mod texture;

pub use image::{Content, Image, Texels};
pub use sampler::{Filter, Sampler, Wrap};
pub use texture::{Texture, UvTransform};
