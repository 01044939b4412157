//! Photon passes that follow one another: each brings new photons and a smaller kernel, so that
//! the mean of the images tends to the truth while memory holds the photons of one pass.
//!
//! A kernel of area `a` has a bias in proportion to `a` and, with `k` photons in it, a variance
//! in proportion to `1/k`. Passes of `M_i = M √i` photons with the same `k` have kernels of
//! `a_i ~ i^(−1/2)`. Over `P` passes of weight `M_i` the variance falls with `1/P` and the squared
//! bias too; since `P ~ N^(2/3)` for `N` photons in all, the mean squared error falls with
//! `N^(−2/3)`, the best that a kernel with a bias of second order allows.
//!
//! Source: Knaus and Zwicker, *Progressive Photon Mapping: A Probabilistic Approach*, ACM TOG
//! 30(3), 2011, sections 4 and 5; there the kernels shrink, here the passes grow.

use super::PhotonSettings;
use crate::sampling::hash2;

/// Camera samples of a pixel that share the photons of the first pass, if it is to be efficient.
pub const SAMPLES: u32 = 16;

/// A pass.
#[derive(Clone, Debug)]
pub struct PhotonPass {
    /// What the photon pass is told.
    pub photons: PhotonSettings,
    /// Camera samples of a pixel that see these photons.
    pub samples: u32,
}

impl PhotonPass {
    /// The pass of a number, counted from 0. `first` is the first one's settings, whose photons
    /// serve `samples` camera samples of a pixel.
    pub fn new(first: &PhotonSettings, samples: u32, number: u32) -> Self {
        let growth = f64::from(number + 1).sqrt();
        let grown = |n: u64| (n as f64 * growth) as u64;
        Self {
            photons: PhotonSettings {
                seed: match number {
                    0 => first.seed,
                    n => hash2(first.seed, u64::from(n)),
                },
                global: grown(first.global),
                caustic: grown(first.caustic),
                ..first.clone()
            },
            samples: (f64::from(samples) * growth) as u32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_grow_with_the_root_of_their_number() {
        let first = PhotonSettings {
            seed: 7,
            global: 1000,
            caustic: 100,
            nearest: 50,
            max_depth: None,
            roulette: true,
            guidance: crate::photons::Guidance::Off,
        };
        let pass = |n| PhotonPass::new(&first, SAMPLES, n);
        assert_eq!((pass(0).samples, pass(0).photons.seed), (16, 7));
        assert_eq!((pass(3).samples, pass(3).photons.global), (32, 2000));
        assert_eq!((pass(99).samples, pass(99).photons.caustic), (160, 1000));
        assert_ne!(pass(1).photons.seed, pass(2).photons.seed);
    }
}
