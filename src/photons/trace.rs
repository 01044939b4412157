//! Following photons through the scene.

use super::emit::{PhotonSource, Purpose};
use super::in_order::in_order;
use super::ledger::Ledger;
use super::photon::{Photon, PhotonClass};
use super::{EmittedPhoton, PhotonSettings};
use crate::accel::Accelerator;
use crate::control::Control;
use crate::effects::EffectSet;
use crate::lights::range_window;
use crate::materials::{Bsdf, BsdfSample, LobeClass, TransportMode};
use crate::sampling::{Rng, hash2, stream};
use crate::scene::Scene;
use crate::stats::tally::{self, Event, Part};
use crate::stats::{PhotonCounts, RayCounts};

/// Photons followed by one task: enough to hide the cost of a task, few enough to share evenly.
const BATCH: u64 = 8192;

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
    let (name, part, event) = match purpose {
        Purpose::Global => ("global photons", Part::Indirect, Event::GlobalPhotons),
        Purpose::Caustic => ("caustic photons", Part::Caustics, Event::CausticPhotons),
    };
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

struct Tracer<'a> {
    scene: &'a Scene,
    accel: &'a dyn Accelerator,
    purpose: Purpose,
    effects: EffectSet,
    settings: &'a PhotonSettings,
}

impl Tracer<'_> {
    /// Follows one photon to its end.
    fn follow(&self, photon: &EmittedPhoton, index: u64, out: &mut Batch) {
        let key = match self.purpose {
            Purpose::Global => stream::GLOBAL_PHOTONS,
            Purpose::Caustic => stream::CAUSTIC_PHOTONS,
        };
        let mut rng = Rng::new(hash2(hash2(self.settings.seed, key), !index));
        let max_depth = self.settings.max_depth.unwrap_or(DEPTH_GUARD);
        let mut ray = photon.ray;
        let mut power = photon.power;
        let mut class = PhotonClass::Direct;
        let mut inside = self.scene.enclosing(ray.origin());
        out.ledger.emitted += power;
        for depth in 1.. {
            out.segments += 1;
            let Some(hit) = self.accel.intersect(&ray) else {
                out.ledger.escaped += power;
                return;
            };
            let sp = self.scene.surface_point(&ray, &hit);
            if depth == 1 && photon.range < f64::INFINITY {
                let left = power * range_window(sp.distance, photon.range);
                out.ledger.absorbed += power - left;
                power = left;
            }
            let crossing = self.scene.crossing(inside, &sp);
            if let Some(t) = self.scene.transmittance(&sp, &crossing) {
                let left = power * t;
                out.ledger.absorbed += power - left;
                power = left;
            }
            let mut bsdf = Bsdf::new(&sp, TransportMode::Importance);
            self.scene.scatter(&sp, None, &mut bsdf);
            crossing.apply(&mut bsdf);
            if bsdf.has_diffuse() {
                let ng = if sp.front { sp.ng } else { -sp.ng };
                let photon = Photon::new(sp.p, sp.wo, ng, power, class);
                match (self.purpose, class) {
                    (Purpose::Global, _) | (Purpose::Caustic, PhotonClass::Caustic) => {
                        out.photons.push(photon);
                    }
                    (Purpose::Caustic, PhotonClass::Indirect) => out.glow.push(photon),
                    (Purpose::Caustic, PhotonClass::Direct) => {}
                }
                // A caustic photon needs a specular surface before its first diffuse one, and
                // stops at its second.
                if self.purpose == Purpose::Caustic && class != PhotonClass::Caustic {
                    if !bsdf.has_specular() {
                        out.ledger.cut += power;
                        out.ledger.discarded += u64::from(class == PhotonClass::Direct);
                        return;
                    }
                    bsdf.keep_specular();
                }
            }
            if depth >= max_depth {
                out.ledger.cut += power;
                return;
            }
            let Some(s) = bsdf.sample(rng.next_1d(), rng.next_2d()) else {
                out.ledger.absorbed += power;
                return;
            };
            let follow = |s: &BsdfSample| {
                self.effects
                    .follow(self.scene, &sp, s.class, s.transmitted)
                    .is_some()
            };
            if !follow(&s) {
                out.ledger.absorbed += power;
                return;
            }
            let mut weight = s.weight;
            if self.settings.roulette {
                let survive = weight.max_channel().min(1.0);
                if rng.next_1d() >= survive {
                    out.ledger.absorbed += power;
                    return;
                }
                weight = weight / survive;
            }
            let next = power * weight;
            out.ledger.absorbed += power - next;
            power = next;
            if power.is_black() {
                return;
            }
            class = match (class, s.class) {
                (_, LobeClass::Diffuse) => PhotonClass::Indirect,
                (PhotonClass::Indirect, _) => PhotonClass::Indirect,
                _ => PhotonClass::Caustic,
            };
            ray = sp.spawn(s.wi);
            inside = crossing.beyond(s.transmitted);
        }
    }
}
