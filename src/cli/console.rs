//! Writing to the terminal. A reader that went away is no reason to fail, let alone to panic.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::path::Path;

use crate::error::{Error, Result};

/// Prints text on standard output.
///
/// # Errors
/// [`Error::File`] if it cannot be written, for instance to a full disk.
pub fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        // As in `dualight plugins | head -1`.
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| {
            Error::file(
                Path::new("standard output"),
                format!("could not be written ({e})"),
                "redirect it elsewhere",
            )
        }),
    }
}

/// Says one line on standard error, after the program's name.
pub fn say(message: impl Display) {
    // File names and backends may bring line breaks of their own.
    let line: Vec<String> = message.to_string().lines().map(String::from).collect();
    // There is nowhere left to complain.
    let _ = writeln!(io::stderr().lock(), "dualight: {}", line.join(" "));
}

/// Prints lines on standard error.
pub fn tell(text: &str) {
    let _ = io::stderr().lock().write_all(text.as_bytes());
}
