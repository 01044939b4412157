//! The unsafe code that calls nothing foreign: what Embree calls back, and what reads its answers.
//! These tests play Embree's part, so that Miri can run them (`scripts/miri`).

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use embree4_sys::RTCFilterFunctionNArguments;

use crate::ffi::abi::{self, RayHit};
use crate::ffi::filter::{Context, Filter, on_hit};
use crate::ffi::scene::{is_ray, raw_hit};
use crate::ffi::{HitFilter, INVALID_ID, RawHit};

/// Lets keys up to one pass, and adds up who asked.
struct Up {
    to: u64,
    asked: Arc<AtomicU64>,
}

impl HitFilter for Up {
    fn stops(&self, key: u64, hit: &RawHit, outward: bool) -> bool {
        assert_eq!((hit.t, hit.u, hit.v), (2.5, 0.25, 0.5));
        assert_eq!((hit.prim, hit.geom, hit.inst), (3, 4, INVALID_ID));
        assert!(outward);
        self.asked.fetch_add(key, Ordering::Relaxed);
        key > self.to
    }
}

fn query() -> RayHit {
    let mut query = RayHit::new(abi::ray([0.0; 3], [0.0, 0.0, 2.0], 0.0, 2.5));
    query.hit.ng = [0.0, 0.0, 0.5];
    (query.hit.u, query.hit.v) = (0.25, 0.5);
    (query.hit.prim, query.hit.geom) = (3, 4);
    query
}

/// What Embree does about a hit of a geometry with a filter: whether the hit counts.
fn asked(filter: &Arc<Filter>, key: u64, count: u32) -> bool {
    let mut context = Context::new(key);
    let mut query = query();
    let mut valid = -1;
    let args = RTCFilterFunctionNArguments {
        valid: &raw mut valid,
        geometryUserPtr: Arc::as_ptr(filter).cast_mut().cast(),
        context: context.intersect_arguments().context,
        ray: (&raw mut query.ray).cast(),
        hit: (&raw mut query.hit).cast(),
        N: count,
    };
    // SAFETY: arguments as Embree makes them for one ray; all that they point at lives on.
    unsafe { on_hit(&raw const args) };
    valid != 0
}

#[test]
fn a_filter_decides_by_the_key() {
    let counted = Arc::new(AtomicU64::new(0));
    let filter = Arc::new(Filter(Box::new(Up {
        to: 7,
        asked: counted.clone(),
    })));
    assert!(!asked(&filter, 7, 1));
    assert!(asked(&filter, 8, 1));
    std::thread::scope(|s| {
        for key in 9..13 {
            let filter = &filter;
            s.spawn(move || assert!(asked(filter, key, 1)));
        }
    });
    assert_eq!(counted.load(Ordering::Relaxed), 57);
    // Packets are never traced: such a question is not answered, and the hit counts.
    assert!(asked(&filter, 1, 4));
    assert_eq!(counted.load(Ordering::Relaxed), 57);
}

#[test]
fn shadow_rays_carry_their_key_too() {
    let mut context = Context::new(5);
    let pointer = context.occluded_arguments().context;
    // SAFETY: it points at the whole of our context, as `on_hit` relies on.
    assert_eq!(unsafe { (*pointer.cast::<Context>()).key }, 5);
}

#[test]
fn answers_are_read_as_they_were_written() {
    assert!(raw_hit(&RayHit::new(abi::ray([0.0; 3], [1.0; 3], 0.0, 1.0))).is_none());
    let hit = raw_hit(&query()).expect("a hit");
    assert_eq!((hit.t, hit.u, hit.v, hit.prim), (2.5, 0.25, 0.5, 3));
}

#[test]
fn malformed_rays_are_told() {
    let (o, d, far) = ([0.0; 3], [0.0, 0.0, 1.0], f32::INFINITY);
    assert!(is_ray(o, d, 0.0, far) && is_ray([3e38; 3], [3e38; 3], 1.0, 1.0));
    assert!(!is_ray(o, [0.0; 3], 0.0, far) && !is_ray(o, d, 2.0, 1.0));
    for bad in [f32::NAN, far, -far] {
        assert!(!is_ray([0.0, bad, 0.0], d, 0.0, far) && !is_ray(o, [1.0, 0.0, bad], 0.0, far));
        assert!(!is_ray(o, d, bad, far));
    }
    assert!(!is_ray(o, d, 0.0, f32::NAN) && !is_ray(o, d, 0.0, -far));
}
