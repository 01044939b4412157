//! Thin films (`KHR_materials_iridescence`).

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "iridescence",
    doc: "the colours of thin films",
    bit: EffectSet::IRIDESCENCE,
    part: Part::Iridescence,
    acts: Acts::Built(|omit| omit.features |= Features::IRIDESCENCE),
    verdict: |c| with_feature(c, Features::IRIDESCENCE, "has a thin film"),
};
