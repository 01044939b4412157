//! Which light a shading point samples.

use arrayvec::ArrayVec;

use crate::geometry::LightId;
use crate::lights::Light;
use crate::math::DVec3;
use crate::sampling::Discrete;

/// Most lights that are weighed one by one at every point. More are chosen by their flux.
const MOST_WEIGHED: usize = 64;

/// Share of the choice that is even over the lights that can contribute: what a guess without
/// visibility takes for faint may be all that arrives.
const EVEN: f64 = 0.1;

/// Chooses lights by what they would bring to a point if nothing stood between.
#[derive(Clone, Debug, Default)]
pub struct LightChoice {
    by_flux: Discrete,
    infinite: Vec<LightId>,
    bodiless: Vec<LightId>,
    n: usize,
}

/// The lights that are such.
fn those(lights: &[Box<dyn Light>], such: impl Fn(&dyn Light) -> bool) -> Vec<LightId> {
    (0..lights.len())
        .filter(|&i| such(&*lights[i]))
        .map(|i| LightId(i as u32))
        .collect()
}

/// Probabilities of all lights at one point.
type Weights = ArrayVec<f64, MOST_WEIGHED>;

impl LightChoice {
    /// The choice among `lights`.
    pub fn new(lights: &[Box<dyn Light>]) -> Self {
        Self {
            by_flux: Discrete::new(lights.iter().map(|l| l.power().luminance())),
            infinite: those(lights, |l| l.is_infinite()),
            bodiless: those(lights, |l| l.is_bodiless()),
            n: lights.len(),
        }
    }

    /// The lights at infinity that rays see.
    pub(super) fn infinite(&self) -> &[LightId] {
        &self.infinite
    }

    /// The lights that rays see and pass through.
    pub(super) fn bodiless(&self) -> &[LightId] {
        &self.bodiless
    }

    /// Whether lights are weighed one by one at every point.
    pub fn weighs(&self) -> bool {
        self.n > 1 && self.n <= MOST_WEIGHED
    }

    /// Probabilities at `p`, of which each light is `seen` so far; `None` if no light reaches it.
    fn weights(
        &self,
        lights: &[Box<dyn Light>],
        p: DVec3,
        seen: Option<&[f32]>,
    ) -> Option<Weights> {
        let mut w: Weights = lights.iter().map(|l| l.importance(p)).collect();
        for (w, seen) in w.iter_mut().zip(seen.into_iter().flatten()) {
            *w *= f64::from(*seen);
        }
        let (mut sum, mut able) = (0.0, 0u32);
        for x in &mut w {
            if !(*x > 0.0) {
                *x = 0.0;
                continue;
            }
            // At a light's very place the guess has no bound.
            *x = x.min(1e30);
            sum += *x;
            able += 1;
        }
        if able == 0 {
            return None;
        }
        let even = EVEN / f64::from(able);
        for x in &mut w {
            if *x > 0.0 {
                *x = (1.0 - EVEN) * *x / sum + even;
            }
        }
        Some(w)
    }

    /// The light chosen by `u` at `p`, its probability, and `u` rescaled to `[0, 1)`. `seen` is the
    /// share of each light that points around there see, as far as known; positive.
    #[inline]
    pub fn sample(
        &self,
        lights: &[Box<dyn Light>],
        p: DVec3,
        seen: Option<&[f32]>,
        u: f64,
    ) -> Option<(usize, f64, f64)> {
        if self.n == 1 {
            return Some((0, 1.0, u));
        }
        if self.n > MOST_WEIGHED {
            return self.by_flux.sample(u);
        }
        let weights = self.weights(lights, p, seen)?;
        let mut rest = u;
        let mut last = None;
        for (i, &w) in weights.iter().enumerate() {
            if w == 0.0 {
                continue;
            }
            last = Some((i, w));
            if rest < w {
                break;
            }
            rest -= w;
        }
        let (i, w) = last?;
        Some((i, w, (rest / w).clamp(0.0, 1.0 - f64::EPSILON)))
    }

    /// Probability that light `i` is chosen at `p`.
    #[inline]
    pub fn probability(
        &self,
        lights: &[Box<dyn Light>],
        p: DVec3,
        seen: Option<&[f32]>,
        i: usize,
    ) -> f64 {
        if self.n == 1 {
            return 1.0;
        }
        if self.n > MOST_WEIGHED {
            return self.by_flux.probability(i);
        }
        self.weights(lights, p, seen).map_or(0.0, |w| w[i])
    }
}
