//! A camera for files that bring none: it stands in front of the scene, a little above and to
//! the right, and sees all of it.

use super::CameraDesc;
use crate::math::{BoundingSphere, DAffine3, DVec3};

/// Half the angle of view, in radians, across the narrower side of the image.
const HALF_ANGLE: f64 = 0.35;

/// A perspective camera that just sees `scene` in an image of `aspect` = width / height.
pub fn framing(scene: &BoundingSphere, aspect: f64) -> CameraDesc {
    let toward = DVec3::new(0.5, 0.35, 1.0).normalize();
    let radius = if scene.radius > 0.0 {
        scene.radius
    } else {
        1.0
    };
    let eye = scene.center + toward * (radius / HALF_ANGLE.sin());
    let x = DVec3::Y.cross(toward).normalize();
    let vertical = if aspect >= 1.0 {
        2.0 * HALF_ANGLE
    } else {
        2.0 * (HALF_ANGLE.tan() / aspect).atan()
    };
    CameraDesc {
        name: "auto".into(),
        kind: "perspective",
        world_from_camera: DAffine3::from_cols(x, toward.cross(x), toward, eye),
        vertical,
        aspect: None,
        shift: [0.0; 2],
        lens: None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::CAMERAS;
    use super::*;

    #[test]
    fn the_whole_sphere_is_in_the_picture_and_fills_it() {
        let ball = BoundingSphere {
            center: DVec3::new(3.0, -2.0, 1.0),
            radius: 2.0,
        };
        let kind = CAMERAS.iter().find(|c| c.name == "perspective").unwrap();
        for aspect in [1.0, 2.0, 0.5] {
            let camera = (kind.build)(&framing(&ball, aspect), aspect).unwrap();
            // Distance of the rays through the edges' middles from the centre.
            let miss = |x, y| {
                let (o, d) = camera.ray(x, y, [0.5; 2]);
                (ball.center - o).cross(d).length()
            };
            let edges = [miss(0.0, 0.5), miss(0.5, 0.0)];
            let nearest = edges[0].min(edges[1]);
            assert!((nearest - ball.radius).abs() < 1e-9, "{aspect}: {edges:?}");
            assert!(miss(0.5, 0.5) < 1e-12);
        }
    }
}
