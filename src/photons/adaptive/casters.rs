//! What a cell may hold: spheres, and bounding spheres of everything else, related to all rays of
//! a cell at once by the forecast of the ray in its middle.
//!
//! This is the projection map of photon mapping, without a raster: it finds what no ray has hit
//! and no derivative of a hit tells.

use crate::geometry::forecast::{Moves, Order, SphereForecast};
use crate::geometry::{ObjectId, Ray, Shape};
use crate::math::{BoundingSphere, DVec3, Frame};
use crate::scene::Scene;

/// Spheres of one object that are told apart; in a larger set its bounding sphere stands for all.
const MOST_SPHERES: usize = 256;

/// Something that rays may hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Caster {
    pub(crate) object: u32,
    pub(crate) sphere: BoundingSphere,
    /// Whether it is a sphere itself, so that its outline is its silhouette.
    pub(crate) exact: bool,
}

/// How the rays of a cell pass a sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sight {
    /// No ray meets it.
    Outside,
    /// Every ray does.
    Inside,
    /// About this share of them does.
    Straddles(f64),
}

/// The rays of a cell: around one ray, turned or shifted by up to `reach`, from origins up to
/// `spread` away.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam {
    pub(crate) o: DVec3,
    pub(crate) d: DVec3,
    pub(crate) reach: f64,
    pub(crate) spread: f64,
    pub(crate) moves: Moves,
}

impl Beam {
    pub(crate) fn new(ray: &Ray, reach: f64, spread: f64, moves: Moves) -> Self {
        Self {
            o: ray.origin(),
            d: ray.direction(),
            reach,
            spread,
            moves,
        }
    }

    /// Its half width at a distance.
    pub(crate) fn width(&self, distance: f64) -> f64 {
        match self.moves {
            Moves::Target => self.reach * distance,
            Moves::Ray => self.reach,
        }
    }

    /// Least and largest value of a sphere's discriminant over the beam, as forecast.
    fn range(&self, f: &SphereForecast, axis: bool, order: Order) -> [f64; 2] {
        let along = f.gradient - self.d * (f.gradient.dot(self.d) / self.d.length_squared());
        // Around the sphere's middle every way is downhill, and all are alike.
        let way = along
            .try_normalize()
            .unwrap_or_else(|| Frame::from_normal(self.d.normalize()).x);
        let ends = [
            f.discriminant,
            f.at(way * self.reach, order),
            f.at(-way * self.reach, order),
        ];
        let lo = ends.into_iter().fold(f64::INFINITY, f64::min);
        let hi = ends.into_iter().fold(f64::NEG_INFINITY, f64::max);
        // A small sphere within the beam peaks between the ends.
        [
            lo,
            if axis && order == Order::Quadratic {
                hi.max(1.0)
            } else {
                hi
            },
        ]
    }

    /// How it passes a sphere.
    pub(crate) fn sight(&self, s: &BoundingSphere, order: Order) -> Sight {
        let to = s.center - self.o;
        let dist = to.length();
        let outer = s.radius + self.spread;
        if dist <= outer {
            // The light may be inside: only for a light without extent is it known.
            return if self.spread == 0.0 {
                Sight::Inside
            } else {
                Sight::Straddles(0.5)
            };
        }
        let d_len = self.d.length();
        let depth = to.dot(self.d) / d_len;
        let turn = if self.moves == Moves::Target {
            self.reach * dist
        } else {
            0.0
        };
        if depth + turn + outer < 0.0 {
            return Sight::Outside;
        }
        let axis = match self.moves {
            Moves::Target => (to / dist - self.d / d_len).length() <= self.reach,
            Moves::Ray => (to - self.d * (depth / d_len)).length() <= self.reach,
        };
        let around = SphereForecast::new(self.o, self.d, s.center, outer, self.moves);
        if around.is_some_and(|f| self.range(&f, axis, order)[1] < 0.0) {
            return Sight::Outside;
        }
        let inner = s.radius - self.spread;
        if inner > 0.0 && depth - turn > 0.0 {
            let within = SphereForecast::new(self.o, self.d, s.center, inner, self.moves);
            if within.is_some_and(|f| self.range(&f, axis, order)[0] > 0.0) {
                return Sight::Inside;
            }
        }
        Sight::Straddles(self.share(s, dist))
    }

    /// About which share of the beam meets a sphere whose outline crosses it.
    fn share(&self, s: &BoundingSphere, dist: f64) -> f64 {
        let width = self.width(dist).hypot(self.spread);
        let disc = (s.radius / width).powi(2);
        if disc < 0.25 {
            return disc.max(1e-3);
        }
        // The outline is nearly a straight line, at the distance that value and slope tell.
        let Some(f) = SphereForecast::new(self.o, self.d, s.center, s.radius, self.moves) else {
            return 0.5;
        };
        let slope = f.gradient.length();
        let at = if slope > 0.0 {
            f.discriminant / slope
        } else {
            0.0
        };
        let scale = self.reach * width / self.width(dist).max(f64::MIN_POSITIVE);
        (0.5 + 0.7 * at / scale).min(disc).clamp(0.03, 0.97)
    }
}

/// Everything in the scene that a cell may hold; for caustics only what is specular.
pub(crate) fn casters(scene: &Scene, specular_only: bool) -> Vec<Caster> {
    let g = &scene.geometry;
    let mut out = Vec::new();
    for id in (0..g.objects.len() as u32).map(ObjectId) {
        let object = g.object(id);
        let traits = scene.material(object.material).traits();
        if specular_only && !(traits.reflects || traits.transmits) {
            continue;
        }
        let caster = |sphere: BoundingSphere, exact| Caster {
            object: id.0,
            sphere,
            exact,
        };
        match g.shape(object.shape) {
            Shape::Spheres(set)
                if object.placement.is_none() && set.spheres.len() <= MOST_SPHERES =>
            {
                out.extend((0..set.spheres.len()).map(|i| {
                    let (center, radius) = set.get(i as u32);
                    caster(BoundingSphere { center, radius }, true)
                }));
            }
            _ => {
                let mut sphere = scene.bounding_sphere(id);
                // Rounding must not push a corner out.
                sphere.radius *= 1.0 + 1e-6;
                out.push(caster(sphere, false));
            }
        }
    }
    out.retain(|c| c.sphere.radius > 0.0);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sphere::intersect;
    use crate::sampling::{Rng, warp};

    #[test]
    fn what_a_beam_sees_of_a_sphere_is_what_its_rays_meet() {
        let mut rng = Rng::new(1);
        let mut seen = [0; 3];
        for i in 0..4000 {
            let moves = [Moves::Target, Moves::Ray][i % 2];
            let spread = if i % 3 == 0 { 0.05 } else { 0.0 };
            let d = warp::sphere(rng.next_2d());
            let s = BoundingSphere {
                center: (d * 3.0 + warp::sphere(rng.next_2d()) * 1.5)
                    .as_vec3()
                    .as_dvec3(),
                radius: f64::from((0.02 + rng.next_1d()) as f32),
            };
            let beam = Beam {
                o: DVec3::ZERO,
                d,
                reach: 0.01 + 0.2 * rng.next_1d(),
                spread,
                moves,
            };
            let frame = Frame::from_normal(d);
            let (mut hits, n) = (0u32, 200);
            for _ in 0..n {
                let [x, y] = warp::disc(rng.next_2d()).map(|x| x * beam.reach);
                let h = frame.x * x + frame.y * y;
                let shift = warp::sphere(rng.next_2d()) * spread * rng.next_1d();
                let (o, d) = match moves {
                    Moves::Target => (shift, d + h),
                    Moves::Ray => (shift + h, d),
                };
                let hit = intersect(o, d, s.center, s.radius, 0.0, f64::INFINITY);
                hits += u32::from(hit.is_some());
            }
            let share = f64::from(hits) / f64::from(n);
            match beam.sight(&s, Order::Quadratic) {
                Sight::Outside => {
                    seen[0] += 1;
                    assert_eq!(hits, 0, "{beam:?} {s:?}");
                }
                Sight::Inside => {
                    seen[1] += 1;
                    assert_eq!(hits, n, "{beam:?} {s:?}");
                }
                Sight::Straddles(p) => {
                    seen[2] += 1;
                    // A guess, but not a wild one.
                    assert!((p - share).abs() < 0.5, "{p} for {share}: {beam:?} {s:?}");
                }
            }
        }
        println!("outside, inside, straddling: {seen:?}");
        assert!(seen.iter().all(|&n| n > 100), "{seen:?}");
    }
}
