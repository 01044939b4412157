//! The patches of a whole scene, and which of them a ray has hit.

use rayon::prelude::*;

use super::forecast::Moves;
use super::{Edge, Geometry, Hit, Object, Patches, Shape, TriangleMesh, Walk};
use crate::math::{DAffine3, DVec3};

/// What of a surface is one as seen from a light: two hits of equal value have no edge that
/// matters between them, as far as the surface itself can tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PatchId {
    /// The object.
    pub object: u32,
    /// The patch of its mesh, or the number of the sphere.
    pub patch: u32,
    /// Whether it turns its front to the light.
    pub front: bool,
}

/// Most triangles that a forecast walks over. A longer way is cheaper to trace.
const MOST_STEPS: u32 = 48;

/// A mesh's adjacency with a number for each part that smooth edges hold together.
#[derive(Debug)]
struct Labelled {
    links: Patches,
    patch: Vec<u32>,
}

impl Labelled {
    fn new(mesh: &TriangleMesh) -> Option<Self> {
        let links = Patches::new(mesh)?;
        let mut patch = vec![u32::MAX; mesh.indices.len()];
        let (mut pending, mut count) = (Vec::new(), 0);
        for start in 0..patch.len() {
            if patch[start] != u32::MAX {
                continue;
            }
            patch[start] = count;
            pending.push(start as u32);
            while let Some(t) = pending.pop() {
                for k in 0..3 {
                    if let (Edge::Smooth, Some(to)) = links.edge(t, k)
                        && patch[to as usize] == u32::MAX
                    {
                        patch[to as usize] = count;
                        pending.push(to);
                    }
                }
            }
            count += 1;
        }
        Some(Self { links, patch })
    }
}

/// The patches of all meshes of a scene.
#[derive(Debug, Default)]
pub struct ScenePatches {
    /// One per shape; none for spheres.
    meshes: Vec<Option<Labelled>>,
}

impl ScenePatches {
    /// Finds the patches of all meshes.
    pub fn new(geometry: &Geometry) -> Self {
        let meshes = geometry
            .shapes
            .par_iter()
            .map(|s| match s {
                Shape::Mesh(mesh) => Labelled::new(mesh),
                Shape::Spheres(_) => None,
            })
            .collect();
        Self { meshes }
    }

    /// The mesh with its adjacency, if that is what an object is.
    #[inline]
    pub fn mesh<'a>(&'a self, geometry: &'a Geometry, hit: &Hit) -> Option<Placed<'a>> {
        let object = geometry.object(hit.object);
        let labelled = self.meshes.get(object.shape.index())?.as_ref()?;
        let Shape::Mesh(mesh) = geometry.shape(object.shape) else {
            return None;
        };
        Some(Placed {
            mesh,
            labelled,
            object_from_world: object.placement.as_ref().map(|p| p.object_from_world),
        })
    }

    /// What the line `o + t·d` meets at `hit`.
    #[inline]
    pub fn id(&self, geometry: &Geometry, o: DVec3, d: DVec3, hit: &Hit) -> PatchId {
        let (patch, front) = match self.mesh(geometry, hit) {
            None => {
                let object = geometry.object(hit.object);
                (hit.prim, sphere_front(geometry, object, hit.prim, o))
            }
            Some(m) => {
                let d = m.vector(d);
                let [a, b, c] = m.mesh.corners(hit.prim);
                let front = (b - a).cross(c - a).dot(d) < 0.0;
                (m.labelled.patch[hit.prim as usize], front)
            }
        };
        PatchId {
            object: hit.object.0,
            patch,
            front,
        }
    }
}

/// Whether `o` lies outside of a sphere: its front is seen from there.
fn sphere_front(geometry: &Geometry, object: &Object, prim: u32, o: DVec3) -> bool {
    let Shape::Spheres(set) = geometry.shape(object.shape) else {
        return true;
    };
    let o = match &object.placement {
        Some(p) => p.object_from_world.transform_point3(o),
        None => o,
    };
    let (c, r) = set.get(prim);
    (o - c).length_squared() >= r * r
}

/// A mesh where it is placed.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    mesh: &'a TriangleMesh,
    labelled: &'a Labelled,
    object_from_world: Option<DAffine3>,
}

impl Placed<'_> {
    #[inline]
    fn point(&self, p: DVec3) -> DVec3 {
        self.object_from_world.map_or(p, |m| m.transform_point3(p))
    }

    #[inline]
    fn vector(&self, v: DVec3) -> DVec3 {
        self.object_from_world.map_or(v, |m| m.transform_vector3(v))
    }

    /// As [`Patches::walk`], in world space.
    #[inline]
    pub fn walk(&self, prim: u32, [o, d, h]: [DVec3; 3], moves: Moves) -> Walk {
        let [o, d, h] = [self.point(o), self.vector(d), self.vector(h)];
        self.labelled
            .links
            .walk(self.mesh, prim, o, d, h, moves, MOST_STEPS)
    }
}
