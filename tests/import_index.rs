//! Real files of many exporters, where they are at hand, against the index that says what each of
//! them is.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use dualight::control::Control;
use dualight::import::{ImportOptions, load};
use dualight::pipeline::{self, RenderSettings};
use dualight::plugins::Registry;
use dualight::scene::{Census, Scene, ScenePlugins};

/// Legal files that hold nothing to render, and are refused for that: no node has a mesh that
/// makes a surface.
const EMPTY: &str = "holds no";

/// Whether a file is refused for an extension that this build leaves out.
fn left_out(error: &str) -> bool {
    let built = [
        ("EXT_meshopt_compression", cfg!(feature = "meshopt")),
        ("KHR_meshopt_compression", cfg!(feature = "meshopt")),
        ("KHR_draco_mesh_compression", cfg!(feature = "draco")),
        ("KHR_texture_basisu", cfg!(feature = "ktx2")),
    ];
    let named = |extension| error.contains(extension);
    built.iter().any(|(name, built)| !built && named(*name))
}

/// Renders a tiny picture by each way of making one, and tells what is wrong with it.
fn picture(scene: &Scene, registry: &Registry) -> Result<(), String> {
    for integrator in ["path", "photon"] {
        let mut settings = RenderSettings {
            width: 16,
            height: 12,
            spp: 1,
            integrator: Some(integrator.into()),
            threads: Some(1),
            ..Default::default()
        };
        settings.integrator_settings.photons = 200;
        settings.integrator_settings.caustic_photons = 200;
        let rendering = pipeline::render(scene, &settings, registry, &Control::default())
            .map_err(|e| format!("{integrator}: {e}"))?;
        if rendering.film.rejected() > 0 {
            return Err(format!("{integrator}: samples are not finite"));
        }
        let image = rendering.film.develop();
        let seen = image.channel("", "A").unwrap_or_default();
        if scene.cameras.is_empty() && seen.iter().all(|a| *a == 0.0) {
            return Err(format!(
                "{integrator}: the camera that was made sees nothing"
            ));
        }
    }
    Ok(())
}

#[test]
fn every_file_is_rendered_or_refused_as_the_index_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets/real");
    let Ok(index) = fs::read_to_string(folder.join("index.tsv")) else {
        eprintln!("skipped: {} is not there", folder.display());
        return;
    };
    let registry = Registry::builtin();
    let (mut wrong, mut count) = (Vec::new(), BTreeMap::new());
    for line in index.lines().skip(1) {
        let column: Vec<&str> = line.split('\t').collect();
        let (path, kind) = (column[0], column[2]);
        let result = load(
            &folder.join(path),
            &ImportOptions::default(),
            ScenePlugins::default(),
        );
        let should_load = matches!(kind, "valid" | "nonconforming" | "odd");
        *count.entry(kind).or_insert(0) += 1;
        match result {
            Ok(scene) if should_load => {
                // Instances are counted in other ways by the index, and triangles without area
                // are dropped.
                let expected: u64 = column[7].parse().unwrap_or(0);
                let seen = Census::new(&scene).placed_triangles;
                if seen < expected / 2 && scene.warnings.is_empty() {
                    wrong.push(format!("{path}: {seen} triangles of {expected}"));
                }
                if let Err(e) = picture(&scene, &registry) {
                    wrong.push(format!("{path}: {e}"));
                }
            }
            Ok(_) => wrong.push(format!("{kind} was read: {path}")),
            Err(e) if should_load => {
                if left_out(&e.to_string()) {
                    println!("left out {path}");
                } else if !e.to_string().contains(EMPTY) {
                    wrong.push(format!("{kind}: {e}"));
                } else {
                    println!("empty {path}");
                }
            }
            Err(e) => {
                let text = e.to_string();
                println!("{text}");
                let placed = [": /", "line ", "GLB container"]
                    .iter()
                    .any(|p| text.contains(p));
                if text.lines().count() != 1 || !placed {
                    wrong.push(format!("without a place: {text}"));
                }
                assert_eq!(
                    e.exit_code(),
                    if kind == "unsupported" { 3 } else { 1 },
                    "{text}"
                );
            }
        }
    }
    println!("{count:?}");
    assert!(wrong.is_empty(), "{wrong:#?}");
}
