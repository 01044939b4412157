//! Depth of field: cameras with an aperture.

use super::{Acts, EffectEntry, EffectSet, Verdict};
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "lens",
    doc: "depth of field",
    bit: EffectSet::LENS,
    part: Part::Lens,
    acts: Acts::Built(|omit| omit.lens = true),
    verdict: |c| match c.lenses {
        0 => Verdict::off("no camera has an aperture"),
        n => Verdict::on(format!("{n} camera(s) with an aperture")),
    },
};
