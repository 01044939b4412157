//! Cameras (glTF 2.0, 3.10), and what our extras say about their lenses.

use std::f64::consts::{PI, TAU};

use super::json::Cursor;
use super::{Notes, Problem, extras};
use crate::cameras::{CameraDesc, Lens};
use crate::math::DAffine3;

/// Our names in the extras of a camera.
const NAMES: &[&str] = &[
    "aperture_radius",
    "f_stop",
    "focal_length",
    "focus_distance",
    "blades",
    "blade_rotation",
    "aperture_ratio",
    "shift",
];

/// Reads the camera `c` of a node that stands at `world`.
pub(super) fn read(
    c: &Cursor<'_>,
    name: String,
    world: DAffine3,
    notes: &mut Notes,
) -> Result<CameraDesc, Problem> {
    let kind = c.need("type")?;
    let (kind, vertical, aspect) = match kind.str()? {
        "perspective" => {
            let p = c.need("perspective")?;
            let aspect = p.get("aspectRatio").map(|a| a.f64()).transpose()?;
            let at = p.need("yfov")?;
            let yfov = at.f64()?;
            if !(yfov > 0.0 && yfov < PI) {
                return Err(at.problem(format!("{yfov} is not an angle between 0 and π")));
            }
            ("perspective", yfov, aspect)
        }
        "orthographic" => {
            let o = c.need("orthographic")?;
            let half = |key: &str| {
                let at = o.need(key)?;
                let length = at.f64()?;
                if length > 0.0 {
                    return Ok(length);
                }
                Err(at.problem(format!("{length} is not a length above 0")))
            };
            let (x, y) = (half("xmag")?, half("ymag")?);
            ("orthographic", y, Some(x / y))
        }
        other => {
            let text = format!("'{other}' is no kind of camera");
            return Err(kind.problem(text));
        }
    };
    let ours = extras::of(c, NAMES, notes)?;
    let (mut shift, mut lens) = ([0.0; 2], None);
    if let Some(ours) = &ours {
        shift = ours.numbers_or("shift", shift)?;
        lens = read_lens(ours)?;
    }
    Ok(CameraDesc {
        name,
        kind,
        world_from_camera: world,
        vertical,
        aspect: aspect.filter(|a| a.is_finite() && *a > 0.0),
        shift,
        lens,
    })
}

fn read_lens(ours: &Cursor<'_>) -> Result<Option<Lens>, Problem> {
    let radius = match extras::number(ours, "aperture_radius", 0.0..=1e30, "a length from 0")? {
        Some(r) => r,
        None => match extras::length(ours, "f_stop")? {
            None => return Ok(None),
            Some(stop) => match extras::length(ours, "focal_length")? {
                Some(f) => 0.5 * f / stop,
                None => return Err(ours.problem("has an f_stop, but no focal_length")),
            },
        },
    };
    let focus = extras::length(ours, "focus_distance")?
        .ok_or_else(|| ours.problem("has an aperture, but no focus_distance"))?;
    let blades = ours.index_or("blades", 0)?;
    if !(blades == 0 || (3..=1000).contains(&blades)) {
        let at = ours.need("blades")?;
        return Err(at.problem(format!("{blades} is neither 0 nor a number of corners")));
    }
    let turn = -TAU..=TAU;
    Ok(Some(Lens {
        radius,
        focus,
        blades: blades as u32,
        rotation: extras::number(ours, "blade_rotation", turn, "an angle in radians")?
            .unwrap_or(0.0),
        ratio: extras::length(ours, "aperture_ratio")?.unwrap_or(1.0),
    }))
}
