//! Glass that disperses: each channel has lobes of its own, and turns its own way.

use arrayvec::ArrayVec;

use super::{Bsdf, BsdfSample};
use crate::color::Rgb;

/// Samples of the channels, alike ones together.
pub type ChannelSamples = ArrayVec<BsdfSample, 3>;

impl Bsdf {
    /// Whether channels have lobes of their own.
    #[inline]
    pub fn disperses(&self) -> bool {
        self.lobes.len() > 1 && self.lobes.iter().any(|e| e.lobe.is_of_one_channel())
    }

    /// The same without the lobes that leave a channel black.
    fn seen_by(&self, channel: Rgb) -> Self {
        let mut own = self.clone();
        own.lobes.retain(|e| !(e.lobe.share() * channel).is_black());
        own.total = own.lobes.iter().map(|e| e.pick).sum();
        own
    }

    /// Samples for each channel of `carried` that is not black the lobes that serve it, all by the
    /// same numbers. A sample has the weights of its own channels only, those of the others are 0;
    /// channels that go the same way, as all that are reflected do, share one sample. Densities
    /// are those that [`eval`](Self::eval) weighs by, as if all lobes had been there to pick.
    pub fn sample_channels(&self, carried: Rgb, u_lobe: f64, u: [f64; 2]) -> ChannelSamples {
        let mut out = ChannelSamples::new();
        for channel in Rgb::CHANNELS {
            if (carried * channel).is_black() {
                continue;
            }
            let own = self.seen_by(channel);
            let Some(mut s) = own.sample(u_lobe, u) else {
                continue;
            };
            s.weight *= channel;
            s.pdf *= own.total / self.total;
            let alike = |o: &&mut BsdfSample| o.wi == s.wi && o.class == s.class && o.pdf == s.pdf;
            match out.iter_mut().find(alike) {
                Some(same) => same.weight += s.weight,
                None => out.push(s),
            }
        }
        out
    }

    /// As [`sample`](Self::sample), for a path that carries these channels: where they part, it
    /// goes on with some of them, chosen by `choose` in proportion to what they carry. No sample
    /// is lost to a channel that the path does not have.
    #[inline(always)]
    pub fn sample_carried(
        &self,
        carried: Rgb,
        u_lobe: f64,
        u: [f64; 2],
        choose: impl FnOnce() -> f64,
    ) -> Option<BsdfSample> {
        if self.disperses() {
            one_of(&self.sample_channels(carried, u_lobe, u), carried, choose)
        } else {
            self.sample(u_lobe, u)
        }
    }
}

/// One of several samples, in proportion to what it carries on.
#[inline(never)]
fn one_of(
    samples: &ChannelSamples,
    carried: Rgb,
    choose: impl FnOnce() -> f64,
) -> Option<BsdfSample> {
    if let [one] = samples.as_slice() {
        return Some(*one);
    }
    let carries = |s: &BsdfSample| (carried * s.weight).max_channel();
    let total: f64 = samples.iter().map(carries).sum();
    let mut rest = choose() * total;
    for s in samples {
        let own = carries(s);
        if rest < own {
            return Some(BsdfSample {
                weight: s.weight * (total / own),
                ..*s
            });
        }
        rest -= own;
    }
    None
}
