//! What a file may leave open, and is rendered all the same: its scenes, its default scene, its
//! camera.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod asset;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use asset::Asset;
use dualight::control::Control;
use dualight::pipeline::{self, RenderSettings};
use dualight::plugins::Registry;
use serde_json::json;

/// A triangle below a node that moves it to x = 5, and two more that stand alone; no scenes.
fn forest() -> Asset {
    let mut a = Asset::triangle();
    a.json["nodes"] = json!([
        {"mesh": 0},
        {"children": [0], "translation": [5, 0, 0]},
        {"mesh": 0},
        {"mesh": 0, "translation": [0, -3, 0]},
    ]);
    let file = a.json.as_object_mut().unwrap();
    file.remove("scenes");
    file.remove("scene");
    a
}

#[test]
fn without_scenes_every_root_node_is_shown_once() {
    let scene = forest().read().unwrap();
    assert_eq!(scene.geometry.objects.len(), 3);
    let size = scene.bounds.max - scene.bounds.min;
    assert!((size.x - 6.0).abs() < 1e-6 && (size.y - 4.0).abs() < 1e-6);
    assert!(
        scene.notes.iter().any(|n| n.contains("no scenes")),
        "{:?}",
        scene.notes
    );
    // Nodes in a circle have no root, and nothing is to be seen.
    let mut circle = forest();
    circle.json["nodes"] = json!([{"mesh": 0, "children": [1]}, {"children": [0]}]);
    assert!(circle.error().contains("holds no geometry"));
    let mut nothing = forest();
    nothing.json.as_object_mut().unwrap().remove("nodes");
    assert!(nothing.error().contains("/scenes: the file holds no scene"));
}

#[test]
fn without_a_default_scene_the_first_is_shown() {
    let mut a = forest();
    a.json["scenes"] = json!([{"nodes": [3], "name": "low"}, {"nodes": [1, 2]}]);
    let scene = a.read().unwrap();
    assert_eq!(scene.geometry.objects.len(), 1);
    assert!(
        scene.notes.iter().any(|n| n.contains("no default scene")),
        "{:?}",
        scene.notes
    );
    a.json["scene"] = json!(1);
    let scene = a.read().unwrap();
    assert_eq!(scene.geometry.objects.len(), 2);
    assert!(scene.notes.is_empty(), "{:?}", scene.notes);
}

#[test]
fn a_camera_is_made_where_there_is_none() {
    let scene = Asset::triangle().read().unwrap();
    let settings = RenderSettings {
        width: 32,
        height: 32,
        spp: 4,
        integrator: Some("path".into()),
        ..Default::default()
    };
    let registry = Registry::builtin();
    let rendering = pipeline::render(&scene, &settings, &registry, &Control::default()).unwrap();
    let image = rendering.film.develop();
    let seen = image.channel("", "A").expect("alpha");
    let covered: f32 = seen.iter().sum::<f32>() / (32.0 * 32.0);
    // The eye is 1/sin 0.35 radii from the middle of the box around the triangle, along (0.5 0.35 1),
    // and sees a square of 2/cos 0.35 radii there. What lies in the plane z = 0 at the depth d
    // appears in it as its area times (D/d)³ and the cosine of that direction to z.
    let (angle, radius2) = (0.35f64, 0.5f64);
    let (away, length) = (radius2.sqrt() / angle.sin(), 1.3725f64.sqrt());
    // The triangle's centroid is at (-1/6 -1/6 0) from the middle.
    let depth = away + (0.5 + 0.35) / 6.0 / length;
    let want = 0.5 / length * (away / depth).powi(3) / (4.0 * radius2 / angle.cos().powi(2));
    assert!(
        (f64::from(covered) / want - 1.0).abs() < 0.03,
        "{covered} for {want}"
    );
    // The borders are empty: all is in the picture.
    for k in 0..32 {
        for at in [k, 31 * 32 + k, 32 * k, 32 * k + 31] {
            assert_eq!(seen[at], 0.0);
        }
    }
}

fn render(d: &Path, words: &[&str]) -> (Output, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_dualight"))
        .args([
            "render", "s.glb", "-o", "a.exr", "--size", "8x6", "--spp", "1",
        ])
        .args(words)
        .current_dir(d)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    (out, said)
}

#[test]
fn the_program_says_that_it_made_a_camera_and_how_to_name_another() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    fs::write(d.join("s.glb"), Asset::triangle().glb()).unwrap();
    let (out, said) = render(d, &[]);
    assert_eq!(out.status.code(), Some(0), "{said}");
    assert!(
        said.contains("no camera:") && said.contains("--camera NAME"),
        "{said}"
    );
    assert!(d.join("a.exr").is_file());
    // Whoever asks for it needs no note; a name that no camera has stays an error.
    let (out, said) = render(d, &["--camera", "auto"]);
    assert!(
        out.status.success() && !said.contains("no camera:"),
        "{said}"
    );
    let (out, said) = render(d, &["--camera", "main"]);
    assert_eq!(out.status.code(), Some(2), "{said}");
    assert!(
        said.contains("main") && said.contains("known: auto"),
        "{said}"
    );
}
