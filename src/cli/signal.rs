//! Ctrl-C: the first stops the run, which writes what it has; the second exits at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::console;
use crate::control::Control;
use crate::output;

/// Lets Ctrl-C (and the polite signals of the system) stop `control`. Once per process.
pub(super) fn install(control: &Arc<Control>, quiet: bool) {
    let control = control.clone();
    let again = AtomicBool::new(false);
    let handler = move || {
        if again.swap(true, Ordering::Relaxed) {
            output::discard_unfinished();
            std::process::exit(130);
        }
        control.interrupt();
        if !quiet {
            console::say("stopping; what there is will be written (again: exit at once)");
        }
    };
    if let Err(e) = ctrlc::set_handler(handler) {
        // Rendering works without it; Ctrl-C then ends the process as it always does.
        console::say(format_args!("warning: Ctrl-C will write no image: {e}"));
    }
}
