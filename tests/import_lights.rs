//! Lights as they are read: their shapes, their units and how they spread their light.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use std::f64::consts::PI;

use asset::{Asset, area, with_light};
use dualight::color::units::LightUnits;
use dualight::import::ImportOptions;
use dualight::math::DVec3;
use dualight::scene::Scene;
use serde_json::json;

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
    // There is nothing to tell of Blender's files: it writes no other units of emission.
    let mut blenders = glowing();
    blenders.json["asset"]["generator"] = json!("Khronos glTF Blender I/O v5.0.21");
    let scene = blenders.read().unwrap();
    assert!(scene.notes.is_empty() && close(flux(&scene), 2.0 * watts));
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
