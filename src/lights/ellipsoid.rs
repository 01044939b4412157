//! `ellipsoid`: emissive spheres under an affine map that does not keep them round.
//!
//! In the space before the map they are spheres. There a direction is chosen in the cone that
//! they fill, and carried over: with the linear part `M` and a unit direction `d`, solid angle
//! grows by `|det M| / |M d|³`.

use std::f64::consts::PI;

use super::{EmissionOrigin, LiSample, Light, LightDesc, LightEntry, surface_importance};
use crate::color::Rgb;
use crate::geometry::{Surface, SurfacePoint};
use crate::math::{Aabb, BoundingSphere, DAffine3, DMat3, DVec3, Frame, max_abs, robust};
use crate::sampling::{Discrete, warp};

struct EllipsoidLight {
    radiance: Rgb,
    /// Before the map.
    spheres: Vec<BoundingSphere>,
    choose: Discrete,
    world: DAffine3,
    inverse: DAffine3,
    /// `det M · M⁻ᵀ`: carries vector areas.
    cofactor: DMat3,
    /// `|det M|`.
    det: f64,
    /// Of all of them, m².
    area: f64,
    around: BoundingSphere,
}

/// `1 − cos θ_max` of the cone that `s` fills seen from outside; `None` from within or upon it.
#[inline]
fn cone_complement(s: &BoundingSphere, p: DVec3) -> Option<f64> {
    let d2 = (s.center - p).length_squared();
    let r2 = s.radius * s.radius;
    if !(d2 > r2 * (1.0 + 1e-9)) {
        return None;
    }
    let sin2 = r2 / d2;
    // sin² / (1 + cos) does not cancel for a far sphere.
    Some(sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt()))
}

impl EllipsoidLight {
    /// Outward unit normal in the world where it is `n` before the map.
    #[inline]
    fn normal(&self, n: DVec3) -> DVec3 {
        (self.inverse.matrix3.transpose() * n).normalize_or_zero()
    }

    fn offset(&self, s: &BoundingSphere) -> f64 {
        let m = &self.world.matrix3;
        let stretch = m.x_axis.length() + m.y_axis.length() + m.z_axis.length();
        let reach = (max_abs(s.center) + s.radius) * stretch + max_abs(self.world.translation);
        robust::spawn_offset(reach)
    }

    /// Density of [`Light::sample_li`] along the unit direction `wi`, once a sphere is chosen.
    #[inline]
    fn pdf_along(&self, complement: f64, wi: DVec3) -> f64 {
        let shrink = self.inverse.transform_vector3(wi).length();
        warp::cone_pdf(complement) / (self.det * shrink * shrink * shrink)
    }
}

impl Light for EllipsoidLight {
    fn power(&self) -> Rgb {
        self.radiance * (PI * self.area)
    }

    fn importance(&self, p: DVec3) -> f64 {
        surface_importance(self.power().luminance(), &self.around, p)
    }

    fn sample_li(&self, p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        let (i, p_choose, rest) = self.choose.sample(u[0])?;
        let s = &self.spheres[i];
        let local = self.inverse.transform_point3(p);
        let to_center = s.center - local;
        // From within, only the back is seen, which emits nothing.
        let complement = cone_complement(s, local)?;
        let dist = to_center.length();
        let d = warp::cone_from_complement([rest, u[1]], complement);
        let sin2 = 1.0 - d.z * d.z;
        let half = (s.radius * s.radius - dist * dist * sin2).max(0.0).sqrt();
        let d = Frame::from_normal(to_center / dist).to_world(d);
        let along = dist * d.dot(to_center / dist) - half;
        let n = (local + d * along - s.center).try_normalize()?;
        let q = self.world.transform_point3(s.center + n * s.radius);
        let wi = (q - p).try_normalize()?;
        let ng = self.normal(n);
        if -wi.dot(ng) <= 0.0 {
            return None;
        }
        Some(LiSample {
            wi,
            target: Some(q + ng * self.offset(s)),
            radiance: self.radiance,
            pdf: self.pdf_along(complement, wi) * p_choose,
            delta: false,
        })
    }

    fn pdf_li(&self, p: DVec3, on: &SurfacePoint) -> f64 {
        let i = on.prim as usize;
        let local = self.inverse.transform_point3(p);
        let complement = self.spheres.get(i).and_then(|s| cone_complement(s, local));
        complement.map_or(0.0, |c| {
            self.pdf_along(c, -on.wo) * self.choose.probability(i)
        })
    }

    fn radiance(&self, on: &Surface<'_>) -> Rgb {
        if on.sp.front {
            self.radiance
        } else {
            Rgb::ZERO
        }
    }

    fn sample_origin(&self, u: [f64; 2]) -> Option<EmissionOrigin> {
        let (i, p_choose, rest) = self.choose.sample(u[0])?;
        let s = &self.spheres[i];
        let n = warp::sphere([rest, u[1]]);
        // Uniform on the sphere, so denser where the map stretches less.
        let growth = (self.cofactor * n).length();
        Some(EmissionOrigin {
            p: self.world.transform_point3(s.center + n * s.radius),
            ng: Some(self.normal(n)),
            offset: self.offset(s),
            pdf_area: p_choose / (4.0 * PI * s.radius * s.radius * growth),
            radiance: self.radiance,
        })
    }

    fn sample_direction(&self, from: &EmissionOrigin, u: [f64; 2]) -> (DVec3, f64) {
        let local = warp::cosine_hemisphere(u);
        let frame = Frame::from_normal(from.ng.unwrap_or(DVec3::Z));
        (frame.to_world(local), warp::cosine_hemisphere_pdf(local.z))
    }

    fn emitted(&self, from: &EmissionOrigin, dir: DVec3) -> Rgb {
        self.radiance * from.ng.map_or(0.0, |n| n.dot(dir)).max(0.0)
    }
}

/// Area by which the unit sphere's surface grows to that of the ellipsoid: the mean of `|C n|`
/// over the sphere, `C` the cofactor matrix. That is Carlson's `R_G` of the squared singular
/// values (NIST DLMF, 19.33.2).
fn mean_growth(cofactor: &DMat3) -> f64 {
    let mut e = eigenvalues(cofactor.transpose() * *cofactor).map(|x| x.max(0.0));
    e.sort_by(f64::total_cmp);
    let [x, z, y] = e;
    if !(z > 0.0) {
        return 0.5 * y.sqrt();
    }
    // DLMF 19.21.10; with z in the middle no term is negative.
    let root = (x * y / z).sqrt();
    0.5 * (z * carlson_f(x, y, z) + (z - x) * (y - z) * carlson_d(x, y, z) / 3.0 + root)
}

/// Eigenvalues of a symmetric matrix by Jacobi's rotations, scaled by its largest entry.
fn eigenvalues(m: DMat3) -> [f64; 3] {
    let scale = max_abs(m.x_axis)
        .max(max_abs(m.y_axis))
        .max(max_abs(m.z_axis));
    if !(scale > 0.0 && scale.is_finite()) {
        return [0.0; 3];
    }
    let mut a = (m * (1.0 / scale)).to_cols_array_2d();
    // Convergence is quadratic; a handful of sweeps reaches the last digit.
    for _ in 0..16 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let c = 1.0 / t.hypot(1.0);
            let s = t * c;
            let mut r = [[0.0; 3]; 3];
            for (k, row) in r.iter_mut().enumerate() {
                row[k] = 1.0;
            }
            (r[p][p], r[q][q], r[p][q], r[q][p]) = (c, c, -s, s);
            let r = DMat3::from_cols_array_2d(&r);
            a = (r.transpose() * DMat3::from_cols_array_2d(&a) * r).to_cols_array_2d();
            (a[p][q], a[q][p]) = (0.0, 0.0);
        }
    }
    [a[0][0] * scale, a[1][1] * scale, a[2][2] * scale]
}

/// Carlson's `R_F` by duplication (B. C. Carlson, *Numerical computation of real or complex
/// elliptic integrals*, Numerical Algorithms 10, 1995).
fn carlson_f(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    // Each step divides the spread by four.
    for _ in 0..64 {
        let (sx, sy, sz) = (x.sqrt(), y.sqrt(), z.sqrt());
        let lambda = sx * sy + sy * sz + sz * sx;
        (x, y, z) = (
            0.25 * (x + lambda),
            0.25 * (y + lambda),
            0.25 * (z + lambda),
        );
    }
    ((x + y + z) / 3.0).sqrt().recip()
}

/// Carlson's `R_D` by duplication, as [`carlson_f`].
fn carlson_d(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    let (mut sum, mut factor) = (0.0, 1.0);
    for _ in 0..64 {
        let (sx, sy, sz) = (x.sqrt(), y.sqrt(), z.sqrt());
        let lambda = sx * sy + sy * sz + sz * sx;
        sum += factor / (sz * (z + lambda));
        factor *= 0.25;
        (x, y, z) = (
            0.25 * (x + lambda),
            0.25 * (y + lambda),
            0.25 * (z + lambda),
        );
    }
    3.0 * sum + factor * ((x + y + 3.0 * z) / 5.0).powf(-1.5)
}

fn build(d: &LightDesc) -> Result<Box<dyn Light>, String> {
    let m = d.world.matrix3;
    let inverse = d.world.inverse();
    let det = m.determinant().abs();
    if !(det > 0.0) || !inverse.is_finite() {
        return Err("its transform is singular".into());
    }
    // All of them grow alike, so their areas compare as before the map.
    let choose = Discrete::new(d.spheres.iter().map(|s| 4.0 * PI * s.radius * s.radius));
    if choose.is_empty() {
        return Err("its spheres have no area".into());
    }
    let cofactor = DMat3::from_cols(
        m.y_axis.cross(m.z_axis),
        m.z_axis.cross(m.x_axis),
        m.x_axis.cross(m.y_axis),
    );
    let mut around = Aabb::EMPTY;
    for s in &d.spheres {
        // Along each axis the ellipsoid reaches as far as the map's row is long.
        let rows = m.transpose();
        let reach = DVec3::new(
            rows.x_axis.length(),
            rows.y_axis.length(),
            rows.z_axis.length(),
        ) * s.radius;
        let center = d.world.transform_point3(s.center);
        around = around.union(Aabb {
            min: center - reach,
            max: center + reach,
        });
    }
    Ok(Box::new(EllipsoidLight {
        radiance: d.strength,
        area: choose.total() * mean_growth(&cofactor),
        spheres: d.spheres.clone(),
        choose,
        world: d.world,
        inverse,
        cofactor,
        det,
        around: around.bounding_sphere(),
    }))
}

/// The registry's line.
pub(super) const ENTRY: LightEntry = LightEntry {
    name: "ellipsoid",
    doc: "emissive ellipsoids, sampled by the cone they fill before they are stretched",
    build,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_of_spheroids_are_the_closed_forms() {
        let turn = DMat3::from_quat(crate::math::DQuat::from_rotation_arc(
            DVec3::Z,
            DVec3::new(0.36, 0.48, 0.8),
        ));
        let growth = |a: f64, b: f64, c: f64| {
            let m = turn * DMat3::from_diagonal(DVec3::new(a, b, c)) * turn.transpose();
            let cofactor = DMat3::from_cols(
                m.y_axis.cross(m.z_axis),
                m.z_axis.cross(m.x_axis),
                m.x_axis.cross(m.y_axis),
            );
            mean_growth(&cofactor)
        };
        let close = |x: f64, y: f64| assert!((x / y - 1.0).abs() < 1e-12, "{x} is {y}");
        close(growth(1.0, 1.0, 1.0), 1.0);
        close(growth(0.1, 0.1, 0.1), 0.01);
        for c in [1.001, 2.0, 100.0f64] {
            let e = (1.0 - 1.0 / (c * c)).sqrt();
            close(growth(1.0, 1.0, c), 0.5 * (1.0 + c / e * e.asin()));
            close(growth(c, 1.0, 1.0), growth(1.0, 1.0, c));
            // Oblate: c, c, 1.
            let oblate = 0.5 * (c * c + e.atanh() / e);
            close(growth(c, 1.0, c), oblate);
        }
        // A leaf has two sides: half the area of the sphere's disc, twice.
        assert!((growth(1.0, 1.0, 1e-9) - 0.5).abs() < 1e-12);
    }
}
