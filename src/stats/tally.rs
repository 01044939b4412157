//! What each part of light transport took: rays, other events, and time. Whoever does a piece of
//! work counts it where it is done; nothing is handed around for that.
//!
//! Each thread has an array of its own, without locks or atomics: to count is one addition in
//! memory. A [`Meter`] collects the arrays of all threads of a pool once, at the end.
//!
//! Time is sampled. Each thread knows the part that it works for now ([`enter`]); a clock, which
//! one thread of its own puts forward each millisecond, is compared whenever that changes, and
//! what passed meanwhile goes to the part that was worked for. So no clock is read in inner
//! loops, and as short a piece of work as the look-up of a texture is told apart: on average over
//! its many times. Every moment of a thread belongs to one part, the innermost; the rest, with
//! the time in which a thread had nothing to do, to [`Part::Rest`].

use std::cell::Cell;
use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle, Thread};
use std::time::{Duration, Instant};

use serde::Serialize;

/// Shortest time between two readings of the clock.
const TICK: Duration = Duration::from_millis(1);

/// Longest, as a share of what has passed: enough readings are taken of a long run as well.
const COARSEST: f64 = 1e-3;

macro_rules! parts {
    ($($(#[$doc:meta])* $name:ident $(= $($event:ident $text:literal),+)?;)*) => {
        /// A part of light transport that is told apart: what every picture needs, and the effects.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum Part {
            $($(#[$doc])* $name,)*
        }

        /// Something that is counted beside rays; each belongs to one part.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum Event {
            $($($(#[doc = $text] $event,)+)?)*
        }

        /// All parts.
        const PARTS: &[Part] = &[$(Part::$name),*];

        /// All events: the part and what is counted.
        const EVENTS: &[(Event, Part, &str)] =
            &[$($($((Event::$event, Part::$name, $text),)+)?)*];
    };
}

// One line for each: the part, and what of it is counted beside rays.
parts! {
    /// What is no effect: camera rays, shading of what they meet, waiting.
    Rest;
    /// Light straight from lights.
    Direct;
    /// Mirror-like and glossy reflection, and unbent transmission.
    Specular = Reflections "reflections";
    /// Bent transmission.
    Refraction = Refractions "refractions";
    /// Light focused onto diffuse surfaces.
    Caustics = CausticPhotons "photons", CausticLookups "map lookups";
    /// Light by way of other diffuse surfaces.
    Indirect = GlobalPhotons "photons", GlobalLookups "map lookups";
    /// Light absorbed by bodies.
    Absorption = Attenuations "attenuated segments";
    /// Colours that glass takes apart.
    Dispersion = Dispersions "dispersing hits";
    /// Diffuse light that comes through.
    Translucency = TranslucentLobes "lobe evaluations";
    /// Clear coats.
    Coat = CoatLobes "lobe evaluations";
    /// The sheen of cloth.
    Sheen = SheenLobes "lobe evaluations";
    /// Thin films.
    Iridescence = FilmLobes "lobe evaluations";
    /// Brushed surfaces.
    Anisotropy = BrushedLobes "lobe evaluations";
    /// Values from images.
    Textures = TextureLookups "lookups", Derivatives "hits with derivatives";
    /// Shading normals from images.
    Normals = PerturbedFrames "perturbed frames";
    /// Surfaces that are not whole.
    Alpha = FilterCalls "filter calls";
    /// Light from all around.
    Environment = SkySamples "samples", SkyLookups "lookups";
    /// Depth of field.
    Lens = LensPoints "points on the lens";
    /// Shapes that stand in several places.
    Instances = InstanceHits "hits";
}

/// What is done in passing: to tell its time would take more than it does.
const UNTIMED: [Part; 3] = [Part::Dispersion, Part::Lens, Part::Instances];

impl Event {
    /// Its bit in a [set of lobes' events](lobe).
    pub const fn bit(self) -> u32 {
        1 << self as u8
    }
}

struct Own {
    rays: [Cell<u64>; PARTS.len()],
    events: [Cell<u64>; EVENTS.len()],
    micros: [Cell<u64>; PARTS.len()],
    part: Cell<Part>,
    /// The clock as it was last seen.
    seen: Cell<u64>,
}

thread_local! {
    static OWN: Own = const {
        Own {
            rays: [const { Cell::new(0) }; PARTS.len()],
            events: [const { Cell::new(0) }; EVENTS.len()],
            micros: [const { Cell::new(0) }; PARTS.len()],
            part: Cell::new(Part::Rest),
            seen: Cell::new(0),
        }
    };
}

/// Microseconds since [`EPOCH`], as one of the [`Meter`]s last read them.
static CLOCK: AtomicU64 = AtomicU64::new(0);

static EPOCH: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Reads the time for all to see. Meters may run side by side: the clock never goes back.
fn tick() {
    CLOCK.fetch_max(EPOCH.elapsed().as_micros() as u64, Ordering::Relaxed);
}

#[inline(always)]
fn add(to: &Cell<u64>, n: u64) {
    to.set(to.get().wrapping_add(n));
}

/// Counts an event.
#[inline(always)]
pub fn count(event: Event) {
    OWN.with(|own| add(&own.events[event as usize], 1));
}

/// Counts several events of a kind.
#[inline(always)]
pub fn count_many(event: Event, n: u64) {
    OWN.with(|own| add(&own.events[event as usize], n));
}

/// Counts a ray that is traced for a part.
#[inline(always)]
pub fn ray(part: Part) {
    rays(part, 1);
}

/// Counts several rays.
#[inline(always)]
pub fn rays(part: Part, n: u64) {
    OWN.with(|own| add(&own.rays[part as usize], n));
}

/// Counts the evaluation of a lobe that carries these [bits](Event::bit), of which there is one at
/// least, and works for the first of their parts until the answer is dropped.
#[cold]
#[inline(never)]
pub fn lobe(bits: u32) -> Scope {
    let mut part = Part::Rest;
    for (event, of, _) in EVENTS.iter().rev() {
        if bits & event.bit() != 0 {
            count(*event);
            part = *of;
        }
    }
    enter(part)
}

impl Own {
    /// Books what has passed, if the clock went on, and works for another part from now on.
    #[inline(always)]
    fn switch(&self, part: Part) -> Part {
        let now = CLOCK.load(Ordering::Relaxed);
        let before = self.part.replace(part);
        if now != self.seen.get() {
            self.book(before, now);
        }
        before
    }

    #[cold]
    #[inline(never)]
    fn book(&self, part: Part, now: u64) {
        let passed = now.wrapping_sub(self.seen.replace(now));
        add(&self.micros[part as usize], passed);
    }
}

/// Works for a part until it is dropped; then for what was worked for before.
#[derive(Debug)]
pub struct Scope {
    before: Part,
    /// It belongs to its thread.
    _here: PhantomData<*const ()>,
}

/// Works for a part from now on, until the answer is dropped.
#[inline(always)]
pub fn enter(part: Part) -> Scope {
    Scope {
        before: OWN.with(|own| own.switch(part)),
        _here: PhantomData,
    }
}

impl Scope {
    /// Works for another part.
    #[inline(always)]
    pub fn switch(&mut self, part: Part) {
        OWN.with(|own| own.switch(part));
    }
}

impl Drop for Scope {
    #[inline(always)]
    fn drop(&mut self) {
        OWN.with(|own| own.switch(self.before));
    }
}

/// Does work in which all threads of the pool work for a part.
pub fn stage<T>(part: Part, work: impl FnOnce() -> T) -> T {
    let turn = |part| {
        rayon::broadcast(|_| OWN.with(|own| own.switch(part)));
    };
    let before = OWN.with(|own| own.part.get());
    turn(part);
    let done = work();
    turn(before);
    done
}

/// What was counted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    rays: [u64; PARTS.len()],
    events: [u64; EVENTS.len()],
    micros: [u64; PARTS.len()],
}

/// What an effect took.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// How often something was done for it, by what was done.
    pub counts: BTreeMap<&'static str, u64>,
    /// Its share of the time of all threads, as sampled; none if its time is not told apart.
    pub time_share: Option<f64>,
}

impl Cost {
    /// Whether nothing was done for it.
    pub fn is_nothing(&self) -> bool {
        self.counts.values().all(|n| *n == 0)
    }
}

impl Tally {
    /// Takes what this thread has counted.
    fn take() -> Self {
        fn all<const N: usize>(of: &[Cell<u64>; N]) -> [u64; N] {
            std::array::from_fn(|i| of[i].take())
        }
        OWN.with(|own| {
            own.switch(Part::Rest);
            Self {
                rays: all(&own.rays),
                events: all(&own.events),
                micros: all(&own.micros),
            }
        })
    }

    /// What the threads of this pool have counted since they last were asked.
    fn collect() -> Self {
        tick();
        let mut sum = Self::default();
        for own in rayon::broadcast(|_| Self::take()) {
            let both = [
                (&mut sum.rays[..], &own.rays[..]),
                (&mut sum.events[..], &own.events[..]),
                (&mut sum.micros[..], &own.micros[..]),
            ];
            for (to, from) in both {
                to.iter_mut().zip(from).for_each(|(to, n)| *to += n);
            }
        }
        sum
    }

    /// How often something happened.
    pub fn events(&self, event: Event) -> u64 {
        self.events[event as usize]
    }

    /// What a part took.
    pub fn cost(&self, part: Part) -> Cost {
        let own = EVENTS.iter().filter(|(_, of, _)| *of == part);
        let rays = self.rays[part as usize];
        let all: u64 = self.micros.iter().sum();
        Cost {
            counts: own
                .map(|(event, _, name)| (*name, self.events(*event)))
                .chain([("rays", rays)])
                .collect(),
            time_share: (!UNTIMED.contains(&part))
                .then(|| self.micros[part as usize] as f64 / all.max(1) as f64),
        }
    }
}

/// Measures what the threads of a pool do, from when it is made.
#[derive(Debug)]
pub struct Meter {
    running: std::sync::Arc<AtomicBool>,
    clock: Option<JoinHandle<()>>,
}

impl Meter {
    /// Begins. To be called by a thread of the pool.
    pub fn new() -> Self {
        let running = std::sync::Arc::new(AtomicBool::new(true));
        let heeded = running.clone();
        let clock = thread::Builder::new().name("clock".into()).spawn(move || {
            let start = Instant::now();
            while heeded.load(Ordering::Relaxed) {
                tick();
                thread::park_timeout(TICK.max(start.elapsed().mul_f64(COARSEST)));
            }
        });
        // What was counted before does not count.
        let _ = Tally::collect();
        Self {
            running,
            // Without a thread to spare there are counts, but no times.
            clock: clock.ok(),
        }
    }

    /// Ends, and tells what was done.
    pub fn finish(self) -> Tally {
        Tally::collect()
    }
}

impl Default for Meter {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for Meter {
    fn drop(&mut self) {
        self.running.store(false, Ordering::Relaxed);
        if let Some(clock) = self.clock.take() {
            Thread::unpark(clock.thread());
            // It does nothing that can fail.
            let _ = clock.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
        pool.unwrap_or_else(|e| panic!("{e}")).install(work)
    }

    fn spin(for_ms: u64) {
        let start = Instant::now();
        while start.elapsed() < Duration::from_millis(for_ms) {}
    }

    #[test]
    fn what_all_threads_count_is_collected_once() {
        let (first, second) = in_pool(|| {
            rays(Part::Direct, 5);
            let meter = Meter::new();
            rayon::broadcast(|_| {
                ray(Part::Direct);
                count_many(Event::TextureLookups, 3);
                drop(lobe(Event::SheenLobes.bit() | Event::BrushedLobes.bit()));
            });
            (meter.finish(), Tally::collect())
        });
        assert_eq!(first.cost(Part::Direct).counts["rays"], 2);
        let textures = first.cost(Part::Textures).counts;
        assert_eq!(textures["lookups"], 6);
        assert_eq!(textures["hits with derivatives"], 0);
        assert_eq!(first.cost(Part::Sheen).counts["lobe evaluations"], 2);
        assert_eq!(first.cost(Part::Anisotropy).counts["lobe evaluations"], 2);
        assert!(first.cost(Part::Coat).is_nothing());
        assert_eq!(
            [second.rays, [0; PARTS.len()]].concat(),
            [0; 2 * PARTS.len()]
        );
        assert_eq!(second.events, [0; EVENTS.len()]);
    }

    /// Pieces of work far shorter than a tick share the time as they should: within 0.1, which is
    /// more than five standard deviations of the several hundred ticks.
    #[test]
    fn short_pieces_of_work_have_their_share_of_time() {
        let tally = in_pool(|| {
            let meter = Meter::new();
            let start = Instant::now();
            stage(Part::Indirect, || {
                while start.elapsed() < Duration::from_millis(600) {
                    for _ in 0..100 {
                        let t = Instant::now();
                        let mut scope = enter(Part::Textures);
                        while t.elapsed() < Duration::from_nanos(3000) {}
                        scope.switch(Part::Alpha);
                        while t.elapsed() < Duration::from_nanos(4000) {}
                    }
                }
            });
            spin(200);
            meter.finish()
        });
        // Of two threads, one works, the other waits within the stage and after it.
        let share = |part| tally.cost(part).time_share.unwrap_or(f64::NAN);
        let all: f64 = PARTS
            .iter()
            .filter(|p| !UNTIMED.contains(p))
            .map(|p| share(*p))
            .sum();
        assert!((all - 1.0).abs() < 1e-9, "{all}");
        for (part, expected) in [
            (Part::Textures, 0.375 * 0.75),
            (Part::Alpha, 0.375 * 0.25),
            (Part::Indirect, 0.375),
            (Part::Rest, 0.25),
        ] {
            let found = share(part);
            assert!(
                (found - expected).abs() < 0.1,
                "{part:?}: {found} {expected}"
            );
        }
    }
}
