//! Counter-based pseudo-random numbers.
//!
//! Source: Steele et al., *Fast Splittable Pseudorandom Number Generators*, OOPSLA 2014
//! (the finaliser is Stafford's variant 13).

pub(super) const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

#[inline]
pub(super) fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Hash of two words; not symmetric.
#[inline]
pub fn hash2(a: u64, b: u64) -> u64 {
    mix(mix(a.wrapping_add(GOLDEN)) ^ b.wrapping_mul(GOLDEN).rotate_left(17))
}

/// A SplitMix64 stream.
#[derive(Clone, Debug)]
pub struct Rng {
    state: u64,
}

impl Rng {
    /// The stream that starts at `state`.
    #[inline]
    pub fn new(state: u64) -> Self {
        Self { state }
    }

    /// Next 64 bits.
    #[inline]
    pub fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(GOLDEN);
        mix(self.state)
    }

    /// Uniform in `[0, 1)`.
    #[inline]
    pub fn next_1d(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Uniform in `[0, 1)²`, from one 64-bit word.
    #[inline]
    pub fn next_2d(&mut self) -> [f64; 2] {
        let x = self.next_u64();
        [unit_u32(x as u32), unit_u32((x >> 32) as u32)]
    }
}

/// The middle of cell `x` of 2³² cells of `[0, 1)`.
#[inline]
pub(super) fn unit_u32(x: u32) -> f64 {
    (f64::from(x) + 0.5) * (1.0 / 4_294_967_296.0)
}
