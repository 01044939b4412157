//! Output formats: how a developed [`Image`] becomes a file. A format is one file and one line in
//! [`OUTPUTS`]; it encodes into a [`Sink`] and never sees a path, so every format is written
//! atomically.

mod atomic;
mod checkpoint;
mod exr;
mod png;

pub use atomic::{check_writable, discard_unfinished, write_atomically};
pub use checkpoint::{Checkpoint, fingerprint};
pub use exr::read;
pub use png::display_bytes;

use std::io::{self, Seek, Write};
use std::path::Path;

use crate::error::{Error, Result};
use crate::film::Image;
use crate::registry::Table;

/// Where a format writes to.
pub trait Sink: Write + Seek {}

impl<T: Write + Seek> Sink for T {}

/// What formats are told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OutputSettings {
    /// Exposure in stops, for formats that store what a display shows.
    pub exposure: f64,
}

/// What an image's file tells of its making, in formats that can hold it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// The command that made it.
    pub command_line: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Camera samples per pixel.
    pub spp: u32,
    /// Wall-clock seconds from the start of the command to the finished film.
    pub render_seconds: f64,
}

impl Metadata {
    /// Name and version of this software.
    pub const SOFTWARE: &str = concat!("Dualight ", env!("CARGO_PKG_VERSION"));

    /// The commit this software was built from, if that is known.
    pub const COMMIT: Option<&str> = option_env!("DUALIGHT_GIT_COMMIT");
}

/// An output format that can be chosen.
#[derive(Clone, Copy, Debug)]
pub struct OutputEntry {
    /// Name.
    pub name: &'static str,
    /// One sentence.
    pub doc: &'static str,
    /// File name extensions in lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// Encodes the image.
    pub encode: fn(&Image, &OutputSettings, &Metadata, &mut dyn Sink) -> io::Result<()>,
}

crate::registry::impl_entry!(OutputEntry, "output format");

/// The output formats.
pub static OUTPUTS: &[OutputEntry] = &[exr::ENTRY, png::ENTRY];

/// The format that the extension of `path` names.
///
/// # Errors
/// [`Error::Usage`] with the list of known extensions.
pub fn format_of<'a>(outputs: &'a Table<OutputEntry>, path: &Path) -> Result<&'a OutputEntry> {
    let extension = path
        .extension()
        .map(|e| e.to_string_lossy().to_lowercase())
        .unwrap_or_default();
    let entries = outputs.entries();
    entries
        .iter()
        .find(|e| e.extensions.contains(&extension.as_str()))
        .ok_or_else(|| {
            let known: Vec<String> = entries
                .iter()
                .flat_map(|e| e.extensions)
                .map(|e| format!(".{e}"))
                .collect();
            Error::Usage(format!(
                "{}: the extension chooses the format and must be one of {}",
                path.display(),
                known.join(", ")
            ))
        })
}

/// Writes the image in the format that the extension of `path` names: all of it, or nothing.
///
/// # Errors
/// An extension that no format has; a file that cannot be written.
pub fn write(
    outputs: &Table<OutputEntry>,
    image: &Image,
    settings: &OutputSettings,
    metadata: &Metadata,
    path: &Path,
) -> Result<()> {
    let format = format_of(outputs, path)?;
    write_atomically(path, |sink| {
        (format.encode)(image, settings, metadata, sink)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::Entry;

    #[test]
    fn the_extension_chooses_and_an_unknown_one_lists_the_known() {
        let table = Table::new(OUTPUTS);
        let name = |p: &str| format_of(&table, Path::new(p)).map(Entry::name);
        assert_eq!(name("a/b.EXR").unwrap(), "exr");
        assert_eq!(name("b.tar.png").unwrap(), "png");
        for bad in ["b.jpg", "exr", ".exr", "dir.exr/"] {
            match name(bad) {
                Ok(format) => assert_eq!(bad, "dir.exr/", "taken for {format}"),
                Err(e) => assert!(e.to_string().contains(".exr, .png"), "{e}"),
            }
        }
    }

    #[test]
    fn every_format_has_its_own_extensions_in_lower_case() {
        let mut all: Vec<_> = OUTPUTS.iter().flat_map(|e| e.extensions).collect();
        assert!(all.iter().all(|e| **e == e.to_lowercase()));
        all.sort();
        let n = all.len();
        all.dedup();
        assert_eq!(all.len(), n);
    }
}
