//! `perspective`: a pinhole.

use super::{Camera, CameraDesc, CameraEntry};
use crate::math::{DMat3, DVec3};

struct Perspective {
    origin: DVec3,
    /// Columns: right and up scaled by the half sizes of the image at distance one, and forward.
    basis: DMat3,
    /// Inverse of `basis`.
    from_world: DMat3,
    /// In parts of the half sizes.
    shift: [f64; 2],
}

impl Camera for Perspective {
    #[inline]
    fn ray(&self, x: f64, y: f64, _lens: [f64; 2]) -> (DVec3, DVec3) {
        let [sx, sy] = self.shift;
        let d = self.basis * DVec3::new(2.0 * x - 1.0 + sx, 1.0 - 2.0 * y + sy, 1.0);
        (self.origin, d.normalize())
    }

    fn project(&self, p: DVec3) -> Option<([f64; 2], DVec3)> {
        let q = self.from_world * (p - self.origin);
        let [sx, sy] = self.shift;
        let at = [0.5 * (q.x / q.z + 1.0 - sx), 0.5 * (1.0 + sy - q.y / q.z)];
        (q.z > 0.0 && at.iter().all(|x| x.is_finite())).then_some((at, self.origin))
    }
}

fn build(d: &CameraDesc, aspect: f64) -> Result<Box<dyn Camera>, String> {
    if !(d.vertical > 0.0 && d.vertical < std::f64::consts::PI) {
        return Err(format!("yfov {} is not between 0 and π", d.vertical));
    }
    let m = d.world_from_camera.matrix3;
    let axis = |v: DVec3| {
        v.try_normalize()
            .ok_or("its node has a scale of zero".to_string())
    };
    let h = (0.5 * d.vertical).tan();
    let basis = DMat3::from_cols(
        axis(m.x_axis)? * (h * aspect),
        axis(m.y_axis)? * h,
        -axis(m.z_axis)?,
    );
    Ok(Box::new(Perspective {
        origin: d.world_from_camera.translation,
        basis,
        from_world: basis.inverse(),
        shift: d.shift.map(|s| 2.0 * s),
    }))
}

/// The registry's line.
pub(super) const ENTRY: CameraEntry = CameraEntry {
    name: "perspective",
    doc: "a pinhole camera",
    build,
};
