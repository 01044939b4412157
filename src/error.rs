//! What can go wrong, by stage; each message names the thing, the place in it and the remedy.

use std::path::{Path, PathBuf};

/// Anything that stops a command.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// What was typed makes no sense.
    #[error("{0}")]
    Usage(String),
    /// No plugin has that name.
    #[error("unknown {kind} '{name}'; known: {known}")]
    UnknownPlugin {
        /// Family, for instance "integrator".
        kind: &'static str,
        /// What was asked for.
        name: String,
        /// All names, comma-separated.
        known: String,
    },
    /// A scene file is broken.
    #[error("{}: {place}: {problem}; {remedy}", path.display())]
    Scene {
        /// The file.
        path: PathBuf,
        /// Where in it, for instance a JSON path.
        place: String,
        /// What is wrong.
        problem: String,
        /// What to do.
        remedy: String,
    },
    /// A scene file requires something that Dualight cannot do.
    #[error("{}: {place}: {problem}; {remedy}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Where in it.
        place: String,
        /// What is required.
        problem: String,
        /// What to do.
        remedy: String,
    },
    /// The ray tracing backend failed.
    #[error("{backend}: {problem}; {remedy}")]
    Accelerator {
        /// Its name.
        backend: &'static str,
        /// What it said.
        problem: String,
        /// What to do.
        remedy: String,
    },
    /// A file could not be read or written.
    #[error("{}: {problem}; {remedy}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        problem: String,
        /// What to do.
        remedy: String,
    },
}

/// Result of anything that can stop a command.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// The process's exit status: 1 rendering or I/O failed, 2 usage, 3 the file requires
    /// something unsupported.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::UnknownPlugin { .. } => 2,
            Self::Unsupported { .. } => 3,
            _ => 1,
        }
    }

    /// A file could not be read or written.
    pub fn file(path: &Path, problem: impl ToString, remedy: &str) -> Self {
        Self::File {
            path: path.into(),
            problem: problem.to_string(),
            remedy: remedy.into(),
        }
    }
}
