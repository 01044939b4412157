//! Animations (glTF 2.0, 3.11): what they make of the nodes at one moment.
//!
//! Only the keys around that moment are read, however long the animation is.

use std::collections::HashMap;

use super::accessor::{Component, Source};
use super::json::Cursor;
use super::{ImportOptions, Notes, Problem};
use crate::math::{DQuat, DVec3};

/// What animations set on one node.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct NodePose {
    pub(super) translation: Option<DVec3>,
    pub(super) rotation: Option<DQuat>,
    pub(super) scale: Option<DVec3>,
    /// Weights of the morph targets.
    pub(super) weights: Option<Vec<f64>>,
}

/// What animations set, by node; nothing in the rest pose.
pub(super) type Pose = HashMap<usize, NodePose>;

/// The pose that the options ask for.
pub(super) fn pose<'a>(
    source: &Source<'a>,
    options: &ImportOptions,
    notes: &mut Notes,
) -> Result<Pose, Problem> {
    let mut pose = Pose::new();
    let Some(time) = options.time else {
        return Ok(pose);
    };
    let animations = source.root.items("animations")?;
    let chosen: Vec<&Cursor<'a>> = match &options.animation {
        Some(name) => {
            let named = animations.iter().filter(|a| a.name() == *name);
            let chosen: Vec<_> = named.take(1).collect();
            if chosen.is_empty() {
                let known: Vec<String> = animations.iter().map(Cursor::name).collect();
                return Err(Problem {
                    remedy: if known.is_empty() {
                        "leave --animation out".into()
                    } else {
                        format!("known animations: {}", known.join(", "))
                    },
                    ..Problem::invalid("/animations", format!("none is named '{name}'"))
                });
            }
            chosen
        }
        None => animations.iter().collect(),
    };
    if chosen.is_empty() {
        notes.add("there are no animations: the rest pose is used", 1);
    }
    for animation in chosen {
        let mut reader = Reader {
            source,
            time,
            spans: HashMap::new(),
        };
        for channel in animation.items("channels")? {
            reader.channel(animation, &channel, &mut pose, notes)?;
        }
    }
    Ok(pose)
}

/// Where the moment lies among the keys of a sampler.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    /// Number of keys.
    keys: usize,
    /// The key before, or the first or the last one outside of their time.
    key: usize,
    /// How far on the way to the next key, from 0 to 1; 0 where there is none.
    part: f64,
    /// Time between the two keys in seconds.
    length: f64,
}

/// Finds `time` among ascending times.
fn span(times: &[f32], time: f64) -> Span {
    let keys = times.len();
    let at = |i: usize| f64::from(times[i]);
    let after = times.partition_point(|t| f64::from(*t) <= time);
    let key = after.saturating_sub(1);
    // Before the first key and after the last one, the value stays.
    if after == 0 || after == keys {
        return Span {
            keys,
            key,
            part: 0.0,
            length: 0.0,
        };
    }
    let length = at(after) - at(key);
    Span {
        keys,
        key,
        part: (time - at(key)) / length,
        length,
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

/// Reads the channels of one animation.
struct Reader<'s, 'a> {
    source: &'s Source<'a>,
    time: f64,
    /// By accessor of times: many channels share one.
    spans: HashMap<usize, Span>,
}

impl<'a> Reader<'_, 'a> {
    fn channel(
        &mut self,
        animation: &Cursor<'a>,
        channel: &Cursor<'a>,
        pose: &mut Pose,
        notes: &mut Notes,
    ) -> Result<(), Problem> {
        let target = channel.need("target")?;
        let path = target.need("path")?;
        if path.str()? == "pointer" {
            notes.add(
                "animations of anything but nodes (KHR_animation_pointer) are ignored",
                1,
            );
            return Ok(());
        }
        // Without a node the target is an extension's (glTF 2.0, 3.11).
        let Some(at) = target.get("node") else {
            return Ok(());
        };
        let index = at.index()?;
        let node = self.source.root.element("nodes", index, &at)?;
        let which = channel.need("sampler")?;
        let samplers = animation.items("samplers")?;
        let sampler = samplers
            .get(which.index()?)
            .ok_or_else(|| which.problem("names a sampler that does not exist"))?;
        let entry = pose.entry(index).or_default();
        let taken = match path.str()? {
            "translation" => entry.translation.is_some(),
            "rotation" => entry.rotation.is_some(),
            "scale" => entry.scale.is_some(),
            "weights" => entry.weights.is_some(),
            other => return Err(path.problem(format!("'{other}' cannot be animated"))),
        };
        if taken {
            notes.add(
                "several animations move the same node: the first one does; --animation chooses",
                1,
            );
            return Ok(());
        }
        match path.str()? {
            "weights" => entry.weights = Some(self.weights(sampler)?),
            _ if node.get("matrix").is_some() => {
                return Err(path.problem(format!(
                    "moves {}, which has a matrix and so cannot be animated",
                    node.path()
                )));
            }
            "translation" => entry.translation = Some(self.vector(sampler)?),
            "scale" => entry.scale = Some(self.vector(sampler)?),
            _ => entry.rotation = Some(self.rotation(sampler)?),
        }
        Ok(())
    }

    /// The moment among the keys of a sampler.
    fn span(&mut self, sampler: &Cursor<'a>) -> Result<Span, Problem> {
        let input = sampler.need("input")?;
        let index = input.index()?;
        if let Some(known) = self.spans.get(&index) {
            return Ok(*known);
        }
        let accessor = self.source.accessor(&input)?;
        let times = self.source.floats::<1>(&accessor, None)?;
        let times: Vec<f32> = times.into_iter().map(|[t]| t).collect();
        if times.is_empty() {
            return Err(input.problem("has no key"));
        }
        let ascending = times.windows(2).all(|w| w[0] < w[1]);
        if !ascending || !times[0].is_finite() || times[times.len() - 1].is_infinite() {
            return Err(input.problem("has times that do not ascend"));
        }
        let span = span(&times, self.time);
        self.spans.insert(index, span);
        Ok(span)
    }

    /// The values around the moment: `width` elements of `N` numbers for each key.
    fn keys<const N: usize>(
        &self,
        sampler: &Cursor<'a>,
        span: Span,
        kind: Interpolation,
    ) -> Result<Keys<N>, Problem> {
        let output = sampler.need("output")?;
        let accessor = self.source.accessor(&output)?;
        if accessor.component == Component::U32 {
            return Err(output.problem("is of 32-bit integers, which values may not be"));
        }
        let parts = if kind == Interpolation::CubicSpline {
            3
        } else {
            1
        };
        let per_key = accessor.count / span.keys;
        let width = per_key / parts;
        if width == 0 || width * parts * span.keys != accessor.count || (N > 1 && width != 1) {
            return Err(output.problem(format!(
                "has {} elements for {} keys",
                accessor.count, span.keys
            )));
        }
        let first = span.key * per_key;
        let count = if span.part > 0.0 { 2 } else { 1 } * per_key;
        let Ok(last) = u32::try_from(first + count) else {
            return Err(output.problem("has too many elements"));
        };
        let pick: Vec<u32> = (first as u32..last).collect();
        let values: Vec<[f64; N]> = self
            .source
            .floats::<N>(&accessor, Some(&pick))?
            .into_iter()
            .map(|v| v.map(f64::from))
            .collect();
        if values.iter().flatten().any(|x| !x.is_finite()) {
            return Err(output.problem("holds values that are infinite or not a number"));
        }
        Ok(Keys {
            values,
            width,
            kind,
            span,
        })
    }

    fn sampled<const N: usize>(&mut self, sampler: &Cursor<'a>) -> Result<Keys<N>, Problem> {
        let kind = match sampler.get("interpolation") {
            None => Interpolation::Linear,
            Some(c) => match c.str()? {
                "LINEAR" => Interpolation::Linear,
                "STEP" => Interpolation::Step,
                "CUBICSPLINE" => Interpolation::CubicSpline,
                other => return Err(c.problem(format!("'{other}' is no interpolation"))),
            },
        };
        let span = self.span(sampler)?;
        self.keys(sampler, span, kind)
    }

    fn vector(&mut self, sampler: &Cursor<'a>) -> Result<DVec3, Problem> {
        let keys = self.sampled::<3>(sampler)?;
        Ok(DVec3::from_array(keys.value(0)))
    }

    fn rotation(&mut self, sampler: &Cursor<'a>) -> Result<DQuat, Problem> {
        let keys = self.sampled::<4>(sampler)?;
        let unit = |q: [f64; 4]| {
            let q = DQuat::from_array(q);
            if q.length_squared() > 0.0 {
                q.normalize()
            } else {
                DQuat::IDENTITY
            }
        };
        Ok(match (keys.kind, keys.values.get(1)) {
            // The shorter way round (glTF 2.0, appendix C.4).
            (Interpolation::Linear, Some(&end)) => {
                unit(keys.values[0]).slerp(unit(end), keys.span.part)
            }
            _ => unit(keys.value(0)),
        })
    }

    fn weights(&mut self, sampler: &Cursor<'a>) -> Result<Vec<f64>, Problem> {
        let keys = self.sampled::<1>(sampler)?;
        Ok((0..keys.width).map(|i| keys.value(i)[0]).collect())
    }
}

/// The values of the keys before and after the moment.
struct Keys<const N: usize> {
    values: Vec<[f64; N]>,
    /// Elements of a value.
    width: usize,
    kind: Interpolation,
    span: Span,
}

impl<const N: usize> Keys<N> {
    /// Element `i` of the value, without regard to what it means.
    fn value(&self, i: usize) -> [f64; N] {
        let (w, t) = (self.width, self.span.part);
        let at = |k: usize| self.values[k * w + i];
        let between = t > 0.0;
        match self.kind {
            Interpolation::Linear if between => {
                let (a, b) = (at(0), at(1));
                std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t)
            }
            Interpolation::Step | Interpolation::Linear => at(0),
            // Each key is tangent in, value, tangent out (glTF 2.0, appendix C.5).
            Interpolation::CubicSpline if between => {
                let (v0, out, into, v1) = (at(1), at(2), at(3), at(4));
                let (t2, t3) = (t * t, t * t * t);
                let d = self.span.length;
                std::array::from_fn(|k| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * v0[k]
                        + d * (t3 - 2.0 * t2 + t) * out[k]
                        + (3.0 * t2 - 2.0 * t3) * v1[k]
                        + d * (t3 - t2) * into[k]
                })
            }
            Interpolation::CubicSpline => at(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(times: &[f32], time: f64) -> (usize, f64) {
        let s = span(times, time);
        (s.key, s.part)
    }

    #[test]
    fn moments_are_found_among_the_keys() {
        let times = [1.0, 2.0, 4.0];
        assert_eq!(at(&times, 0.0), (0, 0.0));
        assert_eq!(at(&times, 1.0), (0, 0.0));
        assert_eq!(at(&times, 1.25), (0, 0.25));
        assert_eq!(at(&times, 2.0), (1, 0.0));
        assert_eq!(at(&times, 3.0), (1, 0.5));
        assert_eq!(at(&times, 4.0), (2, 0.0));
        assert_eq!(at(&times, 9.0), (2, 0.0));
        assert_eq!(at(&[0.5], 0.7), (0, 0.0));
    }

    #[test]
    fn cubic_splines_pass_their_keys_with_their_slopes() {
        // x(t) = t³ on [1, 3]: values 1 and 27, slopes 3 and 27.
        let keys = |part: f64| Keys::<1> {
            values: vec![[0.0], [1.0], [3.0], [27.0], [27.0], [0.0]],
            width: 1,
            kind: Interpolation::CubicSpline,
            span: Span {
                keys: 2,
                key: 0,
                part,
                length: 2.0,
            },
        };
        for part in [0.0, 0.25, 0.5, 0.9] {
            let t = 1.0 + 2.0 * part;
            assert!((keys(part).value(0)[0] - t * t * t).abs() < 1e-12);
        }
    }
}
