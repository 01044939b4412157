//! Photons that are sent out to learn from.

use super::{Guidance, Guide};
use crate::accel::Accelerator;
use crate::control::Control;
use crate::effects::EffectSet;
use crate::geometry::LightId;
use crate::photons::departure::leave;
use crate::photons::map::Nearest;
use crate::photons::trace::{Outcome, Tracer, outcomes};
use crate::photons::uniform::{apportion, fluxes};
use crate::photons::{EmittedPhoton, PhotonSettings, PhotonSource, Purpose, Targets};
use crate::sampling::{Sampler, hash2, stream};
use crate::scene::Scene;
use crate::stats::RayCounts;

/// Photons for each one that is sent out to learn from, and for each of the fewest that a light needs, if
/// there are enough.
const PER_LESSON: u64 = 16;
const AT_MOST: u64 = 4;

/// Lessons that a light needs.
const PER_LIGHT: u64 = 64;

/// What one photon has taught.
#[derive(Clone, Copy, Debug)]
pub(in crate::photons) struct Lesson {
    /// Where in its light's square it left.
    pub(super) u: [f64; 2],
    /// Square of the power that it left with, were it alone.
    pub(super) power: f64,
    /// Squares of the powers that were stored of it, by their worth.
    pub(super) worth: f64,
}

/// Who sends photons out to learn from.
pub(in crate::photons) struct Teacher<'a> {
    pub(in crate::photons) scene: &'a Scene,
    pub(in crate::photons) accel: &'a dyn Accelerator,
    pub(in crate::photons) effects: EffectSet,
    pub(in crate::photons) settings: &'a PhotonSettings,
    pub(in crate::photons) purpose: Purpose,
    /// Whether global photons are seen by gather rays.
    pub(in crate::photons) gathers: bool,
}

/// Photons that leave each light evenly.
struct Lessons<'a> {
    scene: &'a Scene,
    seed: u64,
    targets: Option<Targets>,
    first: Vec<u64>,
}

impl Lessons<'_> {
    /// The light of photon `i`, and the two points it leaves by.
    fn departure(&self, i: u64) -> (usize, [[f64; 2]; 2]) {
        let light = self.first.partition_point(|&f| f <= i) - 1;
        let key = stream::LESSONS;
        let mut sampler = Sampler::new(self.seed, key, light as u64, i - self.first[light]);
        (light, [sampler.next_2d(), sampler.next_2d()])
    }
}

impl PhotonSource for Lessons<'_> {
    fn len(&self) -> u64 {
        self.first.last().copied().unwrap_or(0)
    }

    /// As if it were the only photon of its light.
    fn emit(&self, i: u64) -> Option<EmittedPhoton> {
        let (light, [first, second]) = self.departure(i);
        let light = self.scene.light(LightId(light as u32));
        leave(light, self.scene, self.targets.as_ref(), first, second)
    }
}

impl Teacher<'_> {
    /// What a few photons teach, if they are to, with their number and the rays it took.
    pub(in crate::photons) fn teach(&self, control: &Control) -> (Option<Guide>, u64, RayCounts) {
        let count = match self.purpose {
            Purpose::Global => self.settings.global,
            Purpose::Caustic => self.settings.caustic,
        };
        let nothing = (None, 0, RayCounts::default());
        let targets = (self.purpose == Purpose::Caustic).then(|| Targets::new(self.scene));
        let blind = targets.as_ref().is_some_and(Targets::is_empty);
        if matches!(self.settings.guidance, Guidance::Off) || blind {
            return nothing;
        }
        let fluxes = fluxes(self.scene);
        let flux: f64 = fluxes.iter().sum();
        if !(flux > 0.0) {
            return nothing;
        }
        // A weak lamp may be the one that matters.
        let lit = fluxes.iter().filter(|f| **f > 0.0).count() as f64;
        let share = |f: &f64| match *f > 0.0 {
            true => 0.5 * f / flux + 0.5 / lit,
            false => 0.0,
        };
        let shares: Vec<f64> = fluxes.iter().map(share).collect();
        let needed = (lit as u64 * PER_LIGHT).min(count / AT_MOST);
        let lessons = needed.max(count.div_ceil(PER_LESSON));
        let lessons = Lessons {
            scene: self.scene,
            seed: hash2(self.settings.seed, stream::LESSONS),
            targets,
            first: apportion(&shares, lessons),
        };
        let settings = PhotonSettings {
            seed: lessons.seed,
            ..self.settings.clone()
        };
        let asked = (self.purpose, self.gathers);
        let learn = |i: u64, outcome: Option<Outcome<'_>>, found: &mut Nearest| {
            let (light, [_, u]) = lessons.departure(i);
            let (power, worth) = outcome.map_or((0.0, 0.0), |o| {
                let stored = o.photons.iter().chain(o.glow);
                let worth = self.settings.guidance.worth(stored, asked, found);
                (o.power.luminance().powi(2), worth)
            });
            (light, Lesson { u, power, worth })
        };
        let tracer = Tracer {
            scene: self.scene,
            accel: self.accel,
            purpose: self.purpose,
            effects: self.effects,
            settings: &settings,
        };
        let (learnt, rays) = outcomes(&tracer, &lessons, learn, control);
        let sent = learnt.len() as u64;
        let mut by_light = vec![Vec::new(); fluxes.len()];
        for (light, lesson) in learnt {
            by_light[light].push(lesson);
        }
        (Guide::new(by_light, &fluxes), sent, rays)
    }
}
