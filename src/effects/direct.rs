//! Direct light: on when anything emits.

use super::{Acts, EffectEntry, EffectSet, Verdict, lights};
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "direct",
    doc: "light that arrives straight from a light, by shadow rays",
    bit: EffectSet::DIRECT,
    part: Part::Direct,
    acts: Acts::Traced,
    verdict: |c| match lights(c) {
        0 => Verdict::off("nothing emits light"),
        n => Verdict::on(format!("{n} light(s)")),
    },
};
