//! Sheen (`KHR_materials_sheen`).

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "sheen",
    doc: "the sheen of cloth",
    bit: EffectSet::SHEEN,
    part: Part::Sheen,
    acts: Acts::Built(|omit| omit.features |= Features::SHEEN),
    verdict: |c| with_feature(c, Features::SHEEN, "has a sheen"),
};
