//! `dualight diff`.

use serde_json::json;

use super::args::DiffArgs;
use super::{Ending, console};
use crate::error::Result;
use crate::output::{self, Metadata, OutputSettings};
use crate::plugins::Registry;
use crate::report::diff::{Comparison, Pair};
use crate::report::error_image;

/// Compares an image with a reference.
pub(super) fn run(args: &DiffArgs) -> Result<Ending> {
    let outputs = Registry::builtin().outputs;
    // Numbers for the format that can hold them, colours for the one that is looked at.
    let mut false_colours = true;
    if let Some(path) = &args.output {
        false_colours = output::format_of(&outputs, path)?.name != "exr";
        output::check_writable(path)?;
    }
    let image = output::read(&args.image)?;
    let reference = output::read(&args.reference)?;
    let pair = Pair::new(&image, &reference, args.layer.as_deref())?;
    let comparison = pair.compare(args.exposure);
    if let Some(path) = &args.output {
        let picture = error_image(&pair, args.error_map, args.exposure, false_colours)?;
        let settings = OutputSettings::default();
        output::write(&outputs, &picture, &settings, &Metadata::default(), path)?;
    }
    console::print(&if args.json {
        let value = json!({
            "image": args.image.to_string_lossy(),
            "reference": args.reference.to_string_lossy(),
            "layer": pair.layer,
            "width": pair.width,
            "height": pair.height,
            "comparison": comparison,
        });
        format!("{value:#}\n")
    } else {
        table(&comparison, pair.width)
    })?;
    Ok(Ending::Done)
}

fn table(c: &Comparison, width: u32) -> String {
    let triple = |v: [f64; 3]| format!("{:.6} {:.6} {:.6}", v[0], v[1], v[2]);
    let number = |v: Option<f64>, none: &str| v.map_or(none.into(), |v| format!("{v:.6}"));
    let at = (
        c.max_error_pixel % width.max(1) as usize,
        c.max_error_pixel / width.max(1) as usize,
    );
    let mut rows = vec![
        ("mean", triple(c.mean)),
        ("reference mean", triple(c.reference_mean)),
        (
            "mean ratio",
            number(c.mean_ratio, "none: the reference is black"),
        ),
        ("RMSE", format!("{:.6}", c.rmse)),
        ("relMSE", format!("{:.6}", c.rel_mse)),
        (
            "relMSE, worst 0.1 % left out",
            format!("{:.6}", c.rel_mse_trimmed),
        ),
        (
            "largest error",
            format!("{:.6} at pixel {},{}", c.max_error, at.0, at.1),
        ),
        ("FLIP", number(c.flip, "not in this build")),
    ];
    if c.not_finite > 0 {
        rows.push((
            "left out",
            format!("{} pixels that are not finite", c.not_finite),
        ));
    }
    rows.iter()
        .map(|(name, value)| format!("{name:>28}  {value}\n"))
        .collect()
}
