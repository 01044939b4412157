//! Textures through the whole pipeline: pictures that do not alias, and files that others made.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::path::Path;
use std::sync::Arc;

use common::render::{DIRECT_MAP, Mode, PATH, rendering, settings};
use common::{add_sphere, glass, lamp, look_at, mirror};
use dualight::color::Rgb;
use dualight::geometry::TriangleMesh;
use dualight::import::{self, ImportOptions};
use dualight::materials::{MaterialDesc, TextureSlots};
use dualight::math::{DAffine3, DVec3};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder, ScenePlugins};
use dualight::textures::{Content, Image, Texels, Texture};

/// A plane that glows in squares, so many pairs per metre, seen toward the horizon.
fn plane(pairs: f32, things: impl FnOnce(&mut SceneBuilder)) -> Scene {
    let texels = (0..64 * 64)
        .map(|i: u32| {
            if (i % 64 / 32 + i / 64 / 32).is_multiple_of(2) {
                255
            } else {
                0
            }
        })
        .collect();
    let image = Image::from_texels(64, 64, 1, Texels::U8(texels)).unwrap();
    let slots = TextureSlots {
        emissive: Some(Texture::new(Arc::new(image), Content::Color)),
        ..Default::default()
    };
    let mut b = SceneBuilder::default();
    let glowing = b
        .add_material(&MaterialDesc {
            textures: Some(Arc::new(slots)),
            ..lamp(Rgb::ONE)
        })
        .unwrap();
    let s = 300.0;
    let mesh = TriangleMesh {
        positions: vec![[-s, 0., s], [s, 0., s], [s, 0., -s], [-s, 0., -s]],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        uv_sets: vec![
            [[-s, s], [s, s], [s, -s], [-s, -s]]
                .map(|v| v.map(|x| x * pairs))
                .to_vec(),
        ],
        ..Default::default()
    };
    let shape = b.add_mesh(mesh, "plane");
    b.place(MeshPlacement {
        shape,
        material: glowing,
        world_from_object: DAffine3::IDENTITY,
        name: "plane".into(),
    });
    things(&mut b);
    b.add_camera(look_at(
        "perspective",
        DVec3::new(0.1, 1.0, 0.3),
        DVec3::new(0.1, 0.8, -1.7),
        0.7,
    ));
    b.finish().unwrap()
}

/// Pixels of the sum of all layers.
fn beauty(scene: &Scene, mode: Mode, spp: u32) -> Vec<f64> {
    let size = common::render::Size {
        pixels: 48,
        spp,
        photons: 10,
    };
    let image = rendering(scene, &settings(mode, size, 3)).film.develop();
    let pixels = image.rgb("").unwrap();
    pixels.iter().map(|p| f64::from(p[1])).collect()
}

/// Root mean square of the difference, over the pixels that `of` picks.
fn difference(a: &[f64], b: &[f64], of: impl Fn(usize) -> bool) -> f64 {
    let squares: Vec<f64> = a
        .iter()
        .zip(b)
        .enumerate()
        .filter(|(i, _)| of(*i))
        .map(|(_, (a, b))| (a - b).powi(2))
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Near the horizon a pixel holds many squares: a point sample is off by half, a filtered one
/// sample per pixel is already the answer.
#[test]
fn one_sample_per_pixel_does_not_alias() {
    let scene = plane(1.0, |_| ());
    let reference = beauty(&scene, PATH, 256);
    let few = beauty(&scene, PATH, 1);
    // The horizon stands at row 17 of 48; nothing is above it.
    let row = |i: usize| i / 48;
    let error = difference(&few, &reference, |i| (19..22).contains(&row(i)));
    assert!(error < 0.04, "{error}");
    let grey: Vec<f64> = (19 * 48..20 * 48).map(|i| reference[i]).collect();
    assert!(grey.iter().all(|g| (g - 0.5).abs() < 0.1), "{grey:?}");
    // Both integrators look the same textures up by the same footprints.
    let other = beauty(&scene, DIRECT_MAP, 1);
    assert!(difference(&few, &other, |_| true) < 0.02);
}

/// The same seen in a mirror ball and through a glass ball, with squares smaller than pixels.
#[test]
fn reflections_and_refractions_do_not_alias_either() {
    for (name, desc, rows) in [("mirror", mirror(), 26..34), ("glass", glass(1.5), 14..22)] {
        let scene = plane(12.0, |b| {
            let material = b.add_material(&desc).unwrap();
            add_sphere(b, "ball", material, DVec3::new(0.1, 0.85, -1.6), 0.45);
        });
        let reference = beauty(&scene, DIRECT_MAP, 256);
        let few = beauty(&scene, DIRECT_MAP, 1);
        // Where the ball shows the plane (glass turns it over), away from its rim, which aliases
        // as any edge does.
        let inside = |i: usize| (18..30).contains(&(i % 48)) && rows.contains(&(i / 48));
        let error = difference(&few, &reference, inside);
        assert!(error < 0.03, "{name}: {error}");
        let seen: Vec<f64> = (0..48 * 48)
            .filter(|i| inside(*i))
            .map(|i| reference[i])
            .collect();
        let mean = seen.iter().sum::<f64>() / seen.len() as f64;
        assert!((0.3..0.6).contains(&mean), "{name}: {mean}");
    }
}

/// Files that nobody of this project made, if they are at hand.
#[test]
fn textures_of_real_files_are_decoded() {
    let root = Path::new("../shared/assets/real");
    let webp = "gltf-pipeline/specs/data/2.0/extensions/EXT_texture_webp";
    let unity = "com.unity.cloud.gltfast/Packages/com.unity.cloud.gltfast.tests/Assets~/Unity";
    let cases: [(String, &[(u32, u32)]); 5] = [
        (
            format!("{webp}/box-textured-embedded/box-textured-embedded.gltf"),
            &[(128, 128)],
        ),
        (
            format!("{webp}/box-textured-separate/box-textured-with-fallback.gltf"),
            &[(128, 128)],
        ),
        (
            format!("{unity}/TextureVariants/glTF-Embedded-KTX/TextureVariants-Embedded-KTX.gltf"),
            &[(4, 4), (4, 4)],
        ),
        (
            "bevy/assets/models/AnisotropyBarnLamp/AnisotropyBarnLamp.gltf".into(),
            &[(512, 512), (1024, 1024)],
        ),
        (
            "tinygltf/models/CubeImageUriSpaces/CubeImageUriSpaces.gltf".into(),
            &[],
        ),
    ];
    for (file, sizes) in cases {
        let basis = file.contains("KTX") || file.contains("BarnLamp");
        if basis && cfg!(not(feature = "ktx2")) {
            continue;
        }
        let path = root.join(&file);
        if !path.exists() {
            eprintln!("{file} is not at hand");
            continue;
        }
        let scene =
            import::load(&path, &ImportOptions::default(), ScenePlugins::default()).unwrap();
        assert!(!scene.textures.is_empty(), "{file}");
        for size in sizes {
            let there = |t: &Texture| (t.image.width(), t.image.height()) == *size;
            assert!(scene.textures.iter().any(there), "{file}: {size:?}");
        }
        let one = |t: &Texture| (t.image.width(), t.image.height()) == (1, 1);
        assert!(
            !scene.textures.iter().any(one),
            "{file}: a placeholder is left"
        );
    }
}
