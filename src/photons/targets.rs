//! Where specular objects are, seen from a light: the directions that caustic photons take.
//!
//! Each specular object (or cluster, if there are many) is held by a bounding sphere. Photons
//! are sent uniformly within the cones under which a light's point sees these spheres: most of them
//! to each cone by its size, so that what is large is not thin, and some to each alike, so that what
//! is small beside something large is not left with nothing. Where cones overlap their densities
//! add, so that of every direction is known exactly.

use std::f64::consts::PI;

use arrayvec::ArrayVec;

use crate::math::{BoundingSphere, DVec3, Frame};
use crate::sampling::warp;
use crate::scene::Scene;

/// Most spheres that are told apart; more are merged with their neighbours.
const MAX_SPHERES: usize = 32;

/// Bounding spheres of what can make caustics.
#[derive(Clone, Debug)]
pub struct Targets {
    spheres: Vec<BoundingSphere>,
}

/// The cone under which a point sees a sphere.
#[derive(Clone, Copy)]
struct Cone {
    axis: DVec3,
    /// `1 − cos` of the half angle; 2 for the whole sphere of directions.
    complement: f64,
}

impl Cone {
    fn new(s: &BoundingSphere, from: DVec3) -> Self {
        let to = s.center - from;
        let d2 = to.length_squared();
        // A little wider than the sphere, so that rounding loses no direction.
        let r = s.radius * (1.0 + 1e-6);
        if d2 <= r * r {
            return Self {
                axis: DVec3::Z,
                complement: 2.0,
            };
        }
        let sin2 = r * r / d2;
        Self {
            axis: to / d2.sqrt(),
            complement: sin2 / (1.0 + (1.0 - sin2).sqrt()),
        }
    }

    fn holds(&self, dir: DVec3) -> bool {
        // |dir − axis|² = 2 (1 − cos): exact for narrow cones.
        self.complement >= 2.0 || (dir - self.axis).length_squared() <= 2.0 * self.complement
    }
}

impl Targets {
    /// The specular objects of a scene.
    pub fn new(scene: &Scene) -> Self {
        let g = &scene.geometry;
        let spheres = (0..g.objects.len() as u32)
            .map(crate::geometry::ObjectId)
            .filter(|&id| {
                let t = scene.material(g.object(id).material).traits();
                t.reflects || t.transmits
            })
            .map(|id| scene.bounding_sphere(id))
            .collect();
        Self {
            spheres: merge(spheres),
        }
    }

    /// Whether there is nothing to aim at.
    pub fn is_empty(&self) -> bool {
        self.spheres.is_empty()
    }

    /// A direction from `from` toward some sphere, and its density in solid angle.
    pub fn sample_direction(&self, from: DVec3, u: [f64; 2]) -> Option<(DVec3, f64)> {
        let cones: ArrayVec<Cone, MAX_SPHERES> =
            self.spheres.iter().map(|s| Cone::new(s, from)).collect();
        let shares = Shares::new(cones.iter().map(|c| c.complement));
        let (i, v) = shares.choose(u[0])?;
        let local = warp::cone_from_complement([v, u[1]], cones[i].complement);
        let dir = Frame::from_normal(cones[i].axis).to_world(local);
        // The chosen cone holds it by construction; the others by test.
        let holds = |(k, cone): (usize, &Cone)| k == i || cone.holds(dir);
        let pdf = shares.density(cones.iter().enumerate().map(holds));
        Some((dir, pdf / (2.0 * PI)))
    }

    /// A point of the union of the spheres' shadows on a plane normal to `direction`, and its
    /// density in area. The point lies beside some sphere's centre.
    pub fn sample_disc(&self, direction: DVec3, u: [f64; 2]) -> Option<(DVec3, f64)> {
        let area = |s: &BoundingSphere| s.radius * s.radius;
        let shares = Shares::new(self.spheres.iter().map(area));
        let (i, v) = shares.choose(u[0])?;
        let s = &self.spheres[i];
        let frame = Frame::from_normal(direction);
        let [x, y] = warp::disc([v, u[1]]);
        let p = s.center + (frame.x * x + frame.y * y) * s.radius;
        let holds = |(k, t): (usize, &BoundingSphere)| {
            let d = p - t.center;
            k == i || (d - direction * d.dot(direction)).length_squared() <= area(t)
        };
        let pdf = shares.density(self.spheres.iter().enumerate().map(holds));
        Some((p, pdf / PI))
    }
}

/// Share of the photons that goes to all targets alike, whatever their size.
const ALIKE: f64 = 0.25;

/// How photons are shared among targets.
struct Shares {
    /// Size of each, and the probability to choose it.
    parts: ArrayVec<(f64, f64), MAX_SPHERES>,
}

impl Shares {
    fn new(sizes: impl Iterator<Item = f64> + Clone) -> Self {
        let total: f64 = sizes.clone().sum();
        let n = sizes.clone().filter(|s| *s > 0.0).count() as f64;
        let share = |size: f64| match size > 0.0 {
            true => (1.0 - ALIKE) * size / total + ALIKE / n,
            false => 0.0,
        };
        Self {
            parts: sizes.map(|s| (s, share(s))).collect(),
        }
    }

    /// Chooses one by `u`, and makes of the rest of `u` a number of its own.
    fn choose(&self, u: f64) -> Option<(usize, f64)> {
        let mut rest = u;
        let mut chosen = None;
        for (i, &(_, p)) in self.parts.iter().enumerate() {
            if p > 0.0 {
                chosen = Some((i, (rest / p).clamp(0.0, 1.0 - f64::EPSILON)));
                if rest < p {
                    break;
                }
                rest -= p;
            }
        }
        chosen
    }

    /// Density, in units of size, of what lies within some of them.
    fn density(&self, within: impl Iterator<Item = bool>) -> f64 {
        let parts = self.parts.iter().zip(within);
        parts
            .filter(|(part, within)| *within && part.1 > 0.0)
            .map(|((size, p), _)| p / size)
            .sum()
    }
}

/// Merges neighbours until few enough are left.
fn merge(mut spheres: Vec<BoundingSphere>) -> Vec<BoundingSphere> {
    spheres.retain(|s| s.radius > 0.0);
    while spheres.len() > MAX_SPHERES {
        let spread = |k: usize| {
            let c = || spheres.iter().map(|s| s.center[k]);
            c().fold(f64::NEG_INFINITY, f64::max) - c().fold(f64::INFINITY, f64::min)
        };
        let axis = (0..3)
            .max_by(|&a, &b| spread(a).total_cmp(&spread(b)))
            .unwrap_or(0);
        spheres.sort_by(|a, b| a.center[axis].total_cmp(&b.center[axis]));
        spheres = spheres
            .chunks(2)
            .map(|pair| pair[1..].iter().fold(pair[0], |a, b| a.union(*b)))
            .collect();
    }
    spheres
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::Rng;

    #[test]
    fn directions_have_the_density_they_claim_also_where_cones_overlap() {
        let targets = Targets {
            spheres: vec![
                BoundingSphere {
                    center: DVec3::new(0.0, 0.0, 3.0),
                    radius: 1.0,
                },
                BoundingSphere {
                    center: DVec3::new(0.8, 0.0, 3.0),
                    radius: 0.7,
                },
                BoundingSphere {
                    center: DVec3::new(-4.0, 1.0, 0.0),
                    radius: 0.5,
                },
            ],
        };
        // E[1/pdf] is the solid angle of the union; compare with uniform directions.
        let mut rng = Rng::new(2);
        let n = 400_000;
        let (mut sum, mut sum2, mut inside) = (0.0, 0.0, 0u32);
        for _ in 0..n {
            let (dir, pdf) = targets
                .sample_direction(DVec3::ZERO, rng.next_2d())
                .expect("some");
            assert!((dir.length() - 1.0).abs() < 1e-12);
            sum += 1.0 / pdf;
            sum2 += 1.0 / (pdf * pdf);
            let d = warp::sphere(rng.next_2d());
            let hit = targets
                .spheres
                .iter()
                .any(|s| Cone::new(s, DVec3::ZERO).holds(d));
            inside += u32::from(hit);
        }
        let n = f64::from(n);
        let (mean, p) = (sum / n, f64::from(inside) / n);
        let expected = 4.0 * std::f64::consts::PI * p;
        let sigma = ((sum2 / n - mean * mean) / n).sqrt()
            + 4.0 * std::f64::consts::PI * (p * (1.0 - p) / n).sqrt();
        assert!(
            (mean - expected).abs() < 4.0 * sigma,
            "{mean} {expected} ± {sigma}"
        );
    }

    #[test]
    fn many_spheres_are_merged_and_still_held() {
        let mut rng = Rng::new(3);
        let all: Vec<_> = (0..500)
            .map(|_| BoundingSphere {
                center: DVec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) * 10.0,
                radius: rng.next_1d() * 0.1 + 0.01,
            })
            .collect();
        let merged = merge(all.clone());
        assert!(merged.len() <= MAX_SPHERES);
        for s in &all {
            assert!(
                merged
                    .iter()
                    .any(|m| (s.center - m.center).length() + s.radius <= m.radius * (1.0 + 1e-9))
            );
        }
    }
}
