//! What a finished rendering tells of itself: a table for people, JSON for programs.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::format::{bytes, count};
use crate::control::Stopped;
use crate::effects::Decision;
use crate::output::Metadata;
use crate::pipeline::{PixelSampling, RenderSettings, Rendering};
use crate::stats::PhotonCounts;

/// Everything there is to tell.
pub(super) struct Summary<'a> {
    pub(super) scene: &'a Path,
    pub(super) settings: &'a RenderSettings,
    pub(super) integrator_reason: &'a str,
    pub(super) outputs: &'a [PathBuf],
    pub(super) metadata: &'a Metadata,
    pub(super) rendering: &'a Rendering,
    pub(super) seconds: f64,
}

/// A table of stages, counts and effects.
pub(super) fn table(s: &Summary) -> String {
    let statistics = &s.rendering.statistics;
    let r = s.settings;
    let mut rows: Vec<(&str, String)> = vec![(
        "rendered",
        format!(
            "{}x{} pixels, {}, integrator {} ({})",
            r.width,
            r.height,
            match r.pixel_sampling {
                PixelSampling::Uniform => format!("{} samples each", s.metadata.spp),
                PixelSampling::Adaptive => format!(
                    "{} samples in the mean, indirect light {}",
                    r.spp,
                    match s.rendering.not_interpolated {
                        None => "interpolated".into(),
                        Some(why) => format!("not interpolated ({why})"),
                    }
                ),
            },
            r.integrator.as_deref().unwrap_or_default(),
            s.integrator_reason
        ),
    )];
    rows.extend(
        statistics
            .stages
            .iter()
            .map(|t| (t.stage, format!("{:9.3} s", t.seconds))),
    );
    rows.push(("total", format!("{:9.3} s", s.seconds)));

    let rays = &statistics.rays;
    rows.push((
        "rays",
        parts(&[
            (rays.camera, "camera"),
            (rays.shadow, "shadow"),
            (rays.bounce, "bounce"),
            (rays.gather, "gather"),
            (rays.photon, "photon"),
        ]),
    ));
    let (global, caustic) = (&statistics.global_photons, &statistics.caustic_photons);
    if global.emitted > 0 {
        // Of the caustic photons only those on specular paths are followed, so their flux says
        // little.
        let value = format!("{}; {}", photons(global), fate(global));
        rows.push(("global map", value));
    }
    if caustic.emitted > 0 {
        rows.push(("caustic map", photons(caustic)));
    }
    if let Some(e) = statistics.estimated_error {
        rows.push((
            "error",
            format!("relMSE about {e:.2e}, from independent passes"),
        ));
    }
    let peak = statistics.peak_memory_bytes.map_or("unknown".into(), bytes);
    rows.push((
        "memory",
        format!(
            "{peak} at most, {} of it for {}",
            bytes(statistics.accelerator_bytes),
            statistics.accelerator
        ),
    ));
    for d in &s.rendering.effects {
        rows.push(("effect", effect(d)));
    }
    if statistics.rejected_pixels > 0 {
        let n = statistics.rejected_pixels;
        let [x, y] = statistics.first_rejected_pixel.unwrap_or_default();
        rows.push((
            "BUG",
            format!(
                "{n} pixel sums were not finite and left out, the first at {x},{y}; please report \
                 the scene and the command"
            ),
        ));
    }
    rows.extend(s.outputs.iter().map(|p| ("wrote", p.display().to_string())));

    let mut out = String::new();
    for (name, value) in rows {
        // Writing to a string does not fail.
        let _ = writeln!(out, "{name:>12}  {value}");
    }
    out
}

/// What was decided on an effect and why, its share of the time, and what was done for it.
fn effect(d: &Decision) -> String {
    let state = if d.on { "on" } else { "skipped" };
    let mut out = format!("{:<13}{state:<9}", d.name);
    if let Some(cost) = &d.cost {
        out += &match cost.time_share {
            Some(share) if d.on => format!("{:5.1}%  ", 100.0 * share),
            _ => " ".repeat(8),
        };
        out += &d.reason;
        let counts = cost.counts.iter().filter(|(_, n)| **n > 0);
        let counts: Vec<String> = counts
            .map(|(what, n)| format!("{} {what}", count(*n as f64)))
            .collect();
        if !counts.is_empty() {
            out += &format!(" ({})", counts.join(", "));
        }
    } else {
        out += &d.reason;
    }
    out
}

fn parts(all: &[(u64, &str)]) -> String {
    let named: Vec<String> = all
        .iter()
        .filter(|(n, _)| *n > 0)
        .map(|(n, name)| format!("{} {name}", count(*n as f64)))
        .collect();
    if named.is_empty() {
        "none".into()
    } else {
        named.join(", ")
    }
}

fn photons(p: &PhotonCounts) -> String {
    parts(&[(p.emitted, "emitted"), (p.stored, "stored")])
}

/// Where the flux went.
fn fate(p: &PhotonCounts) -> String {
    let of = p.flux_emitted;
    let share = |flux: f64| if of > 0.0 { 100.0 * flux / of } else { 0.0 };
    format!(
        "flux {:.1}% absorbed, {:.1}% escaped, {:.1}% cut",
        share(p.flux_absorbed),
        share(p.flux_escaped),
        share(p.flux_cut)
    )
}

/// The statistics as one JSON object, with a line break at the end.
pub(super) fn json(s: &Summary) -> String {
    let r = s.settings;
    let i = &r.integrator_settings;
    let value = json!({
        "software": Metadata::SOFTWARE,
        "commit": Metadata::COMMIT,
        "command_line": s.metadata.command_line,
        "scene": s.scene.to_string_lossy(),
        "outputs": s.outputs.iter().map(|p| p.to_string_lossy()).collect::<Vec<_>>(),
        "settings": {
            "integrator": r.integrator,
            "integrator_reason": s.integrator_reason,
            "accelerator": r.accelerator,
            "emission": r.emission,
            "guide": i.guide.name(),
            "pixel_sampling": r.pixel_sampling.name(),
            "interpolation": r.interpolation,
            "not_interpolated": s.rendering.not_interpolated,
            "effects": r.effects,
            "width": r.width,
            "height": r.height,
            "spp": (r.spp != u32::MAX).then_some(r.spp),
            "target_error": r.progressive.as_ref().and_then(|p| p.target_error),
            "crop": r.crop,
            "camera": r.camera,
            "threads": r.threads,
            "seed": i.seed,
            "max_depth": i.max_depth,
            "roulette": i.roulette,
            "photons": i.photons,
            "caustic_photons": i.caustic_photons,
            "nearest": i.nearest,
            "gather_rays": i.gather_rays,
            "shadow_rays": i.shadow_rays,
        },
        "seconds": s.seconds,
        "stopped": s.rendering.stopped.map(|why| match why {
            Stopped::Interrupted => "interrupted",
            Stopped::TimeLimit => "time_limit",
        }),
        "effects": s.rendering.effects,
        "statistics": s.rendering.statistics,
    });
    format!("{value:#}\n")
}
