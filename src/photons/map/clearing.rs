//! How far a surface reaches around a point, and what stands on it: the part of a kernel's disc
//! that photons can have arrived on. Without it densities fall towards corners and borders, and
//! light leaks under walls.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::{FLATNESS, NORMAL_AGREEMENT, Site};
use crate::accel::Accelerator;
use crate::geometry::Ray;
use crate::math::{DVec2, DVec3, Frame, Vec3};
use crate::scene::Scene;

/// Directions that are looked along.
const DIRECTIONS: usize = 16;

/// Height above the surface, in kernel radii, at which obstacles are looked for.
const EYE: f64 = 0.1;

/// How far is looked, in kernel radii: a disc around another point nearby must fit in.
const REACH: f64 = 2.0;

/// Cosine to the normal, and height over the plane in kernel radii, up to which a surface is flat:
/// it makes no difference to a kernel of how much of a plane a photon is counted.
const EVEN: f64 = 0.9999;
const LEVEL: f64 = 0.02;

/// Steps of the search for a border; each halves its uncertainty.
const BISECTIONS: u32 = 5;

static COMPASS: LazyLock<[DVec2; DIRECTIONS]> = LazyLock::new(|| {
    std::array::from_fn(|k| DVec2::from_angle(TAU * k as f64 / DIRECTIONS as f64))
});

/// What was met along one direction.
#[derive(Clone, Copy)]
struct Sight {
    /// How far the surface reaches that way.
    distance: f64,
    /// The obstacle's normal in the tangent plane, towards the eye.
    wall: Option<DVec2>,
    /// Whether the surface where sight ends lies in the tangent plane.
    flat: bool,
}

/// What is around a site within the reach of its kernels.
pub(super) enum Seen {
    /// The surface goes on, and is flat.
    Flat,
    /// The surface goes on, but bends.
    Bent,
    /// The surface ends, or something stands on it.
    Limited(Clearing),
}

/// A star-shaped polygon in the tangent plane of a site: a part of what can be seen and stood on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Clearing {
    /// Of each sector between neighbouring directions: how far it reaches along both.
    sectors: [[f32; 2]; DIRECTIONS],
}

impl Clearing {
    fn look(around: Surroundings<'_>, site: &Site, radius: f32) -> Seen {
        let view = Look {
            around,
            p: site.p.as_dvec3(),
            n: site.ng.as_dvec3(),
            radius: f64::from(radius),
        };
        let reach = REACH * view.radius;
        // Every other direction tells whether it is worth looking closely.
        let mut flat = true;
        let mut open = |k: usize| {
            let sight = view.along(COMPASS[k]);
            flat &= sight.flat;
            sight.distance >= reach
        };
        if (0..DIRECTIONS).step_by(2).all(&mut open) {
            return if flat { Seen::Flat } else { Seen::Bent };
        }
        let sights: [Sight; DIRECTIONS] = std::array::from_fn(|k| view.along(COMPASS[k]));
        let sectors = std::array::from_fn(|k| {
            let next = (k + 1) % DIRECTIONS;
            let (a, b) = (&sights[k], &sights[next]);
            let across = COMPASS[next] * b.distance - COMPASS[k] * a.distance;
            // The straight line between two points of the rim stays inside unless one of them
            // is hidden from the other's wall.
            let slack = 1e-3 * view.radius;
            let hidden = a.wall.is_some_and(|n| across.dot(n) < -slack)
                || b.wall.is_some_and(|n| across.dot(n) > slack);
            if hidden {
                [a.distance.min(b.distance) as f32; 2]
            } else {
                [a.distance as f32, b.distance as f32]
            }
        });
        Seen::Limited(Self { sectors })
    }

    fn corners(&self, k: usize) -> [DVec2; 2] {
        let [a, b] = self.sectors[k].map(f64::from);
        [COMPASS[k] * a, COMPASS[(k + 1) % DIRECTIONS] * b]
    }

    /// Whether a point of the tangent plane, relative to the site, lies inside.
    #[inline]
    fn contains(&self, q: DVec2) -> bool {
        let [a, b] = self.corners(sector(q));
        // Strictly: a sector of no reach holds nothing, not everything.
        (b - a).perp_dot(q - a) > 0.0
    }

    /// Area of the disc around `center`, relative to the site, that lies inside.
    fn disc(&self, center: DVec2, radius: f64) -> f64 {
        (0..DIRECTIONS)
            .map(|k| {
                let [a, b] = self.corners(k).map(|v| v - center);
                let origin = -center;
                wedge(origin, a, radius) + wedge(a, b, radius) + wedge(b, origin, radius)
            })
            .sum()
    }
}

/// Which sector a direction of the plane lies in.
#[inline]
fn sector(q: DVec2) -> usize {
    const TAN_22: f64 = 0.414_213_562_373_095_03;
    // Turned into the first quadrant.
    let (quadrant, x, y) = match (q.x > 0.0, q.y >= 0.0) {
        (true, true) => (0, q.x, q.y),
        (false, true) if q.y > 0.0 => (1, q.y, -q.x),
        (false, _) if q.x < 0.0 => (2, -q.x, -q.y),
        _ => (3, -q.y, q.x),
    };
    let steps = usize::from(y >= TAN_22 * x) + usize::from(y >= x) + usize::from(TAN_22 * y >= x);
    (4 * quadrant + steps) % DIRECTIONS
}

/// Signed area of the triangle from the origin to `a` and `b` within the disc of radius `r`
/// around the origin.
fn wedge(a: DVec2, b: DVec2, r: f64) -> f64 {
    let sector = |u: DVec2, v: DVec2| 0.5 * r * r * u.perp_dot(v).atan2(u.dot(v));
    let d = b - a;
    let (dd, ad) = (d.length_squared(), a.dot(d));
    let root = ad * ad - dd * (a.length_squared() - r * r);
    if dd == 0.0 {
        return 0.0;
    }
    if root <= 0.0 {
        return sector(a, b);
    }
    let root = root.sqrt();
    let (t0, t1) = ((-ad - root) / dd, (-ad + root) / dd);
    if t0 >= 1.0 || t1 <= 0.0 {
        return sector(a, b);
    }
    let mut area = 0.0;
    let (mut from, mut to) = (a, b);
    if t0 > 0.0 {
        from = a + d * t0;
        area += sector(a, from);
    }
    if t1 < 1.0 {
        to = a + d * t1;
        area += sector(to, b);
    }
    area + 0.5 * from.perp_dot(to)
}

/// The tangent plane of a site, with what lies in it.
pub(super) struct Plane<'a> {
    frame: Frame,
    site: DVec3,
    clearing: &'a Clearing,
}

impl<'a> Plane<'a> {
    #[inline]
    pub(super) fn new(clearing: &'a Clearing, p: Vec3, ng: Vec3) -> Self {
        Self {
            frame: Frame::from_normal(ng.as_dvec3()),
            site: p.as_dvec3(),
            clearing,
        }
    }

    #[inline]
    fn flat(&self, p: Vec3) -> DVec2 {
        self.frame.to_local(p.as_dvec3() - self.site).truncate()
    }

    /// Whether a point above or below the plane lies in the clearing.
    #[inline]
    pub(super) fn contains(&self, p: Vec3) -> bool {
        self.clearing.contains(self.flat(p))
    }

    /// Area of the disc around a point that lies in the clearing.
    #[inline]
    pub(super) fn disc(&self, p: Vec3, radius: f64) -> f64 {
        self.clearing.disc(self.flat(p), radius)
    }
}

/// What surfaces stand in.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its ray tracer.
    pub accel: &'a dyn Accelerator,
}

impl Surroundings<'_> {
    /// Looks around a site, as far as kernels of this radius reach.
    pub(super) fn look(self, site: &Site, radius: f32) -> Seen {
        Clearing::look(self, site, radius)
    }
}

/// An eye close above a surface.
struct Look<'a> {
    around: Surroundings<'a>,
    p: DVec3,
    n: DVec3,
    radius: f64,
}

impl Look<'_> {
    /// How far the surface reaches in a direction of its tangent plane.
    fn along(&self, dir: DVec2) -> Sight {
        let frame = Frame::from_normal(self.n);
        let d = frame.x * dir.x + frame.y * dir.y;
        let eye = self.p + self.n * (EYE * self.radius);
        let reach = REACH * self.radius;
        let mut sight = Sight {
            distance: reach,
            wall: None,
            flat: false,
        };
        let ray = Ray {
            tmax: reach as f32,
            ..Ray::new(eye, d)
        };
        if let Some(hit) = self.around.accel.intersect(&ray) {
            let on = self.around.scene.surface_point(&ray, &hit);
            // A surface that bends upward meets its own tangent plane.
            if on.ng.dot(self.n).abs() < f64::from(NORMAL_AGREEMENT) {
                sight.distance = on.distance;
                let across = frame.to_local(on.ng).truncate();
                let toward = if across.dot(dir) > 0.0 {
                    -across
                } else {
                    across
                };
                sight.wall = Some(toward);
            }
        }
        // Close before an obstacle there may be a gap, not more.
        let end = sight.distance * (1.0 - 1e-3);
        if let Some(flat) = self.ground(d, end) {
            sight.flat = flat;
        } else {
            let (mut on, mut off) = (0.0, end);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (on + off);
                if self.ground(d, middle).is_some() {
                    on = middle;
                } else {
                    off = middle;
                }
            }
            sight = Sight {
                distance: on,
                wall: None,
                flat: false,
            };
        }
        sight
    }

    /// Whether the surface goes on at this distance, and if so, whether it lies in the tangent
    /// plane there.
    fn ground(&self, d: DVec3, distance: f64) -> Option<bool> {
        let height = f64::from(FLATNESS) * self.radius.max(distance);
        let ray = Ray {
            tmax: (2.0 * height) as f32,
            ..Ray::new(self.p + d * distance + self.n * height, -self.n)
        };
        let hit = self.around.accel.intersect(&ray)?;
        let on = self.around.scene.surface_point(&ray, &hit);
        let cos = on.ng.dot(self.n).abs();
        let flat = cos > EVEN && (on.distance - height).abs() < LEVEL * self.radius;
        (cos >= f64::from(NORMAL_AGREEMENT)).then_some(flat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn regular(r: f32) -> Clearing {
        Clearing {
            sectors: [[r; 2]; DIRECTIONS],
        }
    }

    #[test]
    fn sectors_are_those_of_the_compass() {
        for k in 0..DIRECTIONS {
            for part in [0.01, 0.5, 0.99] {
                let angle = TAU * (k as f64 + part) / DIRECTIONS as f64;
                assert_eq!(sector(DVec2::from_angle(angle) * 3.0), k, "{angle}");
            }
            assert!([k, (k + 15) % 16].contains(&sector(COMPASS[k])), "{k}");
        }
    }

    #[test]
    fn a_sector_of_no_reach_holds_nothing() {
        let mut nook = regular(0.0);
        nook.sectors[3] = [2.0, 1.0];
        let inside = |angle: f64, r: f64| nook.contains(DVec2::from_angle(angle * TAU / 16.0) * r);
        for k in 0..DIRECTIONS {
            let middle = k as f64 + 0.5;
            for r in [1e-6, 1.0, 100.0] {
                assert_eq!(inside(middle, r), k == 3 && r < 1.3, "{k} {r}");
            }
        }
        let area = nook.disc(DVec2::ZERO, 9.0);
        assert!((area - (TAU / 16.0).sin()).abs() < 1e-6, "{area}");
    }

    #[test]
    fn areas_of_discs_are_exact() {
        let inside = regular(2.0);
        let polygon = 0.5 * 16.0 * 4.0 * (TAU / 16.0).sin();
        let area = |c: DVec2, r| inside.disc(c, r);
        assert!((area(DVec2::ZERO, 1.0) - PI).abs() < 1e-12);
        assert!((area(DVec2::new(0.3, -0.2), 1.0) - PI).abs() < 1e-12);
        assert!((area(DVec2::new(0.3, -0.2), 9.0) - polygon).abs() < 1e-6);
        // A straight wall at x = 0.5: the rest of the disc is a circle without a segment.
        let mut walled = regular(2.0);
        for (k, s) in walled.sectors.iter_mut().enumerate() {
            for (reach, dir) in s.iter_mut().zip([k, k + 1]) {
                let cos = COMPASS[dir % DIRECTIONS].x;
                if cos > 0.25 {
                    *reach = (0.5 / cos) as f32;
                }
            }
        }
        let segment = 0.5f64.acos() - 0.5 * 0.75f64.sqrt();
        assert!((walled.disc(DVec2::ZERO, 1.0) - (PI - segment)).abs() < 1e-6);
        assert!(walled.contains(DVec2::new(0.49, 0.2)));
        assert!(!walled.contains(DVec2::new(0.51, 0.2)));
        // Around another point of it.
        let half = walled.disc(DVec2::new(0.5, 0.0), 0.5);
        assert!((half - PI * 0.125).abs() < 1e-6, "{half}");
    }
}
