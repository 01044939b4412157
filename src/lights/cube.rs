//! Cube maps as images of the sky.

use rayon::prelude::*;

use super::SkyImage;
use super::sky::direction;
use crate::math::DVec3;

/// Most columns of the image that a cube map becomes.
const MOST_COLUMNS: u32 = 8192;

/// Six square images of radiance, rows from the top, in the order +x, −x, +y, −y, +z, −z; each
/// as one sees it from the middle of the cube, the four sides upright.
pub struct CubeMap {
    size: u32,
    faces: [Vec<[f32; 3]>; 6],
}

/// Where a face looks, and where its columns and its rows run.
const FRAMES: [[DVec3; 3]; 6] = [
    [DVec3::X, DVec3::Z, DVec3::NEG_Y],
    [DVec3::NEG_X, DVec3::NEG_Z, DVec3::NEG_Y],
    [DVec3::Y, DVec3::NEG_X, DVec3::Z],
    [DVec3::NEG_Y, DVec3::NEG_X, DVec3::NEG_Z],
    [DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y],
    [DVec3::NEG_Z, DVec3::X, DVec3::NEG_Y],
];

impl CubeMap {
    /// A cube of faces of `size × size` texels; `None` if their numbers do not fit.
    pub fn new(size: u32, faces: [Vec<[f32; 3]>; 6]) -> Option<Self> {
        let n = u64::from(size) * u64::from(size);
        let fits = n > 0 && faces.iter().all(|f| f.len() as u64 == n);
        fits.then_some(Self { size, faces })
    }

    /// Mean radiance over the sphere of directions, exact for faces of one colour each.
    pub fn mean(&self) -> [f64; 3] {
        let n = f64::from(self.size);
        let (mut sum, mut all) = ([0.0; 3], 0.0);
        for face in &self.faces {
            for (i, texel) in face.iter().enumerate() {
                let (x, y) = (i as u32 % self.size, i as u32 / self.size);
                let at = |k: u32| 2.0 * (f64::from(k) + 0.5) / n - 1.0;
                // The solid angle falls with the cube of the distance.
                let weight = (1.0 + at(x).powi(2) + at(y).powi(2)).powf(-1.5);
                all += weight;
                for (s, t) in sum.iter_mut().zip(texel) {
                    *s += weight * f64::from(*t);
                }
            }
        }
        sum.map(|s| s / all)
    }

    /// The same in equirectangular projection, a texel near a face's middle about as large as
    /// one of the cube.
    ///
    /// # Errors
    /// A texel that is no radiance.
    pub fn to_sky(&self) -> Result<SkyImage, String> {
        let width = self.size.saturating_mul(4).min(MOST_COLUMNS);
        let height = width / 2;
        // Texels of the cube shrink towards its corners.
        let fine = 2 * (4 * u64::from(self.size)).div_ceil(u64::from(width)) as u32;
        let share = 1.0 / f64::from(fine * fine);
        let row = |(y, row): (usize, &mut [[f32; 3]])| {
            let y = y as u32;
            let texel = |x: u32| {
                let mut sum = [0.0; 3];
                for k in 0..fine * fine {
                    let part = |n: u32, k: u32, of: u32| {
                        (f64::from(n) + (f64::from(k) + 0.5) / f64::from(fine)) / f64::from(of)
                    };
                    let d = direction(part(x, k % fine, width), part(y, k / fine, height));
                    for (s, t) in sum.iter_mut().zip(self.blended(d)) {
                        *s += t * share;
                    }
                }
                sum.map(|s| s as f32)
            };
            for (x, out) in (0..width).zip(row) {
                *out = texel(x);
            }
        };
        let mut texels = vec![[0.0; 3]; width as usize * height as usize];
        texels
            .par_chunks_mut(width.max(1) as usize)
            .enumerate()
            .for_each(row);
        SkyImage::new(width, height, texels)
    }

    /// Radiance from a direction, blended between texels.
    fn blended(&self, d: DVec3) -> [f64; 3] {
        let (face, [x, y]) = self.place(d);
        let (x, y) = (x - 0.5, y - 0.5);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let (x, y) = (x.floor() as i64, y.floor() as i64);
        let corner = |i: i64, j: i64| self.texel(face, x + i, y + j);
        let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
        std::array::from_fn(|k| {
            (a[k] * (1.0 - fx) + b[k] * fx) * (1.0 - fy) + (c[k] * (1.0 - fx) + d[k] * fx) * fy
        })
    }

    /// The texel in column `x` and row `y` of a face; beyond its rim those of its neighbours.
    fn texel(&self, face: usize, x: i64, y: i64) -> [f64; 3] {
        let n = i64::from(self.size);
        let within = 0..n;
        let (face, x, y) = if within.contains(&x) && within.contains(&y) {
            (face, x, y)
        } else {
            let [forward, right, down] = FRAMES[face];
            let at = |k: i64| 2.0 * (k as f64 + 0.5) / n as f64 - 1.0;
            let (face, [x, y]) = self.place(forward + right * at(x) + down * at(y));
            (face, (x as i64).min(n - 1), (y as i64).min(n - 1))
        };
        self.faces[face][(y * n + x) as usize].map(f64::from)
    }

    /// The face that a direction meets, and where, in texels.
    fn place(&self, d: DVec3) -> (usize, [f64; 2]) {
        let a = d.abs();
        let axis = if a.x >= a.y && a.x >= a.z {
            0
        } else if a.y >= a.z {
            1
        } else {
            2
        };
        let face = 2 * axis + usize::from(d[axis] < 0.0);
        let [_, right, down] = FRAMES[face];
        let at = |across: DVec3| {
            let u = 0.5 + 0.5 * d.dot(across) / a[axis];
            u.clamp(0.0, 1.0) * f64::from(self.size)
        };
        (face, [at(right), at(down)])
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

    use super::*;

    /// A cube whose radiance is a function of the direction.
    fn cube(size: u32, radiance: impl Fn(DVec3) -> [f64; 3]) -> CubeMap {
        let faces = FRAMES.map(|[forward, right, down]| {
            let at = |k: u32| 2.0 * (f64::from(k) + 0.5) / f64::from(size) - 1.0;
            (0..size * size)
                .map(|i| forward + right * at(i % size) + down * at(i / size))
                .map(|d| radiance(d.normalize()).map(|c| c as f32))
                .collect()
        });
        CubeMap::new(size, faces).unwrap()
    }

    #[test]
    fn frames_are_seen_from_within() {
        // In right-handed coordinates, forward is right × down where an image is not mirrored.
        for [forward, right, down] in FRAMES {
            assert_eq!(right.cross(down), forward);
        }
    }

    #[test]
    fn smooth_radiance_survives_over_all_edges() {
        // Linear in the direction: no face, edge or corner may be turned or swapped.
        let smooth = |d: DVec3| [1.0 + 0.5 * d.x, 1.0 + 0.5 * d.y, 1.0 + 0.5 * d.z];
        let map = cube(32, smooth);
        let mut worst: f64 = 0.0;
        for j in 0..60 {
            for i in 0..120 {
                let d = direction((f64::from(i) + 0.3) / 120.0, (f64::from(j) + 0.4) / 60.0);
                let (got, want) = (map.blended(d), smooth(d));
                for k in 0..3 {
                    worst = worst.max((got[k] - want[k]).abs());
                }
            }
        }
        assert!(worst < 4e-3, "{worst}");
    }

    #[test]
    fn faces_shed_a_sixth_each() {
        let face = |d: DVec3| {
            let a = d.abs();
            let side = |x: f64, most: f64| f64::from(u8::from(x > 0.0 && x == most));
            let most = a.max_element();
            [side(d.x, most), side(-d.y, most), 6.0 * side(-d.z, most)]
        };
        let map = cube(16, face);
        let mean = map.mean();
        for (got, want) in mean.into_iter().zip([1.0 / 6.0, 1.0 / 6.0, 1.0]) {
            assert!((got - want).abs() < 1e-12, "{got} for {want}");
        }
    }
}
