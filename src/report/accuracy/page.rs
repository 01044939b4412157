//! A study as one page that needs nothing else: plots and pictures are inside.

use std::fmt::Write;
use std::io::Cursor;

use base64::Engine;

use super::analysis::describe;
use super::curves::{components, whole};
use super::tables::{COMPONENTS, changes, interval, ratio, seconds, short};
use super::{Analysis, Circumstances, Point, Study, layers, plots, presets};
use crate::error::Result;
use crate::film::{Channel, Image, Layer};
use crate::output::{Metadata, OutputSettings, format_of};
use crate::plugins::Registry;
use crate::report::diff::Pair;
use crate::report::statistics::Interval;
use crate::report::svg::escape;
use crate::report::{ErrorMap, error_image};

/// A picture of the page.
struct Picture {
    id: String,
    caption: String,
    data: String,
}

/// Writes the page.
///
/// # Errors
/// A picture that cannot be encoded.
pub fn page(
    study: &Study,
    analysis: &Analysis,
    circumstances: &Circumstances,
    registry: &Registry,
) -> Result<String> {
    let scene = escape(&circumstances.scene);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <link rel=\"icon\" href=\"data:,\">\n<title>Accuracy against time: {scene}</title>\n\
         <style>{}</style></head><body>\n<h1>Accuracy against time: {scene}</h1>\n<p>{}</p>\n",
        include_str!("page.css"),
        escape(&circumstances.contents)
    );
    let clock = study.clock;
    out += "<div class=\"plots\">";
    out += &plots::overview(analysis, clock, "Error against time").svg();
    out += "</div>\n";
    out += &times(analysis);
    out += &of_presets(analysis);
    out += &pictures(study, analysis, registry)?;
    out += "<h2>What the error is made of</h2>\n<p>Noise differs from seed to seed; bias does not. \
            Bias is shown where its interval lies above zero. Errors of components are divided by \
            the whole picture, so they tell what they do to it.</p>\n<div class=\"plots\">";
    out += &plots::parts(analysis, clock).svg();
    out += &plots::convergence(analysis).svg();
    if let Some(plot) = plots::flip(analysis, clock) {
        out += &plot.svg();
    }
    for layer in layers::names().into_iter().skip(1) {
        if let Some(plot) = plots::component(analysis, clock, layer) {
            out += &plot.svg();
        }
    }
    out += "</div>\n";
    out += &effects(analysis);
    out += &points(analysis);
    out += &method(study, analysis, circumstances);
    // Writing to a string does not fail.
    let _ = write!(
        out,
        "<script>{}</script>\n</body></html>\n",
        include_str!("page.js")
    );
    Ok(out)
}

fn row(cells: impl IntoIterator<Item = String>, tag: &str) -> String {
    let cells: String = cells
        .into_iter()
        .map(|c| {
            let c = escape(&c)
                .replace(" [", " <small>[")
                .replace(']', "]</small>");
            format!("<{tag}>{c}</{tag}>")
        })
        .collect();
    format!("<tr>{cells}</tr>\n")
}

fn head(cells: &[&str]) -> String {
    row(cells.iter().map(|c| c.to_string()), "th")
}

fn times(analysis: &Analysis) -> String {
    let first = analysis.curves.first().map_or("", |c| c.method.as_str());
    let mut out = String::from("<h2>Time to an error</h2>\n<table>\n");
    let faster = format!("times faster than {first}");
    out += &head(&["method", "relMSE", "seconds", &faster]);
    for r in whole(&analysis.curves) {
        let l = r.level;
        out += &row(
            [r.method.into(), short(l.error), seconds(l), ratio(l)],
            "td",
        );
    }
    out += "</table>\n";
    out += &of_components(analysis, &faster);
    out += "<table>\n";
    out += &head(&["method", "slope of error over time", "over samples"]);
    for c in &analysis.curves {
        let cell = |slope: &Option<Interval>| slope.as_ref().map_or("unknown".into(), interval);
        out += &row([c.method.clone(), cell(&c.slope), cell(&c.fall)], "td");
    }
    let [t, e, both] = analysis
        .floor
        .map(|f| format!("{:.1} %", 100.0 * (f - 1.0)));
    out + &format!(
        "</table>\n<p>Brackets hold 95 % intervals, bootstrapped over seeds. Differences below the \
         noise floor of this run, found by measuring the same twice, are reported as none: {t} of \
         time, {e} of error, {both} of their product. A slope of −1 halves the error in twice the \
         time.</p>\n"
    )
}

fn of_components(analysis: &Analysis, faster: &str) -> String {
    let parts = components(&analysis.curves);
    if parts.is_empty() {
        return String::new();
    }
    let mut out = format!("<p>{COMPONENTS}</p>\n<table class=\"components\">\n");
    out += &head(&["component", "method", "relMSE", "seconds", faster]);
    for r in parts {
        let l = r.level;
        let (error, time, ratio) = (short(l.error), seconds(l), ratio(l));
        let cells = [r.layer.into(), r.method.into(), error, time, ratio];
        out += &row(cells, "td");
    }
    out + "</table>\n"
}

fn of_presets(analysis: &Analysis) -> String {
    let Some(reason) = presets::reason(analysis) else {
        return String::new();
    };
    let reason = escape(&reason.replace('`', ""));
    let mut out = format!("<h2>Presets</h2>\n<p>{reason}</p>\n<table class=\"presets\">\n");
    out += &head(&presets::COLUMNS);
    for p in &analysis.presets {
        out += &row(p.cells(), "td");
    }
    out + "</table>\n"
}

fn points(analysis: &Analysis) -> String {
    let mut out = String::from("<h2>All that was measured</h2>\n<table class=\"points\">\n");
    out += &head(&[
        "",
        "settings",
        "seconds",
        "relMSE",
        "noise",
        "bias",
        "without the worst 0.1 %",
        "FLIP",
    ]);
    for p in &analysis.points {
        let whole = &p.layers[0];
        let flip = p.flip.as_ref().map_or("not in this build".into(), interval);
        let cells = [
            p.name.clone(),
            describe(p),
            interval(&p.seconds),
            interval(&whole.total),
            short(whole.noise.value),
            interval(&whole.bias),
            short(p.trimmed.value),
            flip,
        ];
        out += &row(cells, "td");
    }
    out + "</table>\n"
}

fn effects(analysis: &Analysis) -> String {
    let Some(base) = analysis
        .base
        .as_ref()
        .filter(|_| !analysis.effects.is_empty())
    else {
        return String::new();
    };
    let mut out = format!(
        "<h2>What precision costs</h2>\n<p>One change at a time to photon mapping with {}. Factors: \
         below 1 is less. Their product is what counts if error can be had for time at a slope of \
         −1.</p>\n<table class=\"changes\">\n",
        escape(base)
    );
    out += &head(&["change", "time", "error", "time × error", ""]);
    for e in &analysis.effects {
        let [time, error, cost] = changes(e);
        let cells = [e.change.into(), time, error, cost, e.doc.into()];
        out += &row(cells, "td");
    }
    out + "</table>\n"
}

fn method(study: &Study, analysis: &Analysis, c: &Circumstances) -> String {
    let mut out = String::from("<h2>How this was measured</h2>\n<ul>\n");
    let mut item = |text: String| out += &format!("<li>{}</li>\n", escape(&text));
    item(format!("Reference: {}.", study.reference.origin));
    if !study.reference.good {
        item(
            "The reference is noisier than was asked for: its time was up. Its error is taken off \
             the errors shown; a larger --budget makes it better."
                .into(),
        );
    }
    let repeats = study.runs.iter().map(|r| r.repeat + 1).max().unwrap_or(0);
    item(format!(
        "{repeats} seeds per setting, settings in turns in random order. Time is {} of rendering, \
         without import.",
        study.clock.label()
    ));
    item(
        "relMSE is the mean over pixels and channels of (a − b)² / (b² + 0.01), b the reference."
            .into(),
    );
    for m in &study.methods {
        item(format!("{}: {}.", m.name, m.doc));
    }
    for line in c.machine.iter().chain(&c.effects) {
        item(line.clone());
    }
    let _ = analysis;
    // Writing to a string does not fail.
    let _ = writeln!(
        out,
        "</ul>\n<p>Again: <code>{}</code></p>",
        escape(&c.command)
    );
    out
}

/// The reference, and of each method the picture made in about the same time, with its error.
fn pictures(study: &Study, analysis: &Analysis, registry: &Registry) -> Result<String> {
    let mut shown = vec![Picture {
        id: "reference".into(),
        caption: "reference".into(),
        data: png(
            beauty(study.reference.layers.beauty(), study),
            study.exposure,
            registry,
        )?,
    }];
    let mut errors = Vec::new();
    for (m, p) in alike(analysis).into_iter().enumerate() {
        let runs = study.runs.iter().filter(|r| r.setting == p.setting());
        let Some(run) = runs.min_by_key(|r| r.repeat) else {
            continue;
        };
        let pair = Pair {
            layer: String::new(),
            width: run.layers.width,
            height: run.layers.height,
            image: run.layers.beauty().to_vec(),
            reference: study.reference.layers.beauty().to_vec(),
        };
        let error = error_image(&pair, ErrorMap::Relative, study.exposure, true)?;
        let caption = format!("{}: {}, {} s", p.name, describe(p), short(p.seconds.value));
        shown.push(Picture {
            id: format!("picture{m}"),
            caption: caption.clone(),
            data: png(beauty(run.layers.beauty(), study), study.exposure, registry)?,
        });
        errors.push(Picture {
            id: format!("error{m}"),
            caption: format!("error of {caption}"),
            data: png(error, 0.0, registry)?,
        });
    }
    let options = |chosen: usize| -> String {
        let all = shown.iter().chain(&errors).enumerate();
        all.map(|(i, p)| {
            let selected = if i == chosen { " selected" } else { "" };
            format!(
                "<option value=\"{}\"{selected}>{}</option>",
                p.id,
                escape(&p.caption)
            )
        })
        .collect()
    };
    let strip = |list: &[Picture]| -> String {
        list.iter()
            .map(|p| {
                format!(
                    "<figure><img id=\"{}\" alt=\"{1}\" src=\"data:image/png;base64,{2}\">\
                     <figcaption>{1}</figcaption></figure>\n",
                    p.id,
                    escape(&p.caption),
                    p.data
                )
            })
            .collect()
    };
    Ok(format!(
        "<h2>The pictures</h2>\n<p>Made in about the same time. Left <select id=\"left\">{}</select> \
         right <select id=\"right\">{}</select></p>\n<div class=\"compare\"><img id=\"under\" \
         alt=\"right\"><img id=\"over\" class=\"over\" alt=\"left\"><div id=\"bar\" class=\"bar\">\
         </div></div>\n<input id=\"slider\" type=\"range\" min=\"0\" max=\"100\" value=\"50\" \
         aria-label=\"where left ends\">\n<div class=\"strip\">\n{}</div>\n<p>Relative squared \
         errors from 0.0001 (dark) to 4 (bright):</p>\n<div class=\"strip\">\n{}</div>\n",
        options(0),
        options(1),
        strip(&shown),
        strip(&errors)
    ))
}

/// Of each method the point whose time is nearest to one that all methods have.
fn alike(analysis: &Analysis) -> Vec<&Point> {
    let last = |method: &str| {
        analysis
            .curve(method)
            .map(|p| p.seconds.value)
            .fold(0.0, f64::max)
    };
    let time = analysis
        .curves
        .iter()
        .map(|c| last(&c.method))
        .fold(f64::INFINITY, f64::min);
    let distance = |p: &&Point| (p.seconds.value / time).ln().abs();
    analysis
        .curves
        .iter()
        .filter_map(|c| {
            analysis
                .curve(&c.method)
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        })
        .collect()
}

fn beauty(pixels: &[[f32; 3]], study: &Study) -> Image {
    let l = &study.reference.layers;
    Image {
        width: l.width,
        height: l.height,
        layers: vec![Layer {
            name: String::new(),
            channels: ["R", "G", "B"]
                .iter()
                .enumerate()
                .map(|(c, name)| Channel {
                    name: (*name).into(),
                    half: false,
                    data: pixels.iter().map(|p| p[c]).collect(),
                })
                .collect(),
        }],
    }
}

fn png(image: Image, exposure: f64, registry: &Registry) -> Result<String> {
    let path = std::path::Path::new("picture.png");
    let format = format_of(&registry.outputs, path)?;
    let mut bytes = Cursor::new(Vec::new());
    (format.encode)(
        &image,
        &OutputSettings { exposure },
        &Metadata::default(),
        &mut bytes,
    )
    .map_err(|e| crate::error::Error::file(path, e, "report this as a bug"))?;
    Ok(base64::engine::general_purpose::STANDARD.encode(bytes.into_inner()))
}
