//! Caustics: need a light, something that redirects it, and a diffuse receiver.

use super::{Acts, EffectEntry, EffectSet, Verdict, lights};
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "caustics",
    doc: "light focused onto diffuse surfaces by mirrors and glass, from the caustic photon map",
    bit: EffectSet::CAUSTICS,
    part: Part::Caustics,
    acts: Acts::Traced,
    verdict: |c| {
        if c.specular_objects == 0 {
            Verdict::off("nothing reflects or transmits light onto other surfaces")
        } else if lights(c) == 0 {
            Verdict::off("nothing emits light")
        } else if c.traits.diffuse == 0.0 {
            Verdict::off("no diffuse surface receives them")
        } else if c.lit_specular_objects == 0 {
            Verdict::off("what would redirect light lies beyond the range of every light")
        } else {
            Verdict::on(format!(
                "{} object(s) redirect light onto diffuse surfaces",
                c.lit_specular_objects
            ))
        }
    },
};
