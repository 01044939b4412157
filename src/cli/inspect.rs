//! `dualight inspect`.

use std::fmt::Write;

use serde::Serialize;

use super::args::InspectArgs;
use super::plan::import_options;
use super::{Ending, console};
use crate::effects;
use crate::error::{Error, Result};
use crate::import::{self, Extensions, Inventory};
use crate::plugins::Registry;
use crate::scene::{Census, Scene};

/// Tells what a scene holds and which effects it calls for.
pub(super) fn run(args: &InspectArgs) -> Result<Ending> {
    let registry = Registry::builtin();
    let file = &args.scene.file;
    let loaded = import::load(file, &import_options(&args.scene), registry.scene.clone());
    let scene = match loaded {
        Err(Error::Unsupported { .. }) => {
            // Which extensions stand in the way is what the user wants to know then.
            tell_extensions(&import::extensions(file)?, args.json)?;
            loaded?
        }
        other => other?,
    };
    let effects = effects::survey(&scene, "auto", &registry.effects)?;
    let mut report = Report::new(&scene, import::inventory(file)?);
    report.effects = effects
        .decisions
        .into_iter()
        .map(|d| Effect {
            name: d.name.to_string(),
            on: d.on,
            reason: d.reason,
        })
        .collect();
    console::print(&if args.json {
        report.json()
    } else {
        report.text()
    })?;
    Ok(Ending::Done)
}

/// What is told, as JSON names it.
#[derive(Debug, Serialize)]
struct Report {
    /// Extent of the scene along each axis, in metres.
    size: [f64; 3],
    /// Its middle, in the file's coordinates.
    centre: [f64; 3],
    objects: usize,
    shapes: usize,
    instances: usize,
    /// As seen, instances counted each.
    triangles: u64,
    triangles_in_memory: u64,
    spheres: u64,
    /// Materials that some object shows.
    materials_used: usize,
    lights: Vec<LightLine>,
    cameras: Vec<CameraLine>,
    effects: Vec<Effect>,
    file: Inventory,
    notes: Vec<String>,
    warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
struct LightLine {
    kind: &'static str,
    name: String,
    /// Flux per channel in watts; of light from infinity, what meets the scene.
    watts: [f64; 3],
}

#[derive(Debug, Serialize)]
struct CameraLine {
    kind: &'static str,
    name: String,
    /// Width over height, if the file says.
    aspect: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Effect {
    name: String,
    on: bool,
    reason: String,
}

impl Report {
    fn new(scene: &Scene, file: Inventory) -> Self {
        let census = Census::new(scene);
        let lights = scene.light_names.iter().zip(&scene.lights);
        let cameras = scene.cameras.iter();
        Self {
            size: (scene.bounds.max - scene.bounds.min).into(),
            centre: scene.center.into(),
            objects: census.objects,
            shapes: census.shapes,
            instances: census.instances,
            triangles: census.placed_triangles,
            triangles_in_memory: census.triangles,
            spheres: census.spheres,
            materials_used: census.materials,
            lights: lights
                .map(|((name, kind), light)| {
                    let p = light.power();
                    LightLine {
                        kind,
                        name: name.clone(),
                        watts: [p.r, p.g, p.b],
                    }
                })
                .collect(),
            cameras: cameras
                .map(|c| CameraLine {
                    kind: c.kind,
                    name: c.name.clone(),
                    aspect: c.aspect,
                })
                .collect(),
            effects: Vec::new(),
            file,
            notes: scene.notes.clone(),
            warnings: scene.warnings.clone(),
        }
    }

    fn json(&self) -> String {
        // Strings and finite numbers always become JSON; what is not finite becomes null.
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    fn text(&self) -> String {
        let mut out = String::new();
        let mut row = |name: &str, value: String| {
            // Writing to a string does not fail.
            let _ = writeln!(out, "{name:>10}  {value}");
        };
        let file = &self.file;
        let by = file.generator.as_deref().unwrap_or("unknown");
        row("file", format!("{} bytes, by {by}", file.bytes));
        if file.scenes.len() > 1 {
            for name in &file.scenes {
                let shown = file.default_scene.as_ref() == Some(name);
                let default = if shown { " (default)" } else { "" };
                row("scene", format!("{name}{default}"));
            }
        }
        let [x, y, z] = self.size;
        row("size", format!("{x:.4} x {y:.4} x {z:.4} m"));
        let [x, y, z] = self.centre;
        row("centre", format!("{x:.4}, {y:.4}, {z:.4}"));
        row(
            "objects",
            format!(
                "{} of {} shapes, {} of them instances",
                self.objects, self.shapes, self.instances
            ),
        );
        row(
            "triangles",
            format!(
                "{} as seen, {} in memory",
                self.triangles, self.triangles_in_memory
            ),
        );
        row("spheres", self.spheres.to_string());
        row(
            "materials",
            format!("{} used of {}", self.materials_used, file.materials.len()),
        );
        for m in &file.materials {
            let mut parts = Vec::new();
            if m.alpha != "OPAQUE" {
                parts.push(format!("alpha {}", m.alpha.to_lowercase()));
            }
            if m.double_sided {
                parts.push("both sides".into());
            }
            if !m.textures.is_empty() {
                parts.push(format!("textures {}", m.textures.join(" ")));
            }
            parts.extend(m.extensions.iter().cloned());
            row("material", line(&m.name, &parts));
        }
        for i in &file.images {
            let size = i.size.map(|[w, h]| format!("{w} x {h}"));
            let mut parts = vec![i.format.to_string()];
            parts.extend(size);
            parts.push(format!("{} bytes", i.bytes));
            parts.extend(i.problem.clone());
            row("image", line(&i.name, &parts));
        }
        for l in &self.lights {
            let [r, g, b] = l.watts;
            let watts = format!("{r:.4}, {g:.4}, {b:.4} W");
            row("light", format!("{:<12} {}: {watts}", l.kind, l.name));
        }
        for c in &self.cameras {
            let aspect = c
                .aspect
                .map_or(String::new(), |a| format!(", aspect {a:.4}"));
            row("camera", format!("{:<12} {}{aspect}", c.kind, c.name));
        }
        for a in &file.animations {
            let span = format!("{:.4} to {:.4} s", a.start, a.end);
            let channels = format!("{} channels", a.channels);
            row("animation", line(&a.name, &[span, channels]));
        }
        for v in &file.variants {
            row("variant", v.clone());
        }
        extensions(&file.extensions, &mut row);
        for e in &self.effects {
            let state = if e.on { "on" } else { "skipped" };
            row("effect", format!("{:<13}{state:<9}{}", e.name, e.reason));
        }
        for n in &self.notes {
            row("note", n.clone());
        }
        for w in &self.warnings {
            row("warning", w.clone());
        }
        out
    }
}

/// One row for each extension.
fn extensions(all: &Extensions, row: &mut impl FnMut(&str, String)) {
    for e in &all.used {
        let mut state = Vec::new();
        let required = all.required.contains(e);
        if required {
            state.push("required".to_string());
        }
        if all.ignored.contains(e) {
            state.push(if required { "not supported" } else { "ignored" }.to_string());
        }
        row("extension", line(e, &state));
    }
}

/// Tells the extensions of a file that is refused.
fn tell_extensions(all: &Extensions, json: bool) -> Result<()> {
    let mut out = String::new();
    if json {
        let file = serde_json::json!({"file": {"extensions": all}});
        let _ = writeln!(out, "{file:#}");
    } else {
        // Writing to a string does not fail.
        extensions(all, &mut |name, value| {
            let _ = writeln!(out, "{name:>10}  {value}");
        });
    }
    console::print(&out)
}

/// A name and what is said of it.
fn line(name: &str, parts: &[String]) -> String {
    if parts.is_empty() {
        return name.to_owned();
    }
    format!("{name}: {}", parts.join(", "))
}
