//! Diffuse light that comes through (`KHR_materials_diffuse_transmission`).

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "translucency",
    doc: "diffuse light through leaves and paper",
    bit: EffectSet::TRANSLUCENCY,
    part: Part::Translucency,
    acts: Acts::Built(|omit| omit.features |= Features::TRANSLUCENCY),
    verdict: |c| with_feature(c, Features::TRANSLUCENCY, "lets diffuse light through"),
};
