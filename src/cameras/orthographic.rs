//! `orthographic`: parallel rays.

use super::{Camera, CameraDesc, CameraEntry};
use crate::math::DVec3;

struct Orthographic {
    origin: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    /// In parts of the half sizes.
    shift: [f64; 2],
}

impl Camera for Orthographic {
    #[inline]
    fn ray(&self, x: f64, y: f64, _lens: [f64; 2]) -> (DVec3, DVec3) {
        let [sx, sy] = self.shift;
        let o = self.origin + self.right * (2.0 * x - 1.0 + sx) + self.up * (1.0 - 2.0 * y + sy);
        (o, self.forward)
    }

    fn project(&self, p: DVec3) -> Option<([f64; 2], DVec3)> {
        let d = p - self.origin;
        let depth = d.dot(self.forward);
        let [sx, sy] = self.shift;
        let along = |axis: DVec3| d.dot(axis) / axis.length_squared();
        let at = [
            0.5 * (along(self.right) + 1.0 - sx),
            0.5 * (1.0 + sy - along(self.up)),
        ];
        (depth > 0.0).then(|| (at, p - self.forward * depth))
    }
}

fn build(d: &CameraDesc, aspect: f64) -> Result<Box<dyn Camera>, String> {
    if !(d.vertical > 0.0 && d.vertical.is_finite()) {
        return Err(format!("ymag {} is not positive", d.vertical));
    }
    let m = d.world_from_camera.matrix3;
    let axis = |v: DVec3| {
        v.try_normalize()
            .ok_or("its node has a scale of zero".to_string())
    };
    Ok(Box::new(Orthographic {
        origin: d.world_from_camera.translation,
        right: axis(m.x_axis)? * (d.vertical * aspect),
        up: axis(m.y_axis)? * d.vertical,
        forward: -axis(m.z_axis)?,
        shift: d.shift.map(|s| 2.0 * s),
    }))
}

/// The registry's line.
pub(super) const ENTRY: CameraEntry = CameraEntry {
    name: "orthographic",
    doc: "parallel rays",
    build,
};
