//! The command line's front door: parse, run, tell, exit.

use std::process::ExitCode;

use dualight::cli::{self, args::Refusal};

fn main() -> ExitCode {
    let ending = match cli::args::parse(std::env::args_os()) {
        Ok(typed) => cli::run(&typed).map(cli::Ending::exit_code),
        Err(Refusal::Asked(text)) => cli::print(&text).map(|()| 0),
        Err(Refusal::Help(text)) => {
            cli::tell(&text);
            Ok(2)
        }
        Err(Refusal::Error(line)) => {
            cli::say(format_args!("error: {line}"));
            Ok(2)
        }
    };
    ExitCode::from(ending.unwrap_or_else(|e| {
        cli::say(format_args!("error: {e}"));
        e.exit_code()
    }))
}
