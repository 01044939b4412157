//! Stopping early and telling how far things are: what a long stage needs from outside.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::time::Instant;

/// Why a run ended before it was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped {
    /// The user asked for it.
    Interrupted,
    /// The time was up.
    TimeLimit,
}

/// Hears of progress.
pub trait Reporter: Send + Sync {
    /// A stage begins that will do `total` units of work (0 if unknown), for instance
    /// `("pixels", "samples", 1_048_576)`.
    fn begin(&self, stage: &'static str, unit: &'static str, total: u64);
    /// The current stage has done `done` units so far; may be called from any thread, often.
    fn advance(&self, done: u64);
    /// How the current stage stands, in words that its counts do not say.
    fn note(&self, text: &str) {
        let _ = text;
    }
    /// The current stage is over.
    fn end(&self);
}

/// Says nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Reporter for Silent {
    fn begin(&self, _stage: &'static str, _unit: &'static str, _total: u64) {}
    fn advance(&self, _done: u64) {}
    fn end(&self) {}
}

/// The outside world of a run.
pub struct Control {
    stop: Arc<AtomicU8>,
    deadline: Option<Instant>,
    reporter: Box<dyn Reporter>,
}

impl Default for Control {
    fn default() -> Self {
        Self::new(Box::new(Silent), None)
    }
}

impl Control {
    /// Reports to `reporter` and stops at `deadline`, if there is one.
    pub fn new(reporter: Box<dyn Reporter>, deadline: Option<Instant>) -> Self {
        Self {
            stop: Arc::default(),
            deadline,
            reporter,
        }
    }

    /// One that stops when this one does and says nothing: for a part of the work whose stages
    /// are of no interest.
    pub fn silent(&self) -> Self {
        Self {
            stop: self.stop.clone(),
            deadline: self.deadline,
            reporter: Box::new(Silent),
        }
    }

    /// Asks the run to stop; it ends soon, with what it has.
    pub fn interrupt(&self) {
        self.stop.store(1, Ordering::Relaxed);
    }

    /// Whether, and why, the run should stop.
    pub fn stopped(&self) -> Option<Stopped> {
        match self.stop.load(Ordering::Relaxed) {
            1 => return Some(Stopped::Interrupted),
            2 => return Some(Stopped::TimeLimit),
            _ => {}
        }
        if self.deadline.is_some_and(|d| Instant::now() >= d) {
            self.stop.store(2, Ordering::Relaxed);
            return Some(Stopped::TimeLimit);
        }
        None
    }

    /// When the run stops by itself, if it does.
    pub fn deadline(&self) -> Option<Instant> {
        self.deadline
    }

    /// Begins a stage; it ends when the value is dropped.
    pub fn stage(&self, name: &'static str, unit: &'static str, total: u64) -> Stage<'_> {
        self.reporter.begin(name, unit, total);
        Stage {
            control: self,
            done: AtomicU64::new(0),
        }
    }
}

/// A stage that is under way.
pub struct Stage<'a> {
    control: &'a Control,
    done: AtomicU64,
}

impl Stage<'_> {
    /// `n` more units are done.
    pub fn advance(&self, n: u64) {
        let done = self.done.fetch_add(n, Ordering::Relaxed) + n;
        self.control.reporter.advance(done);
    }

    /// Tells how things stand in words.
    pub fn note(&self, text: &str) {
        self.control.reporter.note(text);
    }
}

impl Drop for Stage<'_> {
    fn drop(&mut self) {
        self.control.reporter.end();
    }
}
