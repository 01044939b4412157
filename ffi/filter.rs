//! Filters: hits that a surface lets pass.
//!
//! A geometry with a filter asks it about every hit. Queries of scenes that hold such geometries
//! carry a key, by which a filter that decides by chance can tell rays apart.

use std::fmt;
use std::mem::{offset_of, size_of};
use std::sync::Arc;

use embree4_sys::{
    RTCFeatureFlags, RTCFilterFunctionNArguments, RTCGeometry, RTCIntersectArguments,
    RTCOccludedArguments, RTCRay, RTCRayQueryContext, RTCRayQueryFlags,
};

use super::RawHit;
use super::abi::{Hit, INVALID_ID};

/// Decides about hits. It is called on whatever thread traces the ray, and must not panic.
pub trait HitFilter: Send + Sync {
    /// Whether the hit counts. `key` is that of the query; `outward` tells whether the ray runs
    /// along the geometric normal, out of a body.
    fn stops(&self, key: u64, hit: &RawHit, outward: bool) -> bool;
}

/// A filter where Embree can point at it.
pub(super) struct Filter(pub(super) Box<dyn HitFilter>);

impl fmt::Debug for Filter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Filter")
    }
}

/// Embree's query context, with room for every version of it, and what we add. A context of
/// Embree is a few ids, all of which say "none" at first: all bits set.
#[repr(C, align(16))]
pub(super) struct Context {
    base: [u8; 64],
    pub(super) key: u64,
}

const _: () = {
    assert!(size_of::<RTCRayQueryContext>() <= 64);
    assert!(offset_of!(Context, base) == 0);
};

impl Context {
    #[inline]
    pub(super) fn new(key: u64) -> Self {
        Self {
            base: [u8::MAX; 64],
            key,
        }
    }

    #[inline]
    pub(super) fn intersect_arguments(&mut self) -> RTCIntersectArguments {
        RTCIntersectArguments {
            flags: RTCRayQueryFlags::NONE,
            feature_mask: RTCFeatureFlags(u32::MAX),
            context: (&raw mut *self).cast(),
            filter: None,
            intersect: None,
        }
    }

    #[inline]
    pub(super) fn occluded_arguments(&mut self) -> RTCOccludedArguments {
        RTCOccludedArguments {
            flags: RTCRayQueryFlags::NONE,
            feature_mask: RTCFeatureFlags(u32::MAX),
            context: (&raw mut *self).cast(),
            filter: None,
            occluded: None,
        }
    }
}

/// Makes Embree ask `filter` about hits of a geometry that is not committed yet. Whoever can
/// query the geometry must hold the filter.
pub(super) fn install(geometry: RTCGeometry, filter: &Arc<Filter>) {
    let pointer: *const Filter = Arc::as_ptr(filter);
    // SAFETY: the geometry is alive and only known to the caller. Embree does nothing with the
    // pointer but hand it to `on_hit`, which only reads through it.
    unsafe { embree4_sys::rtcSetGeometryUserData(geometry, pointer.cast_mut().cast()) };
    // SAFETY: the geometry is alive; `on_hit` has the signature that Embree declares.
    unsafe { embree4_sys::rtcSetGeometryIntersectFilterFunction(geometry, Some(on_hit)) };
    // SAFETY: as above.
    unsafe { embree4_sys::rtcSetGeometryOccludedFilterFunction(geometry, Some(on_hit)) };
}

/// Called by Embree for a hit of a geometry with a filter.
// SAFETY: only Embree calls it, with arguments that it made.
pub(super) unsafe extern "C" fn on_hit(args: *const RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes a pointer to arguments that live during the call.
    let args = unsafe { &*args };
    if args.N != 1 {
        return; // Only single rays are ever traced here; a hit that is not asked about counts.
    }
    // SAFETY: the pointer was set by `install`; scenes that reach the geometry hold the filter.
    let filter = unsafe { &*args.geometryUserPtr.cast_const().cast::<Filter>() };
    // SAFETY: scenes with filters are only queried with a `Context`.
    let key = unsafe { (*args.context.cast_const().cast::<Context>()).key };
    // SAFETY: for a single ray `RTCRayN` is laid out as `RTCRay`.
    let ray = unsafe { &*args.ray.cast_const().cast::<RTCRay>() };
    let hit: *const Hit = args.hit.cast_const().cast();
    // SAFETY: for a single ray `RTCHitN` begins as `RTCHit` does; the fields read here are in
    // every version. The whole struct is not referred to, as an older one is shorter.
    let (ng, u, v, prim, geom, inst) = unsafe {
        (
            (*hit).ng,
            (*hit).u,
            (*hit).v,
            (*hit).prim,
            (*hit).geom,
            (*hit).inst,
        )
    };
    let raw = RawHit {
        t: ray.tfar,
        u,
        v,
        prim,
        geom,
        inst,
    };
    debug_assert_ne!(raw.prim, INVALID_ID);
    // Ray and normal are both in the space of the geometry.
    let outward = ray.dir_x * ng[0] + ray.dir_y * ng[1] + ray.dir_z * ng[2] > 0.0;
    if !filter.0.stops(key, &raw, outward) {
        // SAFETY: one flag for the one ray, ours to clear.
        unsafe { *args.valid = 0 };
    }
}
