//! The neutral description of a scene's geometry: all that a ray tracing backend sees.

use std::sync::Arc;

use rayon::prelude::*;

use super::mesh::COORDINATE_LIMIT;
use super::{
    Coverage, Hit, Invalid, LightId, MaterialId, ObjectId, Ray, ShapeId, SurfacePoint, TriangleMesh,
};
use crate::math::{Aabb, BoundingSphere, DAffine3, DVec3, Vec3};

/// Smallest radius: its square must be a normal number of single precision.
const LEAST_RADIUS: f32 = 1.084_202_2e-19;

/// Analytic spheres in their own (object) space.
#[derive(Clone, Debug, Default)]
pub struct SphereSet {
    /// Centre and radius of each sphere.
    pub spheres: Vec<[f32; 4]>,
}

impl SphereSet {
    /// Drops spheres that no backend can hold or whose radius, beside none, is below 2⁻⁶³.
    pub fn drop_invalid(&mut self) -> Invalid {
        let mut dropped = Invalid::default();
        self.spheres.retain(|s| {
            if s.iter().any(|c| !(c.abs() <= COORDINATE_LIMIT)) {
                dropped.coordinate += 1;
                false
            } else if !(s[3] >= LEAST_RADIUS) {
                dropped.degenerate += 1;
                false
            } else {
                true
            }
        });
        dropped
    }

    /// Centre and radius of sphere `prim`.
    #[inline]
    pub fn get(&self, prim: u32) -> (DVec3, f64) {
        let [x, y, z, r] = self.spheres[prim as usize];
        (Vec3::new(x, y, z).as_dvec3(), f64::from(r))
    }

    /// Box around all spheres.
    pub fn bounds(&self) -> Aabb {
        (0..self.spheres.len()).fold(Aabb::EMPTY, |b, i| {
            let (c, r) = self.get(i as u32);
            b.union(Aabb {
                min: c - r,
                max: c + r,
            })
        })
    }
}

/// Geometry of one material, in its own space, shared by all objects that place it.
#[derive(Clone, Debug)]
pub enum Shape {
    /// Triangles.
    Mesh(TriangleMesh),
    /// Analytic spheres.
    Spheres(SphereSet),
}

impl Shape {
    /// Number of primitives.
    pub fn len(&self) -> usize {
        match self {
            Self::Mesh(m) => m.indices.len(),
            Self::Spheres(s) => s.spheres.len(),
        }
    }

    /// Whether it has no primitive.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Box around it, in its own space.
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Mesh(m) => m.bounds(),
            Self::Spheres(s) => s.bounds(),
        }
    }

    /// Sphere around it, in its own space: about the middle of its box, through what lies farthest
    /// from there. That of a single sphere is the sphere. Without size if there is nothing.
    pub fn bounding_sphere(&self) -> BoundingSphere {
        let bounds = self.bounds();
        if bounds.is_empty() {
            return BoundingSphere {
                center: DVec3::ZERO,
                radius: 0.0,
            };
        }
        let center = bounds.center();
        let radius = match self {
            Self::Mesh(m) => {
                let far = |i: &u32| {
                    (Vec3::from(m.positions[*i as usize]).as_dvec3() - center).length_squared()
                };
                let far = m.indices.par_iter().flatten_iter().map(far);
                far.reduce(|| 0.0, f64::max).sqrt()
            }
            Self::Spheres(s) => (0..s.spheres.len() as u32)
                .map(|i| {
                    let (c, r) = s.get(i);
                    (c - center).length() + r
                })
                .fold(0.0, f64::max),
        };
        BoundingSphere { center, radius }
    }
}

/// Bound on how much longer a linear map can make a vector; what it is for a turn with even scale.
fn stretch(m: &glam::DMat3) -> f64 {
    // The root of the largest row of |MᵀM|, which holds its largest eigenvalue.
    let square = m.transpose() * *m;
    let row = |c: DVec3| c.abs().element_sum();
    row(square.x_axis)
        .max(row(square.y_axis))
        .max(row(square.z_axis))
        .sqrt()
}

/// A shape placed in the world, with its material.
#[derive(Clone)]
pub struct Object {
    /// What is placed.
    pub shape: ShapeId,
    /// World from object space; `None` if the shape is given in world space already, as it is
    /// for everything that is placed once.
    pub placement: Option<Placement>,
    /// Its material.
    pub material: MaterialId,
    /// The light it is, if it emits.
    pub light: Option<LightId>,
    /// How much of it is there, if not all of it.
    pub coverage: Option<Arc<dyn Coverage>>,
    /// Name of the node it came from.
    pub name: Arc<str>,
}

impl Object {
    /// World-space box around what lies in a box of object space.
    fn carry(&self, b: Aabb) -> Aabb {
        let Some(place) = &self.placement else {
            return b;
        };
        let mut out = Aabb::EMPTY;
        b.corners_under(&place.world_from_object)
            .for_each(|corner| out.grow(corner));
        out
    }
}

impl std::fmt::Debug for Object {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Object")
            .field("name", &self.name)
            .field("shape", &self.shape)
            .field("placement", &self.placement)
            .field("material", &self.material)
            .field("light", &self.light)
            .field("whole", &self.coverage.is_none())
            .finish()
    }
}

/// An affine placement with what queries need of it.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// World from object space, rounded to single precision so that all backends use the same.
    pub world_from_object: DAffine3,
    /// Its inverse.
    pub object_from_world: DAffine3,
}

impl Placement {
    /// The placement by `world_from_object`; `None` if it is singular or not finite.
    pub fn new(world_from_object: DAffine3) -> Option<Self> {
        let round = |v: DVec3| v.as_vec3().as_dvec3();
        let m = world_from_object.matrix3;
        let rounded = DAffine3 {
            matrix3: glam::DMat3::from_cols(round(m.x_axis), round(m.y_axis), round(m.z_axis)),
            translation: round(world_from_object.translation),
        };
        let det = rounded.matrix3.determinant();
        let inverse = rounded.inverse();
        (rounded.is_finite() && det != 0.0 && inverse.is_finite()).then_some(Self {
            world_from_object: rounded,
            object_from_world: inverse,
        })
    }
}

/// Shapes and the objects that place them; frozen after import.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// All shapes.
    pub shapes: Vec<Shape>,
    /// All objects; a [`Hit`] names one.
    pub objects: Vec<Object>,
}

impl Geometry {
    /// Prepares small meshes for refinement, on all threads: for those that trace rays in it.
    pub fn prepare(&self) {
        self.shapes.par_iter().for_each(|shape| {
            if let Shape::Mesh(mesh) = shape {
                mesh.prepare();
            }
        });
    }

    /// The object named `id`.
    #[inline]
    pub fn object(&self, id: ObjectId) -> &Object {
        &self.objects[id.0 as usize]
    }

    /// The shape named `id`.
    #[inline]
    pub fn shape(&self, id: ShapeId) -> &Shape {
        &self.shapes[id.0 as usize]
    }

    /// Whether every surface is whole, so that hits need not be asked about.
    pub fn is_whole(&self) -> bool {
        self.objects.iter().all(|o| o.coverage.is_none())
    }

    /// World-space box of an object.
    pub fn object_bounds(&self, id: ObjectId) -> Aabb {
        let object = self.object(id);
        object.carry(self.shape(object.shape).bounds())
    }

    /// World-space spheres around all objects. A mesh has its vertices to go by, not the corners of
    /// its box, which make the sphere around a ball `√3` times too wide.
    pub fn bounding_spheres(&self) -> Vec<BoundingSphere> {
        let own: Vec<BoundingSphere> = self.shapes.par_iter().map(Shape::bounding_sphere).collect();
        self.objects
            .par_iter()
            .map(|object| {
                let sphere = own[object.shape.index()];
                match &object.placement {
                    None => sphere,
                    Some(place) => BoundingSphere {
                        center: place.world_from_object.transform_point3(sphere.center),
                        radius: sphere.radius * stretch(&place.world_from_object.matrix3),
                    },
                }
            })
            .collect()
    }

    /// World-space box of everything.
    pub fn bounds(&self) -> Aabb {
        // Each shape is looked at once, however often it is placed.
        let own: Vec<Aabb> = self.shapes.par_iter().map(Shape::bounds).collect();
        self.objects
            .par_iter()
            .map(|object| object.carry(own[object.shape.index()]))
            .reduce(|| Aabb::EMPTY, Aabb::union)
    }

    /// Refines a hit: recomputes everything about it in `f64` on the primitive it names.
    #[inline(always)]
    pub fn surface_point(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let object = self.object(hit.object);
        SurfacePoint::refine(ray, hit, object, self.shape(object.shape))
    }
}
