//! `dualight plugins`.

use std::fmt::Write;

use super::{Ending, console};
use crate::error::Result;
use crate::plugins::Registry;

/// Lists every family with its plugins.
pub(super) fn run() -> Result<Ending> {
    let mut out = String::new();
    for (kind, plugins) in Registry::builtin().families() {
        // Writing to a string does not fail.
        let _ = writeln!(out, "{kind}");
        for (name, doc) in plugins {
            let _ = writeln!(out, "  {name:<14} {doc}");
        }
    }
    console::print(&out)?;
    Ok(Ending::Done)
}
