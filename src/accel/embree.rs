//! `embree`: Intel Embree 4, robust mode.
//!
//! One top-level scene holds every object under its own id: shapes in world space directly,
//! placed ones as instances of their shape's scene. Whichever it is, the id that Embree reports
//! at the top is the [`ObjectId`].

use std::sync::Arc;
use std::time::Instant;

use super::{Accelerator, AcceleratorEntry, BuildStats};
use crate::error::{Error, Result};
use crate::ffi::{CommittedScene, Device, EmbreeError, Geometry as EmbreeGeometry, SceneBuilder};
use crate::geometry::{Geometry, Hit, ObjectId, Ray, Shape};
use crate::math::DAffine3;

struct Embree {
    scene: CommittedScene,
    device: Device,
    seconds: f64,
    primitives: u64,
}

impl Accelerator for Embree {
    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let h = self
            .scene
            .intersect(ray.o.into(), ray.d.into(), ray.tmin, ray.tmax)?;
        Some(Hit {
            t: h.t,
            u: h.u,
            v: h.v,
            prim: h.prim,
            object: ObjectId(h.top_level()),
        })
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.scene
            .occluded(ray.o.into(), ray.d.into(), ray.tmin, ray.tmax)
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

fn shape_geometry(device: &Device, shape: &Shape) -> Result<EmbreeGeometry, EmbreeError> {
    match shape {
        Shape::Mesh(m) => EmbreeGeometry::triangles(device, &m.positions, &m.indices),
        Shape::Spheres(s) => EmbreeGeometry::spheres(device, &s.spheres),
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

fn build_scene(geometry: &Geometry, threads: usize) -> Result<Embree, EmbreeError> {
    let start = Instant::now();
    let device = Device::new(&format!("threads={}", threads.max(1)))?;
    let mut top = SceneBuilder::new(&device)?;
    let mut shared: Vec<Option<CommittedScene>> = vec![None; geometry.shapes.len()];
    for (i, object) in geometry.objects.iter().enumerate() {
        let shape = geometry.shape(object.shape);
        let attached = match &object.placement {
            None => shape_geometry(&device, shape)?,
            Some(place) => {
                let slot = &mut shared[object.shape.index()];
                let scene = match slot {
                    Some(scene) => &*scene,
                    None => {
                        let mut builder = SceneBuilder::new(&device)?;
                        builder.attach(&shape_geometry(&device, shape)?, 0)?;
                        &*slot.insert(builder.commit()?)
                    }
                };
                EmbreeGeometry::instance(&device, scene, columns(&place.world_from_object))?
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

fn build(geometry: &Arc<Geometry>, threads: usize) -> Result<Box<dyn Accelerator>> {
    Ok(Box::new(build_scene(geometry, threads).map_err(failure)?))
}

/// The registry's line.
pub(super) const ENTRY: AcceleratorEntry = AcceleratorEntry {
    name: "embree",
    doc: "Intel Embree 4 in robust mode",
    build,
};
