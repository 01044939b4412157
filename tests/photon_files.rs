//! Photon maps kept in files: what they are good for, and whose are refused.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use common::render::{DIRECT_MAP, GATHER, HYBRID, Size, settings, with_photons as render};
use common::{add_sphere, box_scene, camera, glass, lambert, light, square};
use dualight::color::Rgb;
use dualight::film::Image;
use dualight::lights::{LightDesc, SkyImage};
use dualight::materials::{MaterialDesc, TextureSlots};
use dualight::math::{DAffine3, DVec3};
use dualight::pipeline::{PhotonFile, RenderSettings, Rendering};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};
use dualight::textures::{Content, Texels, Texture};

const SIZE: Size = Size {
    pixels: 16,
    spp: 20,
    photons: 8000,
};

fn save(path: &Path) -> Option<PhotonFile> {
    Some(PhotonFile::Save(path.into()))
}

fn load(path: &Path) -> Option<PhotonFile> {
    Some(PhotonFile::Load(path.into()))
}

/// Every number of every layer, as bits.
fn bits(image: &Image) -> Vec<u32> {
    let channels = image.layers.iter().flat_map(|l| &l.channels);
    channels
        .flat_map(|c| c.data.iter().map(|x| x.to_bits()))
        .collect()
}

#[test]
fn a_loaded_map_gives_the_very_image_and_no_photon_is_traced() {
    let directory = tempfile::tempdir().unwrap();
    let scene = box_scene();
    // The second pass has photons of its own in any case.
    for (spp, mode) in [(SIZE.spp, GATHER), (2, DIRECT_MAP), (2, HYBRID)] {
        let told = settings(mode, Size { spp, ..SIZE }, 3);
        let path = directory.path().join(mode.name);
        let plain = render(&scene, &told, None).unwrap();
        let saving = render(&scene, &told, save(&path)).unwrap();
        let loading = render(&scene, &told, load(&path)).unwrap();
        for other in [&saving, &loading] {
            let same = bits(&plain.film.develop()) == bits(&other.film.develop());
            assert!(same, "{}", mode.name);
            let (a, b) = (&plain.statistics, &other.statistics);
            assert_eq!(a.global_photons, b.global_photons);
            assert_eq!(a.caustic_photons, b.caustic_photons);
        }
        let traced = |r: &Rendering| r.statistics.rays.photon;
        assert_eq!(traced(&saving), traced(&plain));
        if spp <= 16 {
            assert_eq!(traced(&loading), 0);
            let photons = |s: &&dualight::stats::StageTime| s.stage == "photons";
            let stage = loading.statistics.stages.iter().find(photons).unwrap();
            assert_eq!(stage.seconds, 0.0);
        } else {
            assert!(traced(&loading) < traced(&plain) / 2 + traced(&plain) / 10);
        }
    }
}

/// A textured square, a ball of glass, a lamp and a sky, with something changed in it.
#[derive(Clone)]
struct Parts {
    corner: f32,
    albedo: f64,
    texel: u8,
    lamp: f64,
    sky: f32,
    name: &'static str,
    eye: DVec3,
}

const PARTS: Parts = Parts {
    corner: -1.0,
    albedo: 0.5,
    texel: 7,
    lamp: 10.0,
    sky: 0.1,
    name: "a",
    eye: DVec3::new(0.0, 0.0, 4.0),
};

fn scene(parts: &Parts) -> Scene {
    let mut b = SceneBuilder::default();
    let texels = Texels::U8(vec![200, 100, parts.texel]);
    let image = dualight::textures::Image::from_texels(1, 1, 3, texels).unwrap();
    let ground = MaterialDesc {
        textures: Some(Arc::new(TextureSlots {
            base_color: Some(Texture::new(Arc::new(image), Content::Color)),
            ..Default::default()
        })),
        ..lambert(parts.name, Rgb::splat(parts.albedo))
    };
    let ground = b.add_material(&ground).unwrap();
    let mut mesh = square();
    mesh.positions[0][0] = parts.corner;
    let shape = b.add_mesh(mesh, parts.name);
    b.place(MeshPlacement {
        shape,
        material: ground,
        world_from_object: DAffine3::IDENTITY,
        name: parts.name.into(),
    });
    let glass = b.add_material(&glass(1.5)).unwrap();
    add_sphere(&mut b, parts.name, glass, DVec3::Z * 0.7, 0.3);
    b.add_light(LightDesc {
        name: parts.name.into(),
        ..light("point", DVec3::Z * 2.0, DVec3::NEG_Z, parts.lamp)
    });
    let sky = SkyImage::new(2, 1, vec![[parts.sky; 3], [0.2; 3]]).unwrap();
    b.add_light(LightDesc {
        sky: Some(Arc::new(sky)),
        ..light("environment", DVec3::ZERO, DVec3::NEG_Z, 1.0)
    });
    b.add_camera(camera(parts.eye, 40.0));
    b.finish().unwrap()
}

#[test]
fn the_photons_of_another_scene_are_refused_by_what_differs_and_cameras_do_not_matter() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.photons");
    let told = settings(GATHER, Size { spp: 1, ..SIZE }, 0);
    render(&scene(&PARTS), &told, save(&path)).unwrap();
    for (what, parts) in [
        (
            "geometry",
            Parts {
                corner: (-1f32).next_up(),
                ..PARTS
            },
        ),
        (
            "materials",
            Parts {
                albedo: 0.5f64.next_up(),
                ..PARTS
            },
        ),
        ("textures", Parts { texel: 8, ..PARTS }),
        (
            "lights",
            Parts {
                lamp: 10f64.next_up(),
                ..PARTS
            },
        ),
        (
            "lights",
            Parts {
                sky: 0.1f32.next_up(),
                ..PARTS
            },
        ),
        ("", Parts { name: "b", ..PARTS }),
        (
            "",
            Parts {
                eye: DVec3::new(1.0, 0.0, 3.0),
                ..PARTS
            },
        ),
    ] {
        let other = scene(&parts);
        let result = render(&other, &told, load(&path));
        if what.is_empty() {
            let traced = render(&other, &told, None).unwrap();
            let loaded = bits(&result.unwrap().film.develop());
            assert!(loaded == bits(&traced.film.develop()));
            continue;
        }
        let e = result.unwrap_err();
        let said = format!("a.photons: holds the photons of another scene: {what} differ; ");
        assert!(e.contains(&said) && e.contains("--save-photons"), "{e}");
        assert!(!e.contains('\n'));
    }
}

#[test]
fn the_photons_of_other_settings_are_refused_by_what_differs() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.photons");
    let scene = scene(&PARTS);
    let told = settings(GATHER, Size { spp: 1, ..SIZE }, 1);
    render(&scene, &told, save(&path)).unwrap();
    let with = |change: &dyn Fn(&mut RenderSettings)| {
        let mut told = told.clone();
        change(&mut told);
        render(&scene, &told, load(&path))
    };
    let other = match told.accelerator.as_deref() {
        Some("linear") => "bvh",
        _ => "linear",
    };
    let instead = format!("instead of {other}");
    let changes: [(&str, &dyn Fn(&mut RenderSettings)); 10] = [
        ("--photons 8000 instead of 8001", &|s| {
            s.integrator_settings.photons = 8001
        }),
        ("--caustic-photons 8000 instead of 9", &|s| {
            s.integrator_settings.caustic_photons = 9
        }),
        ("--nearest 50 instead of 49", &|s| {
            s.integrator_settings.nearest = 49
        }),
        ("--seed 1 instead of 2", &|s| s.integrator_settings.seed = 2),
        ("--max-depth none instead of 5", &|s| {
            s.integrator_settings.max_depth = Some(5)
        }),
        ("roulette on instead of off", &|s| {
            s.integrator_settings.roulette = false
        }),
        ("--gather on instead of off", &|s| {
            s.integrator_settings.gather_rays = 0
        }),
        ("--emission uniform instead of adaptive", &|s| {
            s.emission = Some("adaptive".into())
        }),
        (&instead, &|s| s.accelerator = Some(other.into())),
        ("refraction,caustics,indirect instead of ", &|s| {
            s.effects = "-caustics".into()
        }),
    ];
    for (said, change) in changes {
        let e = with(change).map(|_| said).unwrap_err();
        assert!(
            e.contains("a.photons: holds the photons of other settings: "),
            "{e}"
        );
        assert!(e.contains(said), "{e} lacks {said}");
    }
    // What comes after the photons may change.
    assert!(with(&|s| (s.spp, s.width, s.integrator_settings.shadow_rays) = (3, 9, 1)).is_ok());
    assert!(with(&|s| s.threads = Some(1)).is_ok());
}

#[test]
fn what_is_damaged_cut_short_or_something_else_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.photons");
    let scene = scene(&PARTS);
    let few = Size {
        pixels: 1,
        spp: 1,
        photons: 40,
    };
    let told = settings(GATHER, few, 0);
    render(&scene, &told, save(&path)).unwrap();
    let whole = fs::read(&path).unwrap();
    let refused = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let e = render(&scene, &told, load(&path)).unwrap_err();
        assert!(
            e.contains("a.photons: is damaged, or holds no photons of this version; "),
            "{e}"
        );
    };
    for i in (0..whole.len()).step_by(whole.len() / 60) {
        let mut bytes = whole.clone();
        bytes[i] ^= 0x10;
        refused(&bytes);
        refused(&whole[..i]);
    }
    refused(&[&*whole, b"x"].concat());
    fs::remove_file(&path).unwrap();
    let e = render(&scene, &told, load(&path)).unwrap_err();
    assert!(
        e.contains("name a file that --save-photons has written"),
        "{e}"
    );
    // A length that no file has takes no memory.
    let mut huge = whole[..26].to_vec();
    huge[18..26].copy_from_slice(&u64::MAX.to_le_bytes());
    refused(&huge);
}

#[test]
fn the_command_keeps_photons_and_takes_them_again() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    let run = |options: &str| {
        let mut c = Command::new(env!("CARGO_BIN_EXE_dualight"));
        c.args([
            "render",
            concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/box.gltf"),
        ])
        .args("--size 12x12 --spp 2 --photons 3k --caustic-photons 3k".split(' '))
        .args(options.split_whitespace())
        .current_dir(d);
        let out = c.output().unwrap();
        (out.status.code(), String::from_utf8(out.stderr).unwrap())
    };
    let (code, said) = run("-o a.exr --save-photons box.photons");
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = run("-o b.exr --load-photons box.photons --quiet");
    assert_eq!((code, &*said), (Some(0), ""));
    let layers = |name: &str| bits(&dualight::output::read(&d.join(name)).unwrap());
    assert!(layers("a.exr") == layers("b.exr"));
    let (code, said) = run("-o c.exr --load-photons box.photons --seed 1");
    assert_eq!(code, Some(1));
    assert!(said.contains("--seed 0 instead of 1"), "{said}");
    assert!(!d.join("c.exr").exists());
    for (options, part) in [
        (
            "--target-error 0.1 --save-photons x",
            "leave out --target-error",
        ),
        ("--load-photons x --save-photons y", "cannot be used with"),
    ] {
        let (code, said) = run(&format!("-o c.exr {options}"));
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(part), "{said}");
    }
    let (code, said) = run("-o c.exr --integrator path --save-photons x");
    assert_eq!(code, Some(0));
    assert!(
        said.contains("--save-photons has no meaning for the integrator path"),
        "{said}"
    );
    assert!(!d.join("x").exists());
}

/// Radiance of the caustic by place on the floor, and how often each was seen: cells of 1/20 m.
fn caustic(image: &Image) -> Vec<(f64, u32)> {
    const CELLS: usize = 40;
    let light = image.rgb("caustics").unwrap();
    let place = image.layers.iter().find(|l| l.name == "P").unwrap();
    let mut cells = vec![(0.0, 0); CELLS * CELLS];
    for (i, l) in light.iter().enumerate() {
        let p = [0, 1, 2].map(|k| place.channels[k].data[i]);
        let index = |x: f32| ((f64::from(x) + 1.0) * 20.0).floor();
        let (x, z) = (index(p[0]), index(p[2]));
        if p[1] < -0.999 && (0.0..40.0).contains(&x) && (0.0..40.0).contains(&z) {
            let cell = &mut cells[z as usize * CELLS + x as usize];
            cell.0 += f64::from(l[0] + l[1] + l[2]);
            cell.1 += 1;
        }
    }
    cells
}

#[test]
fn a_caustic_is_still_while_the_camera_moves() {
    const FRAMES: u64 = 24;
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("frame.photons");
    let mut scene = box_scene();
    let size = Size {
        pixels: 48,
        spp: 2,
        photons: 6000,
    };
    let mut variance = [0.0; 2];
    for (moving_seed, variance) in variance.iter_mut().enumerate() {
        let mut first = None;
        let mut seen: Vec<Vec<f64>> = vec![Vec::new(); 1600];
        for frame in 0..FRAMES {
            let eye = DVec3::new(0.01 * frame as f64, 0.5, 2.0 - 0.02 * frame as f64);
            scene.cameras[0] = common::look_at("perspective", eye, DVec3::new(0.6, -1.0, 0.3), 0.3);
            let mut told = settings(GATHER, size, 0);
            told.effects = "auto,-indirect".into();
            told.integrator_settings.seed = moving_seed as u64 * frame;
            let rendering = render(&scene, &told, save(&path)).unwrap();
            if moving_seed == 0 {
                // The map of each frame is that of the first, to the bit.
                let bytes = fs::read(&path).unwrap();
                assert!(
                    *first.get_or_insert_with(|| bytes.clone()) == bytes,
                    "frame {frame}"
                );
            }
            for (all, (sum, n)) in seen.iter_mut().zip(caustic(&rendering.film.develop())) {
                if n > 0 {
                    all.push(sum / f64::from(n));
                }
            }
        }
        for all in seen.iter().filter(|all| all.len() == FRAMES as usize) {
            let mean = all.iter().sum::<f64>() / FRAMES as f64;
            *variance += all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (FRAMES - 1) as f64;
        }
    }
    let [still, independent] = variance;
    println!(
        "temporal variance {still:.2e} with one seed, {independent:.2e} with a seed per frame"
    );
    assert!(
        independent > 0.0 && still < 0.5 * independent,
        "{still} {independent}"
    );
}
