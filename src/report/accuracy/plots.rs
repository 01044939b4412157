//! The plots of a study.

use super::{Analysis, Clock, Point};
use crate::report::statistics::Interval;
use crate::report::svg::{Plot, Series};

/// Width and height of a large plot.
const LARGE: (f64, f64) = (680.0, 420.0);

/// And of a small one.
const SMALL: (f64, f64) = (440.0, 300.0);

fn plot(
    analysis: &Analysis,
    clock: Clock,
    (title, y): (&str, &str),
    size: (f64, f64),
    values: &[(&str, bool, &dyn Fn(&Point) -> Option<Interval>)],
) -> Plot {
    let series = analysis.curves.iter().enumerate().flat_map(|(colour, c)| {
        values.iter().map(move |(suffix, dashed, value)| Series {
            name: format!("{}{suffix}", c.method),
            colour,
            dashed: *dashed,
            points: analysis
                .curve(&c.method)
                .filter_map(|p| Some((p.seconds, value(p)?)))
                .collect(),
            labels: Vec::new(),
        })
    });
    Plot {
        title: title.into(),
        x: clock.label().into(),
        y: y.into(),
        series: series.collect(),
        size,
    }
}

/// The one plot that says most: error of the whole picture against time.
pub fn overview(analysis: &Analysis, clock: Clock, title: &str) -> Plot {
    let error = |p: &Point| Some(p.error());
    let mut plot = plot(
        analysis,
        clock,
        (title, "relMSE"),
        LARGE,
        &[("", false, &error)],
    );
    // Presets are points of the curves, or lie beyond their ends.
    for (colour, c) in analysis.curves.iter().enumerate() {
        let preset = |p: &Point| p.preset.unwrap_or_default().to_string();
        let labels = analysis.curve(&c.method).map(preset).collect();
        if let Some(s) = plot.series.iter_mut().find(|s| s.name == c.method) {
            s.labels = labels;
        }
        let own = |p: &&Point| p.preset.is_some() && p.rung.is_none() && p.name == c.method;
        let beyond = analysis.points.iter().filter(own).map(|p| Series {
            name: String::new(),
            colour,
            dashed: true,
            points: analysis
                .curve(&c.method)
                .last()
                .into_iter()
                .chain([p])
                .map(|p| (p.seconds, p.error()))
                .collect(),
            labels: vec![String::new(), preset(p)],
        });
        plot.series.extend(beyond.collect::<Vec<_>>());
    }
    plot
}

/// How the error falls with the samples, and by which power.
pub(super) fn convergence(analysis: &Analysis) -> Plot {
    let series = analysis
        .curves
        .iter()
        .enumerate()
        .map(|(colour, c)| Series {
            name: match &c.fall {
                Some(slope) => format!("{}: slope {:.2}", c.method, slope.value),
                None => c.method.clone(),
            },
            colour,
            dashed: false,
            points: analysis
                .curve(&c.method)
                .map(|p| {
                    let spp = f64::from(p.spp);
                    let exactly = Interval {
                        value: spp,
                        low: spp,
                        high: spp,
                    };
                    (exactly, p.error())
                })
                .collect(),
            labels: Vec::new(),
        });
    Plot {
        title: "Error against samples".into(),
        x: "samples per pixel".into(),
        y: "relMSE".into(),
        series: series.collect(),
        size: SMALL,
    }
}

/// FLIP against time; `None` if this build knows no FLIP.
pub(super) fn flip(analysis: &Analysis, clock: Clock) -> Option<Plot> {
    analysis.points.first()?.flip?;
    let flip = |p: &Point| p.flip;
    Some(plot(
        analysis,
        clock,
        ("FLIP", "mean FLIP"),
        SMALL,
        &[("", false, &flip)],
    ))
}

/// Noise and bias apart.
pub(super) fn parts(analysis: &Analysis, clock: Clock) -> Plot {
    let noise = |p: &Point| Some(p.layers[0].noise);
    // Where noise hides the bias, only its upper end is known.
    let bias = |p: &Point| Some(p.layers[0].bias).filter(|b| b.low > 0.0);
    let values: &[(&str, bool, &dyn Fn(&Point) -> Option<Interval>)] =
        &[(": noise", false, &noise), (": bias", true, &bias)];
    let title = ("Noise and squared bias apart", "part of relMSE");
    plot(analysis, clock, title, SMALL, values)
}

/// A component's errors.
pub(super) fn component(analysis: &Analysis, clock: Clock, layer: &str) -> Option<Plot> {
    let error = |p: &Point| p.layers.iter().find(|l| l.layer == layer).map(|l| l.total);
    // A component that the scene does not have has no error.
    let any = analysis
        .points
        .iter()
        .any(|p| error(p).is_some_and(|e| e.value > 0.0));
    any.then(|| {
        let title = (layer, "relMSE, of the whole");
        plot(analysis, clock, title, SMALL, &[("", false, &error)])
    })
}
