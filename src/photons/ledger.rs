//! Bookkeeping of flux: what leaves the lights must be absorbed, escape or be cut off.

use crate::color::Rgb;
use crate::stats::PhotonCounts;

/// Sums of flux in W, all in `f64`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ledger {
    /// Left a light.
    pub emitted: Rgb,
    /// Taken up by surfaces and media; Russian roulette makes single entries negative.
    pub absorbed: Rgb,
    /// Left the scene.
    pub escaped: Rgb,
    /// Given up at the depth limit or, for caustic photons, because they cannot become one.
    pub cut: Rgb,
    /// Photons emitted.
    pub photons: u64,
    /// Photons given up because they cannot become a caustic.
    pub discarded: u64,
}

impl Ledger {
    /// Adds another part.
    pub fn add(&mut self, o: &Self) {
        self.emitted += o.emitted;
        self.absorbed += o.absorbed;
        self.escaped += o.escaped;
        self.cut += o.cut;
        self.photons += o.photons;
        self.discarded += o.discarded;
    }

    /// Relative difference between what was emitted and what was accounted for, worst channel.
    pub fn imbalance(&self) -> f64 {
        let diff = self.emitted - self.absorbed - self.escaped - self.cut;
        diff.map(f64::abs).max_channel() / self.emitted.max_channel().max(f64::MIN_POSITIVE)
    }

    /// As counts for the statistics; flux summed over the channels.
    pub fn counts(&self, stored: u64) -> PhotonCounts {
        let sum = |c: Rgb| c.r + c.g + c.b;
        PhotonCounts {
            emitted: self.photons,
            stored,
            discarded: self.discarded,
            flux_emitted: sum(self.emitted),
            flux_absorbed: sum(self.absorbed),
            flux_escaped: sum(self.escaped),
            flux_cut: sum(self.cut),
            ..PhotonCounts::default()
        }
    }
}
