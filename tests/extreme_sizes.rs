//! Scenes of atoms and of galaxies: a picture does not depend on the unit of length, on any
//! backend, until numbers end.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::render::{DIRECT_MAP, Mode, PATH, Size, backends, mean, rendering, settings};
use common::{camera, lambert, light};
use dualight::color::Rgb;
use dualight::geometry::{ShapeId, SphereSet, TriangleMesh};
use dualight::materials::{AlphaMode, MaterialDesc};
use dualight::math::{DAffine3, DVec3};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};

/// Powers of two, so that nothing else is rounded: 1e-17 m to 1e17 m.
const EXPONENTS: [i32; 9] = [-56, -47, -43, -30, 0, 30, 43, 47, 56];

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
