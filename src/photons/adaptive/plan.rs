//! Growing a tree: check rays are traced, their hits forecast what the rest of a cell meets, and
//! cells in which that changes are split.

use rayon::prelude::*;

use super::casters::{Beam, Caster, Sight};
use super::domain::{Cell, DEEPEST, Tree};
use crate::accel::Accelerator;
use crate::geometry::forecast::Order;
use crate::geometry::{Hit, Ray};
use crate::geometry::{PatchId, ScenePatches, Walk};
use crate::photons::Purpose;
use crate::scene::Scene;

/// A bounding sphere that no ray has hit yet is searched for down to cells this wide, in radii.
const SEARCH: f64 = 0.25;

/// Least share of a cell that is taken for covered or free when its check rays disagree.
const LEAST_SHARE: f64 = 0.05;

/// Density of photons in cells that may hold a specular object although no check ray met it,
/// relative to those that do: small, and so large that what it does hold stays smooth.
const UNSEEN: f64 = 0.25;

/// All that planning reads.
pub(super) struct Planner<'a> {
    pub(super) scene: &'a Scene,
    pub(super) accel: &'a dyn Accelerator,
    pub(super) patches: &'a ScenePatches,
    pub(super) casters: &'a [Caster],
    pub(super) purpose: Purpose,
    pub(super) order: Order,
}

/// A finished cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    pub(super) cell: Cell,
    /// Global: spread `√(p(1−p))` of what is met, 0 where it is one thing. Caustic: density of
    /// photons, 1 where all of it is covered.
    pub(super) weight: f64,
    /// Mean luminance of the power of its check rays, were it the whole tree.
    pub(super) power: f64,
}

/// A tree when it is grown.
pub(super) struct Grown {
    pub(super) leaves: Vec<Leaf>,
    /// Check rays traced.
    pub(super) checks: u64,
}

/// A ray that was traced.
#[derive(Clone, Copy)]
struct Probe {
    ray: Ray,
    power: f64,
    hit: Option<Hit>,
    id: Option<PatchId>,
    specular: bool,
}

impl Probe {
    fn distance(&self) -> f64 {
        self.hit.map_or(f64::INFINITY, |h| {
            f64::from(h.t) * self.ray.direction().length()
        })
    }
}

/// A cell that may be split further.
struct Open {
    cell: Cell,
    /// Corners in the order of the children, then the middle.
    probes: [Option<Probe>; 5],
    casters: Vec<u32>,
    weight: f64,
    /// Whether it may hold something small that no ray has met.
    search: bool,
}

/// What is known of a cell.
struct Verdict {
    split: bool,
    weight: f64,
}

impl Planner<'_> {
    /// A tree of a single cell, about which nothing is known.
    pub(super) fn whole(&self, tree: &Tree<'_>) -> Grown {
        let leaf = Leaf {
            cell: Cell::default(),
            weight: match self.purpose {
                Purpose::Global => 0.0,
                Purpose::Caustic => 1.0,
            },
            power: tree.flux,
        };
        Grown {
            leaves: vec![leaf],
            checks: 0,
        }
    }

    /// Grows a tree of at most `budget` cells, about.
    pub(super) fn grow(&self, tree: &Tree<'_>, budget: u64, base: u32) -> Grown {
        let mut leaves = Vec::new();
        let mut checks = 0;
        let all = (0..self.casters.len() as u32).collect::<Vec<_>>();
        let mut open: Vec<Open> = Vec::new();
        let settle = |cells: Vec<(Open, Verdict)>, leaves: &mut Vec<Leaf>| -> Vec<Open> {
            let mut next = Vec::new();
            for (mut o, v) in cells {
                o.weight = v.weight;
                if v.split {
                    next.push(o);
                } else {
                    leaves.push(o.leaf());
                }
            }
            next
        };
        // The first cells are there whatever they hold: forecasts need a hit to start from.
        let first: Vec<(Open, Verdict)> = (0..1u32 << (2 * base))
            .into_par_iter()
            .map(|i| {
                let cell = Cell::number(base, i);
                let at = |k: usize| self.probe(tree, cell.knot((k & 1) * 2, (k >> 1) * 2));
                let probes = [
                    at(0),
                    at(1),
                    at(2),
                    at(3),
                    self.probe(tree, cell.knot(1, 1)),
                ];
                self.judge(tree, cell, probes, &all)
            })
            .collect();
        checks += 5 * first.len() as u64;
        open.extend(settle(first, &mut leaves));
        let mut waiting: Vec<Open> = Vec::new();
        loop {
            if open.is_empty() {
                open = std::mem::take(&mut waiting);
            }
            let cells = leaves.len() + open.len() + waiting.len();
            let room = budget.saturating_sub(cells as u64) / 3;
            if room == 0 || open.is_empty() {
                break;
            }
            if (room as usize) < open.len() {
                // What is small takes few cells a level and many levels to find. Edges, of which
                // every level has more, would use up the cells before: they wait.
                let (search, rest): (Vec<_>, Vec<_>) = open.into_iter().partition(|o| o.search);
                if !search.is_empty() && !rest.is_empty() {
                    waiting.extend(rest);
                    open = search;
                    continue;
                }
                open = if search.is_empty() { rest } else { search };
                // The last level is split in part: where most is to be gained, and elsewhere as
                // the order of names would have it, which knows nothing of places.
                let rank = |o: &Open| crate::sampling::hash2(1, o.cell.key());
                open.sort_by(|a, b| {
                    let gain = self.gain(b).total_cmp(&self.gain(a));
                    gain.then_with(|| rank(a).cmp(&rank(b)))
                });
                leaves.extend(open.drain(room as usize..).map(|o| o.leaf()));
            }
            checks += 8 * open.len() as u64;
            let children: Vec<(Open, Verdict)> = open
                .par_iter()
                .flat_map_iter(|o| self.split(tree, o))
                .collect();
            open = settle(children, &mut leaves);
        }
        leaves.extend(open.into_iter().chain(waiting).map(|o| o.leaf()));
        Grown { leaves, checks }
    }

    /// What splitting a cell promises, in steps, so that equal cells stay in their hashed order.
    fn gain(&self, o: &Open) -> f64 {
        match self.purpose {
            Purpose::Global => (4.0 * o.weight).round(),
            Purpose::Caustic => (4.0 * o.weight * (1.0 - o.weight)).round(),
        }
    }

    /// The four quarters of a cell: eight new rays, the others are known.
    fn split(&self, tree: &Tree<'_>, o: &Open) -> [(Open, Verdict); 4] {
        let mid = |i, j| self.probe(tree, o.cell.knot(i, j));
        let [a, b, c, d, m] = o.probes;
        let (south, west, east, north) = (mid(1, 0), mid(0, 1), mid(2, 1), mid(1, 2));
        let corners = [
            [a, south, west, m],
            [south, b, m, east],
            [west, m, c, north],
            [m, east, north, d],
        ];
        [0, 1, 2, 3].map(|k| {
            let cell = o.cell.child(k as u32);
            let [p, q, r, s] = corners[k];
            let middle = self.probe(tree, cell.knot(1, 1));
            self.judge(tree, cell, [p, q, r, s, middle], &o.casters)
        })
    }

    /// Traces the ray at `u`, from the middle of the stratum.
    fn probe(&self, tree: &Tree<'_>, u: [f64; 2]) -> Option<Probe> {
        let photon = tree.leave(u, [0.5; 2])?;
        let ray = photon.ray;
        let hit = self.accel.intersect(&ray);
        let g = &self.scene.geometry;
        let id = hit.map(|h| self.patches.id(g, ray.origin(), ray.direction(), &h));
        let specular = hit.is_some_and(|h| {
            let t = self.scene.material(g.object(h.object).material).traits();
            t.reflects || t.transmits
        });
        Some(Probe {
            ray,
            power: photon.power.luminance(),
            hit,
            id,
            specular,
        })
    }

    /// Decides about a cell whose corners and middle were probed.
    fn judge(
        &self,
        tree: &Tree<'_>,
        cell: Cell,
        probes: [Option<Probe>; 5],
        casters: &[u32],
    ) -> (Open, Verdict) {
        let Some(middle) = &probes[4] else {
            // The light sends nothing here, as far as one ray tells.
            let open = Open::new(cell, probes, Vec::new());
            let weight = match self.purpose {
                Purpose::Global => 0.0,
                Purpose::Caustic => UNSEEN,
            };
            return (
                open,
                Verdict {
                    split: false,
                    weight,
                },
            );
        };
        let reach = tree.reach(cell, &middle.ray);
        let beam = Beam::new(&middle.ray, reach, tree.spread, tree.moves);
        let all: Vec<&Probe> = probes.iter().flatten().collect();
        let far = all.iter().fold(0.0f64, |m, p| m.max(p.distance()));
        let near = all.iter().fold(f64::INFINITY, |m, p| m.min(p.distance()));

        let mut held = Vec::new();
        let (mut crossing, mut search, mut unseen) = (None, false, false);
        for &i in casters {
            let c = &self.casters[i as usize];
            let sight = beam.sight(&c.sphere, self.order);
            if sight == Sight::Outside {
                continue;
            }
            held.push(i);
            let dist = (c.sphere.center - beam.o).length();
            let seen = all
                .iter()
                .any(|p| p.hit.is_some_and(|h| h.object.0 == c.object));
            let hidden = !seen && far < dist - c.sphere.radius - tree.spread;
            if hidden {
                continue;
            }
            match sight {
                Sight::Straddles(p) if c.exact && tree.is_own() => {
                    crossing = Some(crossing.unwrap_or(p));
                    unseen |= !seen;
                }
                _ if !seen => search |= beam.width(dist) > SEARCH * c.sphere.radius,
                _ => {}
            }
        }

        let split_by_hits;
        let weight;
        match self.purpose {
            Purpose::Global => {
                let differ = all.iter().any(|p| p.id != middle.id);
                let feature = !differ && self.walks_off(middle, &all, tree);
                split_by_hits = differ || feature || crossing.is_some() || search;
                let p = if differ || crossing.is_none() {
                    let same = all.iter().filter(|p| p.id == middle.id).count();
                    same as f64 / all.len() as f64
                } else {
                    crossing.unwrap_or(0.5)
                };
                let p = p.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
                weight = if split_by_hits {
                    (p * (1.0 - p)).sqrt()
                } else {
                    0.0
                };
            }
            Purpose::Caustic => {
                let hits = all.iter().filter(|p| p.specular).count();
                // An outline counts where a check ray passes it: the cones end at outlines too.
                split_by_hits = (hits > 0 && hits < all.len())
                    || search
                    || (hits == all.len() && self.walks_off(middle, &all, tree));
                let share = hits as f64 / all.len() as f64;
                weight = if hits == 0 {
                    UNSEEN
                } else {
                    share.max(LEAST_SHARE).sqrt()
                };
            }
        }
        // Where the light's own extent blurs more than the cell, splitting shows nothing.
        let blurred = tree.spread > 0.0
            && beam.width(near.min(self.nearest(&held, &beam))) < 0.5 * tree.parallax();
        let split = split_by_hits && !blurred && cell.level < DEEPEST;
        let mut open = Open::new(cell, probes, held);
        open.search = search || unseen;
        let verdict = Verdict { split, weight };
        (open, verdict)
    }

    /// Distance to the nearest caster that a cell holds.
    fn nearest(&self, held: &[u32], beam: &Beam) -> f64 {
        held.iter().fold(f64::INFINITY, |m, &i| {
            let s = &self.casters[i as usize].sphere;
            let gap = (s.center - beam.o).length() - s.radius;
            // What surrounds the light has its distance from the check rays.
            if gap > 0.0 { m.min(gap) } else { m }
        })
    }

    /// Whether the surface that the middle hits has an edge that matters on the way to a corner,
    /// by the forecast of the middle's hit.
    fn walks_off(&self, middle: &Probe, all: &[&Probe], tree: &Tree<'_>) -> bool {
        let Some(hit) = &middle.hit else {
            return false;
        };
        let Some(mesh) = self.patches.mesh(&self.scene.geometry, hit) else {
            return false;
        };
        let (o, d) = (middle.ray.origin(), middle.ray.direction());
        all.iter().any(|p| {
            let h = tree.offset(&middle.ray, &p.ray);
            matches!(
                mesh.walk(hit.prim, [o, d, h], tree.moves),
                Walk::Stopped(..)
            )
        })
    }
}

impl Open {
    fn new(cell: Cell, probes: [Option<Probe>; 5], casters: Vec<u32>) -> Self {
        Self {
            cell,
            probes,
            casters,
            weight: 0.0,
            search: false,
        }
    }

    /// As a finished cell.
    fn leaf(self) -> Leaf {
        let power: f64 = self.probes.iter().flatten().map(|p| p.power).sum();
        Leaf {
            cell: self.cell,
            weight: self.weight,
            power: power / 5.0,
        }
    }
}
