//! Clear coats (`KHR_materials_clearcoat`).

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "coat",
    doc: "a clear coat over other layers",
    bit: EffectSet::COAT,
    part: Part::Coat,
    acts: Acts::Built(|omit| omit.features |= Features::COAT),
    verdict: |c| with_feature(c, Features::COAT, "has a clear coat"),
};
