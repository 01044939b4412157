//! How a ray, and the point it meets, change with the pixel: ray differentials through
//! reflection and refraction.
//!
//! Nothing is derived by hand. The chain — meeting the plane of a triangle or a sphere, the
//! interpolated normal, reflection, refraction — is written once over [`Real`] and runs on a
//! scalar that carries its derivatives along the two directions of the image.
//!
//! Source: Igehy, *Tracing Ray Differentials*, 1999; Suykens and Willems, *Path Differentials and
//! Applications*, 2001 (what to do at other surfaces than mirrors).

use super::object::Placement;
use super::{Footprint, Geometry, Ray, Shape, SurfacePoint, sphere, triangle};
use crate::ad::{Dual, Real, V3};
use crate::math::{DAffine3, DMat3, DVec3, Frame, Vec3};

// The functions of this file are kept out of line: most scenes have no texture, and then the
// loops of the integrators should not carry them.

/// Share of a lobe's solid angle `1/pdf` that one sample of it stands for. It is a choice between
/// noise and blur: at this one a glossy reflection of a texture comes out wider by 3 % (widths
/// add in quadrature).
const SHARE: f64 = 1.0 / 16.0;

/// Derivatives of a ray's origin and unit direction per pixel to the right and down. World
/// space; where pixels are sampled more than once, per distance between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Differential {
    /// Of the origin.
    pub origin: [DVec3; 2],
    /// Of the direction.
    pub direction: [DVec3; 2],
}

/// Where a ray with a [`Differential`] landed.
#[derive(Clone, Copy, Debug)]
pub struct Landing {
    /// Derivatives of the position.
    point: [DVec3; 2],
    /// Of the unit shading normal `sp.n`.
    normal: [DVec3; 2],
    /// Of the ray's unit direction.
    direction: [DVec3; 2],
}

impl Differential {
    /// Carries the differential of `ray` to the point `sp` that it met. `None` where it has no
    /// derivative, as at the rim of a sphere.
    #[inline(never)]
    pub fn land(&self, geometry: &Geometry, ray: &Ray, sp: &SurfacePoint) -> Option<Landing> {
        let object = geometry.object(sp.object);
        let o = V3::with_derivatives(ray.origin(), self.origin);
        let d = V3::with_derivatives(-sp.wo, self.direction);
        let (p, n) = meet(
            o,
            d,
            geometry.shape(object.shape),
            object.placement.as_ref(),
            sp,
        )?;
        Some(Landing {
            point: p.derivatives()?,
            normal: n.derivatives()?,
            direction: self.direction,
        })
    }
}

impl Landing {
    /// The area that the point stands for.
    #[inline]
    pub fn footprint(&self) -> Footprint {
        Footprint {
            dpdx: self.point[0],
            dpdy: self.point[1],
        }
    }

    /// The differential of the ray that leaves `sp` along the unit direction `wi`, a mirror-like
    /// reflection or refraction. Its index of refraction is read off the two directions.
    #[inline(never)]
    pub fn follow(&self, sp: &SurfacePoint, wi: DVec3) -> Differential {
        let d = V3::with_derivatives(-sp.wo, self.direction);
        let (cos_o, cos_i) = (sp.wo.dot(sp.n), wi.dot(sp.n));
        let out = if cos_o * cos_i > 0.0 {
            // The normal that was reflected at, which a normal map may have turned.
            let h = (sp.wo + wi).try_normalize().unwrap_or(sp.n);
            let side = if h.dot(sp.n) < 0.0 { -1.0 } else { 1.0 };
            Some(reflect(
                d,
                V3::with_derivatives(h, self.normal.map(|v| v * side)),
            ))
        } else {
            let sin = |v: DVec3, cos: f64| (v - sp.n * cos).length();
            let (sin_o, sin_i) = (sin(sp.wo, cos_o), sin(wi, cos_i));
            // Straight down nothing tells the index; what bends there is second order.
            let eta = if sin_o > 1e-9 { sin_i / sin_o } else { 1.0 };
            let side = if cos_o < 0.0 { -1.0 } else { 1.0 };
            let n = V3::with_derivatives(sp.n * side, self.normal.map(|v| v * side));
            refract(d, n, Dual::constant(eta.clamp(0.2, 5.0)))
        };
        Differential {
            origin: self.point,
            direction: out.and_then(V3::derivatives).unwrap_or(self.direction),
        }
    }

    /// The differential of a ray that leaves along `wi`, drawn from a lobe with density `pdf` in
    /// solid angle. It stands for a share of `1/pdf` around itself, or for what the surface as a
    /// mirror would make of it, whichever is larger.
    #[inline(never)]
    pub fn spread(&self, sp: &SurfacePoint, wi: DVec3, pdf: f64) -> Differential {
        let solid_angle = (SHARE / pdf).min(SHARE * std::f64::consts::TAU);
        let radius = (solid_angle * std::f64::consts::FRAC_1_PI).sqrt();
        let mut out = self.follow(sp, wi);
        let [x, y] = out.direction;
        if !(x.cross(y).length() > radius * radius) {
            let frame = Frame::from_normal(wi);
            out.direction = [frame.x * radius, frame.y * radius];
        }
        out
    }
}

/// Position and unit shading normal where the line `o + t·d` meets the primitive of `sp`, near
/// `sp`. World space.
fn meet<R: Real>(
    o: V3<R>,
    d: V3<R>,
    shape: &Shape,
    place: Option<&Placement>,
    sp: &SurfacePoint,
) -> Option<(V3<R>, V3<R>)> {
    let (lo, ld) = match place {
        None => (o, d),
        Some(place) => {
            let inv = &place.object_from_world;
            (point(inv, o), vector(&inv.matrix3, d))
        }
    };
    let (p, n) = match shape {
        Shape::Mesh(mesh) => {
            let [a, b, c] = mesh.corners(sp.prim);
            let (e1, e2) = (b - a, c - a);
            let hit = triangle::plane_hit(lo, ld, a, e1, e2, e1.cross(e2))?;
            let p = V3::constant(a) + V3::constant(e1) * hit.b1 + V3::constant(e2) * hit.b2;
            let n = if mesh.normals.is_empty() {
                V3::constant(e1.cross(e2))
            } else {
                let [a, b, c] = mesh.indices[sp.prim as usize]
                    .map(|i| Vec3::from(mesh.normals[i as usize]).as_dvec3());
                V3::constant(a) + V3::constant(b - a) * hit.b1 + V3::constant(c - a) * hit.b2
            };
            (p, n)
        }
        Shape::Spheres(set) => {
            let (center, r) = set.get(sp.prim);
            let roots = sphere::line_sphere(lo, ld, center, r).roots()?;
            let off = |t: &R| (t.re() - sp.distance).abs();
            let t = roots.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
            let p = lo + ld * t;
            (p, p - V3::constant(center))
        }
    };
    let (p, n) = match place {
        None => (p, n),
        Some(place) => (
            point(&place.world_from_object, p),
            vector(&place.object_from_world.matrix3.transpose(), n),
        ),
    };
    let length = n.dot(n);
    if !(length.re() > 0.0) {
        return None;
    }
    let n = n * (R::constant(1.0) / length.sqrt());
    Some((p, if n.re().dot(sp.n) < 0.0 { -n } else { n }))
}

/// `d` mirrored at the plane of unit normal `n`.
fn reflect<R: Real>(d: V3<R>, n: V3<R>) -> V3<R> {
    d - n * (R::constant(2.0) * d.dot(n))
}

/// The unit vector `d` refracted at unit normal `n` on the side it comes from; `eta` is the index
/// of that side over the other's. `None` if all is reflected.
fn refract<R: Real>(d: V3<R>, n: V3<R>, eta: R) -> Option<V3<R>> {
    let one = R::constant(1.0);
    let cos_i = -d.dot(n);
    let cos2 = one - eta * eta * (one - cos_i * cos_i);
    if !(cos2.re() > 1e-9) {
        return None;
    }
    Some(d * eta + n * (eta * cos_i - cos2.sqrt()))
}

fn vector<R: Real>(m: &DMat3, v: V3<R>) -> V3<R> {
    V3::constant(m.x_axis) * v.x + V3::constant(m.y_axis) * v.y + V3::constant(m.z_axis) * v.z
}

fn point<R: Real>(m: &DAffine3, p: V3<R>) -> V3<R> {
    vector(&m.matrix3, p) + V3::constant(m.translation)
}
