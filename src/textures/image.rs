//! A decoded image: the numbers of its file, and what they mean.

use std::fmt;
use std::sync::{LazyLock, OnceLock};

use rayon::prelude::*;

use super::pyramid::Pyramid;
use crate::color::srgb_to_linear;

/// What the numbers of an image mean. The image itself does not know: one image can serve as
/// colour in one place and as data in another, and is kept once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Content {
    /// sRGB colour; alpha, if there is any, is a number of its own.
    Color,
    /// sRGB colour, and alpha that says how much of it is there: where images are averaged,
    /// colour counts by its alpha.
    Coverage,
    /// Linear numbers.
    #[default]
    Data,
    /// Tangent-space normals, `2·t − 1`.
    Normal,
}

impl Content {
    /// Whether colour is stored by the sRGB curve.
    #[inline]
    pub fn is_srgb(self) -> bool {
        matches!(self, Self::Color | Self::Coverage)
    }
}

/// The numbers of an image as its file gives them, channels interleaved. Whole numbers stand for
/// 0 to 1 and are kept as they are (an image of 8 bits takes one byte per number, not sixteen);
/// a table decodes them at every lookup.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// 8 bits.
    U8(Vec<u8>),
    /// 16 bits.
    U16(Vec<u16>),
    /// Floating point; always linear.
    F32(Vec<f32>),
}

impl Texels {
    fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// The numbers as they lie in memory.
    pub fn as_bytes(&self) -> &[u8] {
        match self {
            Self::U8(v) => v,
            Self::U16(v) => bytemuck::cast_slice(v),
            Self::F32(v) => bytemuck::cast_slice(v),
        }
    }
}

/// A decoded image, rows from the top.
pub struct Image {
    width: u32,
    height: u32,
    /// Grey, grey and alpha, RGB or RGBA.
    channels: usize,
    texels: Texels,
    /// Smallest and largest number of each channel as stored.
    extremes: OnceLock<[[f64; 4]; 2]>,
    /// Smaller sizes, by what the numbers mean.
    pyramids: [OnceLock<Pyramid>; 4],
}

impl fmt::Debug for Image {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Image")
            .field("width", &self.width)
            .field("height", &self.height)
            .field("channels", &self.channels)
            .field("depth", &self.depth())
            .finish_non_exhaustive()
    }
}

impl Image {
    /// A linear image of `width × height` texels; `None` if their number does not fit or is
    /// zero.
    pub fn new(width: u32, height: u32, texels: Vec<[f32; 4]>) -> Option<Self> {
        Self::from_texels(width, height, 4, Texels::F32(texels.into_flattened()))
    }

    /// An image of `width × height` texels of 1 to 4 `channels` (grey, grey and alpha, RGB,
    /// RGBA); `None` if their number does not fit or is zero.
    pub fn from_texels(width: u32, height: u32, channels: usize, texels: Texels) -> Option<Self> {
        let n = (width as usize)
            .checked_mul(height as usize)?
            .checked_mul(channels)?;
        let fits = n > 0 && n == texels.len() && (1..=4).contains(&channels);
        fits.then_some(Self {
            width,
            height,
            channels,
            texels,
            extremes: OnceLock::new(),
            pyramids: Default::default(),
        })
    }

    /// An image of one texel: white.
    pub fn white() -> Self {
        Self {
            width: 1,
            height: 1,
            channels: 1,
            texels: Texels::U8(vec![255]),
            extremes: OnceLock::new(),
            pyramids: Default::default(),
        }
    }

    /// Width in texels.
    #[inline]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in texels.
    #[inline]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The numbers of all texels.
    pub fn texels(&self) -> &Texels {
        &self.texels
    }

    /// Numbers per texel in the file: 1 grey, 2 grey and alpha, 3 RGB, 4 RGBA.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Bits per number.
    pub fn depth(&self) -> u32 {
        match self.texels {
            Texels::U8(_) => 8,
            Texels::U16(_) => 16,
            Texels::F32(_) => 32,
        }
    }

    /// Memory of the texels and of the smaller sizes that are there, in bytes.
    pub fn bytes(&self) -> usize {
        let pyramids = self.pyramids.iter().filter_map(OnceLock::get);
        self.texels.as_bytes().len() + pyramids.map(Pyramid::bytes).sum::<usize>()
    }

    /// The texel in column `x` of row `y`, both within the image: linear red, green, blue and
    /// alpha.
    #[inline]
    pub fn texel(&self, x: u32, y: u32, content: Content) -> [f64; 4] {
        self.at(y as usize * self.width as usize + x as usize, content)
    }

    /// The texel of index `i`.
    #[inline]
    pub(super) fn at(&self, i: usize, content: Content) -> [f64; 4] {
        match &self.texels {
            Texels::U8(v) => {
                let linear = LazyLock::force(&LINEAR_8);
                let color = if content.is_srgb() {
                    LazyLock::force(&SRGB_8)
                } else {
                    linear
                };
                let decode = |t: u8| color[usize::from(t)];
                expand(v, i, self.channels, decode, |t| linear[usize::from(t)])
            }
            Texels::U16(v) => {
                let linear = |t| f64::from(t) * (1.0 / 65535.0);
                if content.is_srgb() {
                    let table = LazyLock::force(&SRGB_16);
                    let color = |t| f64::from(table[usize::from(t)]);
                    expand(v, i, self.channels, color, linear)
                } else {
                    expand(v, i, self.channels, linear, linear)
                }
            }
            Texels::F32(v) => expand(v, i, self.channels, f64::from, f64::from),
        }
    }

    /// The smaller sizes, made when they are first asked for, by one thread: others wait. (It
    /// must not share the work. A thread that waits for its share may be given another task that
    /// asks for the same sizes.)
    #[inline]
    pub(super) fn pyramid(&self, content: Content) -> &Pyramid {
        self.pyramids[content as usize].get_or_init(|| Pyramid::new(self, content, false))
    }

    /// Makes the smaller sizes beforehand, on all threads.
    pub fn prepare(&self, content: Content) {
        let slot = &self.pyramids[content as usize];
        if slot.get().is_none() {
            // If another thread was faster, both made the same.
            let _ = slot.set(Pyramid::new(self, content, true));
        }
    }

    /// Mean over all texels, linear.
    pub fn mean(&self, content: Content) -> [f64; 4] {
        let n = self.texels.len() / self.channels;
        let mut sum = [0.0; 4];
        for i in 0..n {
            for (s, x) in sum.iter_mut().zip(self.at(i, content)) {
                *s += x;
            }
        }
        sum.map(|s| s / n as f64)
    }

    /// Smallest and largest number of each channel, linear and as they are kept, by all threads.
    fn find_extremes(&self) -> [[f64; 4]; 2] {
        // Numbers grow with their codes, so the extremes of codes are those of numbers.
        let expand = |ends: [[f64; 4]; 2]| {
            ends.map(|e| expand(&e[..self.channels], 0, self.channels, |x| x, |x| x))
        };
        match &self.texels {
            Texels::U8(v) => expand(
                extremes(v, self.channels, [u8::MAX, u8::MIN])
                    .map(|e| e.map(|t| LazyLock::force(&LINEAR_8)[usize::from(t)])),
            ),
            Texels::U16(v) => expand(
                extremes(v, self.channels, [u16::MAX, u16::MIN])
                    .map(|e| e.map(|t| f64::from(t) * (1.0 / 65535.0))),
            ),
            Texels::F32(v) => expand(
                extremes(v, self.channels, [f32::INFINITY, f32::NEG_INFINITY])
                    .map(|e| e.map(f64::from)),
            ),
        }
    }

    /// Smallest and largest value of each channel, linear.
    pub fn range(&self, content: Content) -> [[f64; 4]; 2] {
        // Not within the cell's closure: a thread that waits for its share may be given another task
        // that asks for the same.
        let extremes = match self.extremes.get() {
            Some(extremes) => *extremes,
            None => {
                let found = self.find_extremes();
                *self.extremes.get_or_init(|| found)
            }
        };
        // The curve grows, so it maps extremes to extremes.
        let curved = content.is_srgb() && !matches!(self.texels, Texels::F32(_));
        extremes.map(|[r, g, b, a]| {
            let [r, g, b] = [r, g, b].map(|x| if curved { srgb_to_linear(x) } else { x });
            [r, g, b, a]
        })
    }
}

/// Smallest and largest number of each channel; `none` are those of nothing. Numbers that are none
/// do not count.
fn extremes<T: PartialOrd + Copy + Send + Sync>(
    v: &[T],
    channels: usize,
    none: [T; 2],
) -> [[T; 4]; 2] {
    match channels {
        1 => extremes_of::<T, 1>(v, none),
        2 => extremes_of::<T, 2>(v, none),
        3 => extremes_of::<T, 3>(v, none),
        _ => extremes_of::<T, 4>(v, none),
    }
}

fn extremes_of<T: PartialOrd + Copy + Send + Sync, const N: usize>(
    v: &[T],
    [most, least]: [T; 2],
) -> [[T; 4]; 2] {
    /// Texels that one task looks at.
    const CHUNK: usize = 1 << 16;
    /// Texels side by side that are looked at together, which becomes vector code.
    const WIDE: usize = 16;
    let smaller = |a: T, b: T| if b < a { b } else { a };
    let larger = |a: T, b: T| if b > a { b } else { a };
    let grow = |range: &mut [[T; N]; 2], t: &[T; N]| {
        for k in 0..N {
            range[0][k] = smaller(range[0][k], t[k]);
            range[1][k] = larger(range[1][k], t[k]);
        }
    };
    let join = |a: [[T; N]; 2], b: [[T; N]; 2]| {
        [
            std::array::from_fn(|k| smaller(a[0][k], b[0][k])),
            std::array::from_fn(|k| larger(a[1][k], b[1][k])),
        ]
    };
    let none = [[most; N], [least; N]];
    let of = |chunk: &[[T; N]]| {
        let (wide, rest) = chunk.as_chunks::<WIDE>();
        let mut low = [[most; N]; WIDE];
        let mut high = [[least; N]; WIDE];
        for block in wide {
            for i in 0..WIDE {
                for k in 0..N {
                    low[i][k] = smaller(low[i][k], block[i][k]);
                    high[i][k] = larger(high[i][k], block[i][k]);
                }
            }
        }
        let mut range = low
            .into_iter()
            .zip(high)
            .map(<[_; 2]>::from)
            .fold(none, join);
        for t in rest {
            grow(&mut range, t);
        }
        range
    };
    let found = v.as_chunks::<N>().0.par_chunks(CHUNK).map(of);
    let [low, high] = found.reduce(|| none, join);
    let pad = |end: [T; N], none: T| std::array::from_fn(|k| *end.get(k).unwrap_or(&none));
    [pad(low, most), pad(high, least)]
}

/// The four numbers of texel `i`: grey is all colours, and what has no alpha is whole.
#[inline]
pub(super) fn expand<T: Copy>(
    v: &[T],
    i: usize,
    channels: usize,
    color: impl Fn(T) -> f64,
    alpha: impl Fn(T) -> f64,
) -> [f64; 4] {
    match channels {
        1 => {
            let g = color(v[i]);
            [g, g, g, 1.0]
        }
        2 => {
            let [g, a] = v.as_chunks().0[i];
            let g = color(g);
            [g, g, g, alpha(a)]
        }
        3 => {
            let [r, g, b] = v.as_chunks().0[i];
            [color(r), color(g), color(b), 1.0]
        }
        _ => {
            let [r, g, b, a] = v.as_chunks().0[i];
            [color(r), color(g), color(b), alpha(a)]
        }
    }
}

/// Linear values of the codes of 8 bits.
static LINEAR_8: LazyLock<[f64; 256]> = LazyLock::new(|| std::array::from_fn(|i| i as f64 / 255.0));
/// The same by the sRGB curve.
static SRGB_8: LazyLock<[f64; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| srgb_to_linear(i as f64 / 255.0)));
/// Linear values of the codes of 16 bits by the sRGB curve.
static SRGB_16: LazyLock<Vec<f32>> = LazyLock::new(|| {
    (0..=65535)
        .map(|i| srgb_to_linear(f64::from(i) / 65535.0) as f32)
        .collect()
});

#[cfg(test)]
mod tests {
    use super::*;

    /// Codes that look random; the same every time.
    fn codes(n: usize) -> impl Iterator<Item = u32> {
        (0..n as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 7).wrapping_add(i / 3))
    }

    #[test]
    fn extremes_are_those_of_all_texels() {
        // Sizes around those of blocks and tasks.
        for (width, height) in [(1, 1), (15, 1), (16, 3), (37, 29), (300, 257)] {
            for channels in 1..=4 {
                let n = (width * height) as usize * channels;
                let some = |i: u32| 3 + i % 240;
                let kinds = [
                    Texels::U8(codes(n).map(|i| some(i) as u8).collect()),
                    Texels::U16(codes(n).map(|i| (i % 65000) as u16).collect()),
                    Texels::F32(codes(n).map(|i| (i % 9999) as f32 - 4e3).collect()),
                ];
                for texels in kinds {
                    let image = Image::from_texels(width, height, channels, texels).unwrap();
                    let mut ends = [[f64::INFINITY; 4], [f64::NEG_INFINITY; 4]];
                    for i in 0..(width * height) as usize {
                        for (k, x) in image.at(i, Content::Data).into_iter().enumerate() {
                            ends[0][k] = ends[0][k].min(x);
                            ends[1][k] = ends[1][k].max(x);
                        }
                    }
                    assert_eq!(image.range(Content::Data), ends, "{image:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_no_number_is_no_extreme() {
        let texels = Texels::F32(vec![f32::NAN, 2.0, -1.0, f32::NAN]);
        let image = Image::from_texels(4, 1, 1, texels).unwrap();
        let [low, high] = image.range(Content::Data);
        assert_eq!((low[0], high[0]), (-1.0, 2.0));
    }
}
