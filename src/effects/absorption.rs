//! Bodies that absorb light on its way (`KHR_materials_volume`).

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "absorption",
    doc: "light that coloured glass and water absorb on its way",
    bit: EffectSet::ABSORPTION,
    part: Part::Absorption,
    acts: Acts::Built(|omit| omit.features |= Features::ABSORPTION),
    verdict: |c| with_feature(c, Features::ABSORPTION, "bounds a body that absorbs light"),
};
