//! Filters: surfaces that let rays pass.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use super::{FAR, TRIANGLE, UNIT_SPHERE, device, look_up, moved, near, scene, spheres};
use crate::ffi::{CommittedScene, Device, Geometry, HitFilter, INVALID_ID, RawHit};

/// Decides by a function, and counts for how long it is kept.
struct Decides<F> {
    stops: F,
    kept: Arc<AtomicUsize>,
}

impl<F: Fn(u64, &RawHit, bool) -> bool + Send + Sync> HitFilter for Decides<F> {
    fn stops(&self, key: u64, hit: &RawHit, outward: bool) -> bool {
        (self.stops)(key, hit, outward)
    }
}

impl<F> Drop for Decides<F> {
    fn drop(&mut self) {
        self.kept.fetch_sub(1, Ordering::Relaxed);
    }
}

type Boxed = Option<Box<dyn HitFilter>>;

fn filter(
    kept: &Arc<AtomicUsize>,
    stops: impl Fn(u64, &RawHit, bool) -> bool + Send + Sync + 'static,
) -> Boxed {
    kept.fetch_add(1, Ordering::Relaxed);
    Some(Box::new(Decides {
        stops,
        kept: kept.clone(),
    }))
}

fn triangles(device: &Device, filter: Boxed) -> Geometry {
    Geometry::triangles(device, &TRIANGLE, &[[0, 1, 2]], filter).expect("a triangle")
}

fn hidden(scene: &CommittedScene, org: [f32; 3], key: u64) -> bool {
    scene.occluded(org, [0.0, 0.0, 1.0], 0.0, FAR, || key)
}

#[test]
fn a_hit_that_is_let_pass_is_none() {
    let (device, kept) = (device(), Arc::default());
    // The half of the triangle with u below a quarter is missing.
    let cut = triangles(&device, filter(&kept, |_, hit, _| hit.u >= 0.25));
    let behind = spheres(&device, &[[0.0, 0.0, 5.0, 2.0]]);
    let scene = scene(&device, &[(3, &cut), (7, &behind)]);
    let hit = |x| look_up(&scene, [x, 0.25, -1.0]).map(|h| h.geom);
    assert_eq!((hit(0.5), hit(0.125)), (Some(3), Some(7)));
    assert!(hidden(&scene, [0.5, 0.25, -1.0], 0) && hidden(&scene, [0.125, 0.25, -1.0], 0));
    // Where nothing is behind, nothing is hit.
    let upward = |x| scene.intersect([x, 0.25, 1.0], [0.0, 0.0, -1.0], 0.0, FAR, || 0);
    assert!(upward(0.5).is_some() && upward(0.125).is_none());
    let above = |x| scene.occluded([x, 0.25, 1.0], [0.0, 0.0, -1.0], 0.0, FAR, || 0);
    assert!(above(0.5) && !above(0.125));
}

#[test]
fn a_filter_sees_the_key_the_hit_and_its_side() {
    let (device, kept) = (device(), Arc::default());
    // A sphere of which only the inside stops, and only rays of one key.
    let stops = |key: u64, hit: &RawHit, outward: bool| {
        assert_eq!((hit.prim, hit.geom, hit.inst), (0, 4, INVALID_ID));
        key == u64::MAX - 5 && outward
    };
    let sphere = Geometry::spheres(&device, &[UNIT_SPHERE], filter(&kept, stops)).expect("one");
    let scene = scene(&device, &[(4, &sphere)]);
    let ask = |key| scene.intersect([0.0, 0.0, -5.0], [0.0, 0.0, 1.0], 0.0, FAR, || key);
    let far = ask(u64::MAX - 5).expect("the far side");
    assert!(near(far.t, 6.0), "{far:?}");
    assert!(ask(1).is_none());
    assert!(hidden(&scene, [0.0, 0.0, -5.0], u64::MAX - 5));
    assert!(!hidden(&scene, [0.0, 0.0, -5.0], 1));
}

#[test]
fn a_filter_works_in_an_instance() {
    let (device, kept) = (device(), Arc::default());
    // One of two instances of the same triangle lets everything pass.
    let by_instance = filter(&kept, |_, hit, _| hit.top_level() == 2);
    let content = scene(&device, &[(5, &triangles(&device, by_instance))]);
    let [whole, open] = [0.0, 3.0].map(|x| {
        Geometry::instance(&device, &content, moved([x, 0.0, 10.0])).expect("an instance")
    });
    drop(content);
    let scene = scene(&device, &[(2, &whole), (6, &open)]);
    drop((whole, open));
    assert_eq!(look_up(&scene, [0.25, 0.25, 0.0]).map(|h| h.inst), Some(2));
    assert!(look_up(&scene, [3.25, 0.25, 0.0]).is_none());
    assert!(hidden(&scene, [0.25, 0.25, 0.0], 0) && !hidden(&scene, [3.25, 0.25, 0.0], 0));
    assert_eq!(kept.load(Ordering::Relaxed), 1);
    drop(scene);
    assert_eq!(kept.load(Ordering::Relaxed), 0);
}

#[test]
fn a_filter_lives_as_long_as_what_can_ask_it() {
    let (device, kept) = (device(), Arc::default());
    let one = triangles(&device, filter(&kept, |_, _, _| true));
    let [first, second] = [0, 1].map(|id| scene(&device, &[(id, &one)]));
    drop(one);
    drop(first);
    assert_eq!(kept.load(Ordering::Relaxed), 1);
    assert!(look_up(&second, [0.25, 0.25, -1.0]).is_some());
    drop(second);
    assert_eq!(kept.load(Ordering::Relaxed), 0);
    // One that was never in a scene, and one of a geometry that could not be built.
    drop(triangles(&device, filter(&kept, |_, _, _| true)));
    let bad = Geometry::triangles(
        &device,
        &TRIANGLE,
        &[[0, 1, 9]],
        filter(&kept, |_, _, _| true),
    );
    assert!(bad.is_err());
    assert_eq!(kept.load(Ordering::Relaxed), 0);
}

#[test]
fn threads_share_a_filter() {
    let (device, kept) = (device(), Arc::default());
    let asked = Arc::new(AtomicUsize::new(0));
    let counter = asked.clone();
    let even = filter(&kept, move |key, _, _| {
        counter.fetch_add(1, Ordering::Relaxed);
        key % 2 == 0
    });
    let scene = scene(&device, &[(0, &triangles(&device, even))]);
    thread::scope(|s| {
        for start in 0..4 {
            let scene = &scene;
            s.spawn(move || {
                for key in start..start + 200 {
                    let from = [0.25, 0.25, -1.0];
                    let hit = scene.intersect(from, [0.0, 0.0, 1.0], 0.0, FAR, || key);
                    assert_eq!(hit.is_some(), key % 2 == 0);
                    assert_eq!(hidden(scene, from, key), key % 2 == 0);
                }
            });
        }
    });
    // A filter may be asked more than once about one hit.
    assert!(asked.load(Ordering::Relaxed) >= 4 * 200 * 2);
}
