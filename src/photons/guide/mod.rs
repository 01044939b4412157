//! Guided emission: photons leave where, by a few photons sent before, they bring most.
//!
//! Of each light the square of random numbers is divided that photons aim by: directions, or for
//! light from infinity places. Lessons are photons that leave the lights evenly, half of them shared
//! by flux and half alike. What one brings is the square of the power with which it is stored, times
//! the worth of where that is; a cell of flux `P` of which photons bring `P t` gets photons in
//! proportion to `√E (P t)²` (Neyman's allocation), mixed with a share of what it would get by flux
//! alone. So what no lesson has found is not lost, and no power is more than that share's inverse
//! times that of photons without guidance. Photons are divided by their density, and lessons are not
//! stored: what photons are guided by is independent of them, and means remain what they are.
//!
//! Source: Grittmann, Pérard-Gayot, Slusallek and Křivánek, *Efficient Caustic Rendering with
//! Lightweight Photon Mapping*, CGF 37(4), 2018.

mod lesson;
mod square;
mod worth;

pub(in crate::photons) use lesson::Lesson;
pub(super) use lesson::Teacher;
pub(super) use square::Square;
pub use worth::{Guidance, GuideBy, Sights};

use square::Known;

/// Share of the photons that goes out as if nothing had been learnt.
const UNGUIDED: f64 = 0.1;

/// What is known of all lights counts as so many lessons of each, at least.
const HEARSAY: f64 = 0.25;

/// A density of emission over lights and, of each, over the square that its photons aim by.
#[derive(Clone, Debug)]
pub struct Guide {
    shares: Vec<f64>,
    squares: Vec<Square>,
}

impl Guide {
    /// What the lessons of each light tell; `fluxes` are those of the lights. `None` if none of the
    /// lessons brought anything, or powers are beyond what their squares can be told in.
    fn new(mut lessons: Vec<Vec<Lesson>>, fluxes: &[f64]) -> Option<Self> {
        let all = || lessons.iter().flatten();
        let power: f64 = all().map(|l| l.power).sum();
        let worth: f64 = all().map(|l| l.worth).sum();
        let flux: f64 = fluxes.iter().sum();
        let told = |x: f64| x > 0.0 && x.is_finite();
        if !(told(power) && told(worth)) {
            return None;
        }
        let hearsay = Known {
            power: power / all().count() as f64,
            yields: worth / power,
        };
        let before = likeness(&lessons).max(HEARSAY);
        let (mut squares, weights): (Vec<Square>, Vec<f64>) = lessons
            .iter_mut()
            .map(|own| match own.is_empty() {
                true => (Square::default(), 0.0),
                false => {
                    let known = hearsay.learn(own, before);
                    Square::learn(own, known)
                }
            })
            .unzip();
        let total: f64 = weights.iter().sum();
        let mut shares = Vec::new();
        for ((square, weight), own) in squares.iter_mut().zip(&weights).zip(fluxes) {
            let even = UNGUIDED * own / flux;
            let share = (1.0 - UNGUIDED) * weight / total + even;
            if share > 0.0 {
                square.mix(even / share);
            }
            shares.push(share);
        }
        Some(Self { shares, squares })
    }

    /// Shares of the photons that leave each light.
    pub fn shares(&self) -> &[f64] {
        &self.shares
    }

    /// How those of a light leave it.
    pub(super) fn square(&self, light: usize) -> &Square {
        &self.squares[light]
    }
}

/// How many lessons of one light what is known of all is worth, by how much lights differ beyond what is
/// chance: the variance among the lessons of a light over that among lights (analysis of variance).
fn likeness(lessons: &[Vec<Lesson>]) -> f64 {
    let yields = |l: &Lesson| {
        if l.power > 0.0 {
            l.worth / l.power
        } else {
            0.0
        }
    };
    let lit = || lessons.iter().filter(|own| !own.is_empty());
    let mean = |own: &[Lesson]| own.iter().map(yields).sum::<f64>() / own.len() as f64;
    let (lights, n) = (
        lit().count() as f64,
        lit().map(Vec::len).sum::<usize>() as f64,
    );
    if lights < 2.0 || n <= lights {
        return 0.0;
    }
    let all = lit().flatten().map(yields).sum::<f64>() / n;
    let (mut within, mut between) = (0.0, 0.0);
    for own in lit() {
        let mean = mean(own);
        within += own.iter().map(|l| (yields(l) - mean).powi(2)).sum::<f64>();
        between += own.len() as f64 * (mean - all).powi(2);
    }
    within /= n - lights;
    between /= lights - 1.0;
    match between > within {
        true => within * (n / lights) / (between - within),
        false => f64::MAX,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::Rng;

    #[test]
    fn a_weak_lamp_that_alone_brings_something_gets_most_photons() {
        let mut rng = Rng::new(1);
        for flux in [1e-3, 1.0, 100.0] {
            let mut fluxes = vec![1.0; 49];
            fluxes.push(flux);
            let lessons = fluxes.iter().enumerate().map(|(i, f)| {
                let lesson = |_| Lesson {
                    u: rng.next_2d(),
                    power: f * f,
                    worth: if i == 49 { 0.5 * f * f } else { 0.0 },
                };
                (0..300).map(lesson).collect()
            });
            let guide = Guide::new(lessons.collect(), &fluxes).expect("something");
            let sum: f64 = guide.shares().iter().sum();
            assert!((sum - 1.0).abs() < 1e-12);
            let share = guide.shares()[49];
            println!("a lamp of {flux} of the others' flux gets {share:.3} of the photons");
            assert!(share > 0.6, "{share}");
            let least = guide.shares().iter().copied().fold(1.0, f64::min);
            assert!(least >= UNGUIDED / (49.0 + flux));
        }
        assert!(Guide::new(vec![Vec::new(); 2], &[1.0, 0.0]).is_none());
        let huge = Lesson {
            u: [0.5; 2],
            power: f64::INFINITY,
            worth: 1.0,
        };
        assert!(Guide::new(vec![vec![huge]], &[1e200]).is_none());
    }
}
