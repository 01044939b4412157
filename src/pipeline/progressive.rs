//! Rendering until the image is good enough: independent passes, whose spread tells the error.

use std::time::{Duration, Instant};

use super::{PhotonFile, Prepared};
use crate::film::Film;
use crate::photons::{PhotonPass, PhotonSettings, SAMPLES_PER_PASS};

/// Samples of a pixel in the first pass. Later ones grow, see [`PhotonPass`].
const FIRST: u32 = 4;

/// Fewest photons in a kernel.
const FEWEST_NEAREST: usize = 8;

/// When a rendering in independent passes ends, besides by its samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progressive {
    /// At this estimated relative mean squared error.
    pub target_error: Option<f64>,
}

/// What a rendering in passes is told by whoever waits for it.
pub struct Session<'a> {
    /// The film to go on from, of the same settings.
    pub film: Option<Film>,
    /// Seconds that this film took.
    pub seconds: f64,
    /// Sees the film now and then.
    pub watch: &'a mut (dyn FnMut(&Film, &Standing) + Send),
    /// A file that photons are kept in; not with [`Progressive`].
    pub photons: Option<PhotonFile>,
    /// What was built already, of the same scene by the same backend.
    pub prepared: Option<Prepared>,
}

/// How far a rendering in passes is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Standing {
    /// Whether a pass has just ended.
    pub at_end_of_pass: bool,
    /// Samples per pixel of the finished passes.
    pub samples: u32,
    /// Estimated relative mean squared error of the image, once two passes are finished.
    pub error: Option<f64>,
    /// Samples per pixel that it will have when it is done, by estimate.
    pub samples_needed: Option<f64>,
    /// Seconds of rendering so far, those before it was resumed included.
    pub seconds: f64,
    /// Seconds that are left, by estimate.
    pub seconds_left: Option<f64>,
}

/// The pass of a number: smaller than in a rendering of known length, so that there are several
/// soon; fewer photons in a kernel, by the balance of noise and bias.
pub(super) fn pass(settings: &PhotonSettings, number: u32) -> PhotonPass {
    let share = f64::from(FIRST) / f64::from(SAMPLES_PER_PASS);
    let part = |n: u64| (n as f64 * share) as u64;
    let nearest = (settings.nearest as f64 * share.powf(2.0 / 3.0)).round() as usize;
    let first = PhotonSettings {
        global: part(settings.global).max(1),
        caustic: part(settings.caustic).max(1),
        nearest: nearest.max(FEWEST_NEAREST.min(settings.nearest)),
        ..settings.clone()
    };
    PhotonPass::new(&first, FIRST, number)
}

/// Watches the clock and the error.
pub(super) struct Forecast {
    target: Option<f64>,
    limit: u32,
    deadline: Option<Instant>,
    start: Instant,
    /// Samples per pixel and seconds that were there already.
    before: (u32, f64),
}

impl Forecast {
    pub(super) fn new(
        target: Option<f64>,
        limit: u32,
        deadline: Option<Instant>,
        before: (u32, f64),
    ) -> Self {
        Self {
            target,
            limit,
            deadline,
            start: Instant::now(),
            before,
        }
    }

    /// How things stand.
    pub(super) fn standing(&self, film: &Film, samples: u32, at_end_of_pass: bool) -> Standing {
        let error = at_end_of_pass.then(|| film.estimated_error()).flatten();
        let to_deadline = self
            .deadline
            .map(|d| d.saturating_duration_since(Instant::now()).as_secs_f64());
        let own = self.start.elapsed().as_secs_f64();
        Standing {
            at_end_of_pass,
            ..self.foresee(samples, error, own, to_deadline)
        }
    }

    /// How things stand with so many samples per pixel and such an error after `own` seconds; the
    /// deadline is `to_deadline` seconds away, if there is one.
    fn foresee(
        &self,
        samples: u32,
        error: Option<f64>,
        own: f64,
        to_deadline: Option<f64>,
    ) -> Standing {
        // The squared error falls as one over the samples.
        let by_error = match (self.target, error) {
            (Some(target), Some(error)) => Some(f64::from(samples) * error / target),
            _ => None,
        };
        let by_limit = (self.limit != u32::MAX).then(|| f64::from(self.limit));
        let needed = [by_error, by_limit].into_iter().flatten().reduce(f64::min);
        let taken = samples.saturating_sub(self.before.0);
        let by_samples = needed
            .filter(|_| taken > 0)
            .map(|n| (n - f64::from(samples)).max(0.0) * own / f64::from(taken));
        Standing {
            at_end_of_pass: false,
            samples,
            error,
            samples_needed: needed,
            seconds: self.before.1 + own,
            seconds_left: [by_samples, to_deadline]
                .into_iter()
                .flatten()
                .reduce(f64::min),
        }
    }
}

impl Standing {
    /// Whether the image is good enough.
    pub(super) fn reached(&self, target: Option<f64>) -> bool {
        matches!((self.error, target), (Some(e), Some(t)) if e <= t)
    }

    /// In words.
    pub(super) fn text(&self) -> String {
        let mut out = format!("{} samples per pixel", self.samples);
        if let Some(e) = self.error {
            out += &format!(", relMSE about {e:.2e}");
        }
        if let Some(left) = self.seconds_left {
            let left = Duration::try_from_secs_f64(left).unwrap_or(Duration::MAX);
            out += &match left.as_secs() {
                s @ 0..60 => format!(", {s} s left"),
                s @ 60..3600 => format!(", {} min {} s left", s / 60, s % 60),
                s => format!(", {} h {} min left", s / 3600, s / 60 % 60),
            };
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> PhotonSettings {
        PhotonSettings {
            seed: 1,
            global: 1600,
            caustic: 0,
            nearest: 50,
            max_depth: None,
            roulette: true,
            guidance: crate::photons::Guidance::Off,
        }
    }

    #[test]
    fn passes_are_a_quarter_of_those_of_a_known_length() {
        let p = pass(&settings(), 0);
        assert_eq!(
            (p.samples, p.photons.global, p.photons.caustic),
            (4, 400, 1)
        );
        assert_eq!(p.photons.nearest, 20);
        assert_eq!(pass(&settings(), 3).samples, 8);
        let few = PhotonSettings {
            nearest: 5,
            ..settings()
        };
        assert_eq!(pass(&few, 0).photons.nearest, 5);
    }

    /// Renders in pretence: passes of a film of which a sample takes `pace(pass)` seconds and whose
    /// squared error is `noise(pass) / samples`, until `target` or `limit`. Returns all standings
    /// but the last, and what it took.
    fn pretend(
        forecast: &Forecast,
        pace: &mut dyn FnMut(u32) -> f64,
        noise: &mut dyn FnMut(u32) -> f64,
    ) -> (Vec<Standing>, f64) {
        let (mut own, mut samples, mut told) = (0.0, forecast.before.0, Vec::new());
        for number in 0.. {
            let n = pass(&settings(), number).samples;
            let n = n.min(forecast.limit - samples);
            own += f64::from(n) * pace(number);
            samples += n;
            let error = (number > 0).then(|| noise(number) / f64::from(samples));
            let standing = forecast.foresee(samples, error, own, None);
            if standing.reached(forecast.target) || samples == forecast.limit {
                break;
            }
            told.push(standing);
        }
        (told, own)
    }

    #[test]
    fn the_end_is_foreseen_within_a_quarter_after_the_first_tenth() {
        let mut rng = crate::sampling::Rng::new(1);
        let mut within = |x: f64| 1.0 + x * (2.0 * rng.next_1d() - 1.0);
        let mut seen = 0;
        for run in 0..200 {
            // To an error or to a count, from the start or resumed; on a machine that is busy now
            // and then, by an error that is known the better the more passes there are.
            let (target, limit) = match run % 2 {
                0 => (Some(1e-3), u32::MAX),
                _ => (None, 2000),
            };
            let before = if run % 4 < 2 { (0, 0.0) } else { (40, 7.0) };
            let forecast = Forecast::new(target, limit, None, before);
            let (pace, noise): (Vec<f64>, Vec<f64>) = (0..10_000u32)
                .map(|i| {
                    let known = 0.3 / f64::from(i.max(1)).sqrt();
                    (0.01 * within(0.3), within(known))
                })
                .unzip();
            let (told, took) = pretend(&forecast, &mut |i| pace[i as usize], &mut |i| {
                noise[i as usize]
            });
            for s in &told {
                let own = s.seconds - before.1;
                if own < 0.1 * took {
                    continue;
                }
                let left = s.seconds_left.unwrap_or(f64::NAN);
                assert!(
                    (own + left - took).abs() < 0.25 * took,
                    "run {run}: after {own:.2} s of {took:.2} s, {left:.2} s are said to be left"
                );
                seen += 1;
            }
        }
        assert!(seen > 2000, "{seen}");
    }

    #[test]
    fn a_deadline_that_comes_first_is_what_is_left() {
        let forecast = Forecast::new(None, 100, None, (0, 0.0));
        let left = |to| forecast.foresee(25, None, 10.0, to).seconds_left;
        assert_eq!(left(None), Some(30.0));
        assert_eq!(left(Some(5.0)), Some(5.0));
        assert_eq!(left(Some(50.0)), Some(30.0));
    }

    #[test]
    fn a_standing_is_told_in_words() {
        let s = Standing {
            samples: 12,
            error: Some(0.0123),
            seconds_left: Some(75.0),
            ..Default::default()
        };
        let text = "12 samples per pixel, relMSE about 1.23e-2, 1 min 15 s left";
        assert_eq!(s.text(), text);
        assert!(s.reached(Some(0.02)) && !s.reached(Some(0.01)) && !s.reached(None));
    }
}
