//! Work shared by threads whose results are taken in order, while the rest is still under way.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Results that have come, and those that wait for an earlier one.
struct Queue<T, F> {
    next: u64,
    waiting: BTreeMap<u64, T>,
    take: F,
}

impl<T, F: FnMut(T)> Queue<T, F> {
    fn put(&mut self, index: u64, result: T) {
        self.waiting.insert(index, result);
        while let Some(result) = self.waiting.remove(&self.next) {
            (self.take)(result);
            self.next += 1;
        }
    }
}

/// Calls `work` for `0..n` on all threads of the pool, and `take` for every result in that order.
/// No more wait at a time than the threads run apart: what is taken is not held twice, and taking
/// hides behind working.
pub(super) fn in_order<T: Send>(
    n: u64,
    work: impl Fn(u64) -> T + Sync,
    take: impl FnMut(T) + Send,
) {
    let begun = AtomicU64::new(0);
    let queue = Mutex::new(Queue {
        next: 0,
        waiting: BTreeMap::new(),
        take,
    });
    rayon::broadcast(|_| {
        loop {
            let index = begun.fetch_add(1, Ordering::Relaxed);
            if index >= n {
                break;
            }
            let result = work(index);
            let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
            queue.put(index, result);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_whatever_the_threads_do() {
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| {
                let mut got = Vec::new();
                // The early ones take longest.
                let work = |i: u64| {
                    (0..1000 - i).for_each(|k| _ = std::hint::black_box(k));
                    i
                };
                in_order(1000, work, |i| got.push(i));
                assert_eq!(got, (0..1000).collect::<Vec<_>>());
                in_order(0, |i| i, |_| panic!("there is none"));
            });
        }
    }
}
