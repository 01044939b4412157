//! Our own names in a file's `extras`: what glTF has no place for. `docs/blender.md` is their
//! list. They stand in one object, `"extras": {"dualight": {…}}`, so that a name of ours that is
//! misspelt can be told from a stranger's.

use super::json::Cursor;
use super::{Notes, Problem};

/// The name of the object.
const KEY: &str = "dualight";

/// Our object in the extras of `owner`, if there is one. Members other than `known` are
/// warned of.
pub(super) fn of<'a>(
    owner: &Cursor<'a>,
    known: &[&str],
    notes: &mut Notes,
) -> Result<Option<Cursor<'a>>, Problem> {
    let Some(ours) = owner.get("extras").and_then(|e| e.get(KEY)) else {
        return Ok(None);
    };
    check(&ours, known, notes)?;
    Ok(Some(ours))
}

/// Insists that `ours` is an object, and warns of members other than `known`.
pub(super) fn check(ours: &Cursor<'_>, known: &[&str], notes: &mut Notes) -> Result<(), Problem> {
    let members = ours
        .value()
        .as_object()
        .ok_or_else(|| ours.problem("is not an object"))?;
    for name in members.keys().filter(|n| !known.contains(&n.as_str())) {
        let known = known.join(", ");
        notes.add(
            format!(
                "{}: '{name}' is not known here and ignored; known: {known}",
                ours.path()
            ),
            1,
        );
    }
    Ok(())
}

/// The number `key`, which must lie in `range`.
pub(super) fn number(
    c: &Cursor<'_>,
    key: &str,
    range: impl std::ops::RangeBounds<f64>,
    what: &str,
) -> Result<Option<f64>, Problem> {
    let Some(at) = c.get(key) else {
        return Ok(None);
    };
    let x = at.f64()?;
    if range.contains(&x) {
        Ok(Some(x))
    } else {
        Err(at.problem(format!("{x} is not {what}")))
    }
}

/// The length `key` in metres, above zero.
pub(super) fn length(c: &Cursor<'_>, key: &str) -> Result<Option<f64>, Problem> {
    use std::ops::Bound::{Excluded, Included};
    let range = (Excluded(0.0), Included(1e30));
    number(c, key, range, "a length in metres above 0")
}

/// The flag `key`.
pub(super) fn flag(c: &Cursor<'_>, key: &str) -> Result<Option<bool>, Problem> {
    c.get(key)
        .map(|at| {
            at.value()
                .as_bool()
                .ok_or_else(|| at.problem("is neither true nor false"))
        })
        .transpose()
}

/// The linear colour `key`: three numbers from 0.
pub(super) fn color(c: &Cursor<'_>, key: &str) -> Result<Option<[f64; 3]>, Problem> {
    let Some(at) = c.get(key) else {
        return Ok(None);
    };
    let n = at.elements()?.len();
    let rgb = c.numbers_or(key, [0.0; 3])?;
    if n != 3 || !rgb.iter().all(|x| (0.0..=1e30).contains(x)) {
        return Err(at.problem("is not a colour of three numbers from 0"));
    }
    Ok(Some(rgb))
}
