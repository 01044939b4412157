//! An image as a material uses it.

use std::sync::Arc;

use super::{Content, Image, Sampler};
use crate::geometry::Surface;
use crate::stats::tally::{self, Event};

/// An affine map of texture coordinates (`KHR_texture_transform`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform {
    /// Rows of the matrix; the last column is the offset.
    pub rows: [[f64; 3]; 2],
}

impl UvTransform {
    /// Leaves coordinates as they are.
    pub const IDENTITY: Self = Self {
        rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    };

    /// Translation · rotation · scale, as the extension defines it; the rotation in radians.
    pub fn new(offset: [f64; 2], rotation: f64, scale: [f64; 2]) -> Self {
        let (s, c) = rotation.sin_cos();
        Self {
            rows: [
                [c * scale[0], s * scale[1], offset[0]],
                [-s * scale[0], c * scale[1], offset[1]],
            ],
        }
    }

    /// The mapped coordinates.
    #[inline]
    pub fn apply(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        self.rows.map(|r| r[0] * u + r[1] * v + r[2])
    }

    /// The mapped difference of coordinates.
    #[inline]
    pub fn apply_difference(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        self.rows.map(|r| r[0] * u + r[1] * v)
    }
}

/// An image with its place on a surface.
#[derive(Clone, Debug)]
pub struct Texture {
    /// The image; shared by all textures that show it.
    pub image: Arc<Image>,
    /// What its numbers mean.
    pub content: Content,
    /// How it is looked up.
    pub sampler: Sampler,
    /// Which set of texture coordinates places it.
    pub uv_set: usize,
    /// How they are mapped first, if at all.
    pub transform: Option<UvTransform>,
}

impl Texture {
    /// `image` placed by the first set of texture coordinates, repeated and smooth.
    pub fn new(image: Arc<Image>, content: Content) -> Self {
        Self {
            image,
            content,
            sampler: Sampler::default(),
            uv_set: 0,
            transform: None,
        }
    }

    /// Mean over the image, linear.
    pub fn mean(&self) -> [f64; 4] {
        self.image.mean(self.content)
    }

    /// Smallest and largest value of each channel, linear; no lookup leaves them.
    pub fn range(&self) -> [[f64; 4]; 2] {
        self.image.range(self.content)
    }

    /// The value at a surface point.
    pub fn sample(&self, at: &Surface<'_>) -> [f64; 4] {
        self.lookup(at.uv(self.uv_set), at.uv_footprint(self.uv_set))
    }

    /// The value at texture coordinates, before the transform. The footprint is how they change
    /// per pixel to the right and down; without one the value is that of the point alone. What
    /// is not a number counts as 0.
    pub fn lookup(&self, uv: [f64; 2], footprint: Option<[[f64; 2]; 2]>) -> [f64; 4] {
        tally::count(Event::TextureLookups);
        let [u, v] = self.transform.map_or(uv, |t| t.apply(uv));
        // Near the image, so that integers hold the coordinates however far out they were.
        let uv = [self.sampler.wrap_u.fold(u), self.sampler.wrap_v.fold(v)];
        match footprint {
            None => self.point(uv),
            Some(f) => {
                let f = self
                    .transform
                    .map_or(f, |t| f.map(|d| t.apply_difference(d)));
                self.filtered(uv, f)
            }
        }
    }
}
