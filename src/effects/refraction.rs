//! Bent transmission: needs a body (`KHR_materials_volume`) and an index other than one.

use super::{Acts, EffectEntry, EffectSet, Verdict};
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "refraction",
    doc: "light bent on its way through solid glass and water",
    bit: EffectSet::REFRACTION,
    part: Part::Refraction,
    acts: Acts::Traced,
    verdict: |c| {
        if c.traits.refracts {
            Verdict::on("a transmitting body has an index of refraction other than 1")
        } else if c.traits.transmits {
            Verdict::off("what transmits is thin-walled or has index 1, which bends nothing")
        } else {
            Verdict::off("no material transmits")
        }
    },
};
