//! What a row of the catalogue reports: for every path what was tried, how often, the worst case
//! and the bound.

use std::fmt::Write;

/// Keeps the worst of what it sees.
#[derive(Clone, Copy, Debug, Default)]
pub struct Meter {
    pub n: u64,
    pub worst: f64,
}

impl Meter {
    /// An error; what is no number is the worst of all.
    pub fn see(&mut self, x: f64) {
        self.n += 1;
        if x.is_nan() {
            self.worst = f64::INFINITY;
        } else if x > self.worst {
            self.worst = x;
        }
    }

    /// Something that must hold; the worst case is then the number of times it did not.
    pub fn must(&mut self, holds: bool) {
        self.n += 1;
        self.worst += f64::from(u8::from(!holds));
    }
}

struct Line {
    path: &'static str,
    quantity: &'static str,
    meter: Meter,
    bound: f64,
}

/// A row with what was found out about it.
pub struct Row {
    pub id: &'static str,
    pub name: &'static str,
    lines: Vec<Line>,
    notes: Vec<String>,
}

impl Row {
    pub fn new(id: &'static str, name: &'static str) -> Self {
        Self {
            id,
            name,
            lines: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Reports a measurement on a path (`embree`, `bvh`, `dual`, `photons`, …).
    pub fn line(&mut self, path: &'static str, quantity: &'static str, meter: Meter, bound: f64) {
        self.lines.push(Line {
            path,
            quantity,
            meter,
            bound,
        });
    }

    /// Says what the numbers cannot.
    pub fn note(&mut self, text: impl Into<String>) {
        self.notes.push(text.into());
    }

    /// The lines that are worse than their bounds, or tried nothing.
    pub fn failures(&self) -> Vec<String> {
        self.lines
            .iter()
            .filter(|l| !(l.meter.worst <= l.bound) || l.meter.n == 0)
            .map(|l| {
                format!(
                    "{} {}, {}, {}: worst {:e} of {}, bound {:e}",
                    self.id, self.name, l.path, l.quantity, l.meter.worst, l.meter.n, l.bound
                )
            })
            .collect()
    }

    /// Lines of the table in Markdown, and notes below it.
    pub fn markdown(&self, table: &mut String, notes: &mut String) {
        for l in &self.lines {
            let _ = writeln!(
                table,
                "| {} | {} | {} | {} | {} | {} | {} |",
                self.id.to_uppercase(),
                self.name,
                l.path,
                l.quantity,
                l.meter.n,
                number(l.meter.worst),
                number(l.bound),
            );
        }
        for note in &self.notes {
            let _ = writeln!(notes, "- **{}**: {note}", self.id.to_uppercase());
        }
    }
}

fn number(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else if (0.01..1e5).contains(&x) {
        let text = format!("{x:.3}");
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        format!("{x:.1e}")
    }
}
