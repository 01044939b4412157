//! The survey of effects may keep one needlessly, but never drop one that is needed: scenes with
//! features switched on and off at random look the same whatever it decided.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::sync::Arc;

use common::random::{add_square, material, scene};
use common::render::{GATHER, Mode, PATH, Size, mean, rendering, settings};
use common::show::{self, Show};
use common::{add_room, add_sphere, camera, glass, lambert, light};
use dualight::color::Rgb;
use dualight::effects::{Acts, EFFECTS, EffectSet, omissions, survey};
use dualight::geometry::Ray;
use dualight::lights::LightDesc;
use dualight::materials::{AlphaMode, MaterialDesc, TextureSlots, TransportMode};
use dualight::math::DVec3;
use dualight::plugins::Registry;
use dualight::sampling::Rng;
use dualight::scene::{Omit, Scene, SceneBuilder};
use dualight::textures::Content;

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

type Pixels = Vec<[f32; 3]>;

/// How a picture is made, and of what size.
const WAYS: [(Mode, Size); 2] = [
    (
        PATH,
        Size {
            pixels: 12,
            spp: 8,
            photons: 10,
        },
    ),
    (
        GATHER,
        Size {
            pixels: 12,
            spp: 4,
            photons: 1000,
        },
    ),
];

/// What is seen, how much of it surfaces passed to one another, and whether the pilot left that out.
fn rendered(
    scene: &Scene,
    mode: Mode,
    size: Size,
    seed: u64,
    effects: &str,
) -> (Pixels, f64, bool) {
    let mut s = settings(mode, size, seed);
    s.effects = effects.into();
    let done = rendering(scene, &s);
    let left_out = done.effects.iter().any(|d| d.reason.contains("none met"));
    let image = done.film.develop();
    let layer = |name| image.rgb(name).map_or(0.0, |_| mean(&image, name));
    let passed_on = layer("indirect") + layer("caustics");
    (image.rgb("").unwrap(), passed_on, left_out)
}

fn picture(scene: &Scene, mode: Mode, size: Size, seed: u64, effects: &str) -> Pixels {
    rendered(scene, mode, size, seed, effects).0
}

/// Whatever the survey skips can be forced, or left out when the scene is built, and every bit of
/// the picture stays: nothing of it was needed.
#[test]
fn no_scene_loses_light_to_the_survey() {
    let registry = Registry::builtin();
    let table = &registry.effects;
    let (mut skipped, mut needed) = (vec![0; EFFECTS.len()], vec![0; EFFECTS.len()]);
    for round in 0..120 {
        let whole = scene(round, Omit::default());
        let decisions = survey(&whole, "auto", table).unwrap().decisions;
        let (mut rest, mut kept) = (String::from("auto"), Vec::new());
        for (i, (e, d)) in EFFECTS.iter().zip(&decisions).enumerate() {
            skipped[i] += usize::from(!d.on);
            match (e.acts, d.on) {
                (Acts::Built(_), false) => rest += &format!(",-{}", e.name),
                (Acts::Always, _) | (_, false) => {}
                (_, true) => kept.push(i),
            }
        }
        let lean = scene(round, omissions(&rest, table).unwrap());
        for (mode, size) in WAYS {
            let what = format!("round {round} by {}", mode.name);
            let draw = |scene, effects| rendered(scene, mode, size, round, effects);
            let (auto, _, left_out) = draw(&whole, "auto");
            // What was dropped would be missing.
            let (all, passed_on, _) = draw(&whole, "all");
            let same = match left_out {
                false => all == auto,
                // Without bounces other random numbers are drawn: there is nothing to be bounced to.
                true => {
                    assert_eq!(passed_on, 0.0, "{what}");
                    draw(&whole, "all,-indirect,-caustics").0 == auto
                }
            };
            assert!(same, "{what}");
            assert!(draw(&lean, "auto").0 == auto, "{what}: {rest}");
            // And what is kept is not kept for nothing, in one scene or another: one of them is
            // left out in turn.
            if let Some(&i) = kept.iter().min_by_key(|i| needed[**i]) {
                let wish = format!("-{}", EFFECTS[i].name);
                let without = scene(round, omissions(&wish, table).unwrap());
                needed[i] += usize::from(draw(&without, &wish).0 != auto);
            }
        }
    }
    let told = |n: &[usize]| -> Vec<String> {
        let each = EFFECTS.iter().zip(n);
        each.map(|(e, n)| format!("{} {n}", e.name)).collect()
    };
    println!("scenes without each effect: {:?}", told(&skipped));
    println!("pictures that miss it: {:?}", told(&needed));
    assert!(skipped.iter().all(|n| *n > 0), "{:?}", told(&skipped));
    let mut each = EFFECTS.iter().zip(&needed);
    let all = each.all(|(e, n)| *n > 0 || matches!(e.acts, Acts::Always));
    assert!(all, "{:?}", told(&needed));
}

/// Of the effects that are decided when a scene is built, each at zero strength, with all that
/// belongs to it, is skipped, and the picture is that of a scene without it; at full strength it
/// is kept, and leaving it out gives that picture again, which is another one.
#[test]
fn what_has_no_strength_is_skipped_and_what_has_is_needed() {
    let table = Registry::builtin().effects;
    for show in Show::ALL {
        let Some(name) = show.built() else { continue };
        let wish = format!("-{name}");
        let [none, faint, full] =
            [None, Some(0.0), Some(1.0)].map(|x| show::scene(*show, x, Omit::default()));
        let left_out = show::scene(*show, 1.0, omissions(&wish, &table).unwrap());
        let on = |scene: &Scene| -> Vec<&str> {
            let decisions = survey(scene, "auto", &table).unwrap().decisions;
            decisions.iter().filter(|d| d.on).map(|d| d.name).collect()
        };
        assert!(on(&full).contains(&name), "{name} at full strength");
        assert_eq!(on(&faint), on(&none), "{name} at no strength");
        for (mode, size) in WAYS {
            let what = format!("{name} by {}", mode.name);
            let see = |scene: &Scene| picture(scene, mode, size, 2, "auto");
            let (without, full) = (see(&none), see(&full));
            assert!(see(&faint) == without, "{what}: no strength");
            let left_out = picture(&left_out, mode, size, 2, &wish);
            assert!(left_out != full, "{what}: is not needed");
            // Of textures, the factor remains.
            assert!(left_out == without || name == "textures", "{what}: {wish}");
        }
    }
}

/// Footprints are for textures that are averaged over them, and for nothing else.
#[test]
fn rays_carry_differentials_only_for_what_asks_for_them() {
    let image = |content| show::noise(1, content, [[0; 4], [255; 4]]);
    let slots = |base_color, emissive| {
        Some(Arc::new(TextureSlots {
            base_color,
            emissive,
            ..Default::default()
        }))
    };
    let cut_out = MaterialDesc {
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        textures: slots(image(Content::Color), None),
        ..lambert("cut out", Rgb::ZERO)
    };
    let painted = MaterialDesc {
        textures: slots(image(Content::Color), None),
        ..lambert("painted", Rgb::ONE)
    };
    let dark = MaterialDesc {
        textures: slots(None, image(Content::Color)),
        ..lambert("its light is off", Rgb::ONE)
    };
    let glowing = MaterialDesc {
        emission: Rgb::ONE,
        ..dark.clone()
    };
    for (shown, used, expected) in [
        (&cut_out, true, false),
        (&painted, true, true),
        (&painted, false, false),
        (&dark, true, false),
        // It is seen, and averaged as paint is.
        (&glowing, true, true),
    ] {
        let mut b = SceneBuilder::default();
        let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
        let shown_id = b.add_material(shown).unwrap();
        add_square(&mut b, if used { shown_id } else { grey }, DVec3::ZERO);
        b.add_light(light("point", DVec3::new(0.5, 1.0, 1.0), DVec3::Y, 3.0));
        b.add_camera(camera(DVec3::new(0.0, 0.0, 2.5), 60.0));
        let scene = b.finish().unwrap();
        for (mode, size) in WAYS {
            let done = rendering(&scene, &settings(mode, size, 1));
            let textures = done.effects.iter().find(|d| d.name == "textures").unwrap();
            let counts = &textures.cost.as_ref().unwrap().counts;
            let found = counts["hits with derivatives"] > 0;
            assert_eq!(found, expected, "{}, used: {used}", shown.name);
        }
    }
}

/// A lamp throws no caustics by glass that is out of its range, and nothing is missed of them.
#[test]
fn caustics_need_a_light_that_reaches_what_throws_them() {
    let registry = Registry::builtin();
    let scene = |range: f64| {
        let mut b = SceneBuilder::default();
        let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
        let glass = b.add_material(&glass(1.5)).unwrap();
        add_room(&mut b, grey, 3.0);
        add_sphere(&mut b, "ball", glass, DVec3::new(0.0, -0.5, 0.0), 0.5);
        b.add_light(LightDesc {
            range,
            ..light("point", DVec3::new(0.0, 2.0, 0.0), DVec3::Y, 3.0)
        });
        b.add_camera(camera(DVec3::new(0.0, 0.0, 2.5), 60.0));
        b.finish().unwrap()
    };
    // Two metres lie between them.
    for (range, on) in [(1.9, false), (2.1, true), (f64::INFINITY, true)] {
        let scene = scene(range);
        let set = survey(&scene, "auto", &registry.effects).unwrap().set;
        assert_eq!(set.contains(EffectSet::CAUSTICS), on, "{range}");
        let (_, size) = WAYS[0];
        let auto = picture(&scene, PATH, size, 1, "auto");
        assert!(auto == picture(&scene, PATH, size, 1, "all"), "{range}");
    }
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
    show::scene(Show::Everything, 1.0, omit)
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
        // What needs another is gone with it: bumps are images.
        let needs = |name: &str| e.name == "textures" && name == "normals";
        let left: Vec<&str> = all
            .iter()
            .copied()
            .filter(|n| *n != e.name && !needs(n))
            .collect();
        assert_eq!(without, left, "{wish}");
    }
}
