//! The program as it is run: exit statuses, one-line messages, and that mistakes leave no file.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use dualight::film::{Channel, Image, Layer};
use dualight::output::{self, Metadata, OUTPUTS, OutputSettings};
use dualight::registry::Table;

fn dualight<S: AsRef<OsStr>>(directory: &Path, words: &[S]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dualight"))
        .args(words)
        .current_dir(directory)
        .output()
        .unwrap()
}

fn names(directory: &Path) -> Vec<String> {
    let mut all: Vec<String> = fs::read_dir(directory)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    all.sort();
    all
}

/// Runs a command that must fail: with this status, one line that contains all `parts`, nothing
/// on standard output and no new file.
fn refuses(directory: &Path, line: &str, status: i32, parts: &[&str]) {
    let before = names(directory);
    let out = dualight(directory, &line.split_whitespace().collect::<Vec<_>>());
    let said = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(status), "{line}: {said}");
    assert_eq!(said.lines().count(), 1, "{line}: {said}");
    assert!(said.starts_with("dualight: error: "), "{line}: {said}");
    for part in parts {
        assert!(said.contains(part), "{line}: '{part}' is not in: {said}");
    }
    assert!(out.stdout.is_empty(), "{line}");
    assert_eq!(names(directory), before, "{line}");
}

fn write_exr(path: &Path, (width, height): (u32, u32), value: f32) {
    let image = Image {
        width,
        height,
        layers: vec![Layer {
            name: String::new(),
            channels: ["R", "G", "B"]
                .map(|name| Channel {
                    name: name.into(),
                    half: false,
                    data: vec![value; (width * height) as usize],
                })
                .to_vec(),
        }],
    };
    let (settings, metadata) = (OutputSettings::default(), Metadata::default());
    output::write(&Table::new(OUTPUTS), &image, &settings, &metadata, path).unwrap();
}

#[test]
fn mistakes_are_one_line_with_a_remedy_and_leave_no_file() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    fs::write(d.join("s.glb"), "not a scene").unwrap();
    fs::create_dir(d.join("folder.exr")).unwrap();
    for (options, status, parts) in [
        ("-o a.exr --spp 0", 2, &["--spp", "at least 1"][..]),
        ("-o a.exr --spp many", 2, &["--spp", "10k"]),
        (
            "-o a.exr --size 0x0",
            2,
            &["--size", "at least 1", "640x480"],
        ),
        ("-o a.exr --size 640", 2, &["--size", "640x480"]),
        ("-o a.exr --size 99999x99999", 2, &["--size", "smaller"]),
        (
            "-o a.exr --photons 0",
            2,
            &["--photons", "--integrator path"],
        ),
        ("-o a.exr --crop 5,5,1,1", 2, &["--crop", "0,0,64,64"]),
        (
            "-o a.exr --size 4x4 --crop 0,0,5,4",
            2,
            &["--crop", "0,0,4,4"],
        ),
        (
            "-o a.exr --integrator magic",
            2,
            &["'magic'", "known: photon"],
        ),
        (
            "-o a.exr --accel magic",
            2,
            &["'magic'", "known:", "linear"],
        ),
        ("-o a.exr --emission magic", 2, &["'magic'", "known:"]),
        ("-o a.exr --effects +magic", 2, &["'magic'", "caustics"]),
        ("-o a.exr --time-limit soon", 2, &["--time-limit", "30s"]),
        ("-o a.jpg", 2, &["a.jpg", ".exr, .png"]),
        ("-o a", 2, &[".exr, .png"]),
        ("-o missing/a.exr", 1, &["missing/a.exr", "create it"]),
        ("-o s.glb/a.exr", 1, &["s.glb/a.exr", "is not a directory"]),
        ("-o folder.exr", 1, &["folder.exr", "name a file inside it"]),
        (
            "-o a.exr --json=missing/s.json",
            1,
            &["missing/s.json", "create it"],
        ),
        ("--json=s.glb", 2, &["over the scene", "another name"]),
        ("", 2, &["--output"]),
        ("-o a.exr --frobnicate", 2, &["--frobnicate", "--help"]),
    ] {
        refuses(d, &format!("render s.glb {options}"), status, parts);
    }
    refuses(d, "render missing.glb -o a.exr", 1, &["missing.glb"]);
    refuses(d, "inspect missing.glb", 1, &["missing.glb"]);
    refuses(d, "frobnicate", 2, &["frobnicate", "--help"]);
    assert_eq!(fs::read_to_string(d.join("s.glb")).unwrap(), "not a scene");
}

#[test]
fn diff_refuses_what_cannot_be_compared() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    write_exr(&d.join("a.exr"), (4, 4), 1.0);
    write_exr(&d.join("b.exr"), (4, 5), 1.0);
    fs::write(d.join("c.exr"), "not an image").unwrap();
    refuses(d, "diff a.exr b.exr -o e.png", 2, &["4x4", "4x5", "--size"]);
    refuses(d, "diff a.exr c.exr -o e.png", 1, &["c.exr", "OpenEXR"]);
    refuses(
        d,
        "diff a.exr missing.exr",
        1,
        &["missing.exr", "check the name"],
    );
    refuses(
        d,
        "diff a.exr a.exr --layer caustics",
        2,
        &["caustics", "--layer"],
    );
    refuses(d, "diff a.exr a.exr -o e.jpg", 2, &[".exr, .png"]);
    refuses(d, "diff a.exr", 2, &["B.exr"]);
}

#[test]
fn diff_prints_numbers_and_paints_the_error() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    write_exr(&d.join("a.exr"), (8, 8), 1.5);
    write_exr(&d.join("b.exr"), (8, 8), 1.0);
    let out = dualight(d, &["diff", "a.exr", "b.exr", "--json", "-o", "e.png"]);
    assert!(out.status.success() && out.stderr.is_empty());
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let c = &json["comparison"];
    assert_eq!(c["mean_ratio"], 1.5);
    assert_eq!(c["rmse"], 0.5);
    assert_eq!(c["max_error"], 0.5);
    assert!((c["rel_mse"].as_f64().unwrap() - 0.25 / 1.01).abs() < 1e-12);
    assert_eq!(c["flip"].is_number(), cfg!(feature = "flip"));
    assert!(d.join("e.png").exists());

    let out = dualight(d, &["diff", "a.exr", "b.exr", "-o", "e.exr"]);
    let said = String::from_utf8(out.stdout).unwrap();
    assert!(said.contains("1.500000") && said.contains("RMSE"), "{said}");
    let errors = output::read(&d.join("e.exr")).unwrap().rgb("").unwrap();
    assert!((errors[0][0] - 0.25 / 1.01).abs() < 1e-6);

    let out = dualight(
        d,
        &[
            "diff",
            "a.exr",
            "b.exr",
            "-o",
            "f.png",
            "--error-map",
            "flip",
        ],
    );
    assert_eq!(out.status.success(), cfg!(feature = "flip"));
    assert_eq!(d.join("f.png").exists(), cfg!(feature = "flip"));
}

#[test]
fn every_plugin_is_listed() {
    let directory = tempfile::tempdir().unwrap();
    let out = dualight(directory.path(), &["plugins"]);
    assert!(out.status.success());
    let said = String::from_utf8(out.stdout).unwrap();
    for (kind, plugins) in dualight::plugins::Registry::builtin().families() {
        assert!(said.lines().any(|l| l == kind), "{kind}");
        for (name, doc) in plugins {
            assert!(said.contains(name) && said.contains(doc), "{kind} {name}");
        }
    }
}

#[test]
fn help_and_version_succeed_and_nothing_at_all_is_a_mistake() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    for words in [
        &["--help"][..],
        &["--version"],
        &["render", "--help"],
        &["help", "diff"],
    ] {
        let out = dualight(d, words);
        assert!(out.status.success() && !out.stdout.is_empty(), "{words:?}");
    }
    let out = dualight::<&str>(d, &[]);
    assert_eq!(out.status.code(), Some(2));
    assert!(out.stdout.is_empty() && !out.stderr.is_empty());
}
