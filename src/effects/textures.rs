//! Values from images.

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "textures",
    doc: "colours and other values from images",
    bit: EffectSet::TEXTURES,
    acts: Acts::Built(|omit| omit.features |= Features::TEXTURES),
    verdict: |c| with_feature(c, Features::TEXTURES, "has an image"),
};
