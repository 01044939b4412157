//! An image in ever smaller sizes, each texel the mean of those it replaces.
//!
//! Source: Williams, *Pyramidal Parametrics*, 1983.

use rayon::prelude::*;

use super::{Content, Image};

/// The smaller sizes of an image; level 1 is the first that is stored.
#[derive(Debug)]
pub(super) struct Pyramid {
    levels: Vec<Level>,
}

/// One size.
#[derive(Debug)]
struct Level {
    width: u32,
    height: u32,
    texels: Store,
}

/// Linear numbers, four per texel. 16 bits serve images of whole numbers: the smallest step of
/// 8-bit sRGB is twenty of theirs.
#[derive(Debug)]
enum Store {
    U16(Vec<[u16; 4]>),
    F32(Vec<[f32; 4]>),
}

/// A level while it is averaged: colour times alpha for [`Content::Coverage`], vectors for
/// [`Content::Normal`].
struct Sums {
    width: u32,
    height: u32,
    texels: Vec<[f32; 4]>,
}

impl Pyramid {
    /// All levels below `image`, down to one texel. With `parallel` on all threads of the pool.
    pub(super) fn new(image: &Image, content: Content, parallel: bool) -> Self {
        let mut levels = Vec::new();
        let (mut width, mut height) = (image.width(), image.height());
        let mut last: Option<Sums> = None;
        while width > 1 || height > 1 {
            let next = match &last {
                None => {
                    let w = width as usize;
                    let at = |x: usize, y: usize| weigh(image.at(y * w + x, content), content);
                    halve(width, height, &at, parallel)
                }
                Some(s) => {
                    let w = width as usize;
                    halve(width, height, &|x, y| s.texels[y * w + x], parallel)
                }
            };
            (width, height) = (next.width, next.height);
            levels.push(Level {
                width,
                height,
                texels: store(&next.texels, content, image.depth() == 32, parallel),
            });
            last = Some(next);
        }
        Self { levels }
    }

    /// Number of levels, the image itself counted.
    #[inline]
    pub(super) fn len(&self) -> usize {
        self.levels.len() + 1
    }

    /// Width and height of level `l`, from 1.
    #[inline]
    pub(super) fn size(&self, l: usize) -> [u32; 2] {
        let level = &self.levels[l - 1];
        [level.width, level.height]
    }

    /// Texel `i` of level `l`, from 1.
    #[inline]
    pub(super) fn at(&self, l: usize, i: usize) -> [f64; 4] {
        match &self.levels[l - 1].texels {
            Store::U16(v) => v[i].map(|x| f64::from(x) * (1.0 / 65535.0)),
            Store::F32(v) => v[i].map(f64::from),
        }
    }
}

/// As texels are averaged.
fn weigh([r, g, b, a]: [f64; 4], content: Content) -> [f32; 4] {
    let t = match content {
        Content::Coverage => [r * a, g * a, b * a, a],
        Content::Normal => [2.0 * r - 1.0, 2.0 * g - 1.0, 2.0 * b - 1.0, a],
        _ => [r, g, b, a],
    };
    t.map(|x| x as f32)
}

/// The way back. The mean of normals is scaled to unit length; what is lost is roughness that
/// the surface would need instead.
fn unweigh(t: [f32; 4], content: Content) -> [f32; 4] {
    let [x, y, z, a] = t;
    match content {
        Content::Coverage if a > 0.0 => [x / a, y / a, z / a, a],
        Content::Normal => {
            let length = (x * x + y * y + z * z).sqrt();
            let [x, y, z] = if length > 1e-6 {
                [x / length, y / length, z / length]
            } else {
                [0.0, 0.0, 1.0]
            };
            [0.5 * x + 0.5, 0.5 * y + 0.5, 0.5 * z + 0.5, a]
        }
        _ => t,
    }
}

/// Half the size, rounded down but one at least. Each new texel is the mean of the old ones by
/// the area it covers, also where sizes are odd, so the mean of the image stays.
fn halve(
    width: u32,
    height: u32,
    at: &(impl Fn(usize, usize) -> [f32; 4] + Sync),
    parallel: bool,
) -> Sums {
    let (w, h) = ((width / 2).max(1), (height / 2).max(1));
    let columns: Vec<Taps> = (0..w).map(|x| Taps::new(x, w, width)).collect();
    let mut texels = vec![[0.0; 4]; w as usize * h as usize];
    let fill = |(y, row): (usize, &mut [[f32; 4]])| {
        let rows = Taps::new(y as u32, h, height);
        for (out, columns) in row.iter_mut().zip(&columns) {
            for (y, wy) in rows.iter() {
                for (x, wx) in columns.iter() {
                    let t = at(x, y);
                    for (o, t) in out.iter_mut().zip(t) {
                        *o += t * (wx * wy);
                    }
                }
            }
        }
    };
    if parallel {
        texels.par_chunks_mut(w as usize).enumerate().for_each(fill);
    } else {
        texels.chunks_mut(w as usize).enumerate().for_each(fill);
    }
    Sums {
        width: w,
        height: h,
        texels,
    }
}

/// The old texels below a new one, along one axis, with their shares: three at most.
struct Taps {
    first: usize,
    count: usize,
    weights: [f32; 3],
}

impl Taps {
    /// For texel `i` of `m`, which replace `n`; `m` is half of `n` or both are 1.
    fn new(i: u32, m: u32, n: u32) -> Self {
        let (i, m, n) = (u64::from(i), u64::from(m), u64::from(n));
        // In units of 1/m of an old texel, the new one reaches from i·n to (i + 1)·n.
        let (from, to) = (i * n, (i + 1) * n);
        let (first, end) = (from / m, to.div_ceil(m));
        let mut weights = [0.0; 3];
        for (k, w) in weights.iter_mut().enumerate() {
            let (a, b) = ((first + k as u64) * m, (first + k as u64 + 1) * m);
            *w = (b.min(to).saturating_sub(a.max(from)) as f64 / n as f64) as f32;
        }
        Self {
            first: first as usize,
            count: (end - first) as usize,
            weights,
        }
    }

    #[inline]
    fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        (self.first..).zip(self.weights).take(self.count)
    }
}

fn store(texels: &[[f32; 4]], content: Content, float: bool, parallel: bool) -> Store {
    if float {
        return Store::F32(texels.iter().map(|t| unweigh(*t, content)).collect());
    }
    let code =
        |t: &[f32; 4]| unweigh(*t, content).map(|x| (x * 65535.0 + 0.5).clamp(0.0, 65535.0) as u16);
    Store::U16(if parallel {
        texels.par_iter().map(code).collect()
    } else {
        texels.iter().map(code).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_texel_add_up_to_one_and_each_old_texel_counts_the_same() {
        for n in 1..40 {
            let m = (n / 2_u32).max(1);
            let mut used = vec![0.0; n as usize];
            for i in 0..m {
                let taps = Taps::new(i, m, n);
                let sum: f32 = taps.iter().map(|(_, w)| w).sum();
                assert!((sum - 1.0).abs() < 1e-6 && taps.count <= 3, "{i} of {m}");
                for (x, w) in taps.iter() {
                    used[x] += w;
                }
            }
            let each = m as f32 / n as f32;
            assert!(
                used.iter().all(|u: &f32| (u - each).abs() < 1e-6),
                "{used:?}"
            );
        }
    }
}
