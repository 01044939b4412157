//! The guard against leaks: where it is put on, and what it must not do.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::render::{GATHER, Size, settings};
use common::{add_quad, camera, glass, lambert, light};
use dualight::accel::{ACCELERATORS, Accelerator, BuildStats, Guarded};
use dualight::color::Rgb;
use dualight::control::Control;
use dualight::geometry::{Hit, ObjectId, Ray};
use dualight::materials::{AlphaMode, MaterialDesc};
use dualight::math::DVec3;
use dualight::pipeline;
use dualight::plugins::Registry;
use dualight::scene::{Scene, SceneBuilder};

const SIZE: Size = Size {
    pixels: 8,
    spp: 1,
    photons: 500,
};

/// A cube of quads around camera and lamp; the wall before the camera is made of `wall`, or left
/// out.
fn room(wall: Option<MaterialDesc>) -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    for axis in 0..3 {
        for side in [1.0, -1.0] {
            let e = |k: usize| DVec3::AXES[(axis + k) % 3] * 2.0;
            let (e1, e2) = if side < 0.0 {
                (e(1), e(2))
            } else {
                (e(2), e(1))
            };
            let corner = e(0) * (0.5 * side) - (e1 + e2) * 0.5;
            let m = match (axis, side < 0.0, &wall) {
                (2, true, None) => continue,
                (2, true, Some(wall)) => b.add_material(wall).unwrap(),
                _ => grey,
            };
            add_quad(&mut b, "wall", m, corner, e1, e2);
        }
    }
    b.add_light(light("point", DVec3::Y * 0.5, DVec3::NEG_Y, 1.0));
    b.add_camera(camera(DVec3::Z * 0.9, 60.0));
    b.finish().unwrap()
}

fn guarded(scene: &Scene, backend: &str) -> bool {
    let mut settings = settings(GATHER, SIZE, 1);
    settings.accelerator = Some(backend.into());
    let out = pipeline::render(scene, &settings, &Registry::builtin(), &Control::default());
    let name = out.unwrap().statistics.accelerator;
    name.contains("guarded against leaks")
}

#[test]
fn a_guard_is_put_on_where_hardly_any_ray_leaves() {
    let grey = lambert("grey", Rgb::splat(0.5));
    let veil = MaterialDesc {
        alpha_mode: AlphaMode::Blend,
        base_alpha: 0.5,
        ..grey.clone()
    };
    for (what, wall, wanted) in [
        ("closed", Some(grey), true),
        ("open", None, false),
        ("window", Some(glass(1.5)), false),
        // A surface that lets light through by chance would be asked twice.
        ("veil", Some(veil), false),
    ] {
        let scene = room(wall);
        for entry in ACCELERATORS {
            let needed = entry.name == "embree";
            assert_eq!(
                guarded(&scene, entry.name),
                wanted && needed,
                "{what}, {}",
                entry.name
            );
        }
    }
}

/// Hits everything but one ray.
struct Leaky(Ray);

impl Accelerator for Leaky {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        (*ray != self.0).then_some(Hit {
            t: 1.0,
            u: 0.0,
            v: 0.0,
            prim: 7,
            object: ObjectId(3),
        })
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.intersect(ray).is_some()
    }

    fn stats(&self) -> BuildStats {
        BuildStats::default()
    }
}

#[test]
fn only_rays_without_end_are_asked_about_again() {
    for d in [DVec3::X, DVec3::NEG_Z * 1e-15, DVec3::new(3.0, -4.0, 1e6)] {
        let lost = Ray::new(DVec3::splat(1e5), d);
        let guard = Guarded::new(Box::new(Leaky(lost)));
        assert_eq!(guard.intersect(&lost).unwrap().prim, 7);
        assert!(guard.occluded(&lost));
        let ends = Ray { tmax: 2.0, ..lost };
        let guard = Guarded::new(Box::new(Leaky(ends)));
        assert!(guard.intersect(&ends).is_none() && !guard.occluded(&ends));
    }
    let bad = Ray::new(DVec3::ZERO, DVec3::ZERO);
    let guard = Guarded::new(Box::new(Leaky(bad)));
    assert!(
        guard.intersect(&bad).is_none(),
        "an invalid ray hits nothing"
    );
}
