//! `dualight compare`: what is reported can be asked again, and errors are one line.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]
#![cfg(feature = "embree")]

use std::path::Path;
use std::process::Command;

use dualight::report::rays::RayKind;

fn run(directory: &Path, line: &str) -> (Option<i32>, String, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_dualight"))
        .args(line.split_whitespace())
        .current_dir(directory)
        .output()
        .unwrap();
    let text = |v| String::from_utf8(v).unwrap();
    (out.status.code(), text(out.stdout), text(out.stderr))
}

#[test]
fn reports_are_one_line_or_json_and_their_worst_rays_can_be_asked_again() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    let scene = Path::new("scenes/box_mesh.glb").canonicalize().unwrap();
    std::fs::copy(scene, d.join("s.glb")).unwrap();
    let (status, out, err) = run(
        d,
        "compare s.glb -q --rays 60k --worst 7 --spp 1 --size 16x16",
    );
    assert_eq!((status, err.as_str()), (Some(0), ""));
    let last = out.lines().last().unwrap();
    for part in [
        "s.glb",
        "embree against bvh",
        "60.0k rays",
        "0 unexplained",
        "relMSE",
    ] {
        assert!(last.contains(part), "{part}: {out}");
    }
    let line = "compare s.glb -q --rays 60k --worst 7 --spp 0 --json=r.json";
    let (status, out, _) = run(d, line);
    assert_eq!((status, out.as_str()), (Some(0), ""));
    let read = |name| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(d.join(name)).unwrap()).unwrap()
    };
    let first = read("r.json");
    assert_eq!(first["worst"].as_array().unwrap().len(), 7);
    assert!(first["images"].is_null() && first["total"]["unexplained"] == 0);
    assert_eq!(
        first["kinds"].as_object().unwrap().len(),
        RayKind::ALL.len()
    );
    // The same rays bring the same answers, to the bit.
    let (status, _, _) = run(d, "compare s.glb -q --replay r.json --json=again.json");
    assert_eq!(status, Some(0));
    assert_eq!(first["worst"], read("again.json")["worst"]);
    let (_, out, _) = run(d, "compare s.glb -q --replay r.json");
    assert_eq!(
        out.lines().filter(|l| l.contains("of the bound")).count(),
        7
    );

    for (line, status, part) in [
        (
            "compare s.glb --accel bvh --reference bvh",
            2,
            "two different",
        ),
        ("compare s.glb --accel magic", 2, "known:"),
        ("compare s.glb --rays 0", 2, "at least 1"),
        ("compare s.glb --replay missing.json", 1, "missing.json"),
        ("compare s.glb --replay s.glb", 1, "--json=FILE"),
        ("compare s.glb --json=missing/r.json", 1, "create it"),
        ("compare s.glb --replay r.json --rays 5", 2, "--replay"),
    ] {
        let (code, out, err) = run(d, line);
        assert_eq!(code, Some(status), "{line}: {err}");
        assert!(
            out.is_empty() && err.lines().count() == 1 && err.contains(part),
            "{line}: {err}"
        );
    }
}
