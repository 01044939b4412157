//! Where specular objects are, seen from a light: the directions that caustic photons take.
//!
//! Each specular object (or cluster, if there are many) is held by a bounding sphere. Photons
//! are sent uniformly over the union of the cones under which a light's point sees these
//! spheres; overlaps are counted, so the density of every direction is known exactly.

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
        let cones = |s| Cone::new(s, from);
        let total: f64 = self.spheres.iter().map(|s| cones(s).complement).sum();
        let mut rest = u[0] * total;
        let mut chosen = None;
        for s in &self.spheres {
            let cone = cones(s);
            chosen = Some((
                cone,
                (rest / cone.complement).clamp(0.0, 1.0 - f64::EPSILON),
            ));
            if rest < cone.complement {
                break;
            }
            rest -= cone.complement;
        }
        let (cone, v) = chosen?;
        let local = warp::cone_from_complement([v, u[1]], cone.complement);
        let dir = Frame::from_normal(cone.axis).to_world(local);
        // The chosen cone holds it by construction; the others by test.
        let overlap = self
            .spheres
            .iter()
            .filter(|s| cones(s).holds(dir))
            .count()
            .max(1);
        let pdf = overlap as f64 / (2.0 * std::f64::consts::PI * total);
        Some((dir, pdf))
    }

    /// A point of the union of the spheres' shadows on a plane normal to `direction`, and its
    /// density in area. The point lies beside some sphere's centre.
    pub fn sample_disc(&self, direction: DVec3, u: [f64; 2]) -> Option<(DVec3, f64)> {
        let area = |s: &BoundingSphere| s.radius * s.radius;
        let total: f64 = self.spheres.iter().map(area).sum();
        if !(total > 0.0) {
            return None;
        }
        let mut rest = u[0] * total;
        let mut chosen = None;
        for s in &self.spheres {
            chosen = Some((s, (rest / area(s)).clamp(0.0, 1.0 - f64::EPSILON)));
            if rest < area(s) {
                break;
            }
            rest -= area(s);
        }
        let (s, v) = chosen?;
        let frame = Frame::from_normal(direction);
        let [x, y] = warp::disc([v, u[1]]);
        let p = s.center + (frame.x * x + frame.y * y) * s.radius;
        let overlap = self
            .spheres
            .iter()
            .filter(|t| {
                let d = p - t.center;
                (d - direction * d.dot(direction)).length_squared() <= area(t) * (1.0 + 1e-12)
            })
            .count()
            .max(1);
        Some((p, overlap as f64 / (std::f64::consts::PI * total)))
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
