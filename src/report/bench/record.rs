//! What was measured: as a table, as the line that programs read, and against an earlier one.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use crate::report::statistics::median;

/// Name of the layout of the JSON.
pub const SCHEMA: &str = "dualight-bench-1";

/// Begins the line that programs read.
pub const PREFIX: &str = "BENCHMARK_JSON ";

/// One quantity, measured several times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metric {
    /// Scene.
    pub scene: String,
    /// Threads.
    pub threads: usize,
    /// Ray tracing backend; empty for what has none.
    pub backend: String,
    /// What was measured.
    pub metric: String,
    /// Its unit.
    pub unit: String,
    /// Whether more is better.
    pub more_is_better: bool,
    /// The middle value.
    pub median: f64,
    /// The smallest.
    pub low: f64,
    /// The largest.
    pub high: f64,
    /// How many times it was measured.
    pub repeats: usize,
}

impl Metric {
    fn key(&self) -> (&str, usize, &str, &str) {
        (&self.scene, self.threads, &self.backend, &self.metric)
    }

    /// How many times worse than `before`; below 1 is better.
    fn worse(&self, before: &Self) -> f64 {
        match self.more_is_better {
            true => before.median / self.median,
            false => self.median / before.median,
        }
    }
}

/// Everything of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Layout of this: [`SCHEMA`].
    pub schema: String,
    /// Seed of the rays and photons.
    pub seed: u64,
    /// Commit of the program.
    pub commit: String,
    /// Versions of the ray tracing backends.
    pub backends: Vec<String>,
    /// Vector instructions of the processor.
    pub isa: String,
    /// The processor.
    pub processor: String,
    /// The quantities.
    pub results: Vec<Metric>,
}

/// Collects metrics of one scene, thread count and backend.
pub(super) struct Collector<'a> {
    pub(super) scene: &'a str,
    pub(super) threads: usize,
    pub(super) results: Vec<Metric>,
}

impl Collector<'_> {
    /// Enters values; none are no metric.
    pub(super) fn add(
        &mut self,
        backend: &str,
        metric: &str,
        (unit, more_is_better): (&str, bool),
        values: &[f64],
    ) {
        if values.is_empty() {
            return;
        }
        self.results.push(Metric {
            scene: self.scene.into(),
            threads: self.threads,
            backend: backend.into(),
            metric: metric.into(),
            unit: unit.into(),
            more_is_better,
            median: median(values),
            low: values.iter().copied().fold(f64::INFINITY, f64::min),
            high: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            repeats: values.len(),
        });
    }
}

/// A metric that became worse.
#[derive(Clone, Debug, PartialEq)]
pub struct Regression {
    /// It is now.
    pub now: Metric,
    /// How it was.
    pub before: Metric,
    /// How many times worse.
    pub factor: f64,
}

/// Repeats of which the range says something about noise.
const FEWEST_REPEATS: usize = 3;

impl Record {
    /// What is worse than in `baseline` by more than `tolerance` and beyond the noise: the ranges
    /// of all repeats, then and now, do not meet. Also: how many metrics could be judged, since both
    /// have them and, where they vary, often enough.
    pub fn regressions(&self, baseline: &Self, tolerance: f64) -> (Vec<Regression>, usize) {
        let mut shared = 0;
        let found = self
            .results
            .iter()
            .filter_map(|now| {
                let before = baseline.results.iter().find(|b| b.key() == now.key())?;
                let repeats = now.repeats.min(before.repeats);
                if now.unit != "B" && repeats < FEWEST_REPEATS {
                    return None;
                }
                shared += 1;
                let factor = now.worse(before);
                let apart = now.low > before.high || now.high < before.low;
                (factor > 1.0 + tolerance && apart).then(|| Regression {
                    now: now.clone(),
                    before: before.clone(),
                    factor,
                })
            })
            .collect();
        (found, shared)
    }

    /// What was measured and cannot be judged, since the baseline has no such quantity: in a few
    /// words, whole scenes by their names alone.
    pub fn unknown_to(&self, baseline: &Self) -> Vec<String> {
        let known = |m: &Metric| baseline.results.iter().any(|b| b.key() == m.key());
        let mut out: Vec<String> = Vec::new();
        for m in self.results.iter().filter(|m| !known(m)) {
            let group = |o: &&Metric| (&o.scene, o.threads) == (&m.scene, m.threads);
            let scene = format!("{} on {} threads", m.scene, m.threads);
            let name = match self.results.iter().filter(group).any(known) {
                true => format!("{} {} of {scene}", m.metric, m.backend).replace("  ", " "),
                false => format!("all of {scene}"),
            };
            if !out.contains(&name) {
                out.push(name);
            }
        }
        out
    }

    /// The line that programs read.
    pub fn line(&self) -> String {
        // Numbers and text always become JSON.
        let json = serde_json::to_string(self).unwrap_or_default();
        format!("{PREFIX}{json}\n")
    }

    /// Reads what [`line`](Self::line) wrote: alone, or among other lines.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let line = text.lines().find_map(|l| l.strip_prefix(PREFIX));
        let record: Self = serde_json::from_str(line.unwrap_or(text))
            .map_err(|e| format!("no benchmark ({e})"))?;
        if record.schema != SCHEMA {
            return Err(format!("has schema '{}', not '{SCHEMA}'", record.schema));
        }
        Ok(record)
    }

    /// A table for people: per scene and thread count one row per metric, backends side by side
    /// with the ratio of the second to the first.
    pub fn table(&self) -> String {
        let mut out = String::new();
        let mut last = None;
        for m in &self.results {
            let group = (m.scene.as_str(), m.threads);
            let mut side = self
                .results
                .iter()
                .filter(|o| (o.scene.as_str(), o.threads) == group && o.metric == m.metric);
            // Each row once, where its first backend stands.
            if side.clone().next().map(Metric::key) != Some(m.key()) {
                continue;
            }
            if last != Some(group) {
                let names: Vec<&str> = self.backends_of(group);
                // Writing to a string does not fail.
                let _ = write!(out, "\n{} on {} threads\n{:>24}", m.scene, m.threads, "");
                for n in names {
                    let _ = write!(out, " {n:>24}");
                }
                out.push('\n');
                last = Some(group);
            }
            let _ = write!(out, "{:>24}", m.metric);
            let first = side.next();
            if let Some(a) = first {
                let _ = write!(out, " {:>24}", value(a));
                for b in side {
                    let _ = write!(out, " {:>24}  x{:.2}", value(b), b.median / a.median);
                }
            }
            out.push('\n');
        }
        out
    }

    fn backends_of(&self, (scene, threads): (&str, usize)) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for m in &self.results {
            let here = m.scene == scene && m.threads == threads;
            if here && !m.backend.is_empty() && !names.contains(&m.backend.as_str()) {
                names.push(&m.backend);
            }
        }
        names
    }

    /// How the metrics change with threads and with the size of the scene: a row per metric and
    /// backend, a column per scene and thread count; empty if there is but one. Beside a value, how
    /// many times better it is than the same scene's on the fewest threads.
    pub fn scaling(&self) -> String {
        let mut columns: Vec<(&str, usize)> = Vec::new();
        let mut rows: Vec<(&str, &str)> = Vec::new();
        for m in &self.results {
            let (c, r) = (
                (m.scene.as_str(), m.threads),
                (m.metric.as_str(), m.backend.as_str()),
            );
            if !columns.contains(&c) {
                columns.push(c);
            }
            if !rows.contains(&r) {
                rows.push(r);
            }
        }
        if columns.len() < 2 {
            return String::new();
        }
        let mut out = format!("\n{:>32}", "scaling");
        for (scene, threads) in &columns {
            // Writing to a string does not fail.
            let _ = write!(out, " {:>18}", format!("{scene} x{threads}"));
        }
        out.push('\n');
        for row in rows {
            let _ = write!(out, "{:>32}", format!("{} {}", row.0, row.1));
            for c in &columns {
                let found = self
                    .results
                    .iter()
                    .find(|m| m.key() == (c.0, c.1, row.1, row.0));
                let text = found.map_or(String::new(), |m| {
                    let mut text = format!("{} {}", short(m.median), m.unit);
                    if let Some(gain) = self.gain(m) {
                        text += &format!(" x{gain:.2}");
                    }
                    text
                });
                let _ = write!(out, " {text:>18}");
            }
            out.push('\n');
        }
        out
    }
}

impl Record {
    /// How many times better a metric is than on the fewest threads; `None` there, and where memory
    /// is measured.
    fn gain(&self, m: &Metric) -> Option<f64> {
        let same =
            |o: &&Metric| (&o.scene, &o.backend, &o.metric) == (&m.scene, &m.backend, &m.metric);
        let fewest = self.results.iter().filter(same).min_by_key(|o| o.threads)?;
        let comparable = matches!(m.unit.as_str(), "s" | "/s") && fewest.threads < m.threads;
        comparable.then(|| 1.0 / m.worse(fewest))
    }
}

/// The middle value with half the range of all, in percent.
fn value(m: &Metric) -> String {
    let spread = 50.0 * (m.high - m.low) / m.median.max(f64::MIN_POSITIVE);
    format!("{} {} ±{spread:.0}%", short(m.median), m.unit)
}

fn short(v: f64) -> String {
    match v {
        _ if v >= 1e6 => format!("{:.2}M", v * 1e-6),
        _ if v >= 1e4 => format!("{:.0}k", v * 1e-3),
        _ if v >= 100.0 => format!("{v:.0}"),
        _ if v >= 1.0 => format!("{v:.2}"),
        _ => format!("{v:.4}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(values: &[f64], more: bool) -> Record {
        let mut c = Collector {
            scene: "s",
            threads: 2,
            results: Vec::new(),
        };
        c.add("embree", "rate", ("1/s", more), values);
        Record {
            schema: SCHEMA.into(),
            seed: 1,
            commit: "c".into(),
            backends: vec!["Embree".into()],
            isa: "avx2".into(),
            processor: "p".into(),
            results: c.results,
        }
    }

    #[test]
    fn a_regression_is_beyond_tolerance_and_noise() {
        let before = record(&[100.0, 101.0, 99.0], true);
        let count = |values: &[f64], tolerance| {
            let (found, shared) = record(values, true).regressions(&before, tolerance);
            assert_eq!(shared, 1);
            found.len()
        };
        assert_eq!(count(&[80.0, 81.0, 79.0], 0.05), 1);
        assert_eq!(count(&[80.0, 81.0, 79.0], 0.5), 0, "within the tolerance");
        assert_eq!(count(&[80.0, 100.0, 79.0], 0.05), 0, "within the noise");
        assert_eq!(count(&[120.0, 121.0, 119.0], 0.05), 0, "better");
        // Where less is better.
        let slow = record(&[1.2, 1.21, 1.19], false);
        let fast = record(&[1.0, 1.01, 0.99], false);
        assert_eq!(slow.regressions(&fast, 0.05).0.len(), 1);
        // One repeat says nothing of the noise.
        let once = record(&[1.0], false);
        assert_eq!(slow.regressions(&once, 0.05), (Vec::new(), 0));
        // What is new has nothing to be worse than.
        let mut other = record(&[1.0], true);
        other.results[0].scene = "t".into();
        assert_eq!(other.regressions(&before, 0.05), (Vec::new(), 0));
    }

    #[test]
    fn what_the_baseline_does_not_know_is_named() {
        let before = record(&[1.0; 3], true);
        assert_eq!(before.unknown_to(&before), Vec::<String>::new());
        let mut now = record(&[1.0; 3], true);
        let also = |scene: &str, backend: &str, metric: &str| Metric {
            scene: scene.into(),
            backend: backend.into(),
            metric: metric.into(),
            ..before.results[0].clone()
        };
        now.results.push(also("s", "bvh", "rate"));
        now.results.push(also("s", "", "import"));
        now.results.push(also("t", "bvh", "rate"));
        now.results.push(also("t", "embree", "rate"));
        let named = [
            "rate bvh of s on 2 threads",
            "import of s on 2 threads",
            "all of t on 2 threads",
        ];
        assert_eq!(now.unknown_to(&before), named);
        // It is no regression, and what both know is judged still.
        assert_eq!(now.regressions(&before, 0.05), (Vec::new(), 1));
        // The other way round nothing is unknown.
        assert!(before.unknown_to(&now).is_empty());
    }

    #[test]
    fn scaling_tells_what_more_threads_gain() {
        let mut r = record(&[100.0], true);
        r.results[0].unit = "/s".into();
        assert_eq!(r.scaling(), "", "one column scales with nothing");
        let of = |threads, metric: &str, unit: &str, more, median| Metric {
            threads,
            metric: metric.into(),
            unit: unit.into(),
            more_is_better: more,
            median,
            ..r.results[0].clone()
        };
        r.results = vec![
            of(1, "rate", "/s", true, 100.0),
            of(1, "build", "s", false, 3.0),
            of(1, "peak", "B", false, 7.0),
            of(2, "rate", "/s", true, 195.0),
            of(2, "build", "s", false, 2.0),
            of(2, "peak", "B", false, 7.0),
        ];
        let table = r.scaling();
        let row = |name: &str| -> Vec<&str> {
            let found = table.lines().find(|l| l.trim_start().starts_with(name));
            found.unwrap_or("").split_whitespace().collect()
        };
        assert_eq!(
            row("rate"),
            ["rate", "embree", "100", "/s", "195", "/s", "x1.95"]
        );
        assert_eq!(
            row("build"),
            ["build", "embree", "3.00", "s", "2.00", "s", "x1.50"]
        );
        assert_eq!(row("peak"), ["peak", "embree", "7.00", "B", "7.00", "B"]);
    }

    #[test]
    fn the_line_is_read_again_among_others() {
        let r = record(&[1.5, 2.5], true);
        let text = format!("a table\n{}the end\n", r.line());
        assert_eq!(Record::parse(&text), Ok(r.clone()));
        assert!(Record::parse("{}").unwrap_err().contains("no benchmark"));
        let other = r.line().replace(SCHEMA, "x-9");
        assert!(Record::parse(&other).unwrap_err().contains("x-9"));
    }
}
