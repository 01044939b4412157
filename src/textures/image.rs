//! A decoded image.

/// An image of linear colour with alpha, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: u32,
    height: u32,
    /// Four channels per texel.
    texels: Vec<[f32; 4]>,
}

impl Image {
    /// An image of `width × height` texels; `None` if their number does not fit or is zero.
    pub fn new(width: u32, height: u32, texels: Vec<[f32; 4]>) -> Option<Self> {
        let n = (width as usize).checked_mul(height as usize)?;
        (n > 0 && n == texels.len()).then_some(Self {
            width,
            height,
            texels,
        })
    }

    /// Width in texels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in texels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The texel in column `x` of row `y`, both within the image.
    #[inline]
    pub fn texel(&self, x: u32, y: u32) -> [f64; 4] {
        self.texels[y as usize * self.width as usize + x as usize].map(f64::from)
    }

    /// Mean over all texels.
    pub fn mean(&self) -> [f64; 4] {
        let mut sum = [0.0; 4];
        for t in &self.texels {
            for (s, x) in sum.iter_mut().zip(t) {
                *s += f64::from(*x);
            }
        }
        sum.map(|s| s / self.texels.len() as f64)
    }

    /// Smallest and largest value of each channel.
    pub fn range(&self) -> [[f64; 4]; 2] {
        let mut range = [[f64::INFINITY; 4], [f64::NEG_INFINITY; 4]];
        for t in &self.texels {
            for k in 0..4 {
                range[0][k] = range[0][k].min(f64::from(t[k]));
                range[1][k] = range[1][k].max(f64::from(t[k]));
            }
        }
        range
    }
}
