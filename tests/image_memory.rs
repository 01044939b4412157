//! What an image takes in memory: its numbers once, two thirds of that for its smaller sizes, and
//! hardly more while they are made. What is measured is the whole process, so no other test here
//! may take memory.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;
#[path = "common/memory.rs"]
mod memory;

use asset::Asset;
use dualight::textures::{Content, Image, Texels};
use image::{ImageFormat, RgbImage};
use memory::{forget, peak};
use serde_json::json;

/// A flat image of this size as PNG: a few kilobytes.
fn png(side: u32) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    RgbImage::new(side, side)
        .write_to(&mut out, ImageFormat::Png)
        .unwrap();
    out.into_inner()
}

#[test]
fn images_take_little_more_than_their_numbers() {
    // Numbers of whole sizes: 1/4 + 1/16 + … in 16 bits are two thirds of 8 bits.
    for channels in 1..=4 {
        let numbers = 512 * 512 * channels;
        let image = Image::from_texels(512, 512, channels, Texels::U8(vec![9; numbers])).unwrap();
        assert_eq!(image.bytes(), numbers);
        image.prepare(Content::Color);
        let more = image.bytes() - numbers;
        assert!(3 * more <= 2 * numbers, "{channels} channels: {more}");
    }

    let side = 5000;
    let mut a = Asset::triangle();
    let view = a.view(&png(side));
    a.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
    a.json["textures"] = json!([{"source": 0}]);
    let uv = a.floats("VEC2", &[0.0; 6]);
    a.attributes()["TEXCOORD_0"] = json!(uv);
    a.json["materials"] = json!([{
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}
    }]);
    a.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    // Threads, tables and what else is made once.
    let _ = Asset::triangle().read().unwrap();

    let decoded = f64::from(side * side) * 3.0;
    // Of everything else that comes and goes.
    let slack = 24e6;
    let Some(before) = forget().and_then(|()| peak()) else {
        return;
    };
    let scene = a.read().unwrap();
    let loading = (peak().unwrap() - before) as f64;
    scene.prepare_textures();
    let prepared = (peak().unwrap() - before) as f64;
    println!("{decoded} decoded: {loading} to load, {prepared} with all sizes");
    assert!(loading < decoded + slack, "{loading} for {decoded}");
    assert!(
        prepared < 5.0 / 3.0 * decoded + slack,
        "{prepared} for {decoded}"
    );
}

#[test]
fn images_of_absurd_sides_are_refused() {
    // Grey, 70000 × 1.
    let mut out = std::io::Cursor::new(Vec::new());
    image::GrayImage::new(70_000, 1)
        .write_to(&mut out, ImageFormat::Png)
        .unwrap();
    let mut a = Asset::triangle();
    let view = a.view(out.get_ref());
    a.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
    a.json["textures"] = json!([{"source": 0}]);
    a.json["materials"] = json!([{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}]);
    a.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let error = a.error();
    assert!(
        error.contains("/images/0") && error.contains("70000"),
        "{error}"
    );
}
