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

    /// The image point at which `p` is seen, and from where; `None` if `p` is not before the camera.
    /// Of cameras with a lens, through its middle.
    fn project(&self, p: DVec3) -> Option<([f64; 2], DVec3)>;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::BoundingSphere;
    use crate::sampling::Rng;

    #[test]
    fn a_point_is_seen_where_its_ray_leaves_the_image() {
        let around = BoundingSphere {
            center: DVec3::new(1.0, 2.0, 3.0),
            radius: 2.0,
        };
        let mut rng = Rng::new(3);
        for entry in CAMERAS {
            for lens in [false, true] {
                let desc = CameraDesc {
                    shift: [0.1, -0.2],
                    lens: lens.then_some(Lens {
                        radius: 0.1,
                        focus: 2.5,
                        blades: 0,
                        rotation: 0.0,
                        ratio: 1.0,
                    }),
                    ..framing(&around, 1.5)
                };
                let camera = (entry.build)(&desc, 1.5).expect("builds");
                let camera = with_lens(camera, &desc).expect("a lens");
                for _ in 0..100 {
                    let at = rng.next_2d();
                    let (o, d) = camera.ray(at[0], at[1], [0.5; 2]);
                    let (back, from) = camera.project(o + 2.5 * d).expect("before the camera");
                    for (a, b) in at.into_iter().zip(back) {
                        assert!((a - b).abs() < 1e-9, "{}: {at:?} {back:?}", entry.name);
                    }
                    assert!((from - o).length() < 1e-9);
                    assert!(camera.project(o - 2.5 * d).is_none());
                }
            }
        }
    }
}
