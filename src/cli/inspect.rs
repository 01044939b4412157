//! `dualight inspect`.

use std::fmt::Write;

use super::args::InspectArgs;
use super::plan::import_options;
use super::{Ending, console};
use crate::effects::{self, Decision};
use crate::error::Result;
use crate::import;
use crate::plugins::Registry;
use crate::scene::{Census, Scene};

/// Tells what a scene holds and which effects it calls for.
pub(super) fn run(args: &InspectArgs) -> Result<Ending> {
    let registry = Registry::builtin();
    let scene = import::load(
        &args.scene.file,
        &import_options(&args.scene),
        registry.scene.clone(),
    )?;
    let effects = effects::survey(&scene, "auto", &registry.effects)?;
    console::print(&describe(&scene, &effects.decisions))?;
    Ok(Ending::Done)
}

fn describe(scene: &Scene, effects: &[Decision]) -> String {
    let census = Census::new(scene);
    let size = scene.bounds.max - scene.bounds.min;
    let centre = scene.center;
    let mut rows: Vec<(&str, String)> = vec![
        (
            "size",
            format!("{:.4} x {:.4} x {:.4} m", size.x, size.y, size.z),
        ),
        (
            "centre",
            format!("{:.4}, {:.4}, {:.4}", centre.x, centre.y, centre.z),
        ),
        (
            "objects",
            format!(
                "{} of {} shapes, {} of them instances",
                census.objects, census.shapes, census.instances
            ),
        ),
        (
            "triangles",
            format!(
                "{} as seen, {} in memory",
                census.placed_triangles, census.triangles
            ),
        ),
        ("spheres", census.spheres.to_string()),
        (
            "materials",
            format!("{} used of {}", census.materials, scene.materials.len()),
        ),
    ];
    for ((name, kind), light) in scene.light_names.iter().zip(&scene.lights) {
        let p = light.power();
        rows.push((
            "light",
            format!("{kind:<12} {name}: {:.4}, {:.4}, {:.4} W", p.r, p.g, p.b),
        ));
    }
    for c in &scene.cameras {
        let aspect = c
            .aspect
            .map_or(String::new(), |a| format!(", aspect {a:.4}"));
        rows.push(("camera", format!("{:<12} {}{aspect}", c.kind, c.name)));
    }
    for d in effects {
        let state = if d.on { "on" } else { "skipped" };
        rows.push(("effect", format!("{:<11}{state:<9}{}", d.name, d.reason)));
    }
    rows.extend(scene.notes.iter().map(|n| ("note", n.clone())));
    rows.extend(scene.warnings.iter().map(|w| ("warning", w.clone())));
    let mut out = String::new();
    for (name, value) in rows {
        // Writing to a string does not fail.
        let _ = writeln!(out, "{name:>10}  {value}");
    }
    out
}
