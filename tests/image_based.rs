//! `EXT_lights_image_based`, against closed forms.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use std::f64::consts::PI;
use std::io::Cursor;

use asset::Asset;
use dualight::color::srgb_to_linear;
use dualight::import::{ImportOptions, LightUnits};
use dualight::math::DVec3;
use image::{ImageFormat, Rgba, RgbaImage};
use serde_json::{Value, json};

const SIZE: u32 = 16;

/// The directions of the faces, in the extension's order.
const AXES: [DVec3; 6] = [
    DVec3::X,
    DVec3::NEG_X,
    DVec3::Y,
    DVec3::NEG_Y,
    DVec3::Z,
    DVec3::NEG_Z,
];

/// A triangle in a cube of six colours in RGBD, face k of red `codes[k]` and divisor `codes[k]`
/// of the second.
fn lit(red: [u8; 6], divisor: [u8; 6]) -> Asset {
    let mut a = Asset::triangle();
    let mut images = Vec::new();
    for (r, d) in red.into_iter().zip(divisor) {
        // The upper left quarter is green besides, so that turned faces show.
        let face = RgbaImage::from_fn(SIZE, SIZE, |x, y| {
            let mark = if x < SIZE / 2 && y < SIZE / 2 { 255 } else { 0 };
            Rgba([r, mark, 0, d])
        });
        let mut png = Cursor::new(Vec::new());
        face.write_to(&mut png, ImageFormat::Png).unwrap();
        let view = a.view(png.get_ref());
        images.push(json!({"bufferView": view, "mimeType": "image/png"}));
    }
    a.json["images"] = Value::Array(images);
    a.json["extensionsUsed"] = json!(["EXT_lights_image_based"]);
    a.json["extensionsRequired"] = json!(["EXT_lights_image_based"]);
    a.json["extensions"] = json!({"EXT_lights_image_based": {"lights": [{
        "intensity": 2.0,
        "specularImageSize": SIZE,
        "specularImages": [[0, 1, 2, 3, 4, 5]],
        "irradianceCoefficients": vec![[0.0, 0.0, 0.0]; 9],
    }]}});
    a.json["scenes"][0]["extensions"] = json!({"EXT_lights_image_based": {"light": 0}});
    a
}

fn light(a: &mut Asset) -> &mut Value {
    &mut a.json["extensions"]["EXT_lights_image_based"]["lights"][0]
}

#[test]
fn every_face_shines_from_where_it_belongs() {
    let (red, divisor) = ([10, 60, 110, 160, 210, 255], [255, 128, 64, 32, 16, 8]);
    let scene = lit(red, divisor).read().unwrap();
    let radiance = |k: usize| {
        2.0 * srgb_to_linear(f64::from(red[k]) / 255.0) / (f64::from(divisor[k]) / 255.0)
    };
    for (k, d) in AXES.into_iter().enumerate() {
        let got = scene.lights[0].escaped(d).r;
        let want = radiance(k);
        assert!(
            (got / want - 1.0).abs() < 1e-5,
            "face {k}: {got} for {want}"
        );
    }
    // Faces shed a sixth of the sphere each; parallel light meets the scene's disc.
    let radius = scene.bounds.max.distance(scene.bounds.min) / 2.0;
    let fluence = (0..6).map(radiance).sum::<f64>() * 4.0 * PI / 6.0;
    let power = scene.lights[0].power().r / (PI * radius * radius);
    assert!(
        (power / fluence - 1.0).abs() < 0.01,
        "{power} for {fluence}"
    );
}

#[test]
fn photometric_surroundings_are_in_candela_per_square_metre() {
    let a = lit([255; 6], [255; 6]);
    let radiance = |light_units| {
        let options = ImportOptions {
            light_units,
            ..Default::default()
        };
        a.read_with(&options).unwrap().lights[0].escaped(DVec3::X).r
    };
    for (units, want) in [
        (LightUnits::Photometric, 2.0 / 683.0),
        (LightUnits::Radiometric, 2.0),
        (LightUnits::Blender, 2.0),
        // No lamp that they would have to be in proportion to.
        (LightUnits::Auto, 2.0),
    ] {
        assert!((radiance(units) / want - 1.0).abs() < 1e-5, "{units:?}");
    }
}

#[test]
fn faces_stand_upright_and_are_seen_from_within() {
    let scene = lit([0; 6], [255; 6]).read().unwrap();
    let up = [
        DVec3::Y,
        DVec3::Y,
        DVec3::NEG_Z,
        DVec3::Z,
        DVec3::Y,
        DVec3::Y,
    ];
    for (forward, up) in AXES.into_iter().zip(up) {
        let right = forward.cross(up);
        for (x, y) in [(-1.0, 1.0), (1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)] {
            let d = (forward + 0.5 * x * right + 0.5 * y * up).normalize();
            let green = scene.lights[0].escaped(d).g;
            let marked = x < 0.0 && y > 0.0;
            assert_eq!(green > 1.0, marked, "{forward}: {x}, {y}");
            assert_eq!(green < 1.0, !marked, "{forward}: {x}, {y}");
        }
    }
}

#[test]
fn the_cube_turns_and_the_user_may_replace_it() {
    let mut a = lit([255, 0, 0, 0, 0, 0], [255; 6]);
    // A quarter turn about +z takes +x to +y.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    light(&mut a)["rotation"] = json!([0.0, 0.0, half, half]);
    let scene = a.read().unwrap();
    assert!((scene.lights[0].escaped(DVec3::Y).r - 2.0).abs() < 1e-5);
    assert!(scene.lights[0].escaped(DVec3::X).r < 1e-5);
    a.json["scenes"][0]["extras"] = json!({"dualight": {"environment": {"color": [0, 0, 3]}}});
    let scene = a.read().unwrap();
    assert_eq!(scene.lights.len(), 1);
    assert_eq!(scene.lights[0].escaped(DVec3::Y).b, 3.0);
}

#[test]
fn coefficients_that_belong_to_another_light_are_told() {
    let told = |a: &Asset| {
        let warnings = a.read().unwrap().warnings;
        warnings.iter().any(|w| w.contains("its irradiance is"))
    };
    let mut a = lit([255; 6], [255; 6]);
    assert!(told(&a));
    // Radiance 1 in red, and in green over a quarter: the first coefficient is that times
    // π / Y₀₀ = √(4π) π.
    let first = (4.0 * PI).sqrt() * PI;
    light(&mut a)["irradianceCoefficients"][0] = json!([first, 0.25 * first, 0.0]);
    assert!(!told(&a));
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    let at = "/extensions/EXT_lights_image_based/lights/0";
    let case = |change: &dyn Fn(&mut Asset), place: &str, reason: &str| {
        let mut a = lit([100; 6], [255; 6]);
        change(&mut a);
        let text = a.error();
        assert!(text.contains(&format!("{place}: ")), "{text}");
        assert!(text.contains(reason), "{text}");
    };
    case(
        &|a| a.json["scenes"][0]["extensions"]["EXT_lights_image_based"]["light"] = json!(1),
        "/scenes/0/extensions/EXT_lights_image_based/light",
        "does not exist",
    );
    case(
        &|a| light(a)["specularImages"] = json!([[0, 1, 2]]),
        &format!("{at}/specularImages/0"),
        "a cube has 6 faces",
    );
    case(
        &|a| light(a)["specularImages"] = json!([]),
        &format!("{at}/specularImages"),
        "is empty",
    );
    case(
        &|a| light(a)["specularImages"][0][3] = json!(9),
        &format!("{at}/specularImages/0/3"),
        "/images/9 does not exist",
    );
    case(
        &|a| light(a)["specularImageSize"] = json!(32),
        &format!("{at}/specularImages/0/0"),
        "16 × 16 texels",
    );
    // Before anything is decoded: the images are smaller.
    case(
        &|a| light(a)["specularImageSize"] = json!(5000),
        &format!("{at}/specularImageSize"),
        "more than 4096",
    );
    case(
        &|a| light(a)["irradianceCoefficients"] = json!([[0, 0, 0]]),
        &format!("{at}/irradianceCoefficients"),
        "not 9",
    );
    case(
        &|a| light(a)["rotation"] = json!([0, 0, 0, 0]),
        at,
        "no length",
    );
}
