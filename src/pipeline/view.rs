//! From where a scene is seen, and which part of the image is wanted.

use super::RenderSettings;
use crate::cameras::{Camera, framing, with_lens};
use crate::error::{Error, Result};
use crate::integrators::Region;
use crate::plugins::Registry;
use crate::scene::Scene;

/// The name by which a camera is asked for that frames the whole scene.
pub const AUTO_CAMERA: &str = "auto";

/// The camera that the settings name, or the first of the scene; one that frames the whole scene
/// where there is none.
///
/// # Errors
/// A name that no camera has, a camera that cannot be.
pub fn choose_camera(
    scene: &Scene,
    settings: &RenderSettings,
    registry: &Registry,
) -> Result<Box<dyn Camera>> {
    let aspect = f64::from(settings.width) / f64::from(settings.height);
    let desc = match &settings.camera {
        None => scene.cameras.first(),
        Some(name) => {
            let named = scene.cameras.iter().find(|c| c.name == *name);
            if named.is_none() && name != AUTO_CAMERA {
                let names = scene.cameras.iter().map(|c| c.name.as_str());
                return Err(Error::UnknownPlugin {
                    kind: "camera",
                    name: name.clone(),
                    known: names.chain([AUTO_CAMERA]).collect::<Vec<_>>().join(", "),
                });
            }
            named
        }
    };
    let framed;
    let desc = if let Some(desc) = desc {
        desc
    } else {
        framed = framing(&scene.bounds.bounding_sphere(), aspect);
        &framed
    };
    let entry = registry.cameras.find(desc.kind)?;
    (entry.build)(desc, aspect)
        .and_then(|camera| with_lens(camera, desc))
        .map_err(|e| Error::Usage(format!("camera '{}': {e}", desc.name)))
}

pub(super) fn region(settings: &RenderSettings) -> Result<Region> {
    let (w, h) = (settings.width, settings.height);
    if w == 0 || h == 0 || settings.spp == 0 {
        return Err(Error::Usage(
            "an image needs at least one pixel and one sample".into(),
        ));
    }
    let [x0, y0, x1, y1] = settings.crop.unwrap_or([0, 0, w, h]);
    if x0 >= x1 || y0 >= y1 || x1 > w || y1 > h {
        return Err(Error::Usage(format!(
            "crop {x0},{y0},{x1},{y1} is not a rectangle within 0,0,{w},{h}"
        )));
    }
    Ok(Region { x0, y0, x1, y1 })
}
