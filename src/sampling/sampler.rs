//! Points for one pixel sample or one photon.
//!
//! The first few dimension pairs are a two-dimensional Sobol' sequence, shuffled and shifted
//! differently for every pair, so that the leading decisions (lens, light, first bounce) are stratified over
//! the samples of a pixel or the photons of a light; later ones are pseudo-random.
//!
//! Sources: Burley, *Practical Hash-based Owen Scrambling*, JCGT 9(4), 2020 (shuffling and
//! scrambling by hashing); the second Sobol' dimension is the Pascal matrix modulo two, applied
//! as a butterfly (a Kronecker power of `[[1,1],[0,1]]`).

use super::rng::{GOLDEN, Rng, hash2, mix, unit_u32};

/// Names of the independent streams of random numbers.
pub mod stream {
    /// Camera samples; the key is the pixel.
    pub const CAMERA: u64 = 1;
    /// Global photons; the key is the light.
    pub const GLOBAL_PHOTONS: u64 = 2;
    /// Caustic photons; the key is the light.
    pub const CAUSTIC_PHOTONS: u64 = 3;
    /// Trials of what lights reach.
    pub const TRIALS: u64 = 5;
    /// Anything a test or tool needs.
    pub const TOOL: u64 = 4;
    /// Pilot photons. No number of a pass, whose seeds are made alike.
    pub const PILOT: u64 = 1 << 40;
    /// Photons that teach where others are to go; as above.
    pub const LESSONS: u64 = 1 << 41;
}

/// Dimension pairs taken from the low-discrepancy sequence.
const SOBOL_PAIRS: u32 = 8;

/// The stream of sample points of one index of one sequence.
#[derive(Clone, Debug)]
pub struct Sampler {
    key: u64,
    /// The index with its bits reversed: the first Sobol' dimension, as a 32-bit fraction.
    reversed: u32,
    pair: u32,
    rng: Rng,
}

/// A sequence of sample points, for whoever takes many of one.
#[derive(Clone, Copy, Debug)]
pub struct Sequence {
    run: u64,
    key: u64,
    /// Key of the first 2³² points.
    first: u64,
}

impl Sequence {
    /// The sequence named by (`seed`, `stream`, `key`).
    #[inline]
    pub fn new(seed: u64, stream: u64, key: u64) -> Self {
        let run = hash2(seed, stream);
        Self {
            run,
            key,
            first: hash2(run, hash2(key, 0)),
        }
    }

    /// Its point `index`.
    #[inline(always)]
    pub fn point(&self, index: u64) -> Sampler {
        // It has 2³² points; a longer run goes on in an independent one.
        let key = match index >> 32 {
            0 => self.first,
            part => hash2(self.run, hash2(self.key, part)),
        };
        Sampler {
            key,
            reversed: (index as u32).reverse_bits(),
            pair: 0,
            rng: Rng::new(hash2(key, index.wrapping_add(0x5851_f42d_4c95_7f2d))),
        }
    }
}

impl Sampler {
    /// Point `index` of the sequence named by (`seed`, `stream`, `key`).
    #[inline]
    pub fn new(seed: u64, stream: u64, key: u64, index: u64) -> Self {
        Sequence::new(seed, stream, key).point(index)
    }

    /// Next point of the unit square.
    #[inline]
    pub fn next_2d(&mut self) -> [f64; 2] {
        if self.pair < SOBOL_PAIRS {
            self.pair += 1;
            let h = mix(self.key ^ u64::from(self.pair).wrapping_mul(GOLDEN));
            sobol_2d(self.reversed, h)
        } else {
            self.rng.next_2d()
        }
    }

    /// Next number of the unit interval; always pseudo-random.
    #[inline]
    pub fn next_1d(&mut self) -> f64 {
        self.rng.next_1d()
    }

    /// Next number of the unit interval, stratified while stratified dimensions last.
    #[inline]
    pub fn next_1d_stratified(&mut self) -> f64 {
        self.next_2d()[0]
    }
}

/// Laine–Karras permutation (with Vegdahl's constants): an Owen scramble in bit-reversed order.
#[inline]
fn laine_karras(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

/// Both dimensions of the point, from its bit-reversed index: shuffled by an Owen scramble of
/// the index, then shifted digitally. All of it works on reversed bits, so nothing is reversed.
#[inline]
fn sobol_2d(reversed: u32, h: u64) -> [f64; 2] {
    let x = laine_karras(reversed, h as u32);
    let mut y = x;
    y ^= (y & 0x5555_5555) << 1;
    y ^= (y & 0x3333_3333) << 2;
    y ^= (y & 0x0f0f_0f0f) << 4;
    y ^= (y & 0x00ff_00ff) << 8;
    y ^= y << 16;
    let shift = (h >> 32) as u32;
    [
        unit_u32(x ^ shift),
        unit_u32(y ^ shift.wrapping_mul(0x9e37_79b9).rotate_left(16)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_elementary_interval_of_a_power_of_two_prefix_holds_one_point() {
        for seed in 0..8 {
            let n = 256usize;
            for pair in 0..SOBOL_PAIRS {
                let points: Vec<_> = (0..n as u64)
                    .map(|i| {
                        let mut s = Sampler::new(seed, stream::TOOL, 7, i);
                        for _ in 0..pair {
                            s.next_2d();
                        }
                        s.next_2d()
                    })
                    .collect();
                for log_x in 0..=8u32 {
                    let (nx, ny) = (1usize << log_x, n >> log_x);
                    let mut seen = vec![false; n];
                    for p in &points {
                        let cell = (p[0] * nx as f64) as usize * ny + (p[1] * ny as f64) as usize;
                        assert!(!seen[cell], "seed {seed} pair {pair} strata {nx}x{ny}");
                        seen[cell] = true;
                    }
                }
            }
        }
    }

    #[test]
    fn pairs_are_not_correlated() {
        // |r| of 4096 independent pairs is below 4/√4096 with probability 1 − 6e-5 per test.
        let n = 4096;
        let mut sums = [0.0; 6];
        for i in 0..n {
            let mut s = Sampler::new(3, stream::TOOL, 11, i);
            let a = s.next_2d()[0];
            let b = s.next_2d()[0];
            let c = s.next_1d();
            for (k, (u, v)) in [(a, b), (b, c), (a, c)].into_iter().enumerate() {
                sums[k] += 12.0 * (u - 0.5) * (v - 0.5) / n as f64;
            }
        }
        for s in sums {
            assert!(s.abs() < 4.0 / 64.0, "{s}");
        }
    }

    #[test]
    fn a_point_depends_on_all_of_its_keys() {
        let at = |seed, st, key, i| Sampler::new(seed, st, key, i).next_1d();
        let base = at(1, 2, 3, 4);
        assert_eq!(base.to_bits(), at(1, 2, 3, 4).to_bits());
        for other in [
            at(2, 2, 3, 4),
            at(1, 3, 3, 4),
            at(1, 2, 4, 4),
            at(1, 2, 3, 5),
        ] {
            assert_ne!(base.to_bits(), other.to_bits());
        }
        assert_ne!(base.to_bits(), at(1, 2, 3, 4 + (1 << 32)).to_bits());
    }
}
