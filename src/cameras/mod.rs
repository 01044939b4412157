//! Cameras: rays for points of the image. A camera kind is one file and one line in [`CAMERAS`].

mod framing;
mod lens;
mod orthographic;
mod perspective;

pub use framing::framing;
pub use lens::{Lens, with_lens};

use crate::math::{DAffine3, DVec3};

/// Where a camera stands and how it projects.
#[derive(Clone, Debug)]
pub struct CameraDesc {
    /// Name, for `--camera`.
    pub name: String,
    /// Kind: a name of [`CAMERAS`].
    pub kind: &'static str,
    /// World from camera space; the camera looks along its `−z`, `+y` is up.
    pub world_from_camera: DAffine3,
    /// Perspective: vertical field of view in radians. Orthographic: half the height in metres.
    pub vertical: f64,
    /// Width over height that the file asks for, if it does.
    pub aspect: Option<f64>,
    /// How far the image is moved right and up, in parts of its width and height.
    pub shift: [f64; 2],
    /// The lens; a pinhole if there is none.
    pub lens: Option<Lens>,
}

/// A camera for images of a given aspect ratio.
pub trait Camera: Send + Sync {
    /// Origin and unit direction of the ray through the image point `(x, y)`, both in `0..1`,
    /// `y` downward. World space. `lens` chooses a point of the lens, for cameras that have one.
    fn ray(&self, x: f64, y: f64, lens: [f64; 2]) -> (DVec3, DVec3);

    /// Whether `lens` makes a difference to [`ray`](Self::ray).
    fn has_lens(&self) -> bool {
        false
    }
}

/// A camera kind that can be chosen.
#[derive(Clone, Copy, Debug)]
pub struct CameraEntry {
    /// Name.
    pub name: &'static str,
    /// One sentence.
    pub doc: &'static str,
    /// Makes the camera for images of `aspect` = width / height.
    pub build: fn(&CameraDesc, aspect: f64) -> Result<Box<dyn Camera>, String>,
}

crate::registry::impl_entry!(CameraEntry, "camera");

/// The camera kinds.
pub static CAMERAS: &[CameraEntry] = &[perspective::ENTRY, orthographic::ENTRY];
