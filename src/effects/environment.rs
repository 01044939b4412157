//! Light from all around.

use super::{Acts, EffectEntry, EffectSet, Verdict};
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "environment",
    doc: "light from all around",
    bit: EffectSet::ENVIRONMENT,
    part: Part::Environment,
    acts: Acts::Built(|omit| omit.environment = true),
    verdict: |c| match c.lights.iter().any(|(kind, _)| *kind == "environment") {
        true => Verdict::on("the scene has a sky"),
        false => Verdict::off("no light comes from all around"),
    },
};
