//! Data in URIs: however it is written, it says the same, and what is wrong with it is told with its
//! place.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use std::fmt::Write as _;
use std::fs;

use asset::Asset;
use base64::Engine;
use base64::engine::general_purpose::{STANDARD, STANDARD_NO_PAD, URL_SAFE, URL_SAFE_NO_PAD};
use dualight::geometry::Shape;
use dualight::import::{ImportOptions, inventory, load};
use dualight::scene::ScenePlugins;
use serde_json::json;

/// A file of so many triangles, and bytes that follow them.
fn strip(triangles: usize, more: usize) -> Asset {
    let mut a = Asset::new();
    let corner = |i: usize| [(i / 2) as f32 * 0.37, (i % 2) as f32, (i % 7) as f32 * 0.1];
    let corners: Vec<f32> = (0..triangles + 2).flat_map(corner).collect();
    let p = a.floats("VEC3", &corners);
    a.json["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": p}, "mode": 5}]);
    // What base64 writes with one, two and no padding, and every one of its characters.
    let rest = |i: usize| (i * i + i / 3) as u8;
    a.bytes.extend((0..more).map(rest));
    a
}

/// Its text where the string of its buffer is written like this.
fn text(a: &Asset, uri: &str) -> String {
    let mut v = a.json.clone();
    v["buffers"] = json!([{"byteLength": a.bytes.len(), "uri": "HERE"}]);
    v.to_string().replace("HERE", uri)
}

fn read(text: &str) -> Result<Vec<[f32; 3]>, String> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.gltf");
    fs::write(&path, text).unwrap();
    let options = ImportOptions::default();
    let scene = load(&path, &options, ScenePlugins::default()).map_err(|e| e.to_string())?;
    Ok(match &scene.geometry.shapes[0] {
        Shape::Mesh(m) => m.positions.clone(),
        Shape::Spheres(_) => Vec::new(),
    })
}

/// The characters as JSON may write them.
fn escaped(data: &str, which: impl Fn(usize, char) -> bool) -> String {
    let mut out = String::new();
    for (i, c) in data.chars().enumerate() {
        match c {
            _ if which(i, c) => write!(out, "\\u{:04x}", u32::from(c)).unwrap(),
            '/' => out.push_str("\\/"),
            c => out.push(c),
        }
    }
    out
}

#[test]
fn every_spelling_says_the_same() {
    // Some blocks of the reader's, and less than one; all three paddings.
    for (triangles, more) in [
        (1, 0),
        (1, 1),
        (1, 2),
        (30_000, 0),
        (30_000, 4096),
        (9000, 1),
    ] {
        let a = strip(triangles, more);
        let [plain, bare, other, both] =
            [STANDARD, STANDARD_NO_PAD, URL_SAFE, URL_SAFE_NO_PAD].map(|e| e.encode(&a.bytes));
        let percent: String = a.bytes.iter().fold(String::new(), |mut s, b| {
            write!(s, "%{b:02X}").unwrap();
            s
        });
        let expected = read(&text(&a, &format!("data:;base64,{plain}"))).unwrap();
        assert_eq!(expected.len(), triangles + 2);
        let spellings = [
            format!("data:application/octet-stream;base64,{bare}"),
            format!("data:application/gltf-buffer;charset=x;base64,{other}"),
            format!("data:;base64,{both}"),
            format!(
                "data:application\\/octet-stream;base64,{}",
                escaped(&plain, |_, _| false)
            ),
            format!("data:;base64,{}", escaped(&plain, |i, _| i % 5 == 0)),
            format!(
                "data:;base64,{}",
                escaped(&other, |i, c| i % 1000 < 3 || c == '_')
            ),
            format!("d\\u0061ta:;base64,{plain}"),
            format!("data:,{percent}"),
        ];
        for spelling in &spellings {
            let read = read(&text(&a, spelling));
            let begin: String = spelling.chars().take(60).collect();
            assert!(read.as_ref() == Ok(&expected), "{begin}: {:?}", read.err());
        }
    }
}

#[test]
fn what_is_wrong_with_data_is_told_with_its_place() {
    let a = strip(20_000, 0);
    let good = STANDARD.encode(&a.bytes);
    let with = |at: usize, what: &str| format!("{}{what}{}", &good[..at], &good[at + 1..]);
    for (data, what) in [
        // An error of the decoder's names the place in the data.
        (with(200_000, "*"), "Invalid symbol 42, offset 200000"),
        (with(100, "\\n"), "Invalid symbol 10, offset 100"),
        (with(65_535, "="), "offset 65535"),
        (with(70_000, "\u{e9}"), "Invalid symbol 195, offset 70000"),
        // The two alphabets in one string.
        ("-+AA".to_owned(), "Invalid symbol 43, offset 1"),
        ("QUJD=".to_owned(), "is not base64"),
    ] {
        let e = read(&text(&a, &format!("data:;base64,{data}"))).unwrap_err();
        assert!(e.contains("/buffers/0/uri") && e.contains(what), "{e}");
        assert!(e.contains("is not base64") && !e.contains('\n'), "{e}");
    }
    let e = read(&text(&a, "data:;base64")).unwrap_err();
    assert!(
        e.contains("/buffers/0/uri: is a data URI without data"),
        "{e}"
    );
    let short = STANDARD.encode(&a.bytes[..99]);
    let e = read(&text(&a, &format!("data:;base64,{short}"))).unwrap_err();
    assert!(e.contains("is truncated: 99 bytes"), "{e}");

    // The place of an error in the text counts the data before it.
    for bad in ["\t", "\\x", "\u{1}"] {
        let uri = format!("data:;base64,{good}\", \"extras\": \"{bad}");
        let (whole, e) = (text(&a, &uri), read(&text(&a, &uri)).unwrap_err());
        let by_parser = serde_json::from_str::<serde_json::Value>(&whole).unwrap_err();
        let place = format!("line 1 column {}", by_parser.column());
        assert!(by_parser.column() > good.len() && e.contains(&place), "{e}");
    }
    let cut = text(&a, &format!("data:;base64,{good}"));
    let e = read(&cut[..good.len()]).unwrap_err();
    assert!(e.contains("is not JSON (EOF while parsing a string"), "{e}");
}

#[test]
fn what_is_not_used_may_be_wrong_and_looks_like_nothing_else() {
    let mut a = strip(1, 0);
    let expected = read(&a.text()).unwrap();
    a.json["extras"] =
        json!({"uri": "data:;base64,*", "a": ["data:;base64,", "\"data:;base64,A\\"]});
    a.json["images"] =
        json!([{"uri": "data:image/png;base64,?"}, {"uri": "data:;base64,00000000"}]);
    assert_eq!(read(&a.text()), Ok(expected));

    // A string is what it says, even where it is what a reader of data might put in its place.
    let mut a = strip(1, 0);
    let six = STANDARD.decode("00000000").unwrap();
    let image = a.json["images"].take();
    assert!(image.is_null());
    a.json["images"] = json!([{"uri": "data:;base64,00000000"}, {"uri": "data:;base64,00000001"}]);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.gltf");
    fs::write(&path, a.text()).unwrap();
    let images = inventory(&path).unwrap().images;
    assert!(
        images.iter().all(|i| i.bytes == six.len() as u64),
        "{images:?}"
    );
}
