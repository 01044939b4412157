//! The survey of effects may keep one needlessly, but never drop one that is needed: scenes with
//! features switched on and off at random look the same whatever it decided.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::sync::Arc;

use common::render::{GATHER, PATH, Size, mean, rendering, settings};
use common::{add_room, camera, lambert, lamp, light};
use dualight::cameras::{CameraDesc, Lens};
use dualight::color::Rgb;
use dualight::effects::{Acts, EFFECTS, omissions, survey};
use dualight::geometry::{MaterialId, Ray, TriangleMesh};
use dualight::materials::{AlphaMode, MaterialDesc, TextureSlots, TransportMode};
use dualight::math::{DAffine3, DVec3};
use dualight::plugins::Registry;
use dualight::sampling::Rng;
use dualight::scene::{MeshPlacement, Omit, Scene, SceneBuilder};
use dualight::textures::{Content, Image, Texels, Texture};

/// An image of 4 × 4 texels, each channel all 0, all 255 or of both.
fn texture(rng: &mut Rng, content: Content) -> Option<Texture> {
    if rng.next_1d() < 0.5 {
        return None;
    }
    let kinds: [u64; 4] = std::array::from_fn(|_| rng.next_u64() % 3);
    let texels = (0..16 * 4)
        .map(|i| match kinds[i % 4] {
            0 => 0,
            1 => 255,
            _ => 255 * (rng.next_u64() % 2) as u8,
        })
        .collect();
    let image = Image::from_texels(4, 4, 4, Texels::U8(texels)).unwrap();
    Some(Texture::new(Arc::new(image), content))
}

/// A glTF material of which everything may be on or off, by factor and by texture.
fn material(rng: &mut Rng) -> MaterialDesc {
    let toss = |rng: &mut Rng| f64::from(u8::from(rng.next_1d() < 0.5));
    let slots = TextureSlots {
        base_color: texture(rng, Content::Color),
        metallic_roughness: texture(rng, Content::Data),
        transmission: texture(rng, Content::Data),
        specular: texture(rng, Content::Data),
        clearcoat: texture(rng, Content::Data),
        sheen_color: texture(rng, Content::Color),
        ..Default::default()
    };
    MaterialDesc {
        name: "random".into(),
        base_color: Rgb::splat(0.8 * toss(rng)),
        metallic: toss(rng),
        roughness: 0.6 * toss(rng),
        transmission: 0.7 * toss(rng),
        volume: rng.next_1d() < 0.5,
        specular: toss(rng),
        clearcoat: toss(rng),
        sheen_color: Rgb::splat(0.5 * toss(rng)),
        textures: Some(Arc::new(slots)),
        ..Default::default()
    }
}

/// A square of side 2 around `c`, with texture coordinates, that looks along `+z`.
fn add_square(b: &mut SceneBuilder, material: MaterialId, c: DVec3) {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mesh = TriangleMesh {
        positions: corners
            .map(|[x, y]| (c + DVec3::new(x, y, 0.0)).as_vec3().into())
            .to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        uv_sets: vec![corners.map(|v| v.map(|x| x as f32)).to_vec()],
        ..Default::default()
    };
    let shape = b.add_mesh(mesh, "square");
    b.place(MeshPlacement {
        shape,
        material,
        world_from_object: DAffine3::IDENTITY,
        name: "square".into(),
    });
}

fn scene(rng: &mut Rng) -> Scene {
    let mut b = SceneBuilder::default();
    let walls = match rng.next_u64() % 3 {
        0 => b.add_material(&material(rng)),
        1 => b.add_material(&lambert("black", Rgb::ZERO)),
        _ => b.add_material(&lambert("grey", Rgb::splat(0.5))),
    };
    let (walls, other) = (walls.unwrap(), b.add_material(&material(rng)).unwrap());
    add_room(&mut b, walls, 3.0);
    add_square(&mut b, other, DVec3::new(0.0, 0.0, -1.0));
    if rng.next_1d() < 0.5 {
        b.add_light(light("point", DVec3::new(0.5, 1.0, 1.0), DVec3::Y, 3.0));
    }
    if rng.next_1d() < 0.5 {
        let glowing = b.add_material(&lamp(Rgb::splat(2.0))).unwrap();
        add_square(&mut b, glowing, DVec3::new(1.5, 1.5, -2.0));
    }
    b.add_camera(camera(DVec3::new(0.0, 0.0, 2.5), 60.0));
    b.finish().unwrap()
}

/// What a material says that it may do holds wherever it is looked at.
#[test]
fn traits_promise_all_that_a_material_does() {
    let mut rng = Rng::new(11);
    let registry = Registry::builtin();
    let mut seen = [0; 2];
    for round in 0..400 {
        let mut b = SceneBuilder::default();
        let id = b.add_material(&material(&mut rng)).unwrap();
        add_square(&mut b, id, DVec3::ZERO);
        let scene = b.finish().unwrap();
        let accel = (registry.accelerators.find("linear").unwrap().build)(&scene.geometry, 1);
        let accel = accel.unwrap();
        let traits = scene.material(id).traits();
        for _ in 0..16 {
            let at = |rng: &mut Rng| 1.98 * rng.next_1d() - 0.99;
            let o = DVec3::new(at(&mut rng), at(&mut rng), 1.0);
            let ray = Ray::new(o, -DVec3::Z);
            let hit = accel.intersect(&ray).unwrap();
            let sp = scene.surface_point(&ray, &hit);
            let whole = scene.bsdf(&sp, None, TransportMode::Radiance);
            let (mut diffuse, mut specular) = (whole.clone(), whole);
            diffuse.keep_diffuse();
            specular.keep_specular();
            if diffuse.albedo().max_channel() > 0.0 {
                seen[0] += 1;
                assert!(traits.diffuse > 0.0, "round {round}: {traits:?}");
            }
            if specular.albedo().max_channel() > 0.0 {
                seen[1] += 1;
                assert!(traits.reflects || traits.transmits, "round {round}");
            }
        }
    }
    assert!(seen.iter().all(|n| *n > 500), "{seen:?}");
}

#[test]
fn no_scene_loses_light_to_the_survey() {
    let mut rng = Rng::new(5);
    let registry = Registry::builtin();
    let mut skipped = vec![0; EFFECTS.len()];
    for round in 0..60 {
        let scene = scene(&mut rng);
        for (n, d) in skipped
            .iter_mut()
            .zip(survey(&scene, "auto", &registry.effects).unwrap().decisions)
        {
            *n += usize::from(!d.on);
        }
        let size = Size {
            pixels: 12,
            spp: 8,
            photons: 10,
        };
        let picture = |effects: &str| {
            let mut s = settings(PATH, size, round);
            s.effects = effects.into();
            rendering(&scene, &s).film.develop().rgb("").unwrap()
        };
        // Path tracing follows the same paths, and what was dropped would be missing in the sum.
        assert_eq!(picture("auto"), picture("all"), "round {round}");
    }
    println!("scenes without each effect: {skipped:?}");
    // Of those that are decided while light is traced, each is dropped now and then.
    let mut traced = EFFECTS.iter().zip(&skipped);
    assert!(
        traced.all(|(e, n)| *n > 0 || !matches!(e.acts, Acts::Traced)),
        "{skipped:?}"
    );
}

/// Each of the two parts of what is seen in glass can be left out, by both integrators alike, and
/// in photons too.
#[test]
fn what_is_switched_off_is_not_followed() {
    let scene = common::box_scene();
    let size = Size {
        pixels: 32,
        spp: 64,
        photons: 100_000,
    };
    let layers = |mode, effects: &str| {
        let mut s = settings(mode, size, 3);
        s.effects = effects.into();
        let done = rendering(&scene, &s);
        let image = done.film.develop();
        let of = |layer| mean(&image, layer);
        ([of("specular"), of("caustics")], done.statistics.rays)
    };
    for effects in ["-refraction", "-specular"] {
        let ([path, _], _) = layers(PATH, effects);
        let ([photon, _], _) = layers(GATHER, effects);
        let ([all, _], _) = layers(GATHER, "auto");
        println!("{effects}: path {path}, photon {photon}, of {all}");
        // The noise of path tracing; what is missing is far more.
        assert!((path / photon - 1.0).abs() < 0.1, "{effects}");
        assert!(photon < 0.9 * all, "{effects}: {photon} of {all}");
    }
    let ([_, less], _) = layers(GATHER, "-refraction");
    let ([_, all], _) = layers(GATHER, "auto");
    assert!(
        less < 0.7 * all,
        "the caustic of glass is there: {less} of {all}"
    );
    // Paths end where nothing is left for them to find.
    let ((_, few), (_, many)) = (layers(PATH, "-indirect,-caustics"), layers(PATH, "auto"));
    assert!(2 * few.bounce < many.bounce, "{few:?} {many:?}");
}

/// A scene that has something of everything.
fn everything(omit: Omit) -> Scene {
    let mut b = SceneBuilder::default();
    b.leave_out(omit);
    let white = || {
        let image = Image::from_texels(1, 1, 4, Texels::U8(vec![255; 4])).unwrap();
        Some(Texture::new(Arc::new(image), Content::Data))
    };
    let textures = TextureSlots {
        base_color: white(),
        normal: white(),
        ..Default::default()
    };
    let all = MaterialDesc {
        metallic: 0.0,
        alpha_mode: AlphaMode::Blend,
        base_alpha: 0.5,
        roughness: 0.2,
        transmission: 0.5,
        volume: true,
        attenuation_distance: 1.0,
        dispersion: 1.0,
        clearcoat: 1.0,
        sheen_color: Rgb::ONE,
        iridescence: 1.0,
        anisotropy: 0.5,
        diffuse_transmission: 0.5,
        textures: Some(Arc::new(textures)),
        ..Default::default()
    };
    let id = b.add_material(&all).unwrap();
    add_square(&mut b, id, DVec3::ZERO);
    let shape = b.add_mesh(
        TriangleMesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            indices: vec![[0, 1, 2]],
            uv_sets: vec![vec![[0.0; 2]; 3]],
            ..Default::default()
        },
        "twice",
    );
    for z in [-2.0, -3.0] {
        b.place(MeshPlacement {
            shape,
            material: id,
            world_from_object: DAffine3::from_translation(DVec3::Z * z),
            name: "twice".into(),
        });
    }
    b.add_light(light("environment", DVec3::ZERO, DVec3::Y, 1.0));
    b.add_camera(CameraDesc {
        lens: Some(Lens {
            radius: 0.1,
            focus: 2.0,
            blades: 0,
            rotation: 0.0,
            ratio: 1.0,
        }),
        ..camera(DVec3::new(0.0, 0.0, 2.5), 60.0)
    });
    b.finish().unwrap()
}

/// What is left out is gone, the rest stays, and a wish that cannot be granted is refused.
#[test]
fn every_effect_can_be_switched_off_or_says_why_not() {
    let registry = Registry::builtin();
    let full = everything(Omit::default());
    let on = |scene: &Scene, wish: &str| -> Vec<&str> {
        let decisions = survey(scene, wish, &registry.effects).unwrap().decisions;
        decisions.iter().filter(|d| d.on).map(|d| d.name).collect()
    };
    let all = on(&full, "auto");
    assert_eq!(all.len(), EFFECTS.len(), "{all:?}");
    for e in EFFECTS {
        let wish = format!("-{}", e.name);
        let without = match e.acts {
            Acts::Traced => on(&full, &wish),
            Acts::Built(_) => {
                assert!(survey(&full, &wish, &registry.effects).is_err(), "{wish}");
                on(
                    &everything(omissions(&wish, &registry.effects).unwrap()),
                    &wish,
                )
            }
            Acts::Always => {
                assert!(survey(&full, &wish, &registry.effects).is_err(), "{wish}");
                continue;
            }
        };
        // What needs another is gone with it: light needs the only light, bumps are images.
        let needs = |name: &str| match e.name {
            "textures" => name == "normals",
            "environment" => ["direct", "caustics", "indirect"].contains(&name),
            _ => false,
        };
        let left: Vec<&str> = all
            .iter()
            .copied()
            .filter(|n| *n != e.name && !needs(n))
            .collect();
        assert_eq!(without, left, "{wish}");
    }
}
