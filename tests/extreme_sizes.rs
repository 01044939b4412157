//! Scenes of atoms and of galaxies: a picture does not depend on the unit of length, on any
//! backend, until numbers end.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::render::{DIRECT_MAP, Mode, PATH, Size, backends, mean, rendering, settings};
use common::{camera, lambert, lamp, light};
use dualight::accel::ACCELERATORS;
use dualight::color::Rgb;
use dualight::error::Error;
use dualight::geometry::{ShapeId, SphereSet, TriangleMesh};
use dualight::materials::{AlphaMode, MaterialDesc};
use dualight::math::{DAffine3, DVec3};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};

/// Powers of two, so that nothing else is rounded: 1e-17 m to 6e17 m.
const EXPONENTS: [i32; 10] = [-56, -47, -43, -30, 0, 30, 43, 47, 56, 59];

/// What is lit.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// A square and a ball in front of it.
    Plain,
    /// The square half transparent, so that hits are asked about.
    Cutout,
    /// Two instances of a square; their shape is `2^own` times as large as the scene.
    Instances { own: i32 },
}

fn square(h: f64) -> TriangleMesh {
    let h = h as f32;
    TriangleMesh {
        positions: vec![[-h, -h, 0.0], [h, -h, 0.0], [h, h, 0.0], [-h, h, 0.0]],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..Default::default()
    }
}

fn scene(kind: Kind, unit: f64) -> Scene {
    let mut b = SceneBuilder::default();
    let desc = MaterialDesc {
        base_alpha: if kind == Kind::Cutout { 0.5 } else { 1.0 },
        alpha_mode: match kind {
            Kind::Cutout => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        },
        ..lambert("grey", Rgb::splat(0.6))
    };
    let grey = b.add_material(&desc).unwrap();
    let put = |b: &mut SceneBuilder, shape: ShapeId, map: DAffine3| {
        b.place(MeshPlacement {
            shape,
            material: grey,
            world_from_object: map,
            name: "it".into(),
        });
    };
    let at = |x: f64, scale: f64| {
        DAffine3::from_translation(DVec3::X * x * unit) * DAffine3::from_scale(DVec3::splat(scale))
    };
    match kind {
        Kind::Plain | Kind::Cutout => {
            let shape = b.add_mesh(square(unit), "square");
            put(&mut b, shape, DAffine3::IDENTITY);
            let ball = SphereSet {
                spheres: vec![[0.0, 0.0, 0.5 * unit as f32, 0.25 * unit as f32]],
            };
            let shape = b.add_spheres(ball, "ball");
            put(&mut b, shape, DAffine3::IDENTITY);
        }
        Kind::Instances { own } => {
            let own = 2f64.powi(own);
            let shape = b.add_mesh(square(unit * own), "square");
            put(&mut b, shape, at(-0.75, 0.5 / own));
            put(&mut b, shape, at(0.75, 0.25 / own));
        }
    }
    let lamp = DVec3::new(1.0, 2.0, 3.0) * unit;
    b.add_light(light("point", lamp, -DVec3::Z, 20.0 * unit * unit));
    b.add_camera(camera(DVec3::Z * 3.0 * unit, 50.0));
    b.finish().unwrap()
}

/// `bound` is relative.
fn check(kind: Kind, mode: Mode, exponents: &[i32], bound: f64) {
    let size = Size {
        pixels: 16,
        spp: 16,
        photons: 4000,
    };
    let of = |kind: Kind, exponent: i32, backend: &str| {
        let mut s = settings(mode, size, 1);
        s.accelerator = Some(backend.into());
        let image = rendering(&scene(kind, 2f64.powi(exponent)), &s)
            .film
            .develop();
        (mean(&image, ""), mean(&image, "direct"))
    };
    for backend in backends() {
        let plain = match kind {
            Kind::Instances { .. } => Kind::Instances { own: 0 },
            _ => kind,
        };
        let want = of(plain, 0, backend);
        assert!(want.0 > 0.01, "{kind:?} {backend}: nothing is seen");
        for &exponent in exponents {
            let got = of(kind, exponent, backend);
            let error = (got.0 / want.0 - 1.0)
                .abs()
                .max((got.1 / want.1 - 1.0).abs());
            assert!(
                error < bound,
                "{kind:?} {backend} 2^{exponent}: {got:?}, {want:?}"
            );
        }
    }
}

/// Of pictures that are the same but for rounding.
const ROUNDING: f64 = 1e-3;

#[test]
fn the_unit_of_length_does_not_matter_to_paths() {
    check(Kind::Plain, PATH, &EXPONENTS, ROUNDING);
    // Which rays are let through is decided anew. Half of 4096 samples: four standard deviations
    // of the difference of two such means.
    check(Kind::Cutout, PATH, &EXPONENTS, 0.09);
}

#[test]
fn the_unit_of_length_does_not_matter_to_instances() {
    check(Kind::Instances { own: 0 }, PATH, &EXPONENTS, ROUNDING);
    for own in [-56, -43, 43, 56] {
        check(Kind::Instances { own }, PATH, &[0], ROUNDING);
    }
}

#[test]
fn the_unit_of_length_does_not_matter_to_photons() {
    check(Kind::Plain, DIRECT_MAP, &EXPONENTS, ROUNDING);
}

/// So many photons in so small a place that their number per square metre leaves single precision.
#[test]
fn a_density_beyond_single_precision_costs_no_light() {
    let size = Size {
        pixels: 8,
        spp: 16,
        photons: 400_000,
    };
    let [want, got] = [0, -59].map(|exponent| {
        let scene = scene(Kind::Plain, 2f64.powi(exponent));
        let image = rendering(&scene, &settings(DIRECT_MAP, size, 1)).film;
        mean(&image.develop(), "")
    });
    assert!((got / want - 1.0).abs() < 0.01, "{got}, {want}");
}

fn built(strength: Rgb, kind: &'static str, unit: f64, far: f64) -> Result<Scene, Error> {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.6))).unwrap();
    let lit = b.add_material(&lamp(strength)).unwrap();
    let shape = b.add_mesh(square(1.0), "square");
    let balls = SphereSet {
        spheres: vec![[0.0, 0.0, 0.0, 1.0]],
    };
    let balls = b.add_spheres(balls, "balls");
    let mut put = |shape, material, scale: DVec3, z: f64| {
        b.place(MeshPlacement {
            shape,
            material,
            world_from_object: DAffine3::from_translation(DVec3::Z * z * unit)
                * DAffine3::from_scale(scale * unit),
            name: "it".into(),
        });
    };
    put(shape, grey, DVec3::ONE, 0.0);
    put(shape, grey, DVec3::ONE, -far);
    put(balls, grey, DVec3::new(1.0, 2.0, 1.0), -far);
    put(
        shape,
        if kind == "area" { lit } else { grey },
        DVec3::ONE,
        2.0,
    );
    if kind != "area" {
        b.add_light(light(kind, DVec3::Z * 3.0 * unit, -DVec3::Z, strength.r));
    }
    b.add_camera(camera(DVec3::Z * 3.0 * unit, 50.0));
    b.finish()
}

#[test]
fn instances_beyond_the_range_are_dropped_by_name() {
    let scene = built(Rgb::splat(1.0), "point", 1.0, 1e20).unwrap();
    let told = scene.warnings.iter().filter(|w| w.contains("dropped"));
    let told: Vec<_> = told.collect();
    assert_eq!(told.len(), 2, "{:?}", scene.warnings);
    assert!(told[0].starts_with("it: dropped 2 ") && told[0].contains(" 2 with NaN, infinite or"));
    assert!(told[1].starts_with("it: dropped 1 ") && told[1].contains(" 1 with NaN, infinite or"));
    // The others are still instances.
    assert_eq!(scene.geometry.objects.len(), 2);
    assert!(scene.geometry.objects.iter().all(|o| o.placement.is_some()));
    for backend in backends() {
        let accel = ACCELERATORS.iter().find(|a| a.name == backend).unwrap();
        assert!((accel.build)(&scene.geometry, 1).is_ok(), "{backend}");
    }
}

#[test]
fn what_is_too_small_for_its_scene_is_told() {
    let told = |unit: f64, far: f64| {
        let scene = built(Rgb::splat(1.0), "point", unit, far).unwrap();
        scene.warnings.join("\n")
    };
    assert_eq!(told(1.0, 0.0), "");
    assert!(told(1e-18, 0.0).contains("scale it up"));
    let lost = told(1.0, 1e13);
    assert!(lost.contains("3 meshes are smaller than 1.0e1 m"), "{lost}");
    assert!(
        lost.contains("'it' first, too small for a scene of 1.0e13 m"),
        "{lost}"
    );
}

#[test]
fn lights_brighter_than_numbers_are_refused_by_name() {
    for kind in ["area", "point", "spot", "directional"] {
        for strength in [1e20, 1e300, f64::MAX] {
            let why = built(Rgb::splat(strength), kind, 1.0, 0.0);
            match why {
                Ok(_) => assert!(strength == 1e20, "{kind} {strength}"),
                Err(e) => {
                    let e = e.to_string();
                    assert!(strength > 1e20 && e.contains("make it less bright"), "{e}");
                }
            }
        }
    }
}
