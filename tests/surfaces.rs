//! Surfaces of glTF that change light transport: emission that varies, unlit surfaces, light
//! that comes through diffusely. Each against a closed form, for every way to compute it.
//!
//! Statistical statements hold at 4 standard deviations over their seeds, or name their bias.

mod common;

use std::sync::Arc;

use common::render::{MODES, Mode, Size, mean, render};
use common::stats::Samples;
use common::{add_quad, add_room, camera, lambert, look_at, mirror};
use dualight::color::Rgb;
use dualight::geometry::TriangleMesh;
use dualight::materials::{AlphaMode, MaterialDesc, TextureSlots};
use dualight::math::{DAffine3, DVec3};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};
use dualight::textures::{Content, Filter, Image, Sampler, Texture};

const SIZE: Size = Size {
    pixels: 16,
    spp: 64,
    photons: 100_000,
};

fn samples(scene: &Scene, mode: Mode, layer: &str) -> Samples {
    Samples::over_seeds(4, |seed| mean(&render(scene, mode, SIZE, seed), layer))
}

/// A texture of texels in one row, not blended.
fn row(texels: &[[f32; 4]]) -> Texture {
    let image = Image::new(texels.len() as u32, 1, texels.to_vec()).unwrap();
    Texture {
        sampler: Sampler {
            filter: Filter::Nearest,
            ..Default::default()
        },
        ..Texture::new(Arc::new(image), Content::Data)
    }
}

/// A square of half width `h` at height `y` that faces down, with texture coordinates along `x`.
fn square(h: f32, y: f32) -> TriangleMesh {
    TriangleMesh {
        positions: vec![[-h, y, -h], [h, y, -h], [h, y, h], [-h, y, h]],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        uv_sets: vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]],
        ..Default::default()
    }
}

fn add(b: &mut SceneBuilder, mesh: TriangleMesh, desc: &MaterialDesc) {
    let material = b.add_material(desc).unwrap();
    let shape = b.add_mesh(mesh, &desc.name);
    b.place(MeshPlacement {
        shape,
        material,
        world_from_object: DAffine3::IDENTITY,
        name: desc.name.clone(),
    });
}

/// A floor under a lamp that is dark on its left and bright on its right: by a texture, by a
/// mask over uniform emission, or because it is only half as wide.
fn under_a_half_lamp(how: &str) -> Scene {
    let mut b = SceneBuilder::default();
    let white = b.add_material(&lambert("floor", Rgb::splat(0.5))).unwrap();
    let v = DVec3::new;
    let (p, e1, e2) = (v(-2.0, 0.0, -2.0), DVec3::Z * 4.0, DVec3::X * 4.0);
    add_quad(&mut b, "floor", white, p, e1, e2);
    let mut desc = MaterialDesc {
        emission: Rgb::splat(2.0),
        ..lambert("lamp", Rgb::ZERO)
    };
    let mut mesh = square(0.5, 1.0);
    let bright = [1.0; 4];
    let slots = match how {
        "texture" => Some(TextureSlots {
            emissive: Some(row(&[[0.0, 0.0, 0.0, 1.0], bright])),
            ..Default::default()
        }),
        "mask" => {
            desc.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
            Some(TextureSlots {
                base_color: Some(row(&[[1.0, 1.0, 1.0, 0.0], bright])),
                ..Default::default()
            })
        }
        _ => {
            for p in &mut mesh.positions {
                p[0] = p[0].max(0.0);
            }
            None
        }
    };
    desc.textures = slots.map(Arc::new);
    add(&mut b, mesh, &desc);
    let eye = v(0.0, 2.5, 2.5);
    b.add_camera(look_at("perspective", eye, DVec3::ZERO, 1.0));
    b.finish().unwrap()
}

#[test]
fn emission_follows_texture_and_alpha() {
    let half = under_a_half_lamp("half");
    for how in ["texture", "mask"] {
        let scene = under_a_half_lamp(how);
        let (got, want) = (scene.flux().r, half.flux().r);
        assert!((got / want - 1.0).abs() < 0.04, "{how}: {got} of {want} W");
        for mode in MODES {
            let (a, b) = (samples(&scene, mode, ""), samples(&half, mode, ""));
            let sigma = a.sigma().hypot(b.sigma());
            assert!(
                (a.mean() - b.mean()).abs() < 5.0 * sigma.max(1e-4),
                "{how}, {}: {} is not {} ± {sigma}",
                mode.name,
                a.mean(),
                b.mean()
            );
        }
    }
}

#[test]
fn unlit_surfaces_show_their_colour_and_light_nothing() {
    // An unlit ceiling over a white floor, without any light, seen in a mirror too.
    for reflected in [false, true] {
        let mut b = SceneBuilder::default();
        let unlit = MaterialDesc {
            base_color: Rgb::splat(0.6),
            unlit: true,
            ..Default::default()
        };
        let floor = if reflected {
            mirror()
        } else {
            lambert("floor", Rgb::ONE)
        };
        add(&mut b, square(50.0, 1.0), &unlit);
        let floor = b.add_material(&floor).unwrap();
        let p = DVec3::new(-50.0, -1.0, -50.0);
        add_quad(
            &mut b,
            "floor",
            floor,
            p,
            DVec3::Z * 100.0,
            DVec3::X * 100.0,
        );
        let down = DVec3::new(0.0, -1.0, -1.0);
        b.add_camera(look_at("perspective", DVec3::ZERO, down, 0.5));
        let scene = b.finish().unwrap();
        for mode in MODES {
            let got = mean(&render(&scene, mode, SIZE, 0), "");
            let want = if reflected { 0.6 } else { 0.0 };
            assert!((got - want).abs() < 1e-3, "{}: {got}", mode.name);
        }
    }
}

#[test]
fn a_divider_that_absorbs_nothing_leaves_the_furnace_as_it_is() {
    // Walls that emit 1 and reflect half: radiance 2 everywhere, also through a white sheet that
    // reflects 0.6 and transmits 0.4.
    let mut b = SceneBuilder::default();
    let walls = MaterialDesc {
        emission: Rgb::ONE,
        ..lambert("wall", Rgb::splat(0.5))
    };
    let walls = b.add_material(&walls).unwrap();
    add_room(&mut b, walls, 1.0);
    let sheet = MaterialDesc {
        diffuse_transmission: 0.4,
        double_sided: true,
        ..lambert("sheet", Rgb::ONE)
    };
    let sheet = b.add_material(&sheet).unwrap();
    let v = DVec3::new;
    let p = v(-1.0, -1.0, 0.0);
    add_quad(&mut b, "sheet", sheet, p, DVec3::X * 2.0, DVec3::Y * 2.0);
    b.add_camera(camera(v(0.1, 0.2, 0.9), 60.0));
    let scene = b.finish().unwrap();
    for mode in MODES {
        let got = samples(&scene, mode, "").mean();
        // Kernels lose what lies beyond the edges of walls and sheet.
        let bias = if mode.integrator == "path" {
            0.01
        } else {
            0.03
        };
        assert!((got / 2.0 - 1.0).abs() < bias, "{}: {got}", mode.name);
    }
}
