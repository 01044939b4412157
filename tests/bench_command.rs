//! `dualight bench`: the line for programs, and the comparison with a baseline.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use dualight::report::bench::{PREFIX, Record, SCHEMA};

fn bench(directory: &Path, options: &str) -> Output {
    let quick = "--rays 5k --repeats 2 --size 12";
    Command::new(env!("CARGO_BIN_EXE_dualight"))
        .arg("bench")
        .args(options.split_whitespace().chain(quick.split_whitespace()))
        .current_dir(directory)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn every_stage_is_measured_on_every_backend_and_thread_count() {
    let directory = tempfile::tempdir().unwrap();
    let options = "--synthetic soup:2k --synthetic forest:4k --threads 1,2";
    let out = bench(directory.path(), options);
    let said = text(&out.stdout);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let record = Record::parse(&said).unwrap();
    assert_eq!((record.schema.as_str(), record.seed), (SCHEMA, 0));
    let backends: &[&str] = if cfg!(feature = "embree") {
        &["embree", "bvh"]
    } else {
        &["bvh"]
    };
    assert_eq!(record.backends.len(), backends.len());
    for scene in ["soup:2k", "forest:4k"] {
        for threads in [1, 2] {
            let of = |backend: &str, metric: &str| {
                let found = record.results.iter().find(|m| {
                    m.scene == scene
                        && m.threads == threads
                        && m.backend == backend
                        && m.metric == metric
                });
                found.unwrap_or_else(|| panic!("{scene} {threads} {backend} {metric}"))
            };
            assert!(of("", "import").median > 0.0);
            for metric in ["density lookups", "irradiance lookups"] {
                assert!(of("", metric).median > 1e3, "{:?}", of("", metric));
            }
            for backend in backends {
                for metric in [
                    "build",
                    "first image",
                    "closest coherent",
                    "occluded coherent",
                    "closest bounced",
                    "occluded bounced",
                    "closest random",
                    "occluded random",
                    "photons",
                    "photon maps",
                    "gather rays",
                    "frame",
                    "hierarchy/primitive",
                ] {
                    let m = of(backend, metric);
                    assert!(m.low <= m.median && m.median <= m.high, "{m:?}");
                    assert!(m.median > 0.0, "{m:?}");
                }
                if cfg!(target_os = "linux") {
                    assert!(of(backend, "beyond both/primitive").median >= 0.0);
                }
            }
        }
    }
    for part in ["closest bounced", "scaling", "forest:4k x2"] {
        assert!(said.contains(part), "{part}");
    }
}

#[test]
fn scaling_measures_threads_on_the_smallest_terrain_and_sizes_on_the_most_threads() {
    let directory = tempfile::tempdir().unwrap();
    let out = bench(
        directory.path(),
        "--scaling=4k,500 --accel bvh --threads 1,2",
    );
    let said = text(&out.stdout);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let record = Record::parse(&said).unwrap();
    let mut columns: Vec<(String, usize)> = Vec::new();
    for m in &record.results {
        let column = (m.scene.clone(), m.threads);
        if !columns.contains(&column) {
            columns.push(column);
        }
    }
    let expected = [("terrain:500", 1), ("terrain:500", 2), ("terrain:4k", 2)];
    assert_eq!(columns, expected.map(|(s, t)| (s.to_string(), t)));
    // Two threads beside one, with the gain.
    let table = said.split("scaling").nth(1).unwrap();
    let row = table.lines().find(|l| l.contains("photons bvh")).unwrap();
    assert_eq!(row.matches(" x").count(), 1, "{row}");
    let few = bench(directory.path(), "--scaling=5");
    assert_eq!(few.status.code(), Some(2));
    assert!(text(&few.stderr).contains("at least 100"), "{few:?}");
}

#[test]
fn a_baseline_that_was_better_is_told_and_ends_with_status_1() {
    let directory = tempfile::tempdir().unwrap();
    let d = directory.path();
    let options = "--synthetic spheres:500 --accel bvh --threads 1 --quiet";
    let first = bench(d, options);
    let said = text(&first.stdout);
    assert!(
        said.starts_with(PREFIX) && said.lines().count() == 1,
        "{said}"
    );
    fs::write(d.join("same.txt"), &said).unwrap();
    let same = bench(
        d,
        &format!("{options} --baseline same.txt --tolerance 10000%"),
    );
    assert_eq!(same.status.code(), Some(0), "{}", text(&same.stderr));

    let mut better = Record::parse(&said).unwrap();
    for m in &mut better.results {
        let f = if m.more_is_better { 1e6 } else { 1e-6 };
        for v in [&mut m.median, &mut m.low, &mut m.high] {
            *v *= f;
        }
    }
    fs::write(d.join("better.txt"), better.line()).unwrap();
    let worse = bench(d, &format!("{options} --baseline better.txt"));
    assert_eq!(worse.status.code(), Some(1));
    assert!(
        text(&worse.stderr).contains("worse: spheres:500"),
        "{}",
        text(&worse.stderr)
    );

    // What it does not have is named, and the rest is judged.
    let mut less = Record::parse(&said).unwrap();
    less.results.retain(|m| m.metric != "photon maps");
    fs::write(d.join("less.txt"), less.line()).unwrap();
    let partly = bench(
        d,
        &format!("{options} --baseline less.txt --tolerance 10000%"),
    );
    assert_eq!(partly.status.code(), Some(0));
    let told = text(&partly.stderr);
    let part = "does not have, so nothing is said of: photon maps bvh of spheres:500 on 1 threads";
    assert!(told.contains(part), "{told}");

    // A baseline that says nothing is no baseline that was met.
    for options in [
        "--synthetic spheres:400 --accel bvh --threads 1 --quiet",
        "--synthetic spheres:500 --accel bvh --threads 2 --quiet",
    ] {
        let none = bench(d, &format!("{options} --baseline same.txt"));
        let said = text(&none.stderr);
        assert_eq!(none.status.code(), Some(2), "{said}");
        assert!(said.contains("nothing to compare"), "{said}");
    }

    fs::write(d.join("other.txt"), "{}").unwrap();
    for (options, status, part) in [
        ("--synthetic soup", 2, "KIND:N"),
        ("--synthetic soup:1k --baseline other.txt", 1, "other.txt"),
        ("--synthetic soup:1k --accel magic", 2, "known"),
        ("", 2, "SCENE"),
    ] {
        let out = bench(d, options);
        let said = text(&out.stderr);
        assert_eq!(out.status.code(), Some(status), "{options}: {said}");
        assert!(
            said.contains(part) && said.lines().count() == 1,
            "{options}: {said}"
        );
    }
}
