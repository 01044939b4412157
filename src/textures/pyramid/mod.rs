//! An image in ever smaller sizes, each texel the mean of those it replaces.
//!
//! Source: Williams, *Pyramidal Parametrics*, 1983.

mod climb;

use super::image::expand;
use super::{Content, Image};
use climb::{climb, halve};

/// A level of at most so many texels is made at once.
const SMALL: usize = 1 << 14;

/// The smaller sizes of an image; level 1 is the first that is stored.
#[derive(Debug)]
pub(super) struct Pyramid {
    levels: Vec<Level>,
    /// Numbers per texel, as in [`Image::channels`].
    channels: usize,
}

/// One size.
#[derive(Debug)]
struct Level {
    width: u32,
    height: u32,
    texels: Store,
}

/// Linear numbers, as many per texel as the image has. 16 bits serve images of whole numbers: the
/// smallest step of 8-bit sRGB is twenty of theirs.
#[derive(Debug)]
enum Store {
    U16(Vec<u16>),
    F32(Vec<f32>),
}

impl Store {
    fn new(float: bool, numbers: usize) -> Self {
        if float {
            Self::F32(vec![0.0; numbers])
        } else {
            Self::U16(vec![0; numbers])
        }
    }

    fn as_mut(&mut self) -> Part<'_> {
        match self {
            Self::U16(v) => Part::U16(v),
            Self::F32(v) => Part::F32(v),
        }
    }
}

/// Some rows of a [`Store`].
enum Part<'a> {
    U16(&'a mut [u16]),
    F32(&'a mut [f32]),
}

impl<'a> Part<'a> {
    /// Parts with the first `n` numbers, and the others.
    fn split(self, n: usize) -> [Self; 2] {
        match self {
            Self::U16(v) => {
                let (a, b) = v.split_at_mut(n);
                [Self::U16(a), Self::U16(b)]
            }
            Self::F32(v) => {
                let (a, b) = v.split_at_mut(n);
                [Self::F32(a), Self::F32(b)]
            }
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::U16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Keeps sums from number `at` on.
    fn write(&mut self, at: usize, sums: &[[f32; 4]], channels: usize, content: Content) {
        let numbers = at..at + sums.len() * channels;
        let texels = sums.iter().map(|t| pack(unweigh(*t, content), channels));
        match self {
            Self::U16(v) => {
                for (out, t) in v[numbers].chunks_exact_mut(channels).zip(texels) {
                    for (o, x) in out.iter_mut().zip(t) {
                        *o = (x * 65535.0 + 0.5).clamp(0.0, 65535.0) as u16;
                    }
                }
            }
            Self::F32(v) => {
                for (out, t) in v[numbers].chunks_exact_mut(channels).zip(texels) {
                    out.copy_from_slice(&t[..channels]);
                }
            }
        }
    }
}

/// The numbers that are kept of a texel, first.
fn pack(t: [f32; 4], channels: usize) -> [f32; 4] {
    match channels {
        2 => [t[0], t[3], 0.0, 0.0],
        _ => t,
    }
}

/// Half the size, rounded down but one at least.
fn half(n: u32) -> u32 {
    (n / 2).max(1)
}

impl Pyramid {
    /// All levels below `image`, down to one texel. With `parallel` on all threads of the pool.
    pub(super) fn new(image: &Image, content: Content, parallel: bool) -> Self {
        // The mean of normals can be none, for which a vector stands that is not grey.
        let channels = match (content, image.channels()) {
            (Content::Normal, n @ (1 | 2)) => n + 2,
            (_, n) => n,
        };
        let float = image.depth() == 32;
        let (mut width, mut height) = (image.width(), image.height());
        let mut levels = Vec::new();
        while width > 1 || height > 1 {
            (width, height) = (half(width), half(height));
            let numbers = width as usize * height as usize * channels;
            levels.push(Level {
                width,
                height,
                texels: Store::new(float, numbers),
            });
        }
        let small = |l: &Level| l.width as usize * l.height as usize <= SMALL;
        let top = levels.iter().position(small);
        let large = top.map_or(levels.len(), |top| top + 1);
        let (rows, rest) = levels.split_at_mut(large);
        let mut sums = climb(image, content, channels, rows, parallel);
        let mut size = rows.last().map(|l| (l.width, l.height));
        for level in rest {
            let Some((w, h)) = size else { break };
            sums = halve(w, h, &sums);
            level.texels.as_mut().write(0, &sums, channels, content);
            size = Some((level.width, level.height));
        }
        Self { levels, channels }
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
            Store::U16(v) => {
                let share = |x| f64::from(x) * (1.0 / 65535.0);
                expand(v, i, self.channels, share, share)
            }
            Store::F32(v) => expand(v, i, self.channels, f64::from, f64::from),
        }
    }

    /// Memory of all levels in bytes.
    pub(super) fn bytes(&self) -> usize {
        let bytes = |l: &Level| match &l.texels {
            Store::U16(v) => size_of_val(v.as_slice()),
            Store::F32(v) => size_of_val(v.as_slice()),
        };
        self.levels.iter().map(bytes).sum()
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

#[cfg(test)]
mod tests {
    use super::super::Texels;
    use super::*;

    /// Levels as they are defined, each made of the whole one below it.
    fn plainly(image: &Image, content: Content) -> Vec<Vec<[f32; 4]>> {
        let (mut w, mut h) = (image.width(), image.height());
        let n = w as usize * h as usize;
        let mut last: Vec<[f32; 4]> = (0..n)
            .map(|i| weigh(image.at(i, content), content))
            .collect();
        let mut out = Vec::new();
        while w > 1 || h > 1 {
            last = halve(w, h, &last);
            (w, h) = (half(w), half(h));
            out.push(last.iter().map(|t| unweigh(*t, content)).collect());
        }
        out
    }

    #[test]
    fn rows_made_when_they_are_needed_are_those_of_whole_levels() {
        let mut state = 1u32;
        let mut number = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        for (w, h) in [
            (1, 1),
            (301, 777),
            (777, 301),
            (512, 512),
            (70_001, 2),
            (3, 40_000),
        ] {
            for channels in 1..=4 {
                let numbers: Vec<u8> = (0..w * h * channels).map(|_| number()).collect();
                let image = Image::from_texels(w as u32, h as u32, channels, Texels::U8(numbers));
                let image = image.expect("the right number");
                for content in [Content::Color, Content::Coverage, Content::Normal] {
                    let want = plainly(&image, content);
                    for parallel in [false, true] {
                        let made = Pyramid::new(&image, content, parallel);
                        assert_eq!(made.len(), want.len() + 1);
                        for (l, level) in want.iter().enumerate() {
                            for (i, t) in level.iter().enumerate() {
                                let got = made.at(l + 1, i);
                                let off = (0..4).map(|k| (got[k] - f64::from(t[k])).abs());
                                let off = off.fold(0.0, f64::max);
                                assert!(
                                    off < 0.51 / 65535.0,
                                    "{w} × {h} × {channels}, {content:?}, level {l}, {i}"
                                );
                            }
                        }
                    }
                }
            }
        }
    }
}
