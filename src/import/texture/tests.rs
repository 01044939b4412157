//! Images of every format, in every place a file can keep them.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::io;
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{ImageBuffer, ImageFormat, Luma, LumaA, Rgb, Rgba};
use serde_json::{Value, json};

use super::super::accessor::Source;
use super::super::buffer::Buffer;
use super::super::uri::Uris;
use super::*;
use crate::textures::Image;

/// The file of an image.
fn file<P: image::PixelWithColorType>(
    pixels: &ImageBuffer<P, Vec<P::Subpixel>>,
    format: ImageFormat,
) -> Vec<u8>
where
    [P::Subpixel]: image::EncodableLayout,
{
    let mut out = io::Cursor::new(Vec::new());
    pixels.write_to(&mut out, format).unwrap();
    out.into_inner()
}

fn uri(bytes: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(bytes))
}

/// A file with one image and one texture that shows it.
fn document(image: Value) -> Value {
    json!({"images": [image], "textures": [{"source": 0}], "info": {"index": 0}})
}

/// The texture that `info` of a document describes, all images decoded.
fn load(json: &Value, buffers: &[Vec<u8>]) -> Result<Option<Texture>, Problem> {
    load_beside(json, buffers, std::path::Path::new("nowhere/scene.gltf"))
}

fn load_beside(
    json: &Value,
    buffers: &[Vec<u8>],
    path: &std::path::Path,
) -> Result<Option<Texture>, Problem> {
    let root = Cursor::root(json);
    let buffers: Vec<Buffer> = buffers.iter().cloned().map(Buffer::from).collect();
    let source = Source::new(root.clone(), &buffers, 0);
    let uris = Uris::of(path);
    let mut images = Images::new(&source, &uris);
    let info = root.need("info")?;
    read(&info, Content::Color, &mut images, &mut Notes::default())?;
    images.decode()?;
    read(&info, Content::Color, &mut images, &mut Notes::default())
}

fn decoded(bytes: &[u8]) -> Arc<Image> {
    let json = document(json!({"uri": uri(bytes)}));
    load(&json, &[]).unwrap().unwrap().image
}

#[test]
fn every_format_gives_the_numbers_that_were_written() {
    let rgb = ImageBuffer::from_fn(5, 3, |x, y| Rgb([(50 * x) as u8, (80 * y) as u8, 7]));
    for format in [ImageFormat::Png, ImageFormat::WebP] {
        let image = decoded(&file(&rgb, format));
        assert_eq!((image.width(), image.height()), (5, 3));
        assert_eq!((image.channels(), image.depth()), (3, 8));
        let expected = [100.0 / 255.0, 160.0 / 255.0, 7.0 / 255.0, 1.0];
        for (a, b) in image.texel(2, 2, Content::Data).iter().zip(expected) {
            assert!((a - b).abs() < 1e-7, "{format:?}");
        }
    }
    let smooth = ImageBuffer::from_fn(16, 16, |x, y| Rgb([(8 * x) as u8, (8 * y) as u8, 90]));
    let image = decoded(&file(&smooth, ImageFormat::Jpeg));
    let t = image.texel(12, 4, Content::Data);
    assert!((t[0] * 255.0 - 96.0).abs() < 12.0 && (t[1] * 255.0 - 32.0).abs() < 12.0);
    assert_eq!(t[3], 1.0);
}

#[test]
fn sixteen_bits_grey_and_alpha_are_kept() {
    let deep = ImageBuffer::from_pixel(2, 2, Rgba([1_u16, 257, 65535, 40000]));
    let image = decoded(&file(&deep, ImageFormat::Png));
    assert_eq!(
        (image.channels(), image.depth(), image.bytes()),
        (4, 16, 32)
    );
    let t = image.texel(1, 1, Content::Data);
    assert_eq!(t, [1.0 / 65535.0, 257.0 / 65535.0, 1.0, 40000.0 / 65535.0]);
    let t = image.texel(1, 1, Content::Color);
    assert!((t[0] - 1.0 / 65535.0 / 12.92).abs() < 1e-12 && t[3] == 40000.0 / 65535.0);

    let grey = ImageBuffer::from_pixel(2, 2, Luma([51_u8]));
    let image = decoded(&file(&grey, ImageFormat::Png));
    assert_eq!((image.channels(), image.bytes()), (1, 4));
    let t = image.texel(0, 0, Content::Data);
    assert!(t[..3].iter().all(|x| (x - 0.2).abs() < 1e-7) && t[3] == 1.0);
    let veiled = ImageBuffer::from_pixel(2, 2, LumaA([51_u8, 102]));
    let t = decoded(&file(&veiled, ImageFormat::Png)).texel(0, 0, Content::Color);
    assert!((t[0] - crate::color::srgb_to_linear(0.2)).abs() < 1e-7);
    assert!((t[3] - 0.4).abs() < 1e-7);
}

#[test]
fn an_image_is_decoded_once_however_often_it_is_named() {
    let bytes = uri(&file(
        &ImageBuffer::from_pixel(1, 1, Luma([9_u8])),
        ImageFormat::Png,
    ));
    let json = json!({
        "images": [{"uri": bytes}, {"uri": bytes}, {"uri": "not-there.png"}],
        "textures": [{"source": 0}, {"source": 1}, {"source": 2}],
        "a": {"index": 0}, "b": {"index": 1}, "unused": {"index": 2},
    });
    let root = Cursor::root(&json);
    let source = Source::new(root.clone(), &[], 0);
    let uris = Uris::of(std::path::Path::new("scene.gltf"));
    let mut images = Images::new(&source, &uris);
    let info = |key: &str| root.need(key).unwrap();
    let (notes, color) = (&mut Notes::default(), Content::Color);
    for key in ["a", "b"] {
        read(&info(key), color, &mut images, notes).unwrap();
    }
    images.decode().unwrap();
    let a = read(&info("a"), color, &mut images, notes)
        .unwrap()
        .unwrap();
    let b = read(&info("b"), Content::Data, &mut images, notes)
        .unwrap()
        .unwrap();
    assert!(Arc::ptr_eq(&a.image, &b.image) && a.content != b.content);
    // What nobody asked for is not opened, so its absence is no error.
    let unused = read(&info("unused"), color, &mut images, notes)
        .unwrap()
        .unwrap();
    assert_eq!((unused.image.width(), unused.image.height()), (1, 1));
}

#[test]
fn images_are_found_beside_the_file_under_escaped_names_and_in_buffers() {
    let bytes = file(
        &ImageBuffer::from_pixel(3, 2, Luma([9_u8])),
        ImageFormat::Png,
    );
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("tex")).unwrap();
    std::fs::write(dir.path().join("tex/a b%ü.png"), &bytes).unwrap();
    let path = dir.path().join("scene.gltf");
    for name in ["tex/a%20b%25%C3%BC.png", "./tex/a b%25ü.png"] {
        let t = load_beside(&document(json!({"uri": name})), &[], &path);
        assert_eq!(t.unwrap().unwrap().image.width(), 3, "{name}");
    }
    let mut json = document(json!({"bufferView": 0, "mimeType": "image/jpeg"}));
    let n = bytes.len();
    json["bufferViews"] = json!([{"buffer": 0, "byteOffset": 5, "byteLength": n}]);
    let mut buffer = vec![0; 5];
    buffer.extend(bytes);
    let t = load(&json, &[buffer.clone()]).unwrap().unwrap();
    assert_eq!(t.image.width(), 3);
    json["bufferViews"][0]["byteLength"] = json!(n + 1);
    let e = load(&json, &[buffer]).unwrap_err();
    assert!(e.place.contains("bufferViews"), "{}", e.place);
}

#[test]
fn broken_foreign_missing_and_huge_images_are_refused_with_their_place() {
    let mut png = file(
        &ImageBuffer::from_pixel(9, 9, Luma([9_u8])),
        ImageFormat::Png,
    );
    let whole = png.clone();
    png.truncate(40);
    // A header that claims 60000 × 60000 texels; its checksum is what PNG readers look at.
    let mut huge = whole;
    huge[16..24].copy_from_slice(&[0, 0, 0xEA, 0x60, 0, 0, 0xEA, 0x60]);
    let mut crc = flate2::Crc::new();
    crc.update(&huge[12..29]);
    huge[29..33].copy_from_slice(&crc.sum().to_be_bytes());
    let cases: [(Vec<u8>, &str); 4] = [
        (png, "cannot be decoded"),
        (huge, "60000 × 60000"),
        (b"nothing at all".to_vec(), "no image of a known format"),
        (Vec::new(), "no image of a known format"),
    ];
    for (bytes, expected) in cases {
        let e = load(&document(json!({"uri": uri(&bytes)})), &[]).unwrap_err();
        assert!(e.problem.contains(expected), "{}", e.problem);
        assert!(e.place.contains("images"), "{}", e.place);
    }
    // Known, but not in glTF: a note, and no texture.
    let bmp = document(json!({"uri": uri(b"BM123456789012345678")}));
    assert!(load(&bmp, &[]).unwrap().is_none());
    let e = load(&document(json!({"uri": "gone.png"})), &[]).unwrap_err();
    assert!(e.problem.contains("gone.png"), "{}", e.problem);
    let e = load(&document(json!({"name": "empty"})), &[]).unwrap_err();
    assert!(e.problem.contains("neither"), "{}", e.problem);
}

#[test]
fn samplers_and_transforms_are_read() {
    let bytes = uri(&file(
        &ImageBuffer::from_pixel(1, 1, Luma([9_u8])),
        ImageFormat::Png,
    ));
    let mut json = document(json!({"uri": bytes}));
    json["info"] = json!({"index": 0, "texCoord": 1});
    let t = load(&json, &[]).unwrap().unwrap();
    assert_eq!(
        (t.uv_set, t.sampler, t.transform),
        (1, Sampler::default(), None)
    );
    json["textures"][0] = json!({"source": 7, "sampler": 0,
        "extensions": {"EXT_texture_webp": {"source": 0}}});
    json["samplers"] = json!([
        {"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9987}]);
    json["info"]["extensions"] = json!({"KHR_texture_transform":
        {"offset": [0.0, 1.0], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5],
         "texCoord": 3}});
    let t = load(&json, &[]).unwrap().unwrap();
    assert_eq!(t.uv_set, 3);
    let expected = Sampler {
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Mirror,
        filter: Filter::Nearest,
    };
    assert_eq!(t.sampler, expected);
    // The extension's own example: the lower left quadrant, turned clockwise.
    let [u, v] = t.transform.unwrap().apply([1.0, 0.0]);
    assert!(u.abs() < 1e-12 && (v - 0.5).abs() < 1e-12);
    let [u, v] = t.transform.unwrap().apply([0.0, 1.0]);
    assert!((u - 0.5).abs() < 1e-12 && (v - 1.0).abs() < 1e-12);
    for (key, value) in [("wrapS", 1), ("magFilter", 9987), ("minFilter", 3)] {
        let mut json = json.clone();
        json["samplers"][0][key] = json!(value);
        assert!(load(&json, &[]).unwrap_err().place.contains(key));
    }
    json["textures"][0] = json!({"extensions": {"UNKNOWN_texture": {"source": 0}}});
    assert!(load(&json, &[]).unwrap().is_none());
}

/// A KTX2 file of one level.
#[cfg(feature = "ktx2")]
fn ktx2(format: u32, size: [u32; 2], scheme: u32, level: &[u8], unpacked: u64) -> Vec<u8> {
    let mut out = b"\xABKTX 20\xBB\r\n\x1A\n".to_vec();
    for x in [format, 1, size[0], size[1], 0, 0, 1, 1, scheme] {
        out.extend(x.to_le_bytes());
    }
    out.resize(80, 0);
    for x in [104, level.len() as u64, unpacked] {
        out.extend(x.to_le_bytes());
    }
    out.extend(level);
    out
}

#[cfg(feature = "ktx2")]
#[test]
fn plain_texels_in_ktx2_are_read() {
    let rgb: Vec<u8> = (0..18).collect();
    let image = decoded(&ktx2(29, [3, 2], 0, &rgb, 18));
    assert_eq!((image.width(), image.height(), image.channels()), (3, 2, 3));
    let t = image.texel(2, 1, Content::Data);
    assert!((t[0] * 255.0 - 15.0).abs() < 1e-5 && t[3] == 1.0);
    // Red and green of 16 bits: no blue, and no alpha either.
    let image = decoded(&ktx2(77, [1, 1], 0, &[1, 2, 3, 4], 4));
    let t = image.texel(0, 0, Content::Data);
    assert_eq!(t, [513.0 / 65535.0, 1027.0 / 65535.0, 0.0, 1.0]);
    // A frame of Zstandard that holds raw bytes.
    let mut packed = vec![0x28, 0xB5, 0x2F, 0xFD, 0x20, 18, (18 << 3) | 1, 0, 0];
    packed.extend(&rgb);
    let image = decoded(&ktx2(23, [3, 2], 2, &packed, 18));
    let t = image.texel(0, 1, Content::Data);
    assert!((t[1] * 255.0 - 10.0).abs() < 1e-5);
}

#[cfg(feature = "ktx2")]
#[test]
fn broken_ktx2_is_refused_and_foreign_kinds_are_left_out() {
    let load = |bytes: &[u8]| load(&document(json!({"uri": uri(bytes)})), &[]);
    let good = ktx2(29, [3, 2], 0, &[7; 18], 18);
    for n in (0..8).chain(12..good.len()) {
        assert!(load(&good[..n]).is_err(), "{n} bytes");
    }
    for (at, value) in [(20, 9), (80, 0x7F), (95, 0xFF), (88, 1), (40, 0xFF)] {
        let mut bad = good.clone();
        bad[at] = value;
        assert!(load(&bad).is_err(), "byte {at}");
    }
    // Claims memory that its data cannot fill.
    assert!(load(&ktx2(29, [1 << 14, 1 << 13], 0, &[7; 18], 18)).is_err());
    assert!(load(&ktx2(0, [4, 4], 2, &[7; 18], 1 << 48)).is_err());
    for (format, scheme) in [(145, 0), (29, 3), (29, 1)] {
        assert!(
            load(&ktx2(format, [3, 2], scheme, &[7; 18], 18))
                .unwrap()
                .is_none()
        );
    }
}

/// Files of 8 × 8 texels that the reference encoder of Basis Universal wrote: left (200, 60, 20),
/// right (20, 120, 220), with an alpha of 128 in the lower half where there is one.
#[cfg(feature = "ktx2")]
#[test]
fn basis_universal_is_transcoded() {
    let files: [(&[u8], bool); 3] = [
        (include_bytes!("../../../tests/data/etc1s.ktx2"), false),
        (include_bytes!("../../../tests/data/etc1s_alpha.ktx2"), true),
        (include_bytes!("../../../tests/data/uastc.ktx2"), true),
    ];
    for (bytes, alpha) in files {
        let image = decoded(bytes);
        assert_eq!((image.width(), image.height()), (8, 8));
        for (x, y) in [(0, 0), (7, 0), (3, 7), (4, 7)] {
            let color = if x < 4 { [200, 60, 20] } else { [20, 120, 220] };
            let [r, g, b] = color.map(|c| f64::from(c) / 255.0);
            let a = if alpha && y >= 4 { 128.0 / 255.0 } else { 1.0 };
            for (got, want) in image.texel(x, y, Content::Data).iter().zip([r, g, b, a]) {
                assert!((got - want).abs() < 0.04, "{x} {y}: {got} {want}");
            }
        }
        for n in 0..bytes.len() {
            let json = document(json!({"uri": uri(&bytes[..n])}));
            assert!(
                !matches!(load(&json, &[]), Ok(Some(_))),
                "{n} bytes of {}",
                bytes.len()
            );
        }
    }
}
