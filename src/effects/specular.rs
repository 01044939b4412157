//! Mirror-like and glossy reflection.

use super::{Acts, EffectEntry, EffectSet, Verdict};
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "specular",
    doc: "what is seen in mirrors, in glossy surfaces and through glass",
    bit: EffectSet::SPECULAR,
    part: Part::Specular,
    acts: Acts::Traced,
    verdict: |c| {
        if c.specular_objects == 0 {
            Verdict::off("no material reflects like a mirror or transmits")
        } else {
            Verdict::on(format!(
                "{} object(s) reflect or transmit",
                c.specular_objects
            ))
        }
    },
};
