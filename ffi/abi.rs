//! The memory layout shared with the Embree library.
//!
//! `embree4-sys` declares the structs of the 4.2 headers. Since 4.3 an Embree with
//! instance arrays, as distributed, has one field more in `RTCHit`, `instPrimID` after
//! `instID`: 36 bytes, rounded up to 48 by the alignment of 16, where 4.2 has 32. So
//! `RTCRayHit` is 96 bytes instead of 80, and a newer library writes past the end of the
//! older struct (checked against 4.4.0: it stores to bytes 80..84, see the tests). Hence
//! [`RayHit`], which has that room. All fields before it lie where they always did, so it
//! also serves a library without the field.
//!
//! `RTCRay`, `RTCBounds`, and the constants used here are the same in every Embree 4.

use std::mem::{align_of, offset_of, size_of};

use embree4_sys::{RTCBounds, RTCHit, RTCRay, RTCRayHit};

/// The id Embree stores where there is no hit or no instance.
pub(super) const INVALID_ID: u32 = embree4_sys::RTC_INVALID_GEOMETRY_ID;

/// `RTCHit` as libraries from 4.3 on declare it, with one level of instances.
#[repr(C, align(16))]
pub(super) struct Hit {
    /// Normal, not normalised, in the space of the geometry.
    pub(super) ng: [f32; 3],
    /// Barycentric coordinates on triangles, 0 on spheres.
    pub(super) u: f32,
    /// See `u`.
    pub(super) v: f32,
    /// Triangle or sphere in its geometry.
    pub(super) prim: u32,
    /// Geometry in its scene, [`INVALID_ID`] for a miss.
    pub(super) geom: u32,
    /// Instance in the queried scene, [`INVALID_ID`] if none.
    pub(super) inst: u32,
    /// Which one of an instance array; unknown to Embree before 4.3.
    pub(super) inst_prim: u32,
}

/// `RTCRayHit`: what `rtcIntersect1` reads and writes.
#[repr(C)]
pub(super) struct RayHit {
    /// The ray; `tfar` becomes the distance of the hit.
    pub(super) ray: RTCRay,
    /// The hit.
    pub(super) hit: Hit,
}

impl RayHit {
    /// A query for this ray that has hit nothing yet.
    #[inline]
    pub(super) fn new(ray: RTCRay) -> Self {
        let hit = Hit {
            ng: [0.0; 3],
            u: 0.0,
            v: 0.0,
            prim: INVALID_ID,
            geom: INVALID_ID,
            inst: INVALID_ID,
            inst_prim: INVALID_ID,
        };
        Self { ray, hit }
    }
}

/// A ray that sees every geometry.
#[inline]
pub(super) fn ray(org: [f32; 3], dir: [f32; 3], tnear: f32, tfar: f32) -> RTCRay {
    RTCRay {
        org_x: org[0],
        org_y: org[1],
        org_z: org[2],
        tnear,
        dir_x: dir[0],
        dir_y: dir[1],
        dir_z: dir[2],
        time: 0.0,
        tfar,
        mask: u32::MAX,
        id: 0,
        flags: 0,
    }
}

// Where the library finds things.
const _: () = {
    assert!(size_of::<RTCRay>() == 48 && align_of::<RTCRay>() == 16);
    assert!(offset_of!(RTCRay, tfar) == 32 && offset_of!(RTCRay, flags) == 44);
    assert!(size_of::<RTCBounds>() == 32 && align_of::<RTCBounds>() == 16);

    assert!(size_of::<Hit>() == 48 && align_of::<Hit>() == 16);
    assert!(size_of::<RayHit>() == 96 && align_of::<RayHit>() == 16);
    assert!(offset_of!(RayHit, hit) == offset_of!(RTCRayHit, hit));

    // Ours agrees with the declared one in all that both have, and is no smaller.
    assert!(size_of::<RayHit>() >= size_of::<RTCRayHit>());
    assert!(align_of::<RayHit>() >= align_of::<RTCRayHit>());
    assert!(offset_of!(Hit, ng) == offset_of!(RTCHit, Ng_x));
    assert!(offset_of!(Hit, u) == offset_of!(RTCHit, u));
    assert!(offset_of!(Hit, v) == offset_of!(RTCHit, v));
    assert!(offset_of!(Hit, prim) == offset_of!(RTCHit, primID));
    assert!(offset_of!(Hit, geom) == offset_of!(RTCHit, geomID));
    assert!(offset_of!(Hit, inst) == offset_of!(RTCHit, instID));
    assert!(offset_of!(Hit, inst_prim) == 32);
};
