//! `embree`: Intel Embree 4, robust mode.
//!
//! One top-level scene holds every object under its own id: shapes in world space directly,
//! placed ones as instances of their shape's scene. Whichever it is, the id that Embree reports
//! at the top is the [`ObjectId`].

mod scaled;

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;
use std::time::Instant;

use super::{Accelerator, AcceleratorEntry, BuildStats};
use crate::error::{Error, Result};
use crate::ffi::{
    CommittedScene, Device, EmbreeError, Geometry as EmbreeGeometry, HitFilter, RawHit,
    SceneBuilder,
};
use crate::geometry::{
    Coverage, CoverageQuery, Geometry, Hit, MaterialId, Object, ObjectId, Ray, Shape, ShapeId,
    ray_key,
};
use crate::math::DAffine3;

struct Embree {
    scene: CommittedScene,
    device: Device,
    seconds: f64,
    primitives: u64,
}

impl Embree {
    /// The nearest hit of a ray that filters know by `key`.
    #[inline(always)]
    fn nearest(&self, ray: &Ray, key: impl FnOnce() -> u64) -> Option<Hit> {
        let (o, d) = (ray.o.into(), ray.d.into());
        let h = self.scene.intersect(o, d, ray.tmin, ray.tmax, key)?;
        Some(Hit {
            t: h.t,
            u: h.u,
            v: h.v,
            prim: h.prim,
            object: ObjectId(h.top_level()),
        })
    }

    /// Whether anything is in the way of a ray that filters know by `key`.
    #[inline(always)]
    fn any(&self, ray: &Ray, key: impl FnOnce() -> u64) -> bool {
        let (o, d) = (ray.o.into(), ray.d.into());
        self.scene.occluded(o, d, ray.tmin, ray.tmax, key)
    }
}

impl Accelerator for Embree {
    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.nearest(ray, || ray_key(ray))
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.any(ray, || ray_key(ray))
    }

    fn stats(&self) -> BuildStats {
        let [major, minor, patch] = self.device.version();
        BuildStats {
            backend: format!("Embree {major}.{minor}.{patch}"),
            seconds: self.seconds,
            bytes: self.device.memory().current,
            primitives: self.primitives,
        }
    }
}

fn failure(e: EmbreeError) -> Error {
    Error::Accelerator {
        backend: "embree",
        problem: e.to_string(),
        remedy: "run scripts/setup again, or use --accel bvh".into(),
    }
}

/// Asks about the hits of an object that is not whole.
struct Filter {
    geometry: Arc<Geometry>,
    coverage: Arc<dyn Coverage>,
    shape: ShapeId,
}

impl HitFilter for Filter {
    fn stops(&self, key: u64, hit: &RawHit, outward: bool) -> bool {
        let query = CoverageQuery {
            key,
            object: hit.top_level(),
            prim: hit.prim,
            barycentrics: [f64::from(hit.u), f64::from(hit.v)],
            outward,
        };
        query.stops(&*self.coverage, self.geometry.shape(self.shape))
    }
}

/// The shape of an object, `scale` times as large.
fn shape_geometry(
    device: &Device,
    geometry: &Arc<Geometry>,
    object: &Object,
    scale: f32,
) -> Result<EmbreeGeometry, EmbreeError> {
    let filter = object.coverage.as_ref().map(|coverage| {
        Box::new(Filter {
            geometry: geometry.clone(),
            coverage: coverage.clone(),
            shape: object.shape,
        }) as Box<dyn HitFilter>
    });
    match geometry.shape(object.shape) {
        Shape::Mesh(m) => {
            let positions = scaled::scaled(&m.positions, scale);
            EmbreeGeometry::triangles(device, &positions, &m.indices, filter)
        }
        Shape::Spheres(s) => {
            EmbreeGeometry::spheres(device, &scaled::scaled(&s.spheres, scale), filter)
        }
    }
}

fn columns(m: &DAffine3) -> [[f32; 3]; 4] {
    [
        m.matrix3.x_axis,
        m.matrix3.y_axis,
        m.matrix3.z_axis,
        m.translation,
    ]
    .map(|c| c.as_vec3().into())
}

fn build_scene(
    geometry: &Arc<Geometry>,
    device: Device,
    empty: fn(&Device) -> Result<SceneBuilder, EmbreeError>,
    scale: f32,
) -> Result<Embree, EmbreeError> {
    let start = Instant::now();
    let mut top = empty(&device)?;
    // One scene for each shape, and one more for each material through which it is not whole.
    let mut shared: HashMap<(ShapeId, Option<MaterialId>), (CommittedScene, f32)> = HashMap::new();
    for (i, object) in geometry.objects.iter().enumerate() {
        let attached = match &object.placement {
            None => shape_geometry(&device, geometry, object, scale)?,
            Some(place) => {
                let material = object.coverage.as_ref().map(|_| object.material);
                let (scene, own) = match shared.entry((object.shape, material)) {
                    Entry::Occupied(e) => e.into_mut(),
                    Entry::Vacant(e) => {
                        let own = scaled::wanted(geometry.shape(object.shape).bounds());
                        let mut builder = empty(&device)?;
                        builder.attach(&shape_geometry(&device, geometry, object, own)?, 0)?;
                        e.insert((builder.commit()?, own))
                    }
                };
                let map = scaled::map(&place.world_from_object, scale, *own);
                EmbreeGeometry::instance(&device, scene, columns(&map))?
            }
        };
        top.attach(&attached, i as u32)?;
    }
    Ok(Embree {
        scene: top.commit()?,
        seconds: start.elapsed().as_secs_f64(),
        primitives: geometry.shapes.iter().map(|s| s.len() as u64).sum(),
        device,
    })
}

/// A device with its own threads and, if not empty, more settings.
fn device(threads: usize, more: &str) -> Result<Device, EmbreeError> {
    Device::new(&format!("threads={}{more}", threads.max(1)))
}

/// Builds over a geometry that is in the middle of the range of single precision, or is put there.
fn made(
    geometry: &Arc<Geometry>,
    device: Result<Device, EmbreeError>,
    empty: fn(&Device) -> Result<SceneBuilder, EmbreeError>,
) -> Result<Box<dyn Accelerator>> {
    let scale = scaled::wanted(geometry.bounds());
    let built = device.and_then(|d| build_scene(geometry, d, empty, scale));
    let embree = built.map_err(failure)?;
    Ok(match scale {
        1.0 => Box::new(embree),
        _ => Box::new(scaled::Scaled { embree, scale }),
    })
}

fn build(geometry: &Arc<Geometry>, threads: usize) -> Result<Box<dyn Accelerator>> {
    made(geometry, device(threads, ""), SceneBuilder::new)
}

fn build_fast(geometry: &Arc<Geometry>, threads: usize) -> Result<Box<dyn Accelerator>> {
    made(geometry, device(threads, ""), SceneBuilder::fast)
}

/// Embree held to one set of instructions (`sse2`, `sse42`, `avx`, `avx2`, `avx512`), on one
/// thread: it rounds otherwise with each, which is how machines differ.
///
/// # Errors
/// A set that the processor or the library does not have.
pub fn with_instructions(set: &str, geometry: &Arc<Geometry>) -> Result<Box<dyn Accelerator>> {
    let device = device(1, &format!(",isa={set}"));
    made(geometry, device, SceneBuilder::new)
}

/// The registry's line.
pub(super) const ENTRY: AcceleratorEntry = AcceleratorEntry {
    name: "embree",
    doc: "Intel Embree 4 in robust mode",
    build,
};

/// Not in the registry, since it breaks the contract: it shows what keeping it costs.
pub const FAST: AcceleratorEntry = AcceleratorEntry {
    name: "embree-fast",
    doc: "Intel Embree 4 without robust mode: rays slip between triangles",
    build: build_fast,
};
