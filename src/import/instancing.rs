//! Many placements of one mesh (`EXT_mesh_gpu_instancing`).

use super::Problem;
use super::accessor::Source;
use super::json::Cursor;
use super::vertices::finite;
use crate::math::{DAffine3, DQuat, DVec3, Vec3};

/// The placements relative to the node, as the extension object `e` lists them.
pub(super) fn read<'a>(e: &Cursor<'a>, source: &Source<'a>) -> Result<Vec<DAffine3>, Problem> {
    let map = e.need("attributes")?;
    let translation = column::<3>(&map, "TRANSLATION", source)?;
    let rotation = column::<4>(&map, "ROTATION", source)?;
    let scale = column::<3>(&map, "SCALE", source)?;
    let lengths = [
        translation.as_ref().map(Vec::len),
        rotation.as_ref().map(Vec::len),
        scale.as_ref().map(Vec::len),
    ];
    let mut known = lengths.into_iter().flatten();
    let Some(n) = known.next() else {
        return Err(map.problem("has no TRANSLATION, ROTATION or SCALE"));
    };
    if known.any(|m| m != n) {
        return Err(map.problem("has attributes of different lengths"));
    }
    let wide = |v: [f32; 3]| Vec3::from(v).as_dvec3();
    Ok((0..n)
        .map(|i| {
            let t = translation.as_ref().map_or(DVec3::ZERO, |t| wide(t[i]));
            let s = scale.as_ref().map_or(DVec3::ONE, |s| wide(s[i]));
            let q = rotation.as_ref().map_or(DQuat::IDENTITY, |r| {
                let q = DQuat::from_array(r[i].map(f64::from));
                if q.length_squared() > 0.0 {
                    q.normalize()
                } else {
                    DQuat::IDENTITY
                }
            });
            DAffine3::from_scale_rotation_translation(s, q, t)
        })
        .collect())
}

/// What a placement takes in memory, about.
const PLACED: usize = 256;

fn column<'a, const N: usize>(
    map: &Cursor<'a>,
    name: &str,
    source: &Source<'a>,
) -> Result<Option<Vec<[f32; N]>>, Problem> {
    let Some(from) = map.get(name) else {
        return Ok(None);
    };
    let mut accessor = source.accessor(&from)?;
    // Whole numbers are shares of one here, always.
    accessor.normalized = true;
    source
        .views
        .claim(accessor.count.saturating_mul(PLACED), &from)?;
    let values = source.floats::<N>(&accessor, None)?;
    finite(&values, &from)?;
    Ok(Some(values))
}
