//! Surfaces that are not whole.

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "alpha",
    doc: "surfaces with holes or that are half there",
    bit: EffectSet::ALPHA,
    part: Part::Alpha,
    acts: Acts::Built(|omit| omit.features |= Features::ALPHA),
    verdict: |c| with_feature(c, Features::ALPHA, "has alpha below 1"),
};
