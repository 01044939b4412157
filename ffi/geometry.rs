//! Geometries: triangle meshes, spheres and instances of a scene.
//!
//! A geometry is complete when it is made, and never changes afterwards.

use std::ptr::NonNull;
use std::sync::Arc;

use embree4_sys::{RTCBufferType, RTCFormat, RTCGeometry, RTCGeometryTy, RTCGeometryType};

use super::filter::{self, Filter};
use super::scene::CommittedScene;
use super::{Device, EmbreeError, ErrorCode, HitFilter};

/// A mesh, a set of spheres or an instance, ready to be attached to scenes.
#[derive(Debug)]
pub struct Geometry {
    geometry: NonNull<RTCGeometryTy>,
    /// The scene an instance shows.
    instanced: Option<CommittedScene>,
    /// Who decides about its hits.
    filter: Option<Arc<Filter>>,
    /// Dropped last: Embree's device outlives its geometries.
    device: Device,
}

// SAFETY: the pointer is owned by this struct. After `make` no call changes the geometry;
// attaching it, which counts references, happens under the build lock of its device.
unsafe impl Send for Geometry {}
// SAFETY: as above.
unsafe impl Sync for Geometry {}

impl Drop for Geometry {
    fn drop(&mut self) {
        // SAFETY: the pointer comes from `rtcNewGeometry` and this one reference is given
        // up only here; scenes it is attached to hold their own. The device is alive: it is
        // a field of this struct. Releasing is allowed on any thread.
        unsafe { embree4_sys::rtcReleaseGeometry(self.geometry.as_ptr()) }
    }
}

impl Geometry {
    /// A triangle mesh; triangle `i` is primitive `i`.
    ///
    /// `filter` decides about its hits, if there is one. Both slices are copied. Triangles with a vertex that is not finite, or as large as
    /// 1.8e18, are never hit; those without area hardly.
    ///
    /// # Errors
    ///
    /// If an index is out of range, there are more than 2³²-1 items, or memory runs out.
    pub fn triangles(
        device: &Device,
        positions: &[[f32; 3]],
        indices: &[[u32; 3]],
        filter: Option<Box<dyn HitFilter>>,
    ) -> Result<Self, EmbreeError> {
        let last = indices.as_flattened().iter().max();
        if last.is_some_and(|&last| last as usize >= positions.len()) {
            return Err(EmbreeError::argument(
                "a triangle refers to a vertex that does not exist",
            ));
        }
        Self::make(
            device,
            RTCGeometryType::TRIANGLE,
            None,
            filter,
            |geometry| {
                fill(
                    geometry,
                    RTCBufferType::VERTEX,
                    RTCFormat::FLOAT3,
                    positions,
                )?;
                fill(geometry, RTCBufferType::INDEX, RTCFormat::UINT3, indices)
            },
        )
    }

    /// Spheres, as centre and radius; sphere `i` is primitive `i`.
    ///
    /// `filter` decides about its hits, if there is one. The slice is copied. A sphere is hit from outside and from inside. Spheres that are
    /// not finite, have a negative radius, or reach 1.8e18 are never hit. One of radius 0
    /// may be.
    ///
    /// # Errors
    ///
    /// If there are more than 2³²-1 spheres or memory runs out.
    pub fn spheres(
        device: &Device,
        spheres: &[[f32; 4]],
        filter: Option<Box<dyn HitFilter>>,
    ) -> Result<Self, EmbreeError> {
        let kind = RTCGeometryType::SPHERE_POINT;
        Self::make(device, kind, None, filter, |geometry| {
            fill(geometry, RTCBufferType::VERTEX, RTCFormat::FLOAT4, spheres)
        })
    }

    /// An instance of a scene: its content seen through a transform.
    ///
    /// `local_to_world` has four columns, the images of the three axes and of the origin.
    /// The scene is kept alive. It must not hold instances itself: there is one level.
    ///
    /// # Errors
    ///
    /// If the transform is not finite or not invertible, or the scene is of another device
    /// or holds instances.
    pub fn instance(
        device: &Device,
        scene: &CommittedScene,
        local_to_world: [[f32; 3]; 4],
    ) -> Result<Self, EmbreeError> {
        if !device.is(scene.device()) {
            return Err(EmbreeError::argument(
                "the instanced scene belongs to another device",
            ));
        }
        if scene.has_instances() {
            return Err(EmbreeError::argument(
                "the instanced scene holds instances itself",
            ));
        }
        if !is_invertible(&local_to_world) {
            return Err(EmbreeError::argument(
                "the transform of an instance is not finite or not invertible",
            ));
        }
        Self::make(
            device,
            RTCGeometryType::INSTANCE,
            Some(scene.clone()),
            None,
            |geometry| {
                // SAFETY: both handles are alive and of one device. Embree counts a reference to
                // the scene, and `instanced` holds one too.
                unsafe { embree4_sys::rtcSetGeometryInstancedScene(geometry, scene.raw()) };
                let transform = local_to_world.as_flattened().as_ptr();
                // SAFETY: 12 floats, column after column, are there to be read during the call;
                // no alignment beyond that of a float is asked for.
                unsafe {
                    embree4_sys::rtcSetGeometryTransform(
                        geometry,
                        0,
                        RTCFormat::FLOAT3X4_COLUMN_MAJOR,
                        transform.cast(),
                    );
                }
                Ok(())
            },
        )
    }

    /// Makes a geometry: opened, filled, committed, under the build lock.
    fn make(
        device: &Device,
        kind: RTCGeometryType,
        instanced: Option<CommittedScene>,
        filter: Option<Box<dyn HitFilter>>,
        fill: impl FnOnce(RTCGeometry) -> Result<(), EmbreeError>,
    ) -> Result<Self, EmbreeError> {
        device.build(|| {
            // SAFETY: the device is alive; the result is checked.
            let geometry = NonNull::new(unsafe { embree4_sys::rtcNewGeometry(device.raw(), kind) });
            let geometry = geometry.ok_or_else(|| no_memory("a geometry"))?;
            let this = Self {
                geometry,
                instanced,
                filter: filter.map(|f| Arc::new(Filter(f))),
                device: device.clone(),
            };
            fill(geometry.as_ptr())?;
            if let Some(filter) = &this.filter {
                filter::install(geometry.as_ptr(), filter);
            }
            // SAFETY: the geometry is alive and only known here.
            unsafe { embree4_sys::rtcCommitGeometry(geometry.as_ptr()) };
            Ok(this)
        })?
    }

    /// The geometry for Embree's functions; valid while `self` lives.
    pub(super) fn raw(&self) -> RTCGeometry {
        self.geometry.as_ptr()
    }

    /// The device this was made with.
    pub(super) fn device(&self) -> &Device {
        &self.device
    }

    /// Who decides about its hits; to be held by whoever queries it.
    pub(super) fn filter(&self) -> Option<&Arc<Filter>> {
        self.filter.as_ref()
    }

    /// The scene this is an instance of.
    pub(super) fn instanced(&self) -> Option<&CommittedScene> {
        self.instanced.as_ref()
    }
}

/// Gives the geometry a buffer of its own with a copy of these items.
fn fill<const N: usize, T: Copy>(
    geometry: RTCGeometry,
    kind: RTCBufferType,
    format: RTCFormat,
    items: &[[T; N]],
) -> Result<(), EmbreeError> {
    if u32::try_from(items.len()).is_err() {
        return Err(EmbreeError::argument(
            "a geometry has more than 2^32 - 1 items",
        ));
    }
    // SAFETY: the geometry is alive. Embree allocates `stride * length` bytes (and for
    // vertices the few more its wide loads touch), aligned to 16, and frees them with the
    // geometry.
    let buffer = unsafe {
        embree4_sys::rtcSetNewGeometryBuffer(
            geometry,
            kind,
            0,
            format,
            size_of::<[T; N]>(),
            items.len(),
        )
    };
    // Nothing need be there for nothing.
    if items.is_empty() {
        return Ok(());
    }
    let buffer =
        NonNull::new(buffer.cast::<[T; N]>()).ok_or_else(|| no_memory("a geometry buffer"))?;
    // SAFETY: the buffer holds that many items, is aligned to 16, more than `[T; N]` needs,
    // was made just now, so it does not overlap, and is used by nobody before the commit.
    unsafe {
        buffer
            .as_ptr()
            .copy_from_nonoverlapping(items.as_ptr(), items.len())
    };
    Ok(())
}

/// Embree gave nothing, and would have said more if it knew more.
fn no_memory(what: &str) -> EmbreeError {
    EmbreeError::new(
        ErrorCode::OutOfMemory,
        format!("Embree could not make {what}"),
    )
}

/// Whether rays can be taken into the space of an instance: all finite, also the inverse.
fn is_invertible([x, y, z, origin]: &[[f32; 3]; 4]) -> bool {
    let cross = [
        y[1] * z[2] - y[2] * z[1],
        y[2] * z[0] - y[0] * z[2],
        y[0] * z[1] - y[1] * z[0],
    ];
    let determinant = x[0] * cross[0] + x[1] * cross[1] + x[2] * cross[2];
    origin.iter().all(|value| value.is_finite())
        && determinant.is_finite()
        && (1.0 / determinant).is_finite()
}
