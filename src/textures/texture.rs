//! An image as a material uses it.

use std::sync::Arc;

use super::{Content, Filter, Image, Sampler};
use crate::geometry::Surface;

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
    /// per pixel to the right and down.
    pub fn lookup(&self, uv: [f64; 2], _footprint: Option<[[f64; 2]; 2]>) -> [f64; 4] {
        let [u, v] = self.transform.map_or(uv, |t| t.apply(uv));
        let (w, h) = (self.image.width(), self.image.height());
        let wrap = |x: i64, y: i64| {
            self.image.texel(
                self.sampler.wrap_u.index(x, w),
                self.sampler.wrap_v.index(y, h),
                self.content,
            )
        };
        let (x, y) = (u * f64::from(w), v * f64::from(h));
        if self.sampler.filter == Filter::Nearest {
            return wrap(x.floor() as i64, y.floor() as i64);
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let (x, y) = (x.floor() as i64, y.floor() as i64);
        let (a, b, c, d) = (
            wrap(x, y),
            wrap(x.saturating_add(1), y),
            wrap(x, y.saturating_add(1)),
            wrap(x.saturating_add(1), y.saturating_add(1)),
        );
        std::array::from_fn(|k| {
            let top = a[k] + (b[k] - a[k]) * fx;
            let bottom = c[k] + (d[k] - c[k]) * fx;
            top + (bottom - top) * fy
        })
    }
}
