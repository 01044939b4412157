//! A surface point with the data that its primitive carries: what textures and materials read.

use super::object::Placement;
use super::{Geometry, Shape, SurfacePoint, TriangleMesh};
use crate::math::DVec3;

/// How far a surface point moves as the camera ray moves by one pixel, in metres, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Per pixel to the right.
    pub dpdx: DVec3,
    /// Per pixel down.
    pub dpdy: DVec3,
}

/// A surface point with access to its primitive. Everything is computed on demand, so that
/// materials without textures pay nothing.
#[derive(Clone, Copy)]
pub struct Surface<'a> {
    /// The point.
    pub sp: &'a SurfacePoint,
    /// The area it stands for, if that is known.
    pub footprint: Option<Footprint>,
    geometry: Option<&'a Geometry>,
}

impl<'a> Surface<'a> {
    /// The point `sp` of `geometry`.
    #[inline]
    pub fn new(geometry: &'a Geometry, sp: &'a SurfacePoint, footprint: Option<Footprint>) -> Self {
        Self {
            sp,
            footprint,
            geometry: Some(geometry),
        }
    }

    /// A point whose primitive carries no data.
    #[inline]
    pub fn bare(sp: &'a SurfacePoint) -> Self {
        Self {
            sp,
            footprint: None,
            geometry: None,
        }
    }

    fn shape(&self) -> Option<&'a Shape> {
        let geometry = self.geometry?;
        Some(geometry.shape(geometry.object(self.sp.object).shape))
    }

    fn placement(&self) -> Option<&'a Placement> {
        self.geometry?.object(self.sp.object).placement.as_ref()
    }

    fn mesh(&self) -> Option<&'a TriangleMesh> {
        match self.shape() {
            Some(Shape::Mesh(mesh)) => Some(mesh),
            _ => None,
        }
    }

    /// Texture coordinates of one set. On a sphere: longitude and colatitude about the local
    /// `z` axis, both from 0 to 1.
    #[inline]
    pub fn uv(&self, set: usize) -> [f64; 2] {
        match self.shape() {
            Some(Shape::Mesh(mesh)) => mesh.uv(set, self.sp.prim, self.sp.barycentrics),
            Some(Shape::Spheres(_)) => {
                let n = self.local_normal();
                let u = n.y.atan2(n.x) * (0.5 * std::f64::consts::FRAC_1_PI);
                [
                    if u < 0.0 { u + 1.0 } else { u },
                    n.z.clamp(-1.0, 1.0).acos() * std::f64::consts::FRAC_1_PI,
                ]
            }
            None => [0.0; 2],
        }
    }

    fn local_normal(&self) -> DVec3 {
        match self.placement() {
            None => self.sp.ng,
            // A covector goes back by the transpose.
            Some(place) => {
                (place.world_from_object.matrix3.transpose() * self.sp.ng).normalize_or(DVec3::Z)
            }
        }
    }

    /// Vertex colour and alpha, linear; white where there is none.
    #[inline]
    pub fn color(&self) -> [f64; 4] {
        self.mesh()
            .and_then(|m| m.interpolate(&m.colors, self.sp.prim, self.sp.barycentrics))
            .unwrap_or([1.0; 4])
    }

    /// How the world-space position changes with the texture coordinates of one set
    /// (`∂p/∂u`, `∂p/∂v`), and in both directions with the parameters of a sphere; `None` where
    /// the coordinates span no area.
    pub fn derivatives(&self, set: usize) -> Option<[DVec3; 2]> {
        let [du, dv] = match self.shape()? {
            Shape::Mesh(mesh) => {
                let [p0, p1, p2] = mesh.corners(self.sp.prim);
                let [a, b, c] = mesh.corner_uvs(set, self.sp.prim);
                let (e1, e2) = (p1 - p0, p2 - p0);
                let (s1, t1) = (b[0] - a[0], b[1] - a[1]);
                let (s2, t2) = (c[0] - a[0], c[1] - a[1]);
                let det = s1 * t2 - s2 * t1;
                if det == 0.0 || !det.is_finite() {
                    return None;
                }
                [(e1 * t2 - e2 * t1) / det, (e2 * s1 - e1 * s2) / det]
            }
            Shape::Spheres(set) => {
                let (_, r) = set.get(self.sp.prim);
                let n = self.local_normal();
                let sin = n.x.hypot(n.y);
                if sin < 1e-9 {
                    return None;
                }
                let (c, s) = (n.x / sin, n.y / sin);
                [
                    DVec3::new(-s, c, 0.0) * (r * sin * std::f64::consts::TAU),
                    DVec3::new(n.z * c, n.z * s, -sin) * (r * std::f64::consts::PI),
                ]
            }
        };
        Some(match self.placement() {
            None => [du, dv],
            Some(place) => [du, dv].map(|v| place.world_from_object.transform_vector3(v)),
        })
    }

    /// Tangent and bitangent of the tangent space of normal maps, world space, with the shading
    /// normal `sp.n`: the mesh's own tangents where it has them, otherwise along growing `u` of
    /// the given set (glTF 2.0, 3.7.2.1).
    pub fn tangents(&self, set: usize) -> Option<[DVec3; 2]> {
        let n = self.sp.n;
        let own = self
            .mesh()
            .and_then(|m| m.interpolate(&m.tangents, self.sp.prim, self.sp.barycentrics));
        let (t, sign) = match own {
            Some([x, y, z, w]) => {
                let t = DVec3::new(x, y, z);
                let (t, flip) = match self.placement() {
                    None => (t, false),
                    Some(place) => (
                        place.world_from_object.transform_vector3(t),
                        place.world_from_object.matrix3.determinant() < 0.0,
                    ),
                };
                (t, if (w < 0.0) != flip { -1.0 } else { 1.0 })
            }
            None => {
                let [du, dv] = self.derivatives(set)?;
                // glTF's v runs down the image, tangent space's second axis up.
                (du, if n.cross(du).dot(dv) > 0.0 { -1.0 } else { 1.0 })
            }
        };
        let t = (t - n * n.dot(t)).try_normalize()?;
        Some([t, n.cross(t) * sign])
    }

    /// How the texture coordinates of one set change per pixel to the right and down
    /// (`[∂u/∂x, ∂v/∂x]`, `[∂u/∂y, ∂v/∂y]`), by least squares in the tangent plane; `None` where
    /// the footprint is not known.
    pub fn uv_footprint(&self, set: usize) -> Option<[[f64; 2]; 2]> {
        let footprint = self.footprint?;
        let [du, dv] = self.derivatives(set)?;
        let (a, b, c) = (du.dot(du), du.dot(dv), dv.dot(dv));
        let det = a * c - b * b;
        if !(det > 0.0) {
            return None;
        }
        Some([footprint.dpdx, footprint.dpdy].map(|d| {
            let (x, y) = (du.dot(d), dv.dot(d));
            [(c * x - b * y) / det, (a * y - b * x) / det]
        }))
    }
}
