//! Where the time goes.

use std::time::Instant;

use crate::stats::StageTime;

/// Takes the time of stages that follow one another.
pub(super) struct Clock {
    last: Instant,
    /// What was booked.
    pub(super) laps: Vec<StageTime>,
}

impl Default for Clock {
    fn default() -> Self {
        Self {
            last: Instant::now(),
            laps: Vec::new(),
        }
    }
}

impl Clock {
    /// As [`lap`](Self::lap), for two stages of which the first took `seconds`.
    pub(super) fn split(&mut self, first: &'static str, seconds: f64, second: &'static str) {
        let all = self.restart();
        self.add(first, seconds.min(all));
        self.add(second, (all - seconds).max(0.0));
    }

    /// Books the time since the last call.
    pub(super) fn lap(&mut self, stage: &'static str) {
        let seconds = self.restart();
        self.add(stage, seconds);
    }

    /// Takes over what another clock has booked, during a time that counts no more here.
    pub(super) fn take(&mut self, laps: Vec<StageTime>) {
        self.restart();
        for lap in laps {
            self.add(lap.stage, lap.seconds);
        }
    }

    fn restart(&mut self) -> f64 {
        let now = Instant::now();
        let seconds = (now - self.last).as_secs_f64();
        self.last = now;
        seconds
    }

    /// Stages that come again are one.
    pub(super) fn add(&mut self, stage: &'static str, seconds: f64) {
        match self.laps.iter_mut().find(|s| s.stage == stage) {
            Some(lap) => lap.seconds += seconds,
            None => self.laps.push(StageTime { stage, seconds }),
        }
    }
}
