//! Progress: bars on a terminal, a plain line every few seconds elsewhere.

use std::fmt::Write as _;
use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

use super::format;
use crate::control::{Reporter, Silent};

/// Time between two plain lines.
const INTERVAL: Duration = Duration::from_secs(5);

/// The reporter that suits standard error.
pub fn reporter(quiet: bool) -> Box<dyn Reporter> {
    if quiet {
        Box::new(Silent)
    } else if io::stderr().is_terminal() {
        Box::new(Bars::default())
    } else {
        Box::new(Lines::new(Box::new(io::stderr()), INTERVAL))
    }
}

fn lock<T>(m: &Mutex<T>) -> MutexGuard<'_, T> {
    m.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One bar for the current stage; a spinner if its work is not known. Gone when it is over.
#[derive(Debug, Default)]
pub struct Bars {
    current: Mutex<Option<ProgressBar>>,
    done: AtomicU64,
}

impl Reporter for Bars {
    fn begin(&self, stage: &'static str, unit: &'static str, total: u64) {
        let bar = if total == 0 {
            ProgressBar::new_spinner()
                .with_style(style("{prefix:>12} {spinner} {elapsed} {msg}", unit))
        } else {
            ProgressBar::new(total).with_style(style(
                "{prefix:>12} {bar:32} {percent:>3}%  {rate}  {left}",
                unit,
            ))
        };
        bar.set_prefix(stage);
        bar.enable_steady_tick(Duration::from_millis(200));
        self.done.store(0, Ordering::Relaxed);
        if let Some(old) = lock(&self.current).replace(bar) {
            old.finish_and_clear();
        }
    }

    fn advance(&self, done: u64) {
        // Reports of several threads may overtake one another.
        if self.done.fetch_max(done, Ordering::Relaxed) < done
            && let Ok(Some(bar)) = self.current.try_lock().as_deref()
        {
            bar.set_position(done);
        }
    }

    fn note(&self, text: &str) {
        if let Some(bar) = &*lock(&self.current) {
            bar.set_message(text.to_owned());
        }
    }

    fn end(&self) {
        if let Some(bar) = lock(&self.current).take() {
            bar.finish_and_clear();
        }
    }
}

fn style(template: &str, unit: &'static str) -> ProgressStyle {
    ProgressStyle::with_template(template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .with_key(
            "rate",
            move |s: &ProgressState, w: &mut dyn std::fmt::Write| {
                // A terminal that cannot be written to shows no bar either.
                let _ = write!(w, "{} {unit}/s", format::count(s.per_sec()));
            },
        )
        .with_key("left", |s: &ProgressState, w: &mut dyn std::fmt::Write| {
            let left = time_left(s.pos(), s.len().unwrap_or(0), s.elapsed());
            let _ = write!(w, "{} left", format::span(left.unwrap_or_default()));
        })
}

/// A line every few seconds: stage, percent, rate, time left.
pub struct Lines {
    out: Mutex<(Box<dyn Write + Send>, Option<Running>)>,
    interval: Duration,
    epoch: Instant,
    /// Milliseconds from the epoch to the next line: what most calls look at only.
    due: AtomicU64,
}

struct Running {
    stage: &'static str,
    unit: &'static str,
    total: u64,
    start: Instant,
}

impl Lines {
    /// Writes to `out`, a line per `interval` at most.
    pub fn new(out: Box<dyn Write + Send>, interval: Duration) -> Self {
        Self {
            out: Mutex::new((out, None)),
            interval,
            epoch: Instant::now(),
            due: AtomicU64::new(interval.as_millis() as u64),
        }
    }
}

impl Lines {
    /// Whether the next line is due. Of the threads that see that it is, one may speak.
    fn is_time(&self) -> bool {
        let now = self.epoch.elapsed().as_millis() as u64;
        let due = self.due.load(Ordering::Relaxed);
        let next = now + self.interval.as_millis() as u64;
        now >= due
            && (self.due)
                .compare_exchange(due, next, Ordering::Relaxed, Ordering::Relaxed)
                .is_ok()
    }
}

impl Reporter for Lines {
    fn begin(&self, stage: &'static str, unit: &'static str, total: u64) {
        lock(&self.out).1 = Some(Running {
            stage,
            unit,
            total,
            start: Instant::now(),
        });
    }

    fn advance(&self, done: u64) {
        if !self.is_time() {
            return;
        }
        let mut guard = lock(&self.out);
        let (out, running) = &mut *guard;
        if let Some(r) = running {
            // A closed standard error must not end the rendering.
            let _ = out.write_all(r.line(done, r.start.elapsed()).as_bytes());
        }
    }

    fn note(&self, text: &str) {
        if !self.is_time() {
            return;
        }
        let mut guard = lock(&self.out);
        let (out, running) = &mut *guard;
        if let Some(r) = running {
            let line = format!("dualight: {}: {text}\n", r.stage);
            let _ = out.write_all(line.as_bytes());
        }
    }

    fn end(&self) {
        lock(&self.out).1 = None;
    }
}

impl Running {
    fn line(&self, done: u64, elapsed: Duration) -> String {
        let seconds = elapsed.as_secs_f64();
        let rate = done as f64 / seconds.max(1e-9);
        let mut line = format!("dualight: {}: ", self.stage);
        // Writing to a string does not fail.
        let _ = match self.total {
            0 => write!(line, "{} {}", format::count(done as f64), self.unit),
            n => write!(line, "{}%", (done.min(n) as f64 / n as f64 * 100.0) as u64),
        };
        let _ = write!(line, ", {} {}/s", format::count(rate), self.unit);
        if let Some(left) = time_left(done, self.total, elapsed) {
            let _ = write!(line, ", {} left", format::span(left));
        }
        line.push('\n');
        line
    }
}

/// How long work still takes that goes on as it did; unknown at its start. (Not what `indicatif`
/// makes of the last seconds: blocks of pixels differ.)
fn time_left(done: u64, total: u64, elapsed: Duration) -> Option<Duration> {
    if total == 0 || done == 0 {
        return None;
    }
    let left = total.saturating_sub(done) as f64 / done as f64;
    Duration::try_from_secs_f64(left * elapsed.as_secs_f64()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[derive(Clone, Default)]
    struct Shared(Arc<Mutex<Vec<u8>>>);

    impl Write for Shared {
        fn write(&mut self, b: &[u8]) -> io::Result<usize> {
            lock(&self.0).write(b)
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_line_tells_stage_percent_rate_and_time_left() {
        let r = Running {
            stage: "pixels",
            unit: "samples",
            total: 1_000_000,
            start: Instant::now(),
        };
        assert_eq!(
            r.line(250_000, Duration::from_secs(10)),
            "dualight: pixels: 25%, 25.0k samples/s, 30 s left\n"
        );
        let r = Running { total: 0, ..r };
        assert_eq!(
            r.line(5, Duration::from_secs(1)),
            "dualight: pixels: 5 samples, 5 samples/s\n"
        );
    }

    #[test]
    fn the_time_left_is_right_within_a_quarter_after_the_first_tenth() {
        let mut rng = crate::sampling::Rng::new(1);
        for _ in 0..100 {
            // Blocks of pixels that take from a third to three times as long as one another, in an
            // order that knows nothing of it; the clock is made up.
            let blocks: Vec<f64> = (0..400)
                .map(|_| 0.01 * 9f64.powf(rng.next_1d() - 0.5))
                .collect();
            let whole: f64 = blocks.iter().sum();
            let mut now = 0.0;
            for (i, block) in blocks.iter().enumerate() {
                now += block;
                let done = i as u64 + 1;
                if now > 0.1 * whole {
                    let left = time_left(done, 400, Duration::from_secs_f64(now));
                    let end = now + left.map_or(f64::NAN, |l| l.as_secs_f64());
                    assert!(
                        (end - whole).abs() < 0.25 * whole,
                        "{end} of {whole} at {now}"
                    );
                }
            }
        }
    }

    #[test]
    fn lines_come_no_faster_than_the_interval() {
        let out = Shared::default();
        let lines = Lines::new(Box::new(out.clone()), Duration::from_secs(3600));
        lines.begin("pixels", "samples", 10);
        (0..10).for_each(|n| lines.advance(n));
        assert!(lock(&out.0).is_empty());
        let lines = Lines::new(Box::new(out.clone()), Duration::ZERO);
        lines.begin("pixels", "samples", 10);
        lines.advance(3);
        lines.end();
        lines.advance(4);
        assert_eq!(lock(&out.0).iter().filter(|b| **b == b'\n').count(), 1);
    }

    #[test]
    fn bars_survive_any_order_of_calls() {
        let bars = Bars::default();
        bars.advance(1);
        bars.end();
        bars.begin("a", "units", 2);
        bars.begin("b", "units", 0);
        bars.advance(5);
        bars.advance(1);
        bars.end();
    }
}
