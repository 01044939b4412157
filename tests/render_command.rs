//! `dualight render` from a scene's file to images, statistics and exit statuses.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use dualight::output;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/box.gltf");

/// Little work, so that unoptimised backends finish soon.
const CHEAP: &str = "--photons 2k --caustic-photons 2k --spp 2";

fn command(directory: &Path, options: &str) -> Command {
    let mut c = Command::new(env!("CARGO_BIN_EXE_dualight"));
    c.args(["render", SCENE])
        .args(options.split_whitespace())
        .current_dir(directory);
    c
}

fn render(directory: &Path, options: &str) -> Output {
    command(directory, options).output().unwrap()
}

fn names(directory: &Path) -> Vec<String> {
    let mut all: Vec<String> = fs::read_dir(directory)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    all.sort();
    all
}

#[test]
fn the_integrator_is_told_with_its_reason_and_idle_options_are_named() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    let said = |options: &str| {
        let out = render(d, &format!("-o a.exr --size 8x8 --spp 1 {options}"));
        let said = String::from_utf8(out.stderr).unwrap();
        assert!(out.status.success(), "{said}");
        said
    };
    let auto = said("");
    assert!(auto.contains("integrator photon (2 sharp"), "{auto}");
    let none = said("--effects -caustics");
    assert!(none.contains("integrator path ("), "{none}");
    // Whoever speaks of photons wants them.
    let asked = said("--effects -caustics --photons 1k");
    assert!(asked.contains("integrator photon ("), "{asked}");
    let idle = said("--integrator path --photons 1k --emission adaptive");
    for option in ["--photons", "--emission"] {
        let line = format!("warning: {option} has no meaning for the integrator path");
        assert!(idle.contains(&line), "{idle}");
    }
}

#[test]
fn images_and_statistics_are_written() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    let out = render(
        d,
        &format!("-o a.exr -o a.png --size 24x16 --json=s.json {CHEAP}"),
    );
    let said = String::from_utf8(out.stderr).unwrap();
    assert!(out.status.success(), "{said}");
    assert!(out.stdout.is_empty());
    // What was simulated and what was skipped is named, with the reason.
    for part in ["caustics", "pixels", "rays", "memory", "wrote  a.png"] {
        assert!(said.contains(part), "{part} is not in {said}");
    }
    assert_eq!(names(d), ["a.exr", "a.png", "s.json"]);
    let image = output::read(&d.join("a.exr")).unwrap();
    assert_eq!((image.width, image.height), (24, 16));
    let mean = image.rgb("").unwrap().iter().flatten().sum::<f32>() / (24.0 * 16.0 * 3.0);
    assert!(mean > 0.01 && mean.is_finite(), "{mean}");

    let json: serde_json::Value =
        serde_json::from_slice(&fs::read(d.join("s.json")).unwrap()).unwrap();
    assert_eq!(json["settings"]["spp"], 2);
    assert_eq!(json["settings"]["integrator"], "photon");
    assert_eq!(json["stopped"], serde_json::Value::Null);
    assert!(json["statistics"]["rays"]["camera"].as_u64().unwrap() >= 24 * 16 * 2);
    let effects = json["effects"].as_array().unwrap();
    let of = |name: &str| effects.iter().find(|e| e["name"] == name).unwrap();
    assert!(of("direct")["counts"]["rays"].as_u64().unwrap() > 0);
    assert_eq!(of("alpha")["counts"]["filter calls"], 0);
    // Not timed apart.
    assert_eq!(of("lens")["time_share"], serde_json::Value::Null);
    let shares = effects.iter().filter_map(|e| e["time_share"].as_f64());
    let shares: Vec<f64> = shares.collect();
    assert!(shares.len() > 10 && shares.iter().all(|s| (0.0..=1.0).contains(s)));
    assert!(shares.iter().sum::<f64>() <= 1.0 + 1e-9);
}

#[test]
fn quiet_is_silent_and_json_alone_goes_to_standard_output() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    let out = render(d, &format!("--json --quiet --size 8x8 {CHEAP}"));
    assert!(out.status.success() && out.stderr.is_empty());
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(json["settings"]["width"], 8);
    assert!(names(d).is_empty());
}

#[test]
fn a_crop_is_a_part_of_the_whole_and_the_rest_is_black() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    // Adaptive sampling shares out what there is among the pixels of the crop alone.
    let size = format!("--size 16x16 --pixel-sampling uniform -q {CHEAP}");
    assert!(render(d, &format!("-o all.exr {size}")).status.success());
    assert!(
        render(d, &format!("-o part.exr --crop 2,3,10,9 {size}"))
            .status
            .success()
    );
    let pixels = |n: &str| output::read(&d.join(n)).unwrap().rgb("").unwrap();
    let (all, part) = (pixels("all.exr"), pixels("part.exr"));
    for (i, (a, p)) in all.iter().zip(&part).enumerate() {
        let inside = (2..10).contains(&(i % 16)) && (3..9).contains(&(i / 16));
        assert_eq!(*p, if inside { *a } else { [0.0; 3] }, "pixel {i}");
    }
}

#[test]
fn the_time_limit_leaves_a_valid_image() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    let endless = "-o a.exr --size 16x16 --photons 1k --caustic-photons 1k --spp 1G";
    let out = render(d, &format!("{endless} --time-limit 2s"));
    let said = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(4), "{said}");
    assert!(said.contains("stopped at the time limit"), "{said}");
    assert!(output::read(&d.join("a.exr")).is_ok());

    // Before the first sample there is no image to write.
    fs::remove_file(d.join("a.exr")).unwrap();
    let out = render(d, &format!("{endless} --time-limit 0.000001s"));
    let said = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(1), "{said}");
    assert!(said.contains("--time-limit"), "{said}");
    assert!(names(d).is_empty());
}

#[test]
fn a_scene_that_is_none_is_refused_in_one_line() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    fs::write(d.join("s.glb"), "not a scene").unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_dualight"))
        .args(["render", "s.glb", "-o", "a.exr"])
        .current_dir(d)
        .output()
        .unwrap();
    let said = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(1), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.contains("s.glb"));
    assert_eq!(names(d), ["s.glb"]);
    let unknown = render(d, "-o a.exr --camera nobody");
    assert_eq!(unknown.status.code(), Some(2));
    assert!(
        String::from_utf8(unknown.stderr)
            .unwrap()
            .contains("known: ")
    );
    assert_eq!(names(d), ["s.glb"]);
}

#[test]
fn inspect_tells_what_is_there() {
    let out = Command::new(env!("CARGO_BIN_EXE_dualight"))
        .args(["inspect", SCENE])
        .output()
        .unwrap();
    assert!(out.status.success());
    let said = String::from_utf8(out.stdout).unwrap();
    for part in ["triangles", "light", "camera", "effect"] {
        assert!(said.contains(part), "{said}");
    }
}

#[cfg(unix)]
fn interrupt(child: &Child) {
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_a_valid_image() {
    use std::io::{BufRead, BufReader};
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    // The first progress line comes when rendering is well under way; notes come before.
    let mut child = command(
        d,
        "-o a.exr --size 16x16 --photons 1k --caustic-photons 1k --spp 1G",
    )
    .stderr(Stdio::piped())
    .spawn()
    .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let first = lines
        .by_ref()
        .map(Result::unwrap)
        .find(|l| !l.contains("note: "))
        .unwrap();
    interrupt(&child);
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{first} {rest:?}");
    assert!(first.starts_with("dualight: "), "{first}");
    assert!(rest.iter().any(|l| l.contains("interrupted")), "{rest:?}");
    assert!(output::read(&d.join("a.exr")).is_ok());
    assert_eq!(names(d), ["a.exr"]);
}
