//! What files say in their extras under our name, and lights as they are read.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use std::f64::consts::PI;

use asset::Asset;
use dualight::color::units::LightUnits;
use dualight::import::ImportOptions;
use dualight::math::DVec3;
use dualight::scene::Scene;
use serde_json::{Value, json};

/// A triangle, and node 1 with what `node` says.
fn with_node(node: Value) -> Asset {
    let mut a = Asset::triangle();
    a.json["nodes"] = json!([{"mesh": 0}, node]);
    a.json["scenes"] = json!([{"nodes": [0, 1]}]);
    a
}

fn with_light(light: Value) -> Asset {
    let mut a = with_node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    a.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    a
}

fn with_camera(extras: Value) -> Asset {
    let mut a = with_node(json!({"camera": 0}));
    a.json["cameras"] = json!([{
        "type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1},
        "extras": {"dualight": extras}
    }]);
    a
}

fn area(area: Value) -> Asset {
    with_node(json!({
        "name": "Area", "scale": [2, 3, 1],
        "extras": {"dualight": {"area_light": area}, "stranger": 1}
    }))
}

fn flux(scene: &Scene) -> f64 {
    scene.flux().g
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs()
}

#[test]
fn area_lights_have_the_power_and_the_colour_they_name() {
    for (shape, size) in [
        ("square", json!(0.5)),
        ("disk", json!(0.5)),
        ("rectangle", json!([0.5, 0.25])),
        ("ellipse", json!([0.5, 0.25])),
    ] {
        let a = area(json!({
            "shape": shape, "size": size, "power": 60, "color": [1, 0.5, 0.25]
        }));
        let scene = a.read().unwrap();
        assert_eq!(scene.warnings, Vec::<String>::new());
        let f = scene.flux();
        // Whatever the node's scale does to its size.
        assert!(
            close(f.r, 60.0) && close(f.g, 30.0) && close(f.b, 15.0),
            "{f:?}"
        );
        assert_eq!(scene.light_names[0], ("Area".into(), "panel"));
        // Along −z of the node, and not to the camera.
        let light = &scene.lights[0];
        assert!(light.sample_li(DVec3::NEG_Z, [0.5; 2]).is_some());
        assert!(light.sample_li(DVec3::Z, [0.5; 2]).is_none());
        assert!(!light.seen_by_camera());
        let l = light.crossed(DVec3::NEG_Z, DVec3::Z, 2.0).unwrap().radiance;
        let surface = 6.0
            * match shape {
                "square" => 0.25,
                "disk" => 0.25 * PI / 4.0,
                "rectangle" => 0.125,
                _ => 0.125 * PI / 4.0,
            };
        assert!(close(l.r, 60.0 / (PI * surface)), "{shape}: {l:?}");
    }
}

#[test]
fn why_occlusion_is_not_used_is_told_once() {
    let mut a = Asset::triangle();
    let occluded = json!({"occlusionTexture": {"index": 0, "strength": 0.5}});
    a.json["materials"] = json!([occluded, occluded]);
    a.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    // Not even its image has to be there.
    a.json["textures"] = json!([{"source": 0}]);
    a.json["images"] = json!([{"uri": "nowhere.png"}]);
    assert_eq!(
        a.read().unwrap().warnings,
        ["occlusionTexture is not used: what it bakes, global illumination computes (2 times)"]
    );
}

#[test]
fn what_a_material_says_without_effect_is_told_by_its_name() {
    let material = |m: Value| {
        let mut a = Asset::triangle();
        a.json["materials"] = json!([m]);
        a.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        a
    };
    let warnings = |m: Value| material(m).read().unwrap().warnings;
    // All that the specifications list but thickness by texture, which needs no image here.
    let all = json!({
        "name": "full", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.5,
        "emissiveFactor": [0, 0, 0], "extras": {"any": 1},
        "pbrMetallicRoughness": {
            "baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0, "roughnessFactor": 1,
        },
        "extensions": {
            "KHR_materials_anisotropy": {"anisotropyStrength": 0, "anisotropyRotation": 0},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0, "clearcoatRoughnessFactor": 0},
            "KHR_materials_diffuse_transmission": {
                "diffuseTransmissionFactor": 0, "diffuseTransmissionColorFactor": [1, 1, 1],
            },
            "KHR_materials_dispersion": {"dispersion": 0},
            "KHR_materials_emissive_strength": {"emissiveStrength": 1},
            "KHR_materials_ior": {"ior": 1.5},
            "KHR_materials_iridescence": {
                "iridescenceFactor": 0, "iridescenceIor": 1.3,
                "iridescenceThicknessMinimum": 100, "iridescenceThicknessMaximum": 400,
            },
            "KHR_materials_sheen": {"sheenColorFactor": [0, 0, 0], "sheenRoughnessFactor": 0},
            "KHR_materials_specular": {"specularFactor": 1, "specularColorFactor": [1, 1, 1]},
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": {
                "thicknessFactor": 1, "attenuationDistance": 1, "attenuationColor": [1, 1, 1],
            },
        },
    });
    assert_eq!(warnings(all), Vec::<String>::new());
    let volume = |more: Value| {
        let mut v = json!({"thicknessFactor": 1.0, "thicknessTexture": {"index": 0}});
        v.as_object_mut()
            .unwrap()
            .extend(more.as_object().unwrap().clone());
        json!({"name": "tea", "extensions": {"KHR_materials_volume": v}})
    };
    let told = warnings(volume(json!({})));
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(
        told[0].contains("material 'tea': thicknessTexture of KHR_materials_volume is ignored"),
        "{told:?}"
    );
    let told = warnings(volume(json!({"thickness": 3})));
    assert!(
        told.iter().any(|w| w.contains("'tea': thickness of")),
        "{told:?}"
    );
    let told = warnings(json!({
        "name": "odd", "shininess": 3, "pbrMetallicRoughness": {"metalicFactor": 0},
        "extensions": {"EXT_nobody_knows": {}},
    }));
    for part in [
        "'odd': shininess is ignored",
        "'odd': metalicFactor of pbrMetallicRoughness",
        "'odd': EXT_nobody_knows is not supported",
    ] {
        assert!(told.iter().any(|w| w.contains(part)), "{part}: {told:?}");
    }
    // One line is enough for what the file declares.
    let mut a = material(json!({"extensions": {"EXT_nobody_knows": {}}}));
    a.json["extensionsUsed"] = json!(["EXT_nobody_knows"]);
    assert_eq!(a.read().unwrap().warnings.len(), 1);
}

#[test]
fn a_file_that_needs_a_newer_gltf_is_refused() {
    let mut a = Asset::triangle();
    a.json["asset"] = json!({"version": "2.1", "minVersion": "2.0"});
    assert!(a.read().is_ok());
    a.json["asset"]["minVersion"] = json!("2.1");
    let e = a.read().err().unwrap();
    assert_eq!(e.exit_code(), 3);
    assert!(e.to_string().contains("/asset/minVersion"), "{e}");
}

#[test]
fn what_is_wrong_in_our_extras_is_told_with_its_place() {
    let place = "/nodes/1/extras/dualight/area_light";
    for (bad, at, what) in [
        (
            json!({"size": 1, "power": 1}),
            place.to_owned(),
            "'shape' is missing",
        ),
        (
            json!({"shape": "square", "power": 1}),
            place.to_owned(),
            "'size' is missing",
        ),
        (
            json!({"shape": "disk", "size": 1}),
            place.to_owned(),
            "'power' is missing",
        ),
        (
            json!({"shape": "star", "size": 1, "power": 1}),
            format!("{place}/shape"),
            "'star'",
        ),
        (
            json!({"shape": 5, "size": 1, "power": 1}),
            format!("{place}/shape"),
            "string",
        ),
        (
            json!({"shape": "disk", "size": -1, "power": 1}),
            format!("{place}/size"),
            "above 0",
        ),
        (
            json!({"shape": "ellipse", "size": [1, 0], "power": 1}),
            format!("{place}/size"),
            "above 0",
        ),
        (
            json!({"shape": "disk", "size": 1, "power": "x"}),
            format!("{place}/power"),
            "number",
        ),
        (
            json!({"shape": "disk", "size": 1, "power": 1, "color": [1, -1, 0]}),
            format!("{place}/color"),
            "colour",
        ),
        (
            json!({"shape": "disk", "size": 1, "power": 1, "seen_by_camera": 1}),
            format!("{place}/seen_by_camera"),
            "neither true nor false",
        ),
        (json!(7), place.to_owned(), "not an object"),
    ] {
        let text = area(bad.clone()).error();
        assert!(text.contains(&format!("{at}: ")), "{bad}: {text}");
        assert!(
            text.contains(what) && text.lines().count() == 1,
            "{bad}: {text}"
        );
    }
    let text = with_camera(json!({"f_stop": 2.8})).error();
    assert!(text.contains("/cameras/0/extras/dualight: has an f_stop, but no focal_length"));
    let text = with_camera(json!({"aperture_radius": 0.1})).error();
    assert!(text.contains("no focus_distance"), "{text}");
    let lens = json!({"aperture_radius": 0.1, "focus_distance": 1, "blades": 2});
    let text = with_camera(lens).error();
    assert!(
        text.contains("/cameras/0/extras/dualight/blades: 2 is"),
        "{text}"
    );
}

#[test]
fn names_that_nobody_knows_are_a_warning() {
    let mut a = area(json!({"shape": "disk", "size": 1, "power": 1, "spread": 1}));
    a.json["nodes"][1]["extras"]["dualight"]["colour"] = json!(1);
    let warnings = a.read().unwrap().warnings;
    assert!(warnings[0].contains("/nodes/1/extras/dualight/area_light: 'spread'"));
    assert!(warnings[1].contains("/nodes/1/extras/dualight: 'colour' is not known"));
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    // A radius is nothing that a sun has.
    let a = with_light(json!({"type": "directional", "extras": {"dualight": {"radius": 1}}}));
    assert!(a.read().unwrap().warnings[0].contains("known: angle, seen_by_camera"));
}

#[test]
fn points_spots_and_suns_get_their_extent_and_keep_their_power() {
    let blender = "Khronos glTF Blender I/O v5.0.21";
    for (kind, extras, solid_angle) in [
        ("point", json!({"radius": 0.1}), 4.0 * PI),
        ("spot", json!({"radius": 0.1}), PI),
    ] {
        let mut a = with_light(json!({
            "type": kind, "intensity": 683, "spot": {"outerConeAngle": PI / 2.0},
            "extras": {"dualight": extras}
        }));
        a.json["asset"]["generator"] = json!(blender);
        let scene = a.read().unwrap();
        assert!(scene.lights[0].is_bodiless() && !scene.lights[0].seen_by_camera());
        // A smooth step over the whole cone leaves half of its solid angle.
        assert!(close(flux(&scene), solid_angle), "{kind}: {}", flux(&scene));
    }
    let a = with_light(json!({
        "type": "directional", "intensity": 683, "extras": {"dualight": {"angle": 0.1}}
    }));
    let scene = a.read().unwrap();
    let sun = &scene.lights[0];
    assert!(sun.is_infinite() && !sun.seen_by_camera());
    // As Cycles shows it: E / (π sin²).
    let l = sun.escaped(DVec3::Z).g;
    assert!(close(l, 1.0 / (PI * 0.05f64.sin().powi(2))), "{l}");
    assert_eq!(sun.escaped(DVec3::new(0.052, 0.0, 1.0).normalize()).g, 0.0);
}

#[test]
fn units_are_those_of_the_files_writer_unless_they_are_given() {
    let light = json!({"type": "point", "intensity": 683.0});
    for (generator, note) in [
        ("Khronos glTF Blender I/O v4.0", "as Blender exports them"),
        ("somebody", "candela and lux"),
    ] {
        let mut a = with_light(light.clone());
        a.json["asset"]["generator"] = json!(generator);
        let scene = a.read().unwrap();
        assert!(scene.notes[0].contains(note), "{:?}", scene.notes);
        assert!(close(flux(&scene), 4.0 * PI));
    }
    // Watts are what versions before 3.4 wrote, and those that did not yet tell theirs.
    for old in ["glTF Blender I/O v3.3.27", "Blender glTF 2.0 I/O"] {
        for (kind, want) in [("point", 683.0), ("spot", 683.0 / 4.0)] {
            let mut a = with_light(json!({
                "type": kind, "intensity": 683, "spot": {"outerConeAngle": PI / 2.0},
            }));
            a.json["asset"]["generator"] = json!(format!("Khronos {old}"));
            let scene = a.read().unwrap();
            let note = &scene.notes[0];
            assert!(
                note.contains("as watts") && note.contains("--light-units"),
                "{note}"
            );
            assert!(close(flux(&scene), want), "{kind}: {}", flux(&scene));
        }
    }
    let sun =
        json!({"type": "directional", "intensity": 3, "extras": {"dualight": {"angle": 0.1}}});
    let mut a = with_light(sun);
    a.json["asset"]["generator"] = json!("Khronos glTF Blender I/O v1.8.19");
    let l = a.read().unwrap().lights[0].escaped(DVec3::Z).g;
    assert!(close(l, 3.0 / (PI * 0.05f64.sin().powi(2))), "{l}");
    for (light_units, factor) in [
        (LightUnits::Blender, 1.0),
        (LightUnits::Photometric, 1.0),
        (LightUnits::Radiometric, 683.0),
        (LightUnits::Watts, 683.0 / (4.0 * PI)),
    ] {
        let options = ImportOptions {
            light_units,
            ..Default::default()
        };
        let scene = with_light(light.clone()).read_with(&options).unwrap();
        assert!(scene.notes.is_empty() && close(flux(&scene), factor * 4.0 * PI));
    }
}

#[test]
fn what_surfaces_emit_is_in_the_units_of_the_lamps() {
    let glowing = || {
        let mut a = Asset::triangle();
        a.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength"]);
        a.json["materials"] = json!([{
            "emissiveFactor": [0.5, 0.5, 0.5],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}},
        }]);
        a.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        a
    };
    // A radiance of 2 from one side of half a square metre: π A L.
    let watts = PI * 0.5 * 2.0;
    for (light_units, factor) in [
        (LightUnits::Blender, 1.0),
        (LightUnits::Photometric, 1.0 / 683.0),
        (LightUnits::Radiometric, 1.0),
        (LightUnits::Watts, 1.0),
        (LightUnits::Auto, 1.0),
    ] {
        let options = ImportOptions {
            light_units,
            ..Default::default()
        };
        let scene = glowing().read_with(&options).unwrap();
        assert!(close(flux(&scene), factor * watts), "{light_units:?}");
        let told = scene
            .notes
            .iter()
            .any(|n| n.contains("no lamp is in the file"));
        assert_eq!(told, light_units == LightUnits::Auto, "{:?}", scene.notes);
    }
    // What is unlit shines for nobody, whatever else the material says.
    let mut unlit = glowing();
    unlit.json["materials"][0]["extensions"]["KHR_materials_unlit"] = json!({});
    assert!(unlit.read().unwrap().lights.is_empty());
    // Beside a lamp the file's numbers are photometric, but Blender's are not.
    for (generator, factor) in [
        ("somebody", 1.0 / 683.0),
        ("Khronos glTF Blender I/O v4.2.57", 2.0),
    ] {
        let mut a = glowing();
        a.json["asset"]["generator"] = json!(generator);
        a.json["nodes"] = json!([
            {"mesh": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}
        ]);
        a.json["scenes"] = json!([{"nodes": [0, 1]}]);
        let lamp = json!({"type": "point", "intensity": 683.0});
        a.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [lamp]}});
        // Surfaces of Blender's files shine from both sides.
        let want = 4.0 * PI + factor * watts;
        let scene = a.read().unwrap();
        assert!(close(flux(&scene), want), "{generator}");
    }
}

#[test]
fn how_a_lamp_spreads_its_light_depends_on_the_writer_and_not_on_the_units() {
    // Half a watt per steradian in the middle, a smooth step of the cosine from there to the rim.
    let spot = json!({
        "type": "spot", "intensity": 0.5, "range": 0.5,
        "spot": {"innerConeAngle": 0.0, "outerConeAngle": PI / 2.0},
    });
    for (generator, light_units, unit) in [
        (
            "Khronos glTF Blender I/O v5.0.21",
            LightUnits::Radiometric,
            1.0,
        ),
        (
            "Khronos glTF Blender I/O v5.0.21",
            LightUnits::Photometric,
            1.0 / 683.0,
        ),
        (
            "Khronos glTF Blender I/O v5.0.21",
            LightUnits::Watts,
            1.0 / (4.0 * PI),
        ),
        // Who asks for Blender's units says that it is Blender's file, whoever signed it.
        ("gltfpack 0.16", LightUnits::Blender, 1.0 / 683.0),
    ] {
        let mut a = with_light(spot.clone());
        a.json["asset"]["generator"] = json!(generator);
        let options = ImportOptions {
            light_units,
            ..Default::default()
        };
        let scene = a.read_with(&options).unwrap();
        // Cycles' curve leaves half of the half space's solid angle, glTF's a third of it.
        assert!(
            close(flux(&scene), 0.5 * PI * unit),
            "{generator} {light_units:?}"
        );
        let far = scene.lights[0].sample_li(DVec3::new(0.0, 0.0, -7.0), [0.5; 2]);
        let far = far.map_or(0.0, |l| l.radiance.g);
        assert!(close(far, 0.5 * unit / 49.0), "{light_units:?}: {far}");
    }
    let mut a = with_light(spot);
    a.json["asset"]["generator"] = json!("somebody");
    let options = ImportOptions {
        light_units: LightUnits::Radiometric,
        ..Default::default()
    };
    let scene = a.read_with(&options).unwrap();
    assert!(
        close(flux(&scene), 0.5 * 2.0 * PI / 3.0),
        "{}",
        flux(&scene)
    );
    let far = scene.lights[0].sample_li(DVec3::new(0.0, 0.0, -7.0), [0.5; 2]);
    assert_eq!(far.map_or(0.0, |l| l.radiance.g), 0.0);
}

#[test]
fn strange_numbers_make_no_strange_light() {
    for (light, n) in [
        (json!({"type": "point", "intensity": -5}), 0),
        (json!({"type": "point", "intensity": 0}), 0),
        (json!({"type": "point", "color": [-1, -1, -1]}), 0),
        (json!({"type": "spot", "spot": {"outerConeAngle": 0}}), 0),
        (json!({"type": "spot", "spot": {"outerConeAngle": -1}}), 0),
        (
            json!({"type": "spot", "spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.5}}),
            1,
        ),
        (
            json!({"type": "spot", "spot": {"innerConeAngle": 2, "outerConeAngle": 0.5}}),
            1,
        ),
        (json!({"type": "spot", "spot": {"outerConeAngle": 9}}), 1),
        (json!({"type": "spot"}), 1),
        (json!({"type": "directional"}), 1),
    ] {
        for generator in ["Khronos glTF Blender I/O", "x"] {
            let mut a = with_light(light.clone());
            a.json["asset"]["generator"] = json!(generator);
            let scene = a.read().unwrap();
            assert_eq!(scene.lights.len(), n, "{light}");
            assert!(scene.flux().r.is_finite() && scene.flux().r >= 0.0);
            for l in &scene.lights {
                for p in [DVec3::ZERO, DVec3::NEG_Z, DVec3::new(0.3, 0.2, -1.0)] {
                    let li = l.sample_li(p, [0.3, 0.7]);
                    assert!(li.is_none_or(|l| l.radiance.g.is_finite()), "{light}");
                }
            }
        }
    }
    let text = with_light(json!({"type": "point", "range": 0})).error();
    assert!(
        text.contains("/extensions/KHR_lights_punctual/lights/0"),
        "{text}"
    );
}

#[test]
fn cameras_get_their_lens_and_shift() {
    let a = with_camera(json!({
        "f_stop": 2.0, "focal_length": 0.05, "focus_distance": 3, "blades": 6,
        "blade_rotation": 0.5, "aperture_ratio": 2, "shift": [0.1, -0.2]
    }));
    let scene = a.read().unwrap();
    let camera = &scene.cameras[0];
    let lens = camera.lens.unwrap();
    assert!(close(lens.radius, 0.0125) && lens.focus == 3.0 && lens.blades == 6);
    assert!(lens.rotation == 0.5 && lens.ratio == 2.0 && camera.shift == [0.1, -0.2]);
    let plain = with_camera(json!({})).read().unwrap();
    assert!(plain.cameras[0].lens.is_none());
}

#[test]
fn a_scene_brings_its_own_environment_and_the_user_may_replace_it() {
    let mut a = Asset::triangle();
    a.json["scenes"][0]["extras"] = json!({"dualight": {"environment": {
        "color": [1, 2, 3], "strength": 0.5, "seen_by_camera": false
    }}});
    let scene = a.read().unwrap();
    assert_eq!(scene.light_names[0].1, "environment");
    assert_eq!(scene.lights[0].escaped(DVec3::X).b, 1.5);
    assert!(!scene.lights[0].seen_by_camera());
    let options = ImportOptions {
        environment: Some(dualight::import::EnvironmentOption {
            source: dualight::import::EnvironmentSource::Color([7.0; 3]),
            strength: 1.0,
            rotation: 0.0,
            seen_by_camera: true,
        }),
        ..Default::default()
    };
    let scene = a.read_with(&options).unwrap();
    assert_eq!(scene.lights.len(), 1);
    assert_eq!(scene.lights[0].escaped(DVec3::X).b, 7.0);

    let env = |a: &mut Asset, e: Value| {
        a.json["scenes"][0]["extras"] = json!({"dualight": {"environment": e}});
        a.error()
    };
    let text = env(&mut a, json!({"strength": 1}));
    assert!(
        text.contains("/scenes/0/extras/dualight/environment: has not exactly one"),
        "{text}"
    );
    let text = env(&mut a, json!({"image": "no.hdr"}));
    assert!(
        text.contains("no.hdr") && text.lines().count() == 1,
        "{text}"
    );
}
