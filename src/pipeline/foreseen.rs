//! What becomes of the edges that adaptive sampling foresaw, once all samples are taken.

use crate::effects::EffectSet;
use crate::film::{Channel, Film, Layer};

/// Whether indirect light may be interpolated in pixels without an edge: not where surfaces have
/// finer detail than edges tell of, as maps of normals and leaves cut out by alpha, nor where a lens
/// blurs the edges.
pub(super) fn smooth(effects: EffectSet) -> bool {
    let detail = EffectSet::NORMALS | EffectSet::ALPHA | EffectSet::LENS;
    effects.contains(EffectSet::INDIRECT) && !effects.intersects(detail)
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
