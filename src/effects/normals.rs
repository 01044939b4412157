//! Shading normals from images.

use super::{Acts, EffectEntry, EffectSet, with_feature};
use crate::materials::Features;
use crate::stats::tally::Part;

/// The table's line.
pub(super) const ENTRY: EffectEntry = EffectEntry {
    name: "normals",
    doc: "bumps from images of normals",
    bit: EffectSet::NORMALS,
    part: Part::Normals,
    acts: Acts::Built(|omit| omit.features |= Features::NORMAL_MAPS),
    verdict: |c| with_feature(c, Features::NORMAL_MAPS, "has an image of normals"),
};
