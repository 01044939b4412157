//! What a row of the catalogue reports: for every path what was tried, how often, the worst case
//! and the bound; and the table of rows in the documents, of which each test binary keeps a part.
//!
//! `DUALIGHT_HARDCASES=full` tries as many cases as the catalogue asks for where a test of every
//! day tries fewer.
#![allow(dead_code, reason = "each test binary uses its own part")]
#![allow(
    unreachable_pub,
    reason = "shared by binaries, each a crate of its own"
)]

use std::fmt::Write;

const DOCUMENT: &str = "docs/hardcases.md";

/// The bound of what is reported, but not held to anything.
pub const MEASURED: f64 = f64::INFINITY;

/// Paths that break the contract: they show what keeping it is for, and are held to nothing.
const UNBOUND: [&str; 1] = ["embree-fast"];

/// How many cases to try: all that the catalogue asks for, or as many as a test of every day has
/// time for.
pub fn cases(full: u64, daily: u64) -> u64 {
    let told = std::env::var("DUALIGHT_HARDCASES");
    if told.is_ok_and(|t| t == "full") {
        full
    } else {
        daily
    }
}

/// The name of a row and what measures it.
pub type Case = (&'static str, &'static str, fn(&mut Row));

/// Declares the rows of a test binary: one test each; one more, ignored, that writes their part
/// of the table; and one that holds the document to be complete.
macro_rules! rows {
    ($part:literal; $($id:ident: $name:literal in $file:ident;)*) => {
        const ROWS: &[report::Case] = &[$((stringify!($id), $name, $file::$id)),*];
        $(#[test]
        fn $id() {
            report::check($part, &(stringify!($id), $name, $file::$id));
        })*

        #[test]
        #[ignore = "writes a file"]
        fn write_the_table() {
            report::write($part, ROWS);
        }

        #[test]
        fn the_table_lists_every_row() {
            report::listed($part, ROWS);
        }
    };
}
pub(crate) use rows;

fn run(case: &Case) -> Row {
    let mut row = Row::new(case.0, case.1);
    (case.2)(&mut row);
    row
}

/// Measures a row, and holds it to its bounds and the document to what it measured.
pub fn check(part: &str, case: &Case) {
    let row = run(case);
    let mut failures = row.failures();
    let text = std::fs::read_to_string(DOCUMENT).unwrap();
    let table = sections(&text, part)[1];
    failures.extend(row.missing(table));
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}

/// The document before, in and after the part of a test binary.
fn sections<'a>(text: &'a str, part: &str) -> [&'a str; 3] {
    let begin = format!("<!-- written by tests/{part}: begin -->\n");
    let (head, rest) = text.split_once(&begin).unwrap();
    let (own, _) = rest.split_once("<!-- end -->").unwrap();
    [&text[..head.len() + begin.len()], own, &rest[own.len()..]]
}

/// Writes a part of the document.
pub fn write(part: &str, cases: &[Case]) {
    let mut table = String::new();
    let mut notes = String::new();
    let mut failures = Vec::new();
    for case in cases {
        let row = run(case);
        row.markdown(&mut table, &mut notes);
        failures.extend(row.failures());
    }
    let old = std::fs::read_to_string(DOCUMENT).unwrap();
    let [head, _, rest] = sections(&old, part);
    let header = "| row | case | path | what is measured | tried | cases | worst | bound |\n\
                  |---|---|---|---|---|---:|---:|---:|\n";
    if !notes.is_empty() {
        notes.insert_str(0, "\nNotes:\n\n");
    }
    let text = format!("{head}{header}{table}{notes}{rest}");
    std::fs::write(DOCUMENT, text).unwrap();
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}

/// Insists that a part of the document has every row.
pub fn listed(part: &str, cases: &[Case]) {
    let text = std::fs::read_to_string(DOCUMENT).unwrap();
    let own = sections(&text, part)[1];
    for (id, name, _) in cases {
        let id = id.to_uppercase();
        assert!(
            own.contains(&format!("| {id} | {name} |")) || own.contains(&format!("**{id}**")),
            "{id} {name} is not in {DOCUMENT}; write it again"
        );
    }
}

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

    /// Of what did not hold, the share among all.
    pub fn share(self) -> Self {
        Self {
            worst: self.worst / (self.n as f64).max(1.0),
            ..self
        }
    }

    /// Adds what another has seen that must hold.
    pub fn add(&mut self, o: Self) {
        self.n += o.n;
        self.worst += o.worst;
    }
}

struct Line {
    path: String,
    quantity: &'static str,
    tried: String,
    meter: Meter,
    bound: f64,
}

/// A row with what was found out about it.
pub struct Row {
    pub id: &'static str,
    pub name: &'static str,
    tried: String,
    lines: Vec<Line>,
    notes: Vec<String>,
}

impl Row {
    pub fn new(id: &'static str, name: &'static str) -> Self {
        Self {
            id,
            name,
            tried: String::new(),
            lines: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// What the lines from here on are tried with: ranges and seeds.
    pub fn tried(&mut self, text: impl Into<String>) {
        self.tried = text.into();
    }

    /// Reports a measurement on a path (`embree`, `bvh`, `dual`, `photons`, …).
    pub fn line(
        &mut self,
        path: impl Into<String>,
        quantity: &'static str,
        meter: Meter,
        bound: f64,
    ) {
        let path = path.into();
        let unbound = UNBOUND.contains(&path.as_str());
        self.lines.push(Line {
            path,
            quantity,
            tried: self.tried.clone(),
            meter,
            bound: if unbound { MEASURED } else { bound },
        });
    }

    /// Says what the numbers cannot.
    pub fn note(&mut self, text: impl Into<String>) {
        self.notes.push(text.into());
    }

    /// The lines that are worse than their bounds, tried nothing, or do not say what.
    pub fn failures(&self) -> Vec<String> {
        self.lines
            .iter()
            .filter(|l| !(l.meter.worst <= l.bound) || l.meter.n == 0 || l.tried.is_empty())
            .map(|l| {
                format!(
                    "{} {}, {}, {}, tried {:?}: worst {:e} of {}, bound {:e}",
                    self.id,
                    self.name,
                    l.path,
                    l.quantity,
                    l.tried,
                    l.meter.worst,
                    l.meter.n,
                    l.bound
                )
            })
            .collect()
    }

    /// What was measured, and with which bound, but is not in the document's table.
    pub fn missing(&self, table: &str) -> Vec<String> {
        self.lines
            .iter()
            .filter_map(|l| {
                let begin = self.begin(l);
                let end = format!("| {} |", number(l.bound));
                let found = table
                    .lines()
                    .any(|t| t.starts_with(&begin) && t.ends_with(&end));
                (!found).then(|| format!("{begin} …{end} is not in {DOCUMENT}; write it again"))
            })
            .collect()
    }

    /// What a line of the table begins with: all that does not depend on the machine.
    fn begin(&self, l: &Line) -> String {
        let id = self.id.to_uppercase();
        let tried = l.tried.replace('|', "\\|");
        format!(
            "| {id} | {} | {} | {} | {tried} |",
            self.name, l.path, l.quantity
        )
    }

    /// Lines of the table in Markdown, and notes below it.
    pub fn markdown(&self, table: &mut String, notes: &mut String) {
        for l in &self.lines {
            let _ = writeln!(
                table,
                "{} {} | {} | {} |",
                self.begin(l),
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
    if x == MEASURED {
        "measured".into()
    } else if x == 0.0 {
        "0".into()
    } else if (0.01..1e5).contains(&x) {
        let text = format!("{x:.3}");
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        format!("{x:.1e}")
    }
}
