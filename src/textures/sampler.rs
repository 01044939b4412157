//! How an image is continued beyond its border and between its texels (glTF 2.0, 3.8.4).

/// What lies beyond the border.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image mirrored.
    Mirror,
    /// The border's texels.
    Clamp,
}

impl Wrap {
    /// The coordinate near the image, in units of its size, that shows the same as `u`; 0 for
    /// what is not a number.
    #[inline]
    pub fn fold(self, u: f64) -> f64 {
        if !u.is_finite() {
            return 0.0;
        }
        match self {
            Self::Repeat => u - u.floor(),
            Self::Mirror => u - 2.0 * (0.5 * u).floor(),
            // Blends reach no further than an image's width beyond the border.
            Self::Clamp => u.clamp(-1.0, 2.0),
        }
    }

    /// The texel that stands for texel `i` of `n`.
    #[inline]
    pub fn index(self, i: i64, n: u32) -> u32 {
        let n = i64::from(n);
        // Nearly always; a division costs more than all the rest of a texel.
        if (0..n).contains(&i) {
            return i as u32;
        }
        let i = match self {
            Self::Repeat => i.rem_euclid(n),
            Self::Clamp => i.clamp(0, n - 1),
            Self::Mirror => {
                let k = i.rem_euclid(2 * n);
                if k < n { k } else { 2 * n - 1 - k }
            }
        };
        i as u32
    }
}

/// How an image is magnified: what lies between its texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// A linear blend.
    #[default]
    Linear,
}

/// How an image is looked up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sampler {
    /// Beyond the left and right border.
    pub wrap_u: Wrap,
    /// Beyond the upper and lower border.
    pub wrap_v: Wrap,
    /// Between texels.
    pub filter: Filter,
}
