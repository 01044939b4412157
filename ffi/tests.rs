//! What the rest of the crate relies on, asked of the real library.

mod by_hand;
mod filter;

use std::ptr;
use std::thread;

use super::abi::{self, RayHit};
use super::{
    CommittedScene, Device, EmbreeError, ErrorCode, Geometry, INVALID_ID, RawHit, SceneBuilder,
};

const FAR: f32 = f32::INFINITY;
const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
const UNIT_SPHERE: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

fn device() -> Device {
    Device::new("threads=2").expect("a device opens")
}

fn triangle(device: &Device) -> Geometry {
    Geometry::triangles(device, &TRIANGLE, &[[0, 1, 2]], None).expect("a triangle")
}

fn spheres(device: &Device, spheres: &[[f32; 4]]) -> Geometry {
    Geometry::spheres(device, spheres, None).expect("spheres")
}

fn scene(device: &Device, geometries: &[(u32, &Geometry)]) -> CommittedScene {
    let mut builder = SceneBuilder::new(device).expect("a scene");
    for (id, geometry) in geometries {
        builder.attach(geometry, *id).expect("attached");
    }
    builder.commit().expect("committed")
}

/// A transform that only moves.
fn moved(by: [f32; 3]) -> [[f32; 3]; 4] {
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], by]
}

/// The closest hit towards +z, from a point.
fn look_up(scene: &CommittedScene, org: [f32; 3]) -> Option<RawHit> {
    scene.intersect(org, [0.0, 0.0, 1.0], 0.0, FAR, || 0)
}

/// Equal but for the last digits, which differ between processors.
fn near(value: f32, expected: f32) -> bool {
    (value - expected).abs() <= 1e-5
}

fn code<T>(result: Result<T, EmbreeError>) -> Option<ErrorCode> {
    result.err().map(|error| error.code)
}

#[test]
fn a_triangle_is_hit_where_it_is() {
    let device = device();
    let scene = scene(&device, &[(0, &triangle(&device))]);
    let hit = look_up(&scene, [0.25, 0.5, -2.0]).expect("a hit");
    assert!(
        near(hit.t, 2.0) && near(hit.u, 0.25) && near(hit.v, 0.5),
        "{hit:?}"
    );
    assert_eq!(
        (hit.prim, hit.geom, hit.inst, hit.top_level()),
        (0, 0, INVALID_ID, 0)
    );
    // From the other side too, but not beside it.
    assert!(
        scene
            .intersect([0.25, 0.5, 3.0], [0.0, 0.0, -1.0], 0.0, FAR, || 0)
            .is_some()
    );
    assert_eq!(look_up(&scene, [0.75, 0.75, -2.0]), None);
}

#[test]
fn a_sphere_is_hit_from_outside_and_inside() {
    let device = device();
    let scene = scene(&device, &[(0, &spheres(&device, &[UNIT_SPHERE]))]);
    let outside = look_up(&scene, [0.0, 0.0, -5.0]).expect("a hit");
    assert!(near(outside.t, 4.0), "{outside:?}");
    let inside = look_up(&scene, [0.0, 0.0, 0.5]).expect("the exit");
    assert!(near(inside.t, 0.5), "{inside:?}");
}

#[test]
fn a_distance_counts_in_lengths_of_the_direction() {
    let device = device();
    let scene = scene(&device, &[(0, &triangle(&device))]);
    let hit = scene
        .intersect([0.25, 0.25, -2.0], [0.0, 0.0, 4.0], 0.0, FAR, || 0)
        .expect("a hit");
    assert!(near(hit.t, 0.5), "{hit:?}");
}

#[test]
fn only_what_lies_on_the_segment_counts() {
    let device = device();
    let scene = scene(&device, &[(0, &triangle(&device))]);
    let (org, up) = ([0.25, 0.25, -2.0], [0.0, 0.0, 1.0]);
    for (tnear, tfar, expected) in [
        (0.0, 3.0, true),
        (0.0, 1.5, false),
        (2.5, 3.0, false),
        (1.5, 2.5, true),
    ] {
        assert_eq!(
            scene.intersect(org, up, tnear, tfar, || 0).is_some(),
            expected,
            "{tnear}..{tfar}"
        );
        assert_eq!(
            scene.occluded(org, up, tnear, tfar, || 0),
            expected,
            "{tnear}..{tfar}"
        );
    }
}

#[test]
fn ids_tell_geometry_and_primitive() {
    let device = device();
    let two = [[0.0, 0.0, 0.0, 0.5], [4.0, 0.0, 0.0, 0.5]];
    let positions = [
        [8.0, -1.0, 0.0],
        [9.0, -1.0, 0.0],
        [8.0, 1.0, 0.0],
        [9.0, 1.0, 0.0],
    ];
    let mesh =
        Geometry::triangles(&device, &positions, &[[0, 1, 2], [2, 1, 3]], None).expect("a mesh");
    let scene = scene(&device, &[(7, &spheres(&device, &two)), (3, &mesh)]);
    for (x, y, expected) in [
        (0.0, 0.0, (7, 0)),
        (4.0, 0.0, (7, 1)),
        (8.1, -0.9, (3, 0)),
        (8.9, 0.9, (3, 1)),
    ] {
        let hit = look_up(&scene, [x, y, -5.0]).expect("a hit");
        assert_eq!((hit.geom, hit.prim), expected);
        assert_eq!(hit.inst, INVALID_ID);
    }
}

#[test]
fn an_instance_is_hit_where_it_was_moved_to() {
    let device = device();
    let content = scene(
        &device,
        &[(5, &spheres(&device, &[[9.0, 0.0, 0.0, 0.1], UNIT_SPHERE]))],
    );
    let ahead =
        Geometry::instance(&device, &content, moved([0.0, 0.0, 10.0])).expect("an instance");
    let aside =
        Geometry::instance(&device, &content, moved([3.0, 0.0, 10.0])).expect("an instance");
    // The instances keep their scene.
    drop(content);
    let scene = scene(
        &device,
        &[(2, &ahead), (4, &aside), (6, &triangle(&device))],
    );
    for (x, inst) in [(0.0, 2), (3.0, 4)] {
        let hit = look_up(&scene, [x, 0.0, 1.0]).expect("a hit");
        assert!(near(hit.t, 8.0), "{hit:?}");
        assert_eq!(
            (hit.prim, hit.geom, hit.inst, hit.top_level()),
            (1, 5, inst, inst)
        );
    }
    // A hit outside of an instance tells so even after ones inside.
    assert_eq!(
        look_up(&scene, [0.25, 0.25, -1.0]).map(|hit| (hit.geom, hit.inst)),
        Some((6, INVALID_ID))
    );
}

#[test]
fn a_geometry_serves_several_scenes() {
    let device = device();
    let shared = triangle(&device);
    let first = scene(&device, &[(0, &shared)]);
    let second = scene(&device, &[(1, &shared)]);
    drop(shared);
    drop(first);
    assert_eq!(
        look_up(&second, [0.25, 0.25, -1.0]).map(|hit| hit.geom),
        Some(1)
    );
}

/// The room `RayHit` keeps for `instPrimID` is needed, and all the library touches.
#[test]
fn the_library_writes_within_the_ray_hit() {
    const UNTOUCHED: u32 = 0xDEAD_BEEF;
    #[repr(C)]
    struct Guarded {
        query: RayHit,
        after: [u32; 16],
    }
    let device = device();
    let content = scene(&device, &[(0, &triangle(&device))]);
    let instance = Geometry::instance(&device, &content, moved([0.0; 3])).expect("an instance");
    for scene in [&scene(&device, &[(0, &instance)]), &content] {
        let ray = abi::ray([0.25, 0.25, -1.0], [0.0, 0.0, 1.0], 0.0, FAR);
        let mut guarded = Guarded {
            query: RayHit::new(ray),
            after: [UNTOUCHED; 16],
        };
        guarded.query.hit.inst_prim = UNTOUCHED;
        // SAFETY: as in `CommittedScene::intersect`; the struct begins with the query.
        unsafe {
            embree4_sys::rtcIntersect1(scene.raw(), (&raw mut guarded).cast(), ptr::null_mut())
        };
        assert!(near(guarded.query.ray.tfar, 1.0));
        assert_eq!(guarded.after, [UNTOUCHED; 16]);
        let [major, minor, _] = device.version();
        if (major, minor) >= (4, 3) {
            assert_ne!(
                guarded.query.hit.inst_prim, UNTOUCHED,
                "Embree stores instPrimID"
            );
        }
    }
}

#[test]
fn an_empty_scene_is_never_hit() {
    let device = device();
    let empty = Geometry::triangles(&device, &[], &[], None).expect("an empty mesh");
    let none = spheres(&device, &[]);
    for scene in [
        scene(&device, &[]),
        scene(&device, &[(0, &empty), (1, &none)]),
    ] {
        assert_eq!(look_up(&scene, [0.0; 3]), None);
        assert!(!scene.occluded([0.0; 3], [0.0, 0.0, 1.0], 0.0, FAR, || 0));
        assert_eq!(scene.bounds(), None);
    }
}

#[test]
fn bounds_hold_everything() {
    let device = device();
    let scene = scene(
        &device,
        &[
            (0, &triangle(&device)),
            (1, &spheres(&device, &[[0.0, 0.0, 2.0, 1.0]])),
        ],
    );
    let [least, greatest] = scene.bounds().expect("not empty");
    assert_eq!((least, greatest), ([-1.0, -1.0, 0.0], [1.0, 1.0, 3.0]));
}

#[test]
fn a_malformed_ray_is_a_miss() {
    let device = device();
    let scene = scene(
        &device,
        &[
            (0, &spheres(&device, &[UNIT_SPHERE])),
            (1, &triangle(&device)),
        ],
    );
    let (org, up) = ([0.25, 0.25, -5.0], [0.0, 0.0, 1.0]);
    assert!(scene.occluded(org, up, 0.0, FAR, || 0));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut bad_org, mut bad_dir) = (org, up);
            bad_org[axis] = bad;
            bad_dir[axis] = bad;
            for (org, dir) in [(bad_org, up), (org, bad_dir)] {
                assert_eq!(scene.intersect(org, dir, 0.0, FAR, || 0), None);
                assert!(!scene.occluded(org, dir, 0.0, FAR, || 0));
            }
        }
    }
    let nan = f32::NAN;
    for (tnear, tfar) in [
        (nan, FAR),
        (0.0, nan),
        (-1.0, FAR),
        (8.0, 7.0),
        (0.0, f32::NEG_INFINITY),
    ] {
        assert_eq!(
            scene.intersect(org, up, tnear, tfar, || 0),
            None,
            "{tnear}..{tfar}"
        );
        assert!(
            !scene.occluded(org, up, tnear, tfar, || 0),
            "{tnear}..{tfar}"
        );
    }
    assert_eq!(scene.intersect(org, [0.0; 3], 0.0, FAR, || 0), None);
}

#[test]
fn a_bad_configuration_is_an_error() {
    for config in ["threads=", "threads=many", "threads=2\0"] {
        let error = Device::new(config).expect_err(config);
        assert!(error.to_string().contains("configuration"), "{error}");
    }
}

#[test]
fn the_version_is_4() {
    assert_eq!(device().version()[0], 4);
}

#[test]
fn bad_geometry_is_an_error() {
    let (device, other) = (device(), device());
    let argument = Some(ErrorCode::InvalidArgument);
    assert_eq!(
        code(Geometry::triangles(&device, &TRIANGLE, &[[0, 1, 3]], None)),
        argument
    );
    let content = scene(&device, &[(0, &triangle(&device))]);
    assert_eq!(
        code(Geometry::instance(&other, &content, moved([0.0; 3]))),
        argument
    );
    assert_eq!(
        code(Geometry::instance(
            &device,
            &content,
            moved([0.0, f32::NAN, 0.0])
        )),
        argument
    );
    assert_eq!(
        code(Geometry::instance(&device, &content, [[1.0, 2.0, 3.0]; 4])),
        argument
    );
    let instance = Geometry::instance(&device, &content, moved([0.0; 3])).expect("an instance");
    let nested = scene(&device, &[(0, &instance)]);
    assert_eq!(
        code(Geometry::instance(&device, &nested, moved([0.0; 3]))),
        argument
    );
}

#[test]
fn a_bad_id_is_an_error_and_the_message_is_embrees() {
    let (device, other) = (device(), device());
    let mut builder = SceneBuilder::new(&device).expect("a scene");
    builder.attach(&triangle(&device), 1).expect("attached");
    let taken = builder
        .attach(&triangle(&device), 1)
        .expect_err("the id is taken");
    assert!(!taken.message.is_empty(), "{taken:?}");
    assert_eq!(
        code(builder.attach(&triangle(&device), INVALID_ID)),
        Some(ErrorCode::InvalidArgument)
    );
    assert_eq!(
        code(builder.attach(&triangle(&other), 2)),
        Some(ErrorCode::InvalidArgument)
    );
    // An error does no harm to what comes after.
    builder.attach(&triangle(&device), 2).expect("attached");
    let scene = builder.commit().expect("committed");
    assert!(look_up(&scene, [0.25, 0.25, -1.0]).is_some());
}

#[test]
fn memory_is_counted_and_given_back() {
    let device = device();
    let before = device.memory().current;
    let many: Vec<[f32; 4]> = (0..10_000).map(|i| [i as f32, 0.0, 0.0, 0.4]).collect();
    let scene = scene(&device, &[(0, &spheres(&device, &many))]);
    let built = device.memory();
    assert!(built.current >= before + 160_000, "{built:?}");
    assert!(built.peak >= built.current, "{built:?}");
    drop(scene);
    assert!(
        device.memory().current < built.current - 160_000,
        "{:?}",
        device.memory()
    );
    assert_eq!(device.memory().peak, built.peak);
}

#[test]
fn all_types_can_be_sent_and_shared() {
    fn check<T: Send + Sync>() {}
    check::<Device>();
    check::<Geometry>();
    check::<SceneBuilder>();
    check::<CommittedScene>();
    check::<EmbreeError>();
}

#[test]
fn threads_share_a_scene() {
    let device = device();
    let many: Vec<[f32; 4]> = (0..100).map(|i| [i as f32, 0.0, 0.0, 0.4]).collect();
    let scene = scene(&device, &[(0, &spheres(&device, &many))]);
    // The scene keeps the device; both may end on another thread.
    drop(device);
    let found = |scene: &CommittedScene| -> Vec<Option<u32>> {
        (0..100)
            .map(|i| look_up(scene, [i as f32, 0.0, -2.0]).map(|hit| hit.prim))
            .collect()
    };
    let expected: Vec<Option<u32>> = (0..100).map(Some).collect();
    thread::scope(|scope| {
        let threads = [scope.spawn(|| found(&scene)), scope.spawn(|| found(&scene))];
        for thread in threads {
            assert_eq!(thread.join().expect("no panic"), expected);
        }
    });
    thread::spawn(move || drop(scene)).join().expect("no panic");
}

#[test]
fn threads_build_on_one_device_and_see_their_own_errors() {
    let device = device();
    thread::scope(|scope| {
        for bad in [false, true] {
            let device = &device;
            scope.spawn(move || {
                for _ in 0..200 {
                    let mut builder = SceneBuilder::new(device).expect("a scene");
                    let geometry = triangle(device);
                    builder.attach(&geometry, 0).expect("attached");
                    if bad {
                        builder.attach(&geometry, 0).expect_err("the id is taken");
                    }
                    builder.commit().expect("committed");
                }
            });
        }
    });
}
