//! Scenes: built once, committed, then only queried.

use std::ptr;
use std::ptr::NonNull;
use std::sync::Arc;

use embree4_sys::{RTCBounds, RTCScene, RTCSceneFlags, RTCSceneTy};

use super::abi::{self, RayHit};
use super::filter::{Context, Filter};
use super::{Device, EmbreeError, ErrorCode, Geometry};

/// The id that stands for "none" in a [`RawHit`]; no geometry may have it.
pub const INVALID_ID: u32 = abi::INVALID_ID;

/// The closest hit of a ray, as Embree tells it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawHit {
    /// Distance in lengths of the direction.
    pub t: f32,
    /// First barycentric coordinate, the weight of a triangle's second vertex; 0 on spheres.
    pub u: f32,
    /// Second barycentric coordinate, the weight of its third vertex; 0 on spheres.
    pub v: f32,
    /// Triangle or sphere in its geometry.
    pub prim: u32,
    /// Geometry in the scene that holds it: the queried one, or the one instanced.
    pub geom: u32,
    /// Instance in the queried scene, [`INVALID_ID`] if the geometry lies in it directly.
    pub inst: u32,
}

impl RawHit {
    /// The id, in the queried scene, of what was hit: the instance if any, or the geometry.
    #[inline]
    #[must_use]
    pub fn top_level(&self) -> u32 {
        if self.inst == INVALID_ID {
            self.geom
        } else {
            self.inst
        }
    }
}

/// Owns a scene and what it shows. Dropped in this order.
#[derive(Debug)]
struct Handle {
    scene: NonNull<RTCSceneTy>,
    /// The scenes its instances show.
    instanced: Vec<CommittedScene>,
    /// The filters of its geometries.
    filters: Vec<Arc<Filter>>,
    device: Device,
}

// SAFETY: the pointer is owned by this struct. A scene changes only in `SceneBuilder`,
// which is not shared, under the build lock of the device. After the commit there are only
// queries, which Embree allows from all threads at once.
unsafe impl Send for Handle {}
// SAFETY: as above.
unsafe impl Sync for Handle {}

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: the pointer comes from `rtcNewScene` and this one reference is given up
        // only here; no query runs, since each borrows a holder of this handle. The device
        // is a field and still alive. Releasing is allowed on any thread.
        unsafe { embree4_sys::rtcReleaseScene(self.scene.as_ptr()) }
    }
}

/// A scene that takes geometries, and cannot be queried yet.
#[derive(Debug)]
pub struct SceneBuilder {
    handle: Handle,
}

impl SceneBuilder {
    /// An empty scene, to be traversed robustly: no ray passes between neighbours.
    ///
    /// # Errors
    ///
    /// If memory runs out.
    pub fn new(device: &Device) -> Result<Self, EmbreeError> {
        Self::with_flags(device, RTCSceneFlags::ROBUST)
    }

    /// An empty scene to be traversed fast: rays may pass between neighbours that share an edge.
    /// What the others are measured against, not what renders.
    ///
    /// # Errors
    ///
    /// If memory runs out.
    pub fn fast(device: &Device) -> Result<Self, EmbreeError> {
        Self::with_flags(device, RTCSceneFlags::NONE)
    }

    fn with_flags(device: &Device, flags: RTCSceneFlags) -> Result<Self, EmbreeError> {
        let scene = device.build(|| {
            // SAFETY: the device is alive; the result is checked.
            let scene = unsafe { embree4_sys::rtcNewScene(device.raw()) };
            NonNull::new(scene).inspect(|scene| {
                // SAFETY: the scene was made just now and is only known here.
                unsafe { embree4_sys::rtcSetSceneFlags(scene.as_ptr(), flags) }
            })
        })?;
        let scene = scene.ok_or_else(|| {
            EmbreeError::new(ErrorCode::OutOfMemory, "Embree could not make a scene")
        })?;
        Ok(Self {
            handle: Handle {
                scene,
                instanced: Vec::new(),
                filters: Vec::new(),
                device: device.clone(),
            },
        })
    }

    /// Adds a geometry, to be reported as `id`. It may be in other scenes too.
    ///
    /// Embree keeps a table up to the largest id: number geometries from 0.
    ///
    /// # Errors
    ///
    /// If the id is taken or [`INVALID_ID`], or the geometry is of another device.
    pub fn attach(&mut self, geometry: &Geometry, id: u32) -> Result<(), EmbreeError> {
        let Handle {
            scene,
            instanced,
            filters,
            device,
        } = &mut self.handle;
        if !device.is(geometry.device()) {
            return Err(EmbreeError::argument(
                "the geometry belongs to another device than the scene",
            ));
        }
        if id == INVALID_ID {
            return Err(EmbreeError::argument(format!(
                "{id} cannot be the id of a geometry"
            )));
        }
        device.build(|| {
            // SAFETY: both handles are alive and of one device; the scene holds a reference
            // to the geometry from here on. The scene is not shared yet.
            unsafe { embree4_sys::rtcAttachGeometryByID(scene.as_ptr(), geometry.raw(), id) }
        })?;
        instanced.extend(geometry.instanced().cloned());
        filters.extend(geometry.filter().cloned());
        Ok(())
    }

    /// Builds the hierarchy, on Embree's threads.
    ///
    /// # Errors
    ///
    /// If memory runs out or Embree cannot build it.
    pub fn commit(self) -> Result<CommittedScene, EmbreeError> {
        let scene = self.handle.scene;
        let below = |s: &CommittedScene| s.has_filters();
        let filtered = !self.handle.filters.is_empty() || self.handle.instanced.iter().any(below);
        self.handle.device.build(|| {
            // SAFETY: the scene is alive and owned by this builder alone; its geometries are
            // committed, and the scenes of its instances too. Embree's threads are done with
            // it when the call returns.
            unsafe { embree4_sys::rtcCommitScene(scene.as_ptr()) }
        })?;
        Ok(CommittedScene {
            scene,
            filtered,
            handle: Arc::new(self.handle),
        })
    }
}

/// A scene ready for rays, from any number of threads. Clones are handles to the same one.
///
/// A ray starts at `org` and counts `t` in lengths of `dir`, which need not be 1. Hits
/// count for `tnear <= t <= tfar`; exactly at the ends they may. Faces are hit from both
/// sides. A ray that is not finite (save `tfar`), has no direction, or not
/// `0 <= tnear <= tfar` hits nothing: Embree is not asked.
#[derive(Clone, Debug)]
pub struct CommittedScene {
    /// The scene of `handle`, at hand for the queries.
    scene: NonNull<RTCSceneTy>,
    /// Whether some hits are asked about.
    filtered: bool,
    handle: Arc<Handle>,
}

// SAFETY: `scene` only repeats the pointer of `handle`, which may be sent and shared.
unsafe impl Send for CommittedScene {}
// SAFETY: as above.
unsafe impl Sync for CommittedScene {}

impl CommittedScene {
    /// The closest hit of a ray that filters let count; `key` is what they tell rays apart by,
    /// asked for only if there are any.
    #[inline]
    #[must_use]
    pub fn intersect(
        &self,
        org: [f32; 3],
        dir: [f32; 3],
        tnear: f32,
        tfar: f32,
        key: impl FnOnce() -> u64,
    ) -> Option<RawHit> {
        if self.filtered {
            return self.intersect_filtered(org, dir, tnear, tfar, key());
        }
        if !is_ray(org, dir, tnear, tfar) {
            return None;
        }
        let mut query = RayHit::new(abi::ray(org, dir, tnear, tfar));
        // SAFETY: the scene is alive and committed, and queries may run on any thread. The
        // query is ours to write, has the alignment of 16 and all the room the library may
        // use (`abi.rs`). No arguments means Embree's defaults, without callbacks.
        unsafe { embree4_sys::rtcIntersect1(self.raw(), (&raw mut query).cast(), ptr::null_mut()) };
        raw_hit(&query)
    }

    #[inline(never)]
    fn intersect_filtered(
        &self,
        org: [f32; 3],
        dir: [f32; 3],
        tnear: f32,
        tfar: f32,
        key: u64,
    ) -> Option<RawHit> {
        if !is_ray(org, dir, tnear, tfar) {
            return None;
        }
        let mut query = RayHit::new(abi::ray(org, dir, tnear, tfar));
        let mut context = Context::new(key);
        let mut args = context.intersect_arguments();
        // SAFETY: as in `intersect`; the arguments and the context they point at live until the
        // call returns, and have the room that the library may use.
        unsafe {
            embree4_sys::rtcIntersect1(self.raw(), (&raw mut query).cast(), &raw mut args);
        }
        raw_hit(&query)
    }

    #[inline(never)]
    fn occluded_filtered(
        &self,
        org: [f32; 3],
        dir: [f32; 3],
        tnear: f32,
        tfar: f32,
        key: u64,
    ) -> bool {
        if !is_ray(org, dir, tnear, tfar) {
            return false;
        }
        let mut ray = abi::ray(org, dir, tnear, tfar);
        let mut context = Context::new(key);
        let mut args = context.occluded_arguments();
        // SAFETY: as in `intersect_filtered`.
        unsafe { embree4_sys::rtcOccluded1(self.raw(), &raw mut ray, &raw mut args) };
        ray.tfar < 0.0
    }

    /// Whether a ray hits anything that filters let count; `key` as in
    /// [`intersect`](Self::intersect).
    #[inline]
    #[must_use]
    pub fn occluded(
        &self,
        org: [f32; 3],
        dir: [f32; 3],
        tnear: f32,
        tfar: f32,
        key: impl FnOnce() -> u64,
    ) -> bool {
        if self.filtered {
            return self.occluded_filtered(org, dir, tnear, tfar, key());
        }
        if !is_ray(org, dir, tnear, tfar) {
            return false;
        }
        let mut ray = abi::ray(org, dir, tnear, tfar);
        // SAFETY: as in `intersect`; `RTCRay` is the same in every Embree 4 (`abi.rs`).
        unsafe { embree4_sys::rtcOccluded1(self.raw(), &raw mut ray, ptr::null_mut()) };
        // Embree marks a hit with minus infinity.
        ray.tfar < 0.0
    }

    /// The least and the greatest corner of a box around everything, `None` if empty.
    #[must_use]
    pub fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        let mut bounds = RTCBounds {
            lower_x: f32::INFINITY,
            lower_y: f32::INFINITY,
            lower_z: f32::INFINITY,
            align0: 0.0,
            upper_x: f32::NEG_INFINITY,
            upper_y: f32::NEG_INFINITY,
            upper_z: f32::NEG_INFINITY,
            align1: 0.0,
        };
        // SAFETY: the scene is alive and committed; the box is ours to write and aligned.
        unsafe { embree4_sys::rtcGetSceneBounds(self.raw(), &raw mut bounds) };
        let least = [bounds.lower_x, bounds.lower_y, bounds.lower_z];
        let greatest = [bounds.upper_x, bounds.upper_y, bounds.upper_z];
        (0..3)
            .all(|axis| least[axis] <= greatest[axis])
            .then_some([least, greatest])
    }

    /// The scene for Embree's functions; valid while `self` lives.
    #[inline]
    pub(super) fn raw(&self) -> RTCScene {
        self.scene.as_ptr()
    }

    /// The device this was built with.
    pub(super) fn device(&self) -> &Device {
        &self.handle.device
    }

    /// Whether hits of some of its geometries are asked about.
    #[inline]
    #[must_use]
    pub fn has_filters(&self) -> bool {
        self.filtered
    }

    /// Whether some of its geometries are instances.
    pub(super) fn has_instances(&self) -> bool {
        !self.handle.instanced.is_empty()
    }
}

/// What a query found.
#[inline]
pub(super) fn raw_hit(RayHit { ray, hit }: &RayHit) -> Option<RawHit> {
    // The library has just written single numbers here. A compiler that loads a vector which holds
    // one of them makes the processor wait until all of it is in the cache; told not to touch the
    // load, it loads what was written.
    // SAFETY: a reference is valid for reads.
    let single = |value: &f32| unsafe { ptr::read_volatile(value) };
    (hit.geom != INVALID_ID).then(|| RawHit {
        t: single(&ray.tfar),
        u: single(&hit.u),
        v: single(&hit.v),
        prim: hit.prim,
        geom: hit.geom,
        inst: hit.inst,
    })
}

/// Whether Embree may see this ray.
#[inline]
pub(super) fn is_ray(org: [f32; 3], dir: [f32; 3], tnear: f32, tfar: f32) -> bool {
    // A sum of sizes is only finite if all of them are; if it is not, it may have overflowed.
    let length = dir[0].abs() + dir[1].abs() + dir[2].abs();
    let sum = length + (org[0].abs() + org[1].abs() + org[2].abs());
    let finite = sum < f32::INFINITY || org.iter().chain(&dir).all(|x| x.is_finite());
    // Comparisons with what is not a number are false.
    finite && length > 0.0 && 0.0 <= tnear && tnear <= tfar && tnear < f32::INFINITY
}
