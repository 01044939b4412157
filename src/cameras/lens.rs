//! A thin lens in front of any camera: what lies at the focus distance is sharp, the rest blurs
//! by the shape of the aperture (Potmesil and Chakravarty, *A Lens and Aperture Camera Model for
//! Synthetic Image Generation*, 1981).

use std::f64::consts::TAU;

use super::{Camera, CameraDesc};
use crate::math::DVec3;
use crate::sampling::warp;

/// The lens of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the aperture in metres; of the circle through its corners if it has blades.
    pub radius: f64,
    /// Distance in metres, along the direction of view, of the plane that is sharp.
    pub focus: f64,
    /// Corners of the aperture; fewer than three for a circle.
    pub blades: u32,
    /// Turn of the aperture in radians, counter-clockwise as seen from behind the camera.
    pub rotation: f64,
    /// Height over width of the aperture: above 1 for an anamorphic lens.
    pub ratio: f64,
}

struct ThinLens {
    inner: Box<dyn Camera>,
    lens: Lens,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
}

impl Camera for ThinLens {
    fn ray(&self, x: f64, y: f64, lens: [f64; 2]) -> (DVec3, DVec3) {
        let (o, d) = self.inner.ray(x, y, lens);
        // Where the ray through the lens's middle meets the plane that is sharp.
        let target = o + d * (self.lens.focus / d.dot(self.forward));
        let [a, b] = aperture(&self.lens, lens);
        let from = o + self.right * a + self.up * b;
        (from, (target - from).normalize())
    }

    fn project(&self, p: DVec3) -> Option<([f64; 2], DVec3)> {
        self.inner.project(p)
    }

    fn has_lens(&self) -> bool {
        true
    }
}

/// A uniform point of the aperture.
fn aperture(lens: &Lens, u: [f64; 2]) -> [f64; 2] {
    let [x, y] = if lens.blades < 3 {
        warp::disc(u)
    } else {
        // One of the triangles between the middle and two corners.
        let n = f64::from(lens.blades);
        let k = (u[0] * n).floor().min(n - 1.0);
        let [b1, b2] = warp::triangle([u[0] * n - k, u[1]]);
        let corner = |k: f64| (lens.rotation + k / n * TAU).sin_cos();
        let ((s1, c1), (s2, c2)) = (corner(k), corner(k + 1.0));
        [b1 * c1 + b2 * c2, b1 * s1 + b2 * s2]
    };
    [x * lens.radius / lens.ratio, y * lens.radius]
}

/// Puts the lens of `d`, if it has one, in front of `inner`.
///
/// # Errors
/// A lens that is none.
pub fn with_lens(inner: Box<dyn Camera>, d: &CameraDesc) -> Result<Box<dyn Camera>, String> {
    let Some(lens) = d.lens else {
        return Ok(inner);
    };
    let positive = |x: f64| x > 0.0 && x.is_finite();
    if !(positive(lens.focus) && positive(lens.ratio) && lens.radius.is_finite()) {
        return Err(format!(
            "focus distance {} and aperture ratio {} are not both positive",
            lens.focus, lens.ratio
        ));
    }
    if !(lens.radius > 0.0) {
        return Ok(inner);
    }
    let m = d.world_from_camera.matrix3;
    let axis = |v: DVec3| {
        v.try_normalize()
            .ok_or("its node has a scale of zero".to_string())
    };
    Ok(Box::new(ThinLens {
        inner,
        lens,
        right: axis(m.x_axis)?,
        up: axis(m.y_axis)?,
        forward: -axis(m.z_axis)?,
    }))
}

#[cfg(test)]
mod tests {
    use super::super::{CAMERAS, framing};
    use super::*;
    use crate::math::BoundingSphere;
    use crate::sampling::Rng;

    fn camera(lens: Lens) -> (Box<dyn Camera>, CameraDesc) {
        let desc = CameraDesc {
            lens: Some(lens),
            shift: [0.1, -0.2],
            ..framing(
                &BoundingSphere {
                    center: DVec3::new(1.0, 2.0, 3.0),
                    radius: 2.0,
                },
                1.5,
            )
        };
        let kind = CAMERAS.iter().find(|c| c.name == desc.kind).unwrap();
        (
            with_lens((kind.build)(&desc, 1.5).unwrap(), &desc).unwrap(),
            desc,
        )
    }

    const LENS: Lens = Lens {
        radius: 0.3,
        focus: 4.0,
        blades: 0,
        rotation: 0.2,
        ratio: 1.0,
    };

    #[test]
    fn rays_through_all_of_the_lens_meet_in_the_plane_of_focus() {
        let mut rng = Rng::new(1);
        for lens in [
            LENS,
            Lens { blades: 5, ..LENS },
            Lens { ratio: 2.0, ..LENS },
        ] {
            let (camera, desc) = camera(lens);
            let m = desc.world_from_camera;
            for _ in 0..100 {
                let [x, y] = rng.next_2d();
                let (o, d) = camera.ray(x, y, [0.5; 2]);
                let meet = o + d * (4.0 / d.dot(-m.matrix3.z_axis));
                for _ in 0..10 {
                    let (o, d) = camera.ray(x, y, rng.next_2d());
                    assert!((d.length() - 1.0).abs() < 1e-12);
                    assert!((meet - o).cross(d).length() < 1e-9);
                    let off = m.inverse().transform_point3(o);
                    assert!(off.z.abs() < 1e-9);
                    let r = (off.x * lens.ratio).hypot(off.y);
                    assert!(r <= lens.radius * (1.0 + 1e-9), "{r}");
                }
            }
        }
    }

    #[test]
    fn an_aperture_with_blades_is_evenly_filled() {
        // The second moment of a regular polygon of n corners on the unit circle, about its
        // middle: (2 + cos(2π/n)) / 6.
        for blades in [3, 5, 8] {
            let lens = Lens {
                blades,
                radius: 1.0,
                ..LENS
            };
            // A multiple of all three, so that every triangle gets as many points.
            let n = 240;
            let mut sum = 0.0;
            for i in 0..n {
                for j in 0..n {
                    let u = [i, j].map(|k| (f64::from(k) + 0.5) / f64::from(n));
                    let [x, y] = aperture(&lens, u);
                    sum += (x * x + y * y) / f64::from(n * n);
                }
            }
            let want = (2.0 + (TAU / f64::from(blades)).cos()) / 6.0;
            assert!((sum - want).abs() < 1e-3, "{blades}: {sum} {want}");
        }
    }
}
