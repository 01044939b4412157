//! `linear`: tests every primitive, in `f64`. The oracle of the tests.

use std::sync::Arc;

use super::{Accelerator, AcceleratorEntry, BuildStats};
use crate::error::Result;
use crate::geometry::triangle::Watertight;
use crate::geometry::{
    Coverage, CoverageQuery, Geometry, Hit, ObjectId, Ray, Shape, ray_key, sphere,
};
use crate::math::DVec3;

/// An intersection with one primitive, in `f64`.
#[derive(Clone, Copy, Debug)]
pub(super) struct PrimHit {
    pub(super) t: f64,
    pub(super) u: f64,
    pub(super) v: f64,
}

/// Tests one primitive of a shape; shared by all pure-Rust backends.
#[inline]
pub(super) fn intersect_prim(
    shape: &Shape,
    prim: u32,
    ray: &PreparedRay,
    tmin: f64,
    tmax: f64,
) -> Option<PrimHit> {
    match shape {
        Shape::Mesh(mesh) => ray
            .watertight
            .intersect(mesh.corners(prim), tmin, tmax)
            .map(|h| PrimHit {
                t: h.t,
                u: h.b1,
                v: h.b2,
            }),
        Shape::Spheres(set) => {
            let (c, r) = set.get(prim);
            sphere::intersect(ray.o, ray.d, c, r, tmin, tmax).map(|t| PrimHit { t, u: 0.0, v: 0.0 })
        }
    }
}

/// A ray in the space of a shape.
#[derive(Clone, Copy, Debug)]
pub(super) struct PreparedRay {
    pub(super) o: DVec3,
    pub(super) d: DVec3,
    pub(super) watertight: Watertight,
}

impl PreparedRay {
    #[inline]
    pub(super) fn new(o: DVec3, d: DVec3) -> Self {
        Self {
            o,
            d,
            watertight: Watertight::new(o, d),
        }
    }
}

/// The first hit of a primitive from `tmin` on that its coverage lets count. `which` is the
/// ray's key, the object and the primitive; `find` gives the first hit from a distance on.
pub(super) fn uncut(
    coverage: &dyn Coverage,
    shape: &Shape,
    ray: &PreparedRay,
    which: (u64, u32, u32),
    mut tmin: f64,
    find: impl Fn(f64) -> Option<PrimHit>,
) -> Option<PrimHit> {
    let (key, object, prim) = which;
    // A sphere can be hit twice.
    for _ in 0..2 {
        let h = find(tmin)?;
        let outward = match shape {
            Shape::Mesh(_) => false,
            Shape::Spheres(set) => {
                let (center, _) = set.get(prim);
                (ray.o + ray.d * h.t - center).dot(ray.d) > 0.0
            }
        };
        let query = CoverageQuery {
            key,
            object,
            prim,
            barycentrics: [h.u, h.v],
            outward,
        };
        if query.stops(coverage, shape) {
            return Some(h);
        }
        if matches!(shape, Shape::Mesh(_)) {
            return None;
        }
        tmin = h.t.next_up();
    }
    None
}

struct Linear {
    geometry: Arc<Geometry>,
    /// Whether no hit need be asked about.
    whole: bool,
}

impl Linear {
    fn nearest(&self, ray: &Ray, any: bool) -> Option<Hit> {
        if !ray.is_valid() {
            return None;
        }
        let (tmin, mut tmax) = (f64::from(ray.tmin), f64::from(ray.tmax));
        let world = PreparedRay::new(ray.origin(), ray.direction());
        let key = if self.whole { 0 } else { ray_key(ray) };
        let mut best = None;
        for (i, object) in self.geometry.objects.iter().enumerate() {
            let local = match &object.placement {
                None => world,
                Some(p) => PreparedRay::new(
                    p.object_from_world.transform_point3(world.o),
                    p.object_from_world.transform_vector3(world.d),
                ),
            };
            let shape = self.geometry.shape(object.shape);
            for prim in 0..shape.len() as u32 {
                let find = |tmin| intersect_prim(shape, prim, &local, tmin, tmax);
                let h = match &object.coverage {
                    None => find(tmin),
                    Some(c) => uncut(&**c, shape, &local, (key, i as u32, prim), tmin, find),
                };
                let Some(h) = h else {
                    continue;
                };
                // Of equal distances the first stays.
                if best.is_none() || h.t < tmax {
                    tmax = h.t;
                    best = Some(Hit {
                        t: h.t as f32,
                        u: h.u as f32,
                        v: h.v as f32,
                        prim,
                        object: ObjectId(i as u32),
                    });
                }
                if any {
                    return best;
                }
            }
        }
        best
    }
}

impl Accelerator for Linear {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.nearest(ray, false)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.nearest(ray, true).is_some()
    }

    fn watertight(&self) -> bool {
        true
    }

    fn stats(&self) -> BuildStats {
        BuildStats {
            backend: "linear".into(),
            primitives: self.geometry.shapes.iter().map(|s| s.len() as u64).sum(),
            ..Default::default()
        }
    }
}

fn build(geometry: &Arc<Geometry>, _threads: usize) -> Result<Box<dyn Accelerator>> {
    Ok(Box::new(Linear {
        whole: geometry.is_whole(),
        geometry: geometry.clone(),
    }))
}

/// The registry's line.
pub(super) const ENTRY: AcceleratorEntry = AcceleratorEntry {
    name: "linear",
    doc: "tests every primitive in f64: the oracle of the tests, for tiny scenes",
    build,
};
