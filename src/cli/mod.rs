//! The command line: what was typed ([`args`]), what it means ([`plan`]), and one function per
//! command.

mod accuracy;
pub mod args;
mod bench;
mod choice;
mod compare;
mod console;
mod diff;
mod format;
mod inspect;
mod keep;
mod machine;
pub mod measure_args;
pub mod photon_args;
mod photons;
pub mod plan;
mod plugins;
pub mod progress;
mod render;
mod reproduce;
mod signal;
mod summary;
pub mod values;

pub use console::{print, say, tell};

use crate::control::Stopped;
use crate::error::Result;
use args::{Cli, Command};

/// How a command ended that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// All was done.
    Done,
    /// All was done, and what was to be the same is not.
    Different,
    /// It was stopped, and what there was by then is written.
    Partial(Stopped),
    /// It was stopped before there was anything to write.
    Empty(Stopped),
}

impl Ending {
    /// The process's exit status.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Different => 1,
            Self::Partial(Stopped::TimeLimit) => 4,
            Self::Empty(Stopped::TimeLimit) => 1,
            Self::Partial(Stopped::Interrupted) | Self::Empty(Stopped::Interrupted) => 130,
        }
    }
}

/// Does what was typed.
///
/// # Errors
/// Anything that stops the command.
pub fn run(cli: &Cli) -> Result<Ending> {
    match &cli.command {
        Command::Render(args) => render::run(args),
        Command::Inspect(args) => inspect::run(args),
        Command::Plugins => plugins::run(),
        Command::Diff(args) => diff::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Accuracy(args) => accuracy::run(args),
        Command::Bench(args) => bench::run(args),
        Command::Photons(args) => photons::run(args),
        Command::Reproduce(args) => reproduce::run(args),
    }
}
