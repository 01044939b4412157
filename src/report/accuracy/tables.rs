//! A study as text, CSV and JSON.

use std::fmt::Write;

use serde_json::{Value, json};

use super::curves::{Row, components, whole};
use super::presets::{self, COLUMNS, Standing};
use super::{Analysis, Circumstances, Effect, Level, Study};
use crate::report::statistics::Interval;

/// Three digits and the interval: `0.0123 [0.011, 0.014]`.
pub(super) fn interval(i: &Interval) -> String {
    format!("{} [{}, {}]", short(i.value), short(i.low), short(i.high))
}

/// About three digits.
pub(super) fn short(v: f64) -> String {
    match v.abs() {
        0.0 => "0".into(),
        a if !(1e-3..1e4).contains(&a) => format!("{v:.2e}"),
        a if a >= 100.0 => format!("{v:.0}"),
        // From 0.001 to 100: as many decimals as make three digits.
        a => {
            let decimals = (2.0 - a.log10().floor()) as usize;
            format!("{v:.decimals$}")
        }
    }
}

/// The seconds that a method takes to a level, in words.
pub(super) fn seconds(l: &Level) -> String {
    match (&l.seconds, l.at_most) {
        (Some(i), _) => interval(i),
        (None, Some(t)) => format!("at most {}", short(t)),
        (None, None) => l
            .more_than
            .map_or("unknown".into(), |t| format!("more than {}", short(t))),
    }
}

/// How many times faster than the first method, in words.
pub(super) fn ratio(l: &Level) -> String {
    match &l.ratio {
        Some(r) if l.differs => interval(r),
        Some(_) => "none".into(),
        None => l
            .ratio_at_least
            .map_or("unknown".into(), |b| format!("at least {}", short(b))),
    }
}

/// What the table of components shows.
pub(super) const COMPONENTS: &str = "Seconds of the whole picture until the error of one component, \
     divided by the whole reference, is as small:";

/// The answer in a few lines.
pub fn text(analysis: &Analysis) -> String {
    let mut out = String::new();
    // Writing to a string does not fail.
    let _ = writeln!(
        out,
        "{:<18} {:>9} {:>28} {:>28}",
        "method", "relMSE", "seconds", "times faster"
    );
    for c in &analysis.curves {
        for l in &c.times {
            let _ = writeln!(
                out,
                "{:<18} {:>9} {:>28} {:>28}",
                c.method,
                short(l.error),
                seconds(l),
                ratio(l)
            );
        }
        if let Some(s) = &c.slope {
            let _ = writeln!(out, "{:<18} {:>9} {:>28}", c.method, "slope", interval(s));
        }
    }
    let parts = components(&analysis.curves);
    if !parts.is_empty() {
        let _ = writeln!(
            out,
            "seconds of the whole picture until one component is good"
        );
    }
    for r in parts {
        let _ = writeln!(
            out,
            "{:<10} {:<22} {:>9} {:>28} {:>28}",
            r.layer,
            r.method,
            short(r.level.error),
            seconds(r.level),
            ratio(r.level)
        );
    }
    let [t, e, both] = analysis.floor.map(|f| 100.0 * (f - 1.0));
    let _ = writeln!(
        out,
        "noise floor: {t:.1} % of time, {e:.1} % of error, {both:.1} % of their product"
    );
    out
}

/// The tables of times and of changes as Markdown.
pub fn markdown(analysis: &Analysis) -> String {
    let first = analysis.curves.first().map_or("", |c| c.method.as_str());
    let mut out = line([
        "relMSE",
        "method",
        "seconds",
        &format!("faster than {first}"),
    ]);
    out += &line(["---"; 4]);
    for r in whole(&analysis.curves) {
        let l = r.level;
        out += &line([&short(l.error), r.method, &seconds(l), &ratio(l)]);
    }
    let [t, e, both] = analysis.floor.map(|f| 100.0 * (f - 1.0));
    out += &format!(
        "\nNoise floor: {t:.0} % of time, {e:.0} % of error, {both:.0} % of their product.\n"
    );
    let parts = components(&analysis.curves);
    if !parts.is_empty() {
        out += &format!("\n{COMPONENTS}\n\n");
        out += &line([
            "component",
            "relMSE",
            "method",
            "seconds",
            &format!("faster than {first}"),
        ]);
        out += &line(["---"; 5]);
    }
    for r in parts {
        let l = r.level;
        let cells = [r.layer, &short(l.error), r.method, &seconds(l), &ratio(l)];
        out += &line(cells);
    }
    if let Some(reason) = presets::reason(analysis) {
        out += &format!("\n{reason}\n\n{}{}", line(COLUMNS), line(["---"; 6]));
        let cells = analysis.presets.iter().map(Standing::cells);
        let lines = cells.map(|c| line(c.each_ref().map(String::as_str)));
        out.extend(lines);
    }
    let Some(base) = analysis
        .base
        .as_ref()
        .filter(|_| !analysis.effects.is_empty())
    else {
        return out;
    };
    out += &format!("\nChanged one at a time, from {base}:\n\n");
    out += &line(["change", "time", "error", "time × error", "what it is"]);
    out += &line(["---"; 5]);
    for e in &analysis.effects {
        let [time, error, cost] = changes(e);
        out += &line([e.change, &time, &error, &cost, e.doc]);
    }
    out
}

fn line<const N: usize>(cells: [&str; N]) -> String {
    format!("| {} |\n", cells.join(" | "))
}

/// The factors of a change in words: of time, of error, of both.
pub(super) fn changes(e: &Effect) -> [String; 3] {
    let cell = |i, differs: bool| if differs { interval(i) } else { "none".into() };
    [
        cell(&e.time, e.differs[0]),
        cell(&e.error, e.differs[1]),
        cell(&e.cost, e.differs[2]),
    ]
}

/// One line per point and layer.
pub fn csv(analysis: &Analysis) -> String {
    let mut out = String::from(
        "name,rung,spp,photons,nearest,layer,seconds,seconds_low,seconds_high,relmse,relmse_low,\
         relmse_high,noise,bias,bias_low,bias_high,trimmed,flip,flip_low,flip_high\n",
    );
    for p in &analysis.points {
        let of = |v: Option<String>| v.unwrap_or_default();
        for l in &p.layers {
            let whole = l.layer.is_empty();
            let flip = p.flip.filter(|_| whole);
            // Writing to a string does not fail.
            let _ = writeln!(
                out,
                "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
                p.name,
                of(p.rung.map(|r| r.to_string())),
                p.spp,
                of(p.photons.map(|n| n.to_string())),
                of(p.nearest.map(|n| n.to_string())),
                if whole { "all" } else { l.layer },
                p.seconds.value,
                p.seconds.low,
                p.seconds.high,
                l.total.value,
                l.total.low,
                l.total.high,
                l.noise.value,
                l.bias.value,
                l.bias.low,
                l.bias.high,
                of(whole.then(|| p.trimmed.value.to_string())),
                flip.map_or(",,".into(), |f| format!("{},{},{}", f.value, f.low, f.high))
            );
        }
    }
    out
}

/// One line per layer, level and method: seconds to an error.
pub fn times_csv(analysis: &Analysis) -> String {
    let mut out = String::from(
        "layer,relmse,method,seconds,seconds_low,seconds_high,at_most,more_than,ratio,ratio_low,\
         ratio_high,ratio_at_least,differs\n",
    );
    let curves = &analysis.curves;
    for r in whole(curves).into_iter().chain(components(curves)) {
        let Row {
            layer, level: l, ..
        } = r;
        let triple = |i: Option<Interval>| {
            i.map_or(",,".into(), |i| format!("{},{},{}", i.value, i.low, i.high))
        };
        let single = |v: Option<f64>| v.map_or(String::new(), |v| v.to_string());
        // Writing to a string does not fail.
        let _ = writeln!(
            out,
            "{},{},{},{},{},{},{},{},{}",
            if layer.is_empty() { "all" } else { layer },
            l.error,
            r.method,
            triple(l.seconds),
            single(l.at_most),
            single(l.more_than),
            triple(l.ratio),
            single(l.ratio_at_least),
            l.differs
        );
    }
    out
}

/// Everything, for programs.
pub fn json(study: &Study, analysis: &Analysis, circumstances: &Circumstances) -> Value {
    json!({
        "schema": "dualight-accuracy-1",
        "circumstances": circumstances,
        "clock": study.clock.label(),
        "reference": study.reference.origin,
        "reference_error": study.reference.error[0],
        "noise_floor": {
            "time": analysis.floor[0],
            "error": analysis.floor[1],
            "cost": analysis.floor[2],
        },
        "points": analysis.points,
        "curves": analysis.curves,
        "changes": analysis.effects,
        "changes_are_made_to": analysis.base,
        "presets": analysis.presets,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (v, s) in [
            (0.0, "0"),
            (1.0, "1.00"),
            (0.012_345, "0.0123"),
            (12.345, "12.3"),
            (1234.5, "1234"),
            (1.5e-5, "1.50e-5"),
            (-0.5, "-0.500"),
        ] {
            assert_eq!(short(v), s);
        }
    }
}
