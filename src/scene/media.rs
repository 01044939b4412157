//! Bodies of glass and liquid that touch, overlap or lie in one another: which of them a point is
//! in, and which two media a surface parts.
//!
//! glTF describes every body as if it lay in air. Where bodies share space, the one of the highest
//! rank fills it, as in Schmidt and Budge, *Simple Nested Dielectrics in Ray Traced Images*, JGT
//! 7(2), 2002. Ranks follow the materials' priorities (`extras: {"dualight": {"priority": n}}`, 0
//! by default); of equal ones the smaller body wins, so that an air bubble displaces the water, and
//! the water the wall of the glass that it touches. Ranks do not depend on the way that a path
//! came, so light finds the same surfaces in both directions.
//!
//! Surfaces closer together than the offset of spawned rays are crossed in one step: a path that
//! starts beyond one of them would never meet the others.

use std::sync::Arc;

use crate::accel::{ACCELERATORS, Accelerator};
use crate::error::Result;
use crate::geometry::{Geometry, ObjectId, Ray, Shape, SurfacePoint, TriangleMesh};
use crate::materials::{Bsdf, Interior, Medium};
use crate::math::{Aabb, DVec3};

/// Most bodies whose order is kept.
const MOST: usize = u64::BITS as usize;

/// Where a search starts that decides whether a point is inside: any direction will do that no
/// edge is likely to have.
const ASIDE: DVec3 = DVec3::new(0.5278, 0.6217, 0.5789);

/// The bodies that a point lies in, one bit each; the highest bit is the medium there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inside(u64);

impl Inside {
    #[inline]
    fn with(self, bit: usize, inside: bool) -> Self {
        Self(self.0 & !(1 << bit) | u64::from(inside) << bit)
    }

    /// The body whose medium is there.
    #[inline]
    fn top(self) -> Option<usize> {
        (self.0 != 0).then(|| self.0.ilog2() as usize)
    }
}

/// What a path crosses if it passes a surface.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    before: Inside,
    after: Inside,
    /// What the relative index of refraction is to be multiplied by; 0 where there is no border
    /// between media at all.
    correction: f64,
}

impl Crossing {
    /// A surface that parts no bodies whose order is kept.
    #[inline]
    pub(super) fn plain(inside: Inside) -> Self {
        Self {
            before: inside,
            after: inside,
            correction: 1.0,
        }
    }

    /// Puts the media in place of the air that the surface's material assumes outside.
    #[inline]
    pub fn apply(&self, bsdf: &mut Bsdf) {
        if self.correction != 1.0 {
            bsdf.immerse(self.correction);
        }
    }

    /// Where the path is after it was scattered.
    #[inline]
    pub fn beyond(&self, transmitted: bool) -> Inside {
        if transmitted { self.after } else { self.before }
    }
}

struct Body {
    object: ObjectId,
    ior: f64,
    interior: Option<Interior>,
    bounds: Aabb,
    /// The body alone.
    geometry: Arc<Geometry>,
    accel: Box<dyn Accelerator>,
}

impl Body {
    /// Whether the point at the start of a ray is inside, by the first surface that it meets.
    fn holds(&self, ray: &Ray) -> Option<bool> {
        let hit = self.accel.intersect(ray)?;
        Some(!self.geometry.surface_point(ray, &hit).front)
    }
}

/// The bodies of a scene that may share space, by rising rank.
pub struct Media {
    bodies: Vec<Body>,
    /// The bit of each object.
    of: Vec<Option<u8>>,
}

impl Media {
    /// The closed bodies among the objects whose boxes meet; `medium` tells what an object holds.
    /// `None` if there are none. Objects beyond the first 64 of highest rank are returned: they
    /// lie in air.
    pub(super) fn new(
        geometry: &Geometry,
        medium: impl Fn(ObjectId) -> Option<(Medium, Option<Interior>)>,
    ) -> Result<(Option<Self>, Vec<ObjectId>)> {
        let mut found: Vec<(ObjectId, Medium, Option<Interior>, Aabb)> =
            (0..geometry.objects.len())
                .map(|i| ObjectId(i as u32))
                .filter_map(|id| medium(id).map(|(m, interior)| (id, m, interior)))
                .map(|(id, m, interior)| (id, m, interior, geometry.object_bounds(id)))
                .collect();
        let boxes: Vec<Aabb> = found.iter().map(|b| b.3).collect();
        let mut k = 0..;
        found.retain(|b| {
            let me = k.next();
            boxes
                .iter()
                .enumerate()
                .any(|(i, o)| Some(i) != me && meets(&b.3, o))
                && closed(geometry.shape(geometry.object(b.0).shape))
        });
        if found.len() < 2 {
            return Ok((None, Vec::new()));
        }
        let size = |b: &Aabb| b.extent().length();
        found.sort_by(|a, b| {
            let priority = a.1.priority.total_cmp(&b.1.priority);
            let smaller = size(&b.3).total_cmp(&size(&a.3));
            priority.then(smaller).then(a.0.cmp(&b.0))
        });
        let left_out = found.len().saturating_sub(MOST);
        let air: Vec<ObjectId> = found.drain(..left_out).map(|b| b.0).collect();
        let mut of = vec![None; geometry.objects.len()];
        let mut bodies = Vec::with_capacity(found.len());
        for (bit, (object, m, interior, bounds)) in found.into_iter().enumerate() {
            of[object.0 as usize] = Some(bit as u8);
            let geometry = alone(geometry, object);
            let accel = exact(&geometry)?;
            bodies.push(Body {
                object,
                ior: m.ior,
                interior,
                bounds,
                geometry,
                accel,
            });
        }
        Ok((Some(Self { bodies, of }), air))
    }

    /// The bodies that hold a point.
    pub(super) fn enclosing(&self, p: DVec3) -> Inside {
        let mut inside = Inside::default();
        for (bit, body) in self.bodies.iter().enumerate() {
            let b = &body.bounds;
            if p.cmpge(b.min).all() && p.cmple(b.max).all() {
                inside = inside.with(bit, body.holds(&Ray::new(p, ASIDE)) == Some(true));
            }
        }
        inside
    }

    /// What is parted at a point on a surface, for a path that came through `inside`.
    #[inline(never)]
    pub(super) fn crossing(&self, inside: Inside, sp: &SurfacePoint) -> Crossing {
        let Some(bit) = self.of[sp.object.0 as usize] else {
            return Crossing::plain(inside);
        };
        let bit = usize::from(bit);
        // The side that the ray came from is certain: it repairs what a leak has spoilt.
        let mut before = inside.with(bit, !sp.front);
        let mut after = before.with(bit, sp.front);
        let (near, far) = (sp.offset_toward(sp.wo), sp.offset_toward(-sp.wo));
        for (k, body) in self.bodies.iter().enumerate() {
            let b = &body.bounds;
            let around = sp.p.cmpge(b.min - sp.offset).all() && sp.p.cmple(b.max + sp.offset).all();
            if k == bit || body.object == sp.object || !around {
                continue;
            }
            if let Some(there) = body.holds(&Ray::segment(near, far)) {
                before = before.with(k, there);
                let here = body.holds(&Ray::segment(far, near));
                after = after.with(k, here.unwrap_or(!there));
            }
        }
        let index = |inside: Inside| inside.top().map_or(1.0, |k| self.bodies[k].ior);
        let own = self.bodies[bit].ior;
        let assumed = if sp.front { own } else { 1.0 / own };
        Crossing {
            before,
            after,
            correction: if before.top() == after.top() {
                0.0
            } else {
                index(after) / index(before) / assumed
            },
        }
    }

    /// What absorbs light on a segment, if it ran in one of these bodies.
    #[inline]
    pub(super) fn interior(&self, crossing: &Crossing) -> Option<Interior> {
        self.bodies[crossing.before.top()?].interior
    }

    /// Whether the object is one of these bodies.
    #[inline]
    pub(super) fn knows(&self, object: ObjectId) -> bool {
        self.of[object.0 as usize].is_some()
    }
}

/// Whether two boxes have a point in common, or nearly.
fn meets(a: &Aabb, b: &Aabb) -> bool {
    let slack = 1e-5 * a.extent().max(b.extent());
    a.min.cmple(b.max + slack).all() && b.min.cmple(a.max + slack).all()
}

/// An object by itself, without what only shading needs.
fn alone(geometry: &Geometry, id: ObjectId) -> Arc<Geometry> {
    let object = geometry.object(id);
    let shape = match geometry.shape(object.shape) {
        Shape::Mesh(m) => Shape::Mesh(TriangleMesh {
            positions: m.positions.clone(),
            indices: m.indices.clone(),
            ..TriangleMesh::default()
        }),
        Shape::Spheres(s) => Shape::Spheres(s.clone()),
    };
    let mut object = object.clone();
    object.shape = crate::geometry::ShapeId(0);
    object.coverage = None;
    Arc::new(Geometry {
        shapes: vec![shape],
        objects: vec![object],
    })
}

/// The backend that misses nothing, over a body alone.
fn exact(geometry: &Arc<Geometry>) -> Result<Box<dyn Accelerator>> {
    let backend = ACCELERATORS.iter().find(|a| a.name == "bvh");
    let backend = backend.or(ACCELERATORS.last());
    let build = backend.map(|b| b.build);
    build.map_or_else(
        || unreachable!("a table with two backends in every build"),
        |build| build(geometry, 1),
    )
}

/// Whether a shape has an inside: spheres, and meshes whose every edge is run through as often in
/// one direction as in the other.
fn closed(shape: &Shape) -> bool {
    let Shape::Mesh(mesh) = shape else {
        return true;
    };
    let key = |i: u32| mesh.positions[i as usize].map(|x| (x + 0.0).to_bits());
    let mut edges = Vec::with_capacity(3 * mesh.indices.len());
    for t in &mesh.indices {
        for k in 0..3 {
            let (a, b) = (key(t[k]), key(t[(k + 1) % 3]));
            edges.push(if a < b { (a, b, 1) } else { (b, a, -1) });
        }
    }
    edges.sort_unstable();
    let same =
        |a: &([u32; 3], [u32; 3], i32), b: &([u32; 3], [u32; 3], i32)| (a.0, a.1) == (b.0, b.1);
    edges
        .chunk_by(same)
        .all(|e| e.iter().map(|e| e.2).sum::<i32>() == 0)
}
