//! Brushed surfaces (`KHR_materials_anisotropy`).

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "anisotropy",
    doc: "highlights drawn out by brushed surfaces",
    bit: EffectSet::ANISOTROPY,
    part: Part::Anisotropy,
    acts: Acts::Built(|omit| omit.features |= Features::ANISOTROPY),
    verdict: |c| with_feature(c, Features::ANISOTROPY, "is brushed"),
};
