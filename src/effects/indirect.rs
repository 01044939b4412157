//! Indirect light: needs a light and a diffuse surface that passes it on.

use super::{Acts, EffectEntry, EffectSet, Verdict, lights};
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "indirect",
    doc: "light that comes by way of other diffuse surfaces, from the global photon map",
    bit: EffectSet::INDIRECT,
    part: Part::Indirect,
    acts: Acts::Traced,
    verdict: |c| {
        if lights(c) == 0 {
            Verdict::off("nothing emits light")
        } else if c.traits.diffuse == 0.0 {
            Verdict::off("no surface reflects diffusely")
        } else {
            Verdict::on(format!("diffuse albedo up to {:.2}", c.traits.diffuse))
        }
    },
};
