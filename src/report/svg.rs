//! Plots with logarithmic axes, as SVG: text alone, readable everywhere.

use std::fmt::Write;

use super::statistics::Interval;

/// Colours that are told apart by everybody (Okabe and Ito 2008).
pub const COLOURS: [&str; 7] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000",
];

const LEFT: f64 = 62.0;
const RIGHT: f64 = 18.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 46.0;

/// A curve through points with intervals.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name, for the legend; none if empty.
    pub name: String,
    /// Index of its colour.
    pub colour: usize,
    /// Whether its line is broken.
    pub dashed: bool,
    /// Abscissa and ordinate. What is not positive is left out.
    pub points: Vec<(Interval, Interval)>,
    /// A word beside each point; fewer, or empty ones, for none.
    pub labels: Vec<String>,
}

/// A plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Title.
    pub title: String,
    /// What the abscissa is.
    pub x: String,
    /// What the ordinate is.
    pub y: String,
    /// The curves.
    pub series: Vec<Series>,
    /// Width and height in pixels.
    pub size: (f64, f64),
}

/// One axis: a range of logarithms onto a range of pixels.
struct Axis {
    log: (f64, f64),
    pixels: (f64, f64),
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, pixels: (f64, f64)) -> Self {
        let (lo, hi) = values
            .filter(|v| v.is_finite() && *v > 0.0)
            .map(f64::log10)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
                (lo.min(v), hi.max(v))
            });
        let (lo, hi) = if lo <= hi { (lo, hi) } else { (0.0, 1.0) };
        // A margin, and never so short that no tick is in it.
        let margin = (0.06 * (hi - lo)).max((0.7 - (hi - lo)).max(0.0) / 2.0);
        Self {
            log: (lo - margin, hi + margin),
            pixels,
        }
    }

    fn at(&self, v: f64) -> f64 {
        let f = (v.log10() - self.log.0) / (self.log.1 - self.log.0);
        self.pixels.0 + f.clamp(-0.02, 1.02) * (self.pixels.1 - self.pixels.0)
    }

    /// Powers of ten and, where these are few, what lies between; with whether each is labelled.
    fn ticks(&self) -> Vec<(f64, bool)> {
        let (lo, hi) = self.log;
        let decades = hi - lo;
        let labelled = |m: i32| match m {
            1 => decades < 7.5,
            3 => decades < 2.6,
            2 | 5 => decades < 1.0,
            _ => false,
        };
        (lo.floor() as i32..=hi.ceil() as i32)
            .flat_map(|p| (1..10).map(move |m| (m, p)))
            .map(|(m, p)| {
                (
                    f64::from(m) * 10_f64.powi(p),
                    labelled(m) || (m == 1 && p % 2 == 0),
                )
            })
            .filter(|(v, _)| (lo..=hi).contains(&v.log10()))
            .collect()
    }
}

/// A number on an axis.
fn label(v: f64) -> String {
    if (0.01..10_000.0).contains(&v) {
        format!("{}", (v * 1e4).round() / 1e4)
    } else {
        format!("{v:.0e}")
    }
}

/// Text that may stand in XML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

impl Plot {
    /// The plot as one `<svg>` element.
    pub fn svg(&self) -> String {
        let (w, h) = self.size;
        let points = || self.series.iter().flat_map(|s| &s.points);
        let ends = |i: &Interval| [i.low, i.value, i.high];
        let x = Axis::new(points().flat_map(|p| ends(&p.0)), (LEFT, w - RIGHT));
        let y = Axis::new(points().flat_map(|p| ends(&p.1)), (h - BOTTOM, TOP));
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" \
             height=\"{h}\" role=\"img\" font-family=\"system-ui, sans-serif\" font-size=\"12\">\
             <title>{}</title><rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n",
            escape(&self.title)
        );
        // Writing to a string does not fail.
        let _ = writeln!(
            out,
            "<text x=\"{LEFT}\" y=\"20\" font-size=\"14\" font-weight=\"600\">{}</text>",
            escape(&self.title)
        );
        for (v, labelled) in x.ticks() {
            let px = x.at(v);
            let colour = if labelled { "#ddd" } else { "#f1f1f1" };
            let _ = writeln!(
                out,
                "<path d=\"M{px:.1} {TOP}V{:.1}\" stroke=\"{colour}\"/>",
                h - BOTTOM
            );
            if labelled {
                let _ = writeln!(
                    out,
                    "<text x=\"{px:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                    h - BOTTOM + 16.0,
                    label(v)
                );
            }
        }
        for (v, labelled) in y.ticks() {
            let py = y.at(v);
            let colour = if labelled { "#ddd" } else { "#f1f1f1" };
            let _ = writeln!(
                out,
                "<path d=\"M{LEFT} {py:.1}H{:.1}\" stroke=\"{colour}\"/>",
                w - RIGHT
            );
            if labelled {
                let _ = writeln!(
                    out,
                    "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                    LEFT - 6.0,
                    py + 4.0,
                    label(v)
                );
            }
        }
        let _ = writeln!(
            out,
            "<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"none\" \
             stroke=\"#666\"/>\n<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            w - LEFT - RIGHT,
            h - TOP - BOTTOM,
            (LEFT + w - RIGHT) / 2.0,
            h - 10.0,
            escape(&self.x),
            (TOP + h - BOTTOM) / 2.0,
            escape(&self.y),
        );
        for s in &self.series {
            out += &s.svg(&x, &y);
        }
        out += &self.legend();
        out + "</svg>\n"
    }

    fn legend(&self) -> String {
        let named = |s: &&Series| !s.name.is_empty() && s.shown().next().is_some();
        let named: Vec<&Series> = self.series.iter().filter(named).collect();
        let longest = named.iter().map(|s| s.name.chars().count()).max();
        let Some(longest) = longest else {
            return String::new();
        };
        let width = 44.0 + 6.6 * longest as f64;
        let height = 18.0 * named.len() as f64 + 6.0;
        // Errors fall: the lower left corner is empty.
        let (x, y) = (LEFT + 6.0, self.size.1 - BOTTOM - height - 6.0);
        let mut out = format!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"#fff\" \
             fill-opacity=\"0.85\" stroke=\"#ccc\"/>\n"
        );
        for (k, s) in named.iter().enumerate() {
            let y = y + 15.0 + 18.0 * k as f64;
            let _ = writeln!(
                out,
                "<path d=\"M{:.1} {:.1}h24\" stroke=\"{}\" stroke-width=\"2\"{}/>\
                 <text x=\"{:.1}\" y=\"{y:.1}\">{}</text>",
                x + 6.0,
                y - 4.0,
                s.stroke(),
                s.dash(),
                x + 36.0,
                escape(&s.name)
            );
        }
        out
    }
}

impl Series {
    fn stroke(&self) -> &'static str {
        COLOURS[self.colour % COLOURS.len()]
    }

    fn dash(&self) -> &'static str {
        if self.dashed {
            " stroke-dasharray=\"5 4\""
        } else {
            ""
        }
    }

    /// The points that logarithms have a place for.
    fn shown(&self) -> impl Iterator<Item = &(Interval, Interval)> {
        let positive = |p: &&(Interval, Interval)| p.0.value > 0.0 && p.1.value > 0.0;
        self.points.iter().filter(positive)
    }

    fn svg(&self, x: &Axis, y: &Axis) -> String {
        let shown: Vec<&(Interval, Interval)> = self.shown().collect();
        let mut out = String::new();
        let line: Vec<String> = shown
            .iter()
            .map(|(a, b)| format!("{:.1},{:.1}", x.at(a.value), y.at(b.value)))
            .collect();
        let (stroke, dash) = (self.stroke(), self.dash());
        // Writing to a string does not fail.
        let _ = writeln!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"2\"{dash}/>",
            line.join(" ")
        );
        for (a, b) in shown {
            let (px, py) = (x.at(a.value), y.at(b.value));
            let low = y.at(b.low.max(f64::MIN_POSITIVE));
            let _ = writeln!(
                out,
                "<path d=\"M{px:.1} {low:.1}V{:.1}M{:.1} {py:.1}H{:.1}\" stroke=\"{stroke}\"/>\
                 <circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"3.2\" fill=\"{stroke}\"/>",
                y.at(b.high),
                x.at(a.low.max(f64::MIN_POSITIVE)),
                x.at(a.high),
            );
        }
        for ((a, b), label) in self.points.iter().zip(&self.labels) {
            if a.value > 0.0 && b.value > 0.0 && !label.is_empty() {
                let _ = writeln!(
                    out,
                    "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"{stroke}\">{}</text>",
                    x.at(a.value) + 7.0,
                    y.at(b.value) - 7.0,
                    escape(label)
                );
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64) -> (Interval, Interval) {
        let i = |v: f64| Interval {
            value: v,
            low: v * 0.9,
            high: v * 1.1,
        };
        (i(x), i(y))
    }

    #[test]
    fn a_plot_is_well_formed_and_holds_its_points() {
        let plot = Plot {
            title: "a < b".into(),
            x: "seconds".into(),
            y: "error".into(),
            series: vec![Series {
                name: "one".into(),
                colour: 0,
                dashed: true,
                points: vec![point(0.1, 1.0), point(10.0, 1e-4), point(20.0, -1.0)],
                labels: vec!["begin".into()],
            }],
            size: (480.0, 320.0),
        };
        let svg = plot.svg();
        assert!(svg.contains("a &lt; b") && !svg.contains("NaN") && !svg.contains("inf"));
        // The point below zero is left out.
        assert_eq!(svg.matches("<circle").count(), 2);
        for tag in ["svg", "text", "title"] {
            let closed = svg.matches(&format!("</{tag}>")).count();
            assert_eq!(svg.matches(&format!("<{tag}")).count(), closed, "{tag}");
        }
    }

    #[test]
    fn nothing_to_show_is_a_plot_all_the_same() {
        let plot = Plot {
            title: String::new(),
            x: String::new(),
            y: String::new(),
            series: Vec::new(),
            size: (100.0, 100.0),
        };
        assert!(!plot.svg().contains("NaN"));
    }
}
