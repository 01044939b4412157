//! Primitives: triangle meshes and analytic spheres, their intersections written once over
//! [`Real`](crate::ad::Real), and the surface point a hit refines to.
//!
//! A ray tracing backend says *which* primitive a ray hits and roughly where; [`SurfacePoint`]
//! is then recomputed in `f64` on that one primitive, by the same code for every backend.

mod coverage;
mod differential;
mod facet;
pub mod forecast;
mod hit;
mod mesh;
mod object;
mod patch;
mod patches;
mod ray;
pub mod sphere;
mod surface;
mod surface_point;
pub mod triangle;

pub use coverage::{Coverage, CoverageQuery, ray_key};
pub use differential::{Differential, Landing};
pub use hit::Hit;
pub(crate) use mesh::COORDINATE_LIMIT;
pub use mesh::{Invalid, TriangleMesh};
pub use object::{Geometry, Object, Placement, Shape, SphereSet};
pub use patch::{Edge, Patches, Walk};
pub use patches::{PatchId, Placed, ScenePatches};
pub use ray::Ray;
pub use surface::{Footprint, Surface};
pub use surface_point::{LightId, MaterialId, ObjectId, ShapeId, SurfacePoint};
