//! Following photons through the scene.

use arrayvec::ArrayVec;

use super::emit::{PhotonSource, Purpose};
use super::in_order::in_order;
use super::ledger::Ledger;
use super::map::Nearest;
use super::photon::{Photon, PhotonClass};
use super::{EmittedPhoton, PhotonSettings};
use crate::accel::Accelerator;
use crate::color::Rgb;
use crate::control::Control;
use crate::effects::EffectSet;
use crate::geometry::Ray;
use crate::lights::range_window;
use crate::materials::{Bsdf, BsdfSample, LobeClass, TransportMode};
use crate::sampling::{Rng, hash2, stream};
use crate::scene::{Inside, Scene};
use crate::stats::tally::{self, Event, Part};
use crate::stats::{PhotonCounts, RayCounts};

/// Photons followed by one task: enough to hide the cost of a task, few enough to share evenly.
const BATCH: u64 = 8192;

/// The same where few photons are followed.
const LESSONS: u64 = 512;

/// Longest path when neither roulette nor the user ends it.
const DEPTH_GUARD: u32 = 4096;

/// Photons of one purpose, in the order of emission.
#[derive(Debug)]
pub struct StoredPhotons {
    /// Those of the map.
    pub photons: Vec<Photon>,
    /// Caustic photons one diffuse surface further: `L S⁺ D S* D`.
    pub glow: Vec<Photon>,
    /// What became of them.
    pub counts: PhotonCounts,
    /// Rays traced.
    pub rays: RayCounts,
}

/// One task's share.
#[derive(Default)]
struct Batch {
    photons: Vec<Photon>,
    glow: Vec<Photon>,
    ledger: Ledger,
    segments: u64,
}

/// Emits and follows all photons of a source.
pub fn follow_photons(
    scene: &Scene,
    accel: &dyn Accelerator,
    source: &dyn PhotonSource,
    purpose: Purpose,
    effects: EffectSet,
    settings: &PhotonSettings,
    control: &Control,
) -> StoredPhotons {
    let n = source.len();
    let (name, part, event) = names(purpose);
    let stage = control.stage(name, "photons", n);
    let tracer = Tracer {
        scene,
        accel,
        purpose,
        effects,
        settings,
    };
    let (mut ledger, mut rays) = (Ledger::default(), RayCounts::default());
    let (mut photons, mut glow) = (Vec::new(), Vec::new());
    let follow = |b: u64| {
        let mut batch = Batch::default();
        let (lo, hi) = (b * BATCH, ((b + 1) * BATCH).min(n));
        if control.stopped().is_none() {
            for i in lo..hi {
                batch.ledger.photons += 1;
                if let Some(photon) = source.emit(i) {
                    tracer.follow(&photon, i, &mut batch);
                }
            }
        }
        stage.advance(hi - lo);
        tally::rays(part, batch.segments);
        tally::count_many(event, batch.photons.len() as u64);
        batch
    };
    in_order(n.div_ceil(BATCH), follow, |b| {
        photons.extend_from_slice(&b.photons);
        glow.extend_from_slice(&b.glow);
        ledger.add(&b.ledger);
        rays.photon += b.segments;
    });
    rays.check = source.checks();
    let counts = PhotonCounts {
        checked: source.checks(),
        cells: source.cells(),
        ..ledger.counts(photons.len() as u64)
    };
    StoredPhotons {
        photons,
        glow,
        counts,
        rays,
    }
}

/// What a stage is called, and what it is counted as.
fn names(purpose: Purpose) -> (&'static str, Part, Event) {
    match purpose {
        Purpose::Global => ("global photons", Part::Indirect, Event::GlobalPhotons),
        Purpose::Caustic => ("caustic photons", Part::Caustics, Event::CausticPhotons),
    }
}

/// What became of one photon.
pub(super) struct Outcome<'a> {
    /// What it left with.
    pub(super) power: Rgb,
    /// What was stored of it, as in [`StoredPhotons`].
    pub(super) photons: &'a [Photon],
    pub(super) glow: &'a [Photon],
}

/// Follows the photons of a source and stores none: what `tell` has to say of the outcome of each, in
/// their order, and the rays traced. There is no outcome of what did not leave.
pub(super) fn outcomes<T: Copy + Send>(
    tracer: &Tracer<'_>,
    source: &dyn PhotonSource,
    tell: impl Fn(u64, Option<Outcome<'_>>, &mut Nearest) -> T + Sync,
    control: &Control,
) -> (Vec<T>, RayCounts) {
    let n = source.len();
    let (name, part, _) = names(tracer.purpose);
    let stage = control.stage(name, "lessons", n);
    let (mut told, mut rays) = (Vec::new(), RayCounts::default());
    let follow = |b: u64| {
        let (mut batch, mut found) = (Batch::default(), Nearest::new());
        let (lo, hi) = (b * LESSONS, ((b + 1) * LESSONS).min(n));
        let mut out = Vec::new();
        if control.stopped().is_none() {
            out.extend((lo..hi).map(|i| {
                batch.photons.clear();
                batch.glow.clear();
                let outcome = source.emit(i).map(|photon| {
                    tracer.follow(&photon, i, &mut batch);
                    Outcome {
                        power: photon.power,
                        photons: &batch.photons,
                        glow: &batch.glow,
                    }
                });
                tell(i, outcome, &mut found)
            }));
        }
        stage.advance(hi - lo);
        tally::rays(part, batch.segments);
        (out, batch.segments)
    };
    in_order(n.div_ceil(LESSONS), follow, |(part, segments)| {
        told.extend_from_slice(&part);
        rays.photon += segments;
    });
    (told, rays)
}

/// A photon on its way.
#[derive(Clone)]
struct Flight {
    ray: Ray,
    power: Rgb,
    class: PhotonClass,
    inside: Inside,
    /// Number of the surface that comes next, from 1 on.
    depth: u32,
    rng: Rng,
}

/// Colours that wait until the one before them has come to its end. They part once for all: a
/// photon of one channel stays one.
type Parted = ArrayVec<Flight, 2>;

/// What photons are followed by.
pub(super) struct Tracer<'a> {
    pub(super) scene: &'a Scene,
    pub(super) accel: &'a dyn Accelerator,
    pub(super) purpose: Purpose,
    pub(super) effects: EffectSet,
    pub(super) settings: &'a PhotonSettings,
}

impl Tracer<'_> {
    /// Follows one photon to its end.
    fn follow(&self, photon: &EmittedPhoton, index: u64, out: &mut Batch) {
        let key = match self.purpose {
            Purpose::Global => stream::GLOBAL_PHOTONS,
            Purpose::Caustic => stream::CAUSTIC_PHOTONS,
        };
        let first = Flight {
            ray: photon.ray,
            power: photon.power,
            class: PhotonClass::Direct,
            inside: self.scene.enclosing(photon.ray.origin()),
            depth: 1,
            rng: Rng::new(hash2(hash2(self.settings.seed, key), !index)),
        };
        out.ledger.emitted += first.power;
        let mut parted = Parted::new();
        let mut flight = Some(first);
        while let Some(mut one) = flight {
            while self.advance(&mut one, photon.range, out, &mut parted) {}
            flight = parted.pop();
        }
    }

    /// Takes a photon to the next surface and in a new direction. Whether it goes on. Where its
    /// colours part, the others are left in `parted`.
    #[inline(always)]
    fn advance(&self, at: &mut Flight, range: f64, out: &mut Batch, parted: &mut Parted) -> bool {
        let max_depth = self.settings.max_depth.unwrap_or(DEPTH_GUARD);
        out.segments += 1;
        let Some(hit) = self.accel.intersect(&at.ray) else {
            out.ledger.escaped += at.power;
            return false;
        };
        let sp = self.scene.surface_point(&at.ray, &hit);
        if at.depth == 1 && range < f64::INFINITY {
            let left = at.power * range_window(sp.distance, range);
            out.ledger.absorbed += at.power - left;
            at.power = left;
        }
        let crossing = self.scene.crossing(at.inside, &sp);
        if let Some(t) = self.scene.transmittance(&sp, &crossing) {
            let left = at.power * t;
            out.ledger.absorbed += at.power - left;
            at.power = left;
        }
        let mut bsdf = Bsdf::new(&sp, TransportMode::Importance);
        self.scene.scatter(&sp, None, &mut bsdf);
        crossing.apply(&mut bsdf);
        if bsdf.has_diffuse() {
            let ng = if sp.front { sp.ng } else { -sp.ng };
            let photon = Photon::new(sp.p, sp.wo, ng, at.power, at.class);
            match (self.purpose, at.class) {
                (Purpose::Global, _) | (Purpose::Caustic, PhotonClass::Caustic) => {
                    out.photons.push(photon);
                }
                (Purpose::Caustic, PhotonClass::Indirect) => out.glow.push(photon),
                (Purpose::Caustic, PhotonClass::Direct) => {}
            }
            // A caustic photon needs a specular surface before its first diffuse one, and
            // stops at its second.
            if self.purpose == Purpose::Caustic && at.class != PhotonClass::Caustic {
                if !bsdf.has_specular() {
                    out.ledger.cut += at.power;
                    out.ledger.discarded += u64::from(at.class == PhotonClass::Direct);
                    return false;
                }
                bsdf.keep_specular();
            }
        }
        if at.depth >= max_depth {
            out.ledger.cut += at.power;
            return false;
        }
        let (u_lobe, u) = (at.rng.next_1d(), at.rng.next_2d());
        let live = |s: &BsdfSample| {
            let followed = self.effects.follow(self.scene, &sp, s.class, s.transmitted);
            followed.is_some()
        };
        let leave = |at: &mut Flight, s: &BsdfSample| {
            at.class = match (at.class, s.class) {
                (_, LobeClass::Diffuse) => PhotonClass::Indirect,
                (PhotonClass::Indirect, _) => PhotonClass::Indirect,
                _ => PhotonClass::Caustic,
            };
            at.ray = sp.spawn(s.wi);
            at.inside = crossing.beyond(s.transmitted);
            at.depth += 1;
        };
        if bsdf.disperses() {
            let before = at.power;
            // All go on by the same numbers: what does not part stays together.
            let chance = at.rng.next_1d();
            let here = at.clone();
            let (mut on, mut went_on) = (false, Rgb::ZERO);
            let ways = bsdf.sample_channels(before, u_lobe, u);
            for s in ways.iter().filter(|s| live(s)) {
                let survive = self.survival(s);
                let power = before * s.weight / survive;
                if chance >= survive || power.is_black() {
                    continue;
                }
                went_on += power;
                let mut one = here.clone();
                one.power = power;
                leave(&mut one, s);
                if !std::mem::replace(&mut on, true) {
                    *at = one;
                } else if parted.try_push(one).is_err() {
                    debug_assert!(false, "more parts than channels");
                }
            }
            out.ledger.absorbed += before - went_on;
            return on;
        }
        let Some(s) = bsdf.sample(u_lobe, u).filter(live) else {
            out.ledger.absorbed += at.power;
            return false;
        };
        let mut weight = s.weight;
        if self.settings.roulette {
            let survive = self.survival(&s);
            if at.rng.next_1d() >= survive {
                out.ledger.absorbed += at.power;
                return false;
            }
            weight = weight / survive;
        }
        let next = at.power * weight;
        out.ledger.absorbed += at.power - next;
        at.power = next;
        leave(at, &s);
        !next.is_black()
    }

    /// Chance of a photon to go on.
    #[inline]
    fn survival(&self, s: &BsdfSample) -> f64 {
        if self.settings.roulette {
            s.weight.max_channel().min(1.0)
        } else {
            1.0
        }
    }
}
