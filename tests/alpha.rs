//! Surfaces that are not whole: every backend lets the same rays through, as many as their
//! alpha says.
//!
//! Statistical statements hold at 4 standard deviations, with fixed seeds.

mod common;

use std::sync::Arc;

use common::render::{MODES, Size, mean, render};
use common::{add_sphere, camera, lambert, lamp};
use dualight::accel::{ACCELERATORS, Accelerator};
use dualight::color::Rgb;
use dualight::geometry::{Ray, TriangleMesh};
use dualight::materials::{AlphaMode, MaterialDesc, TextureSlots};
use dualight::math::{DAffine3, DVec3};
use dualight::sampling::Rng;
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};
use dualight::textures::{Content, Filter, Image, Sampler, Texels, Texture};

fn veil(alpha: f64, mode: AlphaMode) -> MaterialDesc {
    MaterialDesc {
        base_alpha: alpha,
        alpha_mode: mode,
        ..lambert("veil", Rgb::splat(0.5))
    }
}

/// A square of half width 1 in the plane z = 0 with texture coordinates from 0 to 1, and alpha
/// from 1 at its left to 0 at its right in its vertices' colours.
fn sheet() -> TriangleMesh {
    TriangleMesh {
        colors: [1.0, 0.0, 0.0, 1.0].map(|a| [1.0, 1.0, 1.0, a]).to_vec(),
        ..common::square()
    }
}

/// Sheets of one material at several heights; instances if there are more than one.
fn sheets(material: &MaterialDesc, heights: &[f64]) -> Scene {
    let mut b = SceneBuilder::default();
    let material = b.add_material(material).unwrap();
    let shape = b.add_mesh(sheet(), "sheet");
    for &z in heights {
        b.place(MeshPlacement {
            shape,
            material,
            world_from_object: DAffine3::from_translation(DVec3::Z * z),
            name: "sheet".into(),
        });
    }
    b.add_camera(camera(DVec3::Z * 4.0, 40.0));
    b.finish().unwrap()
}

fn backends(scene: &Scene) -> Vec<Box<dyn Accelerator>> {
    ACCELERATORS
        .iter()
        .map(|a| (a.build)(&scene.geometry, 1).unwrap())
        .collect()
}

/// Downward rays at random places of the sheet.
fn rays(n: usize) -> impl Iterator<Item = (Ray, DVec3)> {
    let mut rng = Rng::new(5);
    (0..n).map(move |_| {
        let [x, y] = rng.next_2d().map(|u| 1.98 * u - 0.99);
        let from = DVec3::new(x, y, 10.0);
        (Ray::new(from, -DVec3::Z), from)
    })
}

/// Share of rays that pass everything, after all backends agreed on every one of them.
fn transmitted(scene: &Scene, n: usize) -> f64 {
    let backends = backends(scene);
    let mut passed = 0;
    for (ray, _) in rays(n) {
        let hits: Vec<_> = backends
            .iter()
            .map(|b| {
                let hit = b.intersect(&ray).map(|h| (h.object, h.prim));
                assert_eq!(hit.is_some(), b.occluded(&ray), "{ray:?}");
                hit
            })
            .collect();
        assert!(hits.windows(2).all(|w| w[0] == w[1]), "{ray:?}: {hits:?}");
        passed += usize::from(hits[0].is_none());
    }
    passed as f64 / n as f64
}

fn assert_share(what: &str, got: f64, want: f64, n: usize) {
    let sigma = (want * (1.0 - want) / n as f64).sqrt();
    assert!(
        (got - want).abs() < 4.0 * sigma + 1e-12,
        "{what}: {got}, not {want}"
    );
}

#[test]
fn as_much_light_passes_as_alpha_says() {
    let n = 40_000;
    for (heights, passes) in [
        (&[0.0][..], 0.7),
        (&[0.0, 1.0][..], 0.49),
        (&[0.0, 1.0, 1.5, 2.0][..], 0.7f64.powi(4)),
    ] {
        let scene = sheets(&veil(0.3, AlphaMode::Blend), heights);
        assert!(!scene.geometry.is_whole());
        assert_share("sheets", transmitted(&scene, n), passes, n);
    }
    // A ball is passed on the way in and on the way out.
    let mut b = SceneBuilder::default();
    let m = b.add_material(&veil(0.3, AlphaMode::Blend)).unwrap();
    add_sphere(&mut b, "ball", m, DVec3::ZERO, 3.0);
    let scene = b.finish().unwrap();
    assert_share("ball", transmitted(&scene, n), 0.49, n);
}

#[test]
fn alpha_of_vertices_and_textures_counts() {
    let n = 40_000;
    let faded = MaterialDesc {
        vertex_colors: true,
        ..veil(1.0, AlphaMode::Blend)
    };
    assert_share("vertices", transmitted(&sheets(&faded, &[0.0]), n), 0.5, n);
    // A mask over the same ramp: nothing is left to chance.
    let masked = MaterialDesc {
        vertex_colors: true,
        ..veil(1.0, AlphaMode::Mask { cutoff: 0.25 })
    };
    for a in backends(&sheets(&masked, &[0.0])) {
        for (ray, from) in rays(2000) {
            let alpha = 0.5 * (1.0 - from.x);
            if (alpha - 0.25).abs() > 1e-4 {
                assert_eq!(a.occluded(&ray), alpha > 0.25, "{from}");
            }
        }
    }
    // A texture of four texels, two of them missing.
    let texels = [255, 0, 0, 255].map(|a| [255, 255, 255, a]).concat();
    let image = Image::from_texels(2, 2, 4, Texels::U8(texels)).unwrap();
    let texture = Texture {
        sampler: Sampler {
            filter: Filter::Nearest,
            ..Default::default()
        },
        ..Texture::new(Arc::new(image), Content::Coverage)
    };
    let checked = MaterialDesc {
        textures: Some(Arc::new(TextureSlots {
            base_color: Some(texture),
            ..Default::default()
        })),
        ..veil(1.0, AlphaMode::Mask { cutoff: 0.5 })
    };
    for a in backends(&sheets(&checked, &[0.0, 3.0])) {
        for (ray, from) in rays(2000) {
            let there = (from.x < 0.0) == (from.y > 0.0);
            assert_eq!(a.occluded(&ray), there, "{from}");
        }
    }
}

#[test]
fn whole_surfaces_are_not_asked_about() {
    for (desc, whole) in [
        (veil(1.0, AlphaMode::Blend), true),
        (veil(0.3, AlphaMode::Opaque), true),
        (veil(0.6, AlphaMode::Mask { cutoff: 0.5 }), true),
        (veil(0.4, AlphaMode::Mask { cutoff: 0.5 }), false),
        (veil(0.0, AlphaMode::Blend), false),
    ] {
        let scene = sheets(&desc, &[0.0]);
        assert_eq!(scene.geometry.is_whole(), whole, "{desc:?}");
        let nothing = transmitted(&scene, 200);
        assert!(nothing == if whole { 0.0 } else { 1.0 });
    }
}

#[test]
fn a_veil_dims_the_picture_behind_it() {
    // A lamp behind a black veil: the mean radiance is what alpha leaves.
    let mut b = SceneBuilder::default();
    let veil = MaterialDesc {
        base_color: Rgb::ZERO,
        ..veil(0.25, AlphaMode::Blend)
    };
    let veil = b.add_material(&veil).unwrap();
    let shape = b.add_mesh(sheet(), "veil");
    b.place(MeshPlacement {
        shape,
        material: veil,
        world_from_object: DAffine3::from_translation(DVec3::Z),
        name: "veil".into(),
    });
    let light = b.add_material(&lamp(Rgb::splat(2.0))).unwrap();
    let shape = b.add_mesh(sheet(), "lamp");
    b.place(MeshPlacement {
        shape,
        material: light,
        world_from_object: DAffine3::from_scale(DVec3::splat(9.0)),
        name: "lamp".into(),
    });
    b.add_camera(camera(DVec3::Z * 4.0, 20.0));
    let scene = b.finish().unwrap();
    for mode in MODES {
        for seed in 0..3 {
            let size = Size {
                pixels: 16,
                spp: 64,
                photons: 1000,
            };
            let mean = mean(&render(&scene, mode, size, seed), "");
            // σ = 2·√(0.25·0.75 / samples).
            assert!((mean - 1.5).abs() < 4.0 * 0.0068, "{}: {mean}", mode.name);
        }
    }
}
