//! `panel`: a flat area light that nothing can hit, as Blender's area lamps are. It shines from
//! one side; rays and photons pass through it.

use std::f64::consts::{FRAC_PI_4, PI};

use super::{Crossing, EmissionOrigin, LiSample, Light, LightDesc, LightEntry, surface_importance};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::{BoundingSphere, DVec3, Frame, max_abs, robust};
use crate::sampling::warp;

struct Panel {
    center: DVec3,
    /// Edges of the rectangle, or of the one around the ellipse.
    edges: [DVec3; 2],
    /// What gives the coordinates along the edges, from −½ to ½.
    dual: [DVec3; 2],
    round: bool,
    /// Toward where it shines.
    n: DVec3,
    area: f64,
    radiance: Rgb,
    offset: f64,
    seen_by_camera: bool,
}

impl Panel {
    /// A uniform point.
    fn point(&self, u: [f64; 2]) -> DVec3 {
        let [a, b] = if self.round {
            warp::disc(u).map(|x| 0.5 * x)
        } else {
            u.map(|x| x - 0.5)
        };
        self.center + self.edges[0] * a + self.edges[1] * b
    }

    fn around(&self) -> BoundingSphere {
        let [a, b] = self.edges;
        BoundingSphere {
            center: self.center,
            radius: 0.5 * (a + b).length().max((a - b).length()),
        }
    }
}

impl Light for Panel {
    fn power(&self) -> Rgb {
        self.radiance * (PI * self.area)
    }

    fn importance(&self, p: DVec3) -> f64 {
        if (p - self.center).dot(self.n) <= 0.0 {
            return 0.0;
        }
        surface_importance(self.power().luminance(), &self.around(), p)
    }

    fn sample_li(&self, p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        let q = self.point(u);
        let to = q - p;
        let d2 = to.length_squared();
        let wi = to.try_normalize()?;
        let cos = -wi.dot(self.n);
        if !(cos > 0.0) {
            return None;
        }
        Some(LiSample {
            wi,
            target: Some(q + self.n * self.offset),
            radiance: self.radiance,
            pdf: d2 / (cos * self.area),
            delta: false,
        })
    }

    fn pdf_li(&self, _p: DVec3, _on: &SurfacePoint) -> f64 {
        0.0
    }

    fn radiance(&self, _on: &Surface<'_>) -> Rgb {
        Rgb::ZERO
    }

    fn is_bodiless(&self) -> bool {
        true
    }

    fn seen_by_camera(&self) -> bool {
        self.seen_by_camera
    }

    fn crossed(&self, from: DVec3, dir: DVec3, reach: f64) -> Option<Crossing> {
        let cos = -dir.dot(self.n);
        let height = (from - self.center).dot(self.n);
        if !(cos > 0.0 && height > 0.0) {
            return None;
        }
        let t = height / cos;
        if !(t < reach) {
            return None;
        }
        let q = from + dir * t - self.center;
        let [a, b] = self.dual.map(|d| q.dot(d));
        let inside = if self.round {
            a * a + b * b <= 0.25
        } else {
            a.abs() <= 0.5 && b.abs() <= 0.5
        };
        inside.then(|| Crossing {
            radiance: self.radiance,
            pdf: t * t / (cos * self.area),
        })
    }

    fn sample_origin(&self, u: [f64; 2]) -> Option<EmissionOrigin> {
        Some(EmissionOrigin {
            p: self.point(u),
            ng: Some(self.n),
            offset: self.offset,
            pdf_area: 1.0 / self.area,
            radiance: self.radiance,
        })
    }

    fn sample_direction(&self, _from: &EmissionOrigin, u: [f64; 2]) -> (DVec3, f64) {
        let local = warp::cosine_hemisphere(u);
        let dir = Frame::from_normal(self.n).to_world(local);
        (dir, warp::cosine_hemisphere_pdf(local.z))
    }

    fn emitted(&self, _from: &EmissionOrigin, dir: DVec3) -> Rgb {
        self.radiance * self.n.dot(dir).max(0.0)
    }
}

fn build(d: &LightDesc) -> Result<Box<dyn Light>, String> {
    let [a, b] = d.edges;
    let cross = a.cross(b);
    let rectangle = cross.length();
    let n = cross.try_normalize().ok_or("it has no area")?;
    let (da, db) = (b.cross(n) / rectangle, n.cross(a) / rectangle);
    if !(da.is_finite() && db.is_finite()) {
        return Err("it has no area".into());
    }
    let far = max_abs(d.position) + max_abs(a) + max_abs(b);
    Ok(Box::new(Panel {
        center: d.position,
        edges: d.edges,
        dual: [da, db],
        round: d.round,
        n: if n.dot(d.direction) < 0.0 { -n } else { n },
        area: rectangle * if d.round { FRAC_PI_4 } else { 1.0 },
        radiance: d.strength,
        offset: robust::spawn_offset(far),
        seen_by_camera: d.seen_by_camera,
    }))
}

/// The registry's line.
pub(super) const ENTRY: LightEntry = LightEntry {
    name: "panel",
    doc: "a flat area light that shines from one side and that nothing can hit",
    build,
};
