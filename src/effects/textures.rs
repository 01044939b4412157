//! Values from images.

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "textures",
    doc: "colours and other values from images",
    bit: EffectSet::TEXTURES,
    part: Part::Textures,
    acts: Acts::Built(|omit| omit.features |= Features::TEXTURES),
    verdict: |c| with_feature(c, Features::TEXTURES, "has an image"),
};
