//! What shading knows about a hit.

use super::object::Placement;
use super::{Hit, Object, Ray, Shape, SphereSet, TriangleMesh, sphere, triangle};
use crate::ad::V3;
use crate::math::{DVec3, larger, max_abs, nearly_unit, robust};
use crate::stats::tally::{self, Event};

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $name {
            /// As an index into its arena.
            #[inline]
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}

id!(/// Names a shape.
    ShapeId);
id!(/// Names an object.
    ObjectId);
id!(/// Names a material.
    MaterialId);
id!(/// Names a light.
    LightId);

/// A point on a surface, computed in `f64` on the primitive that was hit. World space.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Position, on the primitive.
    pub p: DVec3,
    /// Unit geometric normal, out of the front (outside of a sphere).
    pub ng: DVec3,
    /// Unit shading normal, in the hemisphere of `ng`.
    pub n: DVec3,
    /// Unit direction back along the ray.
    pub wo: DVec3,
    /// Whether the ray came from the front: `wo · ng > 0`.
    pub front: bool,
    /// Distance from the ray's origin in metres.
    pub distance: f64,
    /// Barycentric weights of a triangle's second and third corner; zero on a sphere.
    pub barycentrics: [f64; 2],
    /// How far from the surface spawned rays start, in metres.
    pub offset: f64,
    /// Triangle or sphere within the shape.
    pub prim: u32,
    /// The object hit.
    pub object: ObjectId,
    /// Its material.
    pub material: super::MaterialId,
    /// The light it is, if any.
    pub light: Option<LightId>,
}

impl SurfacePoint {
    /// Recomputes a hit on its primitive.
    #[inline(always)]
    pub(super) fn refine(ray: &Ray, hit: &Hit, object: &Object, shape: &Shape) -> Self {
        let (o, d) = (ray.origin(), ray.direction());
        let near = Near {
            t: f64::from(hit.t),
            first: (cfg!(dualight_without = "alpha") || object.coverage.is_none())
                .then_some(f64::from(ray.tmin)),
        };
        let placement = match cfg!(dualight_without = "instances") {
            true => &None,
            false => &object.placement,
        };
        let on = match (placement, shape) {
            (None, Shape::Mesh(mesh)) => on_triangle(o, d, &near, hit.prim, mesh),
            (None, Shape::Spheres(set)) => on_sphere(o, d, &near, hit.prim, set),
            (Some(place), _) => {
                tally::count(Event::InstanceHits);
                on_placed(o, d, &near, hit.prim, shape, place)
            }
        };
        let (unit, length) = nearly_unit(d);
        let wo = -unit;
        Self {
            p: on.p,
            ng: on.ng,
            n: match on.smooth {
                None => on.ng,
                Some(n) if n.dot(on.ng) < 0.0 => -n,
                Some(n) => n,
            },
            wo,
            front: wo.dot(on.ng) > 0.0,
            distance: on.t * length,
            barycentrics: on.barycentrics,
            offset: robust::spawn_offset(on.reach),
            prim: hit.prim,
            object: hit.object,
            material: object.material,
            light: object.light,
        }
    }

    /// The ray from here along `d` (any length), started outside the rounding error on the side
    /// `d` points to. Numerically this never hits the primitive it leaves.
    #[inline]
    pub fn spawn(&self, d: DVec3) -> Ray {
        Ray::new(self.offset_toward(d), d)
    }

    /// The segment from here to `target`, a point already offset from its own surface.
    #[inline]
    pub fn spawn_to(&self, target: DVec3) -> Ray {
        Ray::segment(self.offset_toward(target - self.p), target)
    }

    /// The segment to `target`, or the ray along `d` without end: in one piece, so that a compiler
    /// keeps it in registers.
    #[inline(always)]
    pub fn spawn_toward(&self, d: DVec3, target: Option<DVec3>) -> Ray {
        let from = self
            .offset_toward(target.map_or(d, |t| t - self.p))
            .as_vec3();
        let (d, tmax) = match target {
            Some(t) => (t - from.as_dvec3(), 1.0),
            None => (d, f32::INFINITY),
        };
        Ray {
            o: from,
            tmin: 0.0,
            d: d.as_vec3(),
            tmax,
        }
    }

    /// The position, moved off the surface to the side that `d` points to.
    #[inline(always)]
    pub fn offset_toward(&self, d: DVec3) -> DVec3 {
        let side = if d.dot(self.ng) >= 0.0 {
            self.offset
        } else {
            -self.offset
        };
        self.p + self.ng * side
    }
}

/// What a backend says of the distance.
struct Near {
    /// The distance, with the backend's rounding.
    t: f64,
    /// Where the segment begins, if the primitive's first intersection from there on counts.
    first: Option<f64>,
}

/// A refined point in the space of the shape.
struct Refined {
    /// Distance along the ray in units of its direction, which an affine map keeps.
    t: f64,
    p: DVec3,
    ng: DVec3,
    /// Unit shading normal where it is not `ng`.
    smooth: Option<DVec3>,
    barycentrics: [f64; 2],
    /// Bound on the coordinates that a backend computes with, in world units.
    reach: f64,
}

#[inline(always)]
fn on_triangle(o: DVec3, d: DVec3, near: &Near, prim: u32, mesh: &TriangleMesh) -> Refined {
    let f = mesh.facet(prim);
    let (o, d) = (V3::<f64>::constant(o), V3::constant(d));
    let (t, b1, b2) = match triangle::plane_hit(o, d, f.v0, f.e1, f.e2, f.normal) {
        // A backend may report a hit an ulp outside, or on a triangle seen edge-on: the point is
        // kept on the triangle.
        Some(h) => {
            let (b1, b2) = clamp_barycentrics(h.b1, h.b2);
            (h.t, b1, b2)
        }
        None => (near.t, 1.0 / 3.0, 1.0 / 3.0),
    };
    Refined {
        t,
        p: f.v0 + f.e1 * b1 + f.e2 * b2,
        ng: f.ng,
        smooth: mesh.normal(prim, b1, b2).and_then(DVec3::try_normalize),
        barycentrics: [b1, b2],
        // Corners can be far from the point.
        reach: f.reach,
    }
}

#[inline(never)]
fn on_sphere(o: DVec3, d: DVec3, near: &Near, prim: u32, set: &SphereSet) -> Refined {
    let (c, r) = set.get(prim);
    let line = sphere::line_sphere(V3::<f64>::constant(o), V3::constant(d), c, r);
    let t = match line.roots() {
        Some([t0, t1]) => {
            // A far sphere's intersections lie closer together than a backend in single
            // precision can tell.
            let enters = match near.first {
                Some(tmin) => t0 >= tmin,
                None => (near.t - t0).abs() <= (near.t - t1).abs(),
            };
            if enters { t0 } else { t1 }
        }
        // The backend saw a graze that exact arithmetic misses: the closest point serves.
        None => line.t_closest,
    };
    // As good as unit already where the point was computed well, which spares a root to wait for.
    let (n, length) = nearly_unit((o + d * t - c) * (1.0 / r));
    let n = if length > 0.0 { n } else { DVec3::Z };
    Refined {
        t,
        p: c + n * r,
        ng: n,
        smooth: None,
        barycentrics: [0.0; 2],
        reach: max_abs(c) + r,
    }
}

#[inline(never)]
fn on_placed(
    o: DVec3,
    d: DVec3,
    near: &Near,
    prim: u32,
    shape: &Shape,
    place: &Placement,
) -> Refined {
    // The affine map keeps t; the point goes back through the exact placement.
    let (inv, map) = (&place.object_from_world, &place.world_from_object);
    let (o, d) = (inv.transform_point3(o), inv.transform_vector3(d));
    let on = match shape {
        Shape::Mesh(mesh) => on_triangle(o, d, near, prim, mesh),
        Shape::Spheres(set) => on_sphere(o, d, near, prim, set),
    };
    // By the inverse transpose an outward normal stays outward, also when the map mirrors: that
    // is the flip of the winding which glTF 2.0, 3.7.4 asks for.
    let cofactor = inv.matrix3.transpose();
    let stretch =
        map.matrix3.x_axis.length() + map.matrix3.y_axis.length() + map.matrix3.z_axis.length();
    Refined {
        p: map.transform_point3(on.p),
        ng: (cofactor * on.ng).normalize(),
        smooth: on.smooth.map(|n| (cofactor * n).normalize()),
        reach: on.reach * stretch + max_abs(map.translation),
        ..on
    }
}

#[inline]
fn clamp_barycentrics(b1: f64, b2: f64) -> (f64, f64) {
    let (b1, b2) = (larger(b1, 0.0), larger(b2, 0.0));
    let sum = b1 + b2;
    if sum > 1.0 {
        (b1 / sum, b2 / sum)
    } else {
        (b1, b2)
    }
}
