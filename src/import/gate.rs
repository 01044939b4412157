//! How much of a file's compressed geometry may be decoded at once. A decoder needs several times
//! the memory of what it makes, and with one of them on every thread a file would take several
//! times its own size.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Lets work begin as long as what is in memory stays below a bound.
pub(super) struct Gate {
    /// Bytes that may be in memory.
    limit: usize,
    /// What those at work may need, and what has been made.
    taken: Mutex<Taken>,
    left: Condvar,
}

#[derive(Default)]
struct Taken {
    workers: usize,
    bytes: usize,
}

impl Gate {
    /// For geometry that takes `total` bytes once it is all there.
    pub(super) fn new(total: usize) -> Self {
        Self {
            // The rest of twice the size is for whatever else there is.
            limit: total.saturating_mul(7) / 4,
            taken: Mutex::default(),
            left: Condvar::new(),
        }
    }

    /// Does work that needs `need` bytes and leaves `made`; waits for others first if there is no
    /// room for it beside theirs. The work must not wait for other threads.
    pub(super) fn pass<T>(&self, need: usize, made: usize, work: impl FnOnce() -> T) -> T {
        let mut taken = self.lock();
        while taken.workers > 0 && taken.bytes.saturating_add(need) > self.limit {
            taken = self
                .left
                .wait(taken)
                .unwrap_or_else(PoisonError::into_inner);
        }
        taken.workers += 1;
        taken.bytes = taken.bytes.saturating_add(need);
        drop(taken);
        // Even where the work panics, the others go on.
        struct Leave<'g>(&'g Gate, usize);
        impl Drop for Leave<'_> {
            fn drop(&mut self) {
                let mut taken = self.0.lock();
                taken.workers -= 1;
                taken.bytes = taken.bytes.saturating_sub(self.1);
                self.0.left.notify_all();
            }
        }
        let _leave = Leave(self, need.saturating_sub(made));
        work()
    }

    fn lock(&self) -> MutexGuard<'_, Taken> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn what_is_at_work_at_once_stays_below_the_limit() {
        // Sixteen pieces of 10, each of which needs 30 while it is made: the limit is 280.
        let gate = Gate::new(160);
        let (now, most, made) = (
            AtomicUsize::new(0),
            AtomicUsize::new(0),
            AtomicUsize::new(0),
        );
        std::thread::scope(|s| {
            for _ in 0..16 {
                s.spawn(|| {
                    gate.pass(30, 10, || {
                        let here = now.fetch_add(30, Ordering::SeqCst) + 30;
                        most.fetch_max(here, Ordering::SeqCst);
                        std::thread::sleep(std::time::Duration::from_millis(2));
                        now.fetch_sub(20, Ordering::SeqCst);
                    });
                    made.fetch_add(10, Ordering::SeqCst);
                });
            }
        });
        assert_eq!(made.into_inner(), 160);
        assert!(most.into_inner() <= 280);
        // What alone is too much goes alone.
        assert_eq!(gate.pass(1000, 1000, || 7), 7);
    }
}
