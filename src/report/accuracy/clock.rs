//! Which time is counted, and how finely it is told.

use std::time::Instant;

use super::Run;
use crate::stats::cpu_seconds;

/// Which time counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Clock {
    /// Seconds that pass
    #[default]
    Wall,
    /// Seconds of processors, all threads together: steadier where others use the machine too
    Cpu,
}

impl Clock {
    pub(super) fn of(self, run: &Run) -> f64 {
        match self {
            Self::Wall => run.seconds,
            Self::Cpu => run.cpu_seconds.max(1e-6),
        }
    }

    /// The least time that it tells from another, in seconds; found by watching it for a moment.
    pub(super) fn resolution(self) -> f64 {
        let begin = Instant::now();
        match self {
            Self::Wall => tick(|| begin.elapsed().as_secs_f64()),
            Self::Cpu => tick(|| cpu_seconds().unwrap_or(0.0)),
        }
    }

    /// What the axis says.
    pub fn label(self) -> &'static str {
        match self {
            Self::Wall => "seconds",
            Self::Cpu => "processor seconds",
        }
    }
}

/// How often a clock is watched until it moves on. The first time may begin between two ticks.
const TICKS: u32 = 4;

/// Readings of a clock that stands still, after which it is taken for one that has no ticks.
const MOST_READINGS: u32 = 4_000_000;

/// The smallest step by which a clock is seen to go on; 0 if it never does.
fn tick(read: impl Fn() -> f64) -> f64 {
    let step = |_| {
        let before = read();
        (0..MOST_READINGS)
            .map(|_| read() - before)
            .find(|d| *d > 0.0)
    };
    let least = (0..TICKS).map_while(step).reduce(f64::min);
    least.unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn the_step_of_a_clock_is_seen() {
        // Each reading takes 10 µs; the clock moves on every 10 ms, or every time.
        let reading = Cell::new(0.37);
        let clock = |step: f64| {
            reading.set(reading.get() + 1e-5);
            (reading.get() / step).floor() * step
        };
        for step in [1e-2, 1e-5] {
            let seen = tick(|| clock(step));
            assert!((seen / step - 1.0).abs() < 1e-6, "{seen} {step}");
        }
        assert_eq!(tick(|| 3.0), 0.0);
        let own = Clock::Wall.resolution();
        assert!(own > 0.0 && own < 0.1, "{own}");
    }
}
