//! Shapes that stand in several places.

use super::{Acts, EffectEntry, EffectSet, Verdict};
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "instances",
    doc: "shapes that stand in several places and are kept once",
    bit: EffectSet::INSTANCES,
    part: Part::Instances,
    acts: Acts::Always,
    verdict: |c| match c.instances {
        0 => Verdict::off("nothing stands in several places"),
        n => Verdict::on(format!("{n} placed shape(s) share what they are")),
    },
};
