//! Colours that glass takes apart (`KHR_materials_dispersion`).

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "dispersion",
    doc: "colours that glass takes apart",
    bit: EffectSet::DISPERSION,
    part: Part::Dispersion,
    acts: Acts::Built(|omit| omit.features |= Features::DISPERSION),
    verdict: |c| with_feature(c, Features::DISPERSION, "bends colours apart"),
};
