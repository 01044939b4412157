//! What becomes of the edges that adaptive sampling foresaw, once all samples are taken.

use crate::effects::EffectSet;
use crate::film::{Channel, Film, Layer};

/// Why indirect light is not to be interpolated in pixels without an edge, if it is not.
pub(super) fn hindrance(adaptive: bool, wanted: bool, effects: EffectSet) -> Option<&'static str> {
    [
        (adaptive, "no edges are forecast for even samples"),
        (wanted, "as was asked for"),
        (effects.contains(EffectSet::INDIRECT), "there is none"),
        (
            !effects.intersects(EffectSet::NORMALS),
            "maps of normals have finer detail than edges tell of",
        ),
        (
            !effects.intersects(EffectSet::ALPHA),
            "surfaces that are not whole have finer detail than edges tell of",
        ),
        (
            !effects.intersects(EffectSet::LENS),
            "edges are not where a lens blurs them",
        ),
    ]
    .into_iter()
    .find_map(|(fits, why)| (!fits).then_some(why))
}

/// What was foreseen of each pixel, and what came of it.
pub(super) fn plan_layer(edges: &[bool], film: &Film) -> Layer {
    let channel = |name: &str, data| Channel {
        name: name.into(),
        half: false,
        data,
    };
    let as_number = |b: &bool| f32::from(u8::from(*b));
    let mut channels = vec![
        channel("edges", edges.iter().map(as_number).collect()),
        channel(
            "samples",
            film.samples().iter().map(|n| *n as f32).collect(),
        ),
    ];
    channels.extend(film.reach().map(|reach| channel("reach", reach.to_vec())));
    Layer {
        name: "pixels".into(),
        channels,
    }
}
