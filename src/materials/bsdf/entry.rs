//! A lobe in its stack.

use super::FrameId;
use crate::materials::lobes::Lobe;
use crate::stats::tally::{self, Scope};

/// A lobe of the stack.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) lobe: Lobe,
    /// Its share of the samples, times the sum of all shares.
    pub(super) pick: f64,
    pub(super) frame: FrameId,
    /// The first of the layers above it.
    pub(super) under: u8,
    /// What is [counted](tally::lobe) when it is evaluated or sampled.
    pub(super) events: u32,
}

impl Entry {
    /// Counts an evaluation, and takes its time until the answer is dropped.
    #[inline(always)]
    pub(super) fn tell(&self) -> Option<Scope> {
        (self.events != 0).then(|| tally::lobe(self.events))
    }
}
