//! Decoders that are not ours: what they make of hostile data must neither take the program down nor
//! say more than one line.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// Whether this thread is at such work.
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Does work that may panic, which is not reported on the standard error stream; panics elsewhere are.
/// `None` if it does: then the data is at fault.
pub(super) fn quietly<T>(work: impl FnOnce() -> T) -> Option<T> {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !QUIET.get() {
                report(info);
            }
        }));
    });
    QUIET.set(true);
    // What the work was at is not looked at again.
    let done = panic::catch_unwind(AssertUnwindSafe(work));
    QUIET.set(false);
    done.ok()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

    use std::process::Command;
    use std::thread;

    use super::*;

    /// Set in a process that is to panic.
    const PANIC: &str = "DUALIGHT_TEST_PANIC";

    #[test]
    fn only_panics_of_others_are_reported() {
        if std::env::var_os(PANIC).is_some() {
            assert_eq!(quietly::<()>(|| panic!("kept back")), None);
            assert_eq!(quietly(|| 3), Some(3));
            assert!(thread::spawn(|| panic!("told")).join().is_err());
            return;
        }
        let out = Command::new(std::env::current_exe().unwrap())
            .args(["import::quiet::tests::only_panics_of_others_are_reported"])
            .args(["--exact", "--nocapture"])
            .env(PANIC, "1")
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&out.stderr);
        assert!(out.status.success(), "{text}");
        assert_eq!(text.matches("panicked").count(), 1, "{text}");
        assert!(
            text.contains("told") && !text.contains("kept back"),
            "{text}"
        );
    }
}
