//! What files say in their extras under our name.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use asset::{Asset, area, with_light, with_node};
use dualight::import::ImportOptions;
use dualight::math::DVec3;
use serde_json::{Value, json};

fn with_camera(extras: Value) -> Asset {
    let mut a = with_node(json!({"camera": 0}));
    a.json["cameras"] = json!([{
        "type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1},
        "extras": {"dualight": extras}
    }]);
    a
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
fn cameras_get_their_lens_and_shift() {
    let a = with_camera(json!({
        "f_stop": 2.0, "focal_length": 0.05, "focus_distance": 3, "blades": 6,
        "blade_rotation": 0.5, "aperture_ratio": 2, "shift": [0.1, -0.2]
    }));
    let scene = a.read().unwrap();
    let camera = &scene.cameras[0];
    let lens = camera.lens.unwrap();
    assert!((lens.radius - 0.0125).abs() < 1e-12 && lens.focus == 3.0 && lens.blades == 6);
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
