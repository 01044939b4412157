//! Cameras (glTF 2.0, 3.10).

use super::Problem;
use super::json::Cursor;
use crate::cameras::CameraDesc;
use crate::math::DAffine3;

/// Reads the camera `c` of a node that stands at `world`.
pub(super) fn read(c: &Cursor<'_>, name: String, world: DAffine3) -> Result<CameraDesc, Problem> {
    let kind = c.need("type")?;
    let (kind, vertical, aspect) = match kind.str()? {
        "perspective" => {
            let p = c.need("perspective")?;
            let aspect = p.get("aspectRatio").map(|a| a.f64()).transpose()?;
            ("perspective", p.need("yfov")?.f64()?, aspect)
        }
        "orthographic" => {
            let o = c.need("orthographic")?;
            let (x, y) = (o.need("xmag")?.f64()?, o.need("ymag")?.f64()?);
            ("orthographic", y, Some(x / y))
        }
        other => {
            let text = format!("'{other}' is no kind of camera");
            return Err(kind.problem(text));
        }
    };
    Ok(CameraDesc {
        name,
        kind,
        world_from_camera: world,
        vertical,
        aspect: aspect.filter(|a| a.is_finite() && *a > 0.0),
    })
}
