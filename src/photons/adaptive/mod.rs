//! `adaptive`: photons where what they meet changes (Namae and Makino 2002), without bias.
//!
//! Before photons are traced, the squares of random numbers that each light emits by are divided
//! into cells. Check rays through a cell's middle and corners, the forecasts of their hits and
//! the projection map say whether everything in the cell meets one thing; where not, it is split.
//! Each cell then gets a number of photons, one at least, which share its flux: so the flux is
//! conserved exactly, and splitting changes the variance of an estimate but never its mean. Check
//! rays decide and are not stored.

mod casters;
mod domain;
mod plan;

use std::sync::Arc;

use rayon::prelude::*;

pub(crate) use self::casters::{Beam, Caster, Sight, casters};
use self::domain::{Tree, trees};
use self::plan::{Leaf, Planner};
use super::emit::{EmissionContext, EmissionEntry, EmittedPhoton, PhotonSource, Purpose};
use super::{Guide, Targets};
use crate::geometry::forecast::Order;
use crate::sampling::{Sampler, hash2, stream};

/// Share of the global photons that goes to cells in which something changes.
const EDGES: f64 = 0.25;

/// Cells per photon, at most.
const CELLS: f64 = 0.25;

/// Cells that a tree may always have, if it has as many photons: to zoom in on one small object.
const LEAST_CELLS: u64 = 64;

/// Least flux density of a cell, over the mean of its tree, that photons are shared by.
const FAINTEST: f64 = 0.05;

/// Photons of a tree that is worth another level of strata.
const PER_STRATUM: f64 = 4096.0;

/// Divisions of a surface's points at most: 4096 strata.
const MOST_STRATA: u32 = 6;

/// Photons of one cell.
struct Share {
    tree: u32,
    cell: domain::Cell,
}

struct Adaptive<'a> {
    seed: u64,
    stream: u64,
    trees: Vec<Tree<'a>>,
    shares: Vec<Share>,
    /// First photon of each share, and the total at the end.
    first: Vec<u64>,
    checks: u64,
}

impl PhotonSource for Adaptive<'_> {
    fn len(&self) -> u64 {
        self.first.last().copied().unwrap_or(0)
    }

    fn emit(&self, i: u64) -> Option<EmittedPhoton> {
        let k = self.share(i);
        let (share, count) = (&self.shares[k], self.first[k + 1] - self.first[k]);
        let tree = &self.trees[share.tree as usize];
        let place = hash2(u64::from(tree.index), tree.stratum.key());
        let key = hash2(place, share.cell.key());
        let mut sampler = Sampler::new(self.seed, self.stream, key, i - self.first[k]);
        let u = share.cell.at(sampler.next_2d());
        let photon = tree.leave(u, sampler.next_2d())?;
        Some(EmittedPhoton {
            power: photon.power * (share.cell.measure() / count as f64),
            ..photon
        })
    }

    fn checks(&self) -> u64 {
        self.checks
    }

    fn cells(&self) -> u64 {
        self.shares.len() as u64
    }

    fn level(&self, i: u64) -> Option<u32> {
        Some(self.shares[self.share(i)].cell.level)
    }
}

/// Strata levels for a surface light of `photons`.
fn strata(photons: f64) -> u32 {
    let levels = (photons / PER_STRATUM).max(1.0).log(4.0).floor();
    (levels as u32).min(MOST_STRATA)
}

/// First divisions of a tree of `photons`: at most one cell for four photons.
fn base(photons: f64) -> u32 {
    (photons / 4.0).max(1.0).log(4.0).floor().min(3.0) as u32
}

/// Makes the emission; `order` is that of the forecasts.
pub(super) fn emission<'a>(cx: &EmissionContext<'a>, order: Order) -> Box<dyn PhotonSource + 'a> {
    let caustic = cx.purpose == Purpose::Caustic;
    let casters = casters(cx.scene, caustic);
    let power: f64 = cx.scene.lights.iter().map(|l| l.power().luminance()).sum();
    let aim = caustic.then(|| Arc::new(Targets::new(cx.scene)));
    let blind = aim.as_ref().is_some_and(|targets| targets.is_empty());
    let nothing = cx.count == 0 || !(power > 0.0) || blind;
    let mut all: Vec<Tree<'a>> = Vec::new();
    if !nothing {
        for (i, light) in cx.scene.lights.iter().enumerate() {
            let flux = light.power().luminance();
            if flux > 0.0 {
                let share = cx.guide.map_or(flux / power, |g| g.shares()[i]);
                let levels = strata(share * cx.count as f64);
                all.extend(trees(&**light, i as u32, levels, cx.scene, aim.as_ref()));
            }
        }
    }
    let shares = tree_shares(&all, cx.guide, cx.scene.lights.len());
    let planner = Planner {
        scene: cx.scene,
        accel: cx.accel,
        patches: cx.scene.patches(),
        casters: &casters,
        purpose: cx.purpose,
        order,
    };
    let grown: Vec<_> = all
        .par_iter()
        .zip(&shares)
        .map(|(tree, share)| {
            let photons = share * cx.count as f64;
            let least = LEAST_CELLS.min(photons as u64);
            let budget = ((CELLS * photons) as u64).max(least);
            // What one point of a curved light sees says little about the others.
            if !tree.is_flat() {
                return planner.whole(tree);
            }
            planner.grow(tree, budget, base(photons))
        })
        .collect();
    let checks = grown.iter().map(|g| g.checks).sum();
    let mut out = Adaptive {
        seed: cx.seed,
        stream: match cx.purpose {
            Purpose::Global => stream::GLOBAL_PHOTONS,
            Purpose::Caustic => stream::CAUSTIC_PHOTONS,
        },
        trees: all,
        shares: Vec::new(),
        first: vec![0],
        checks,
    };
    out.allot(&grown, cx, &shares);
    Box::new(out)
}

impl Adaptive<'_> {
    /// The share that photon `i` belongs to.
    fn share(&self, i: u64) -> usize {
        self.first.partition_point(|&f| f <= i) - 1
    }

    /// Gives each cell its photons.
    fn allot(&mut self, grown: &[plan::Grown], cx: &EmissionContext<'_>, shares: &[f64]) {
        let flux = |t: usize, leaf: &Leaf| {
            let tree = &self.trees[t];
            match cx.guide {
                // What every ray of the probes missed may still be there, faintly.
                None => leaf.power.max(FAINTEST * tree.flux) * leaf.cell.measure(),
                Some(guide) => {
                    let square = guide.square(tree.index as usize);
                    shares[t] * square.mass(leaf.cell.quarters())
                }
            }
        };
        let leaves = || {
            let each = grown.iter().enumerate();
            each.flat_map(|(t, g)| g.leaves.iter().map(move |l| (t, l)))
        };
        let spread: f64 = leaves().map(|(t, l)| flux(t, l) * l.weight).sum();
        let total: f64 = leaves().map(|(t, l)| flux(t, l)).sum();
        let edges = if spread > 0.0 { EDGES } else { 0.0 };
        let mut weights = Vec::new();
        for (t, leaf) in leaves() {
            self.shares.push(Share {
                tree: t as u32,
                cell: leaf.cell,
            });
            let f = flux(t, leaf);
            weights.push(match cx.purpose {
                // Neyman: in proportion to flux times deviation; the rest evenly.
                Purpose::Global if spread > 0.0 => {
                    (1.0 - edges) * f / total + edges * f * leaf.weight / spread
                }
                Purpose::Global => f,
                Purpose::Caustic => f * leaf.weight,
            });
        }
        let scale = scale(&weights, cx.count as f64);
        let mut acc = 0.0;
        for w in weights {
            // One photon at least keeps the mean, and rounding the running sum the total.
            acc += (w * scale).max(1.0);
            self.first.push(acc.round() as u64);
        }
    }
}

/// Shares of the photons that go to each tree: by flux, or as the guide says for lights.
fn tree_shares(trees: &[Tree<'_>], guide: Option<&Guide>, lights: usize) -> Vec<f64> {
    let mut fluxes = vec![0.0; lights];
    for tree in trees {
        fluxes[tree.index as usize] += tree.flux;
    }
    let total: f64 = fluxes.iter().sum();
    let share = |tree: &Tree<'_>| {
        let light = tree.index as usize;
        match guide {
            None => tree.flux / total,
            Some(guide) => guide.shares()[light] * tree.flux / fluxes[light],
        }
    };
    let finite = |share: f64| if share.is_finite() { share } else { 0.0 };
    trees.iter().map(|t| finite(share(t))).collect()
}

/// What to multiply weights by so that they sum to `count`, each counted as one at least. Zero if
/// there are more of them.
fn scale(weights: &[f64], count: f64) -> f64 {
    let mut sorted = weights.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let mut sum: f64 = sorted.iter().sum();
    let mut ones = 0.0;
    // The smallest are counted as one each, until what is left is worth more.
    while let Some(&least) = sorted.last() {
        let scale = (count - ones) / sum;
        if !(sum > 0.0) || scale <= 0.0 {
            return 0.0;
        }
        if least * scale >= 1.0 {
            return scale;
        }
        sum -= least;
        ones += 1.0;
        sorted.pop();
    }
    0.0
}

fn build<'a>(cx: &EmissionContext<'a>) -> Box<dyn PhotonSource + 'a> {
    emission(cx, Order::Quadratic)
}

/// The table's line.
pub(super) const ENTRY: EmissionEntry = EmissionEntry {
    name: "adaptive",
    doc: "more photons where what they meet changes, as derivatives of their hits forecast it",
    build,
};

#[cfg(test)]
mod tests {
    use super::scale;

    #[test]
    fn a_budget_is_kept_and_every_cell_has_one_photon() {
        let total = |w: &[f64], count: f64| -> f64 {
            let s = scale(w, count);
            w.iter().map(|w| (w * s).max(1.0)).sum()
        };
        for count in [5.0, 10.0, 1000.0] {
            for weights in [vec![1.0; 5], vec![1e-9, 1.0, 0.0, 3.0, 1e-3]] {
                assert!((total(&weights, count) - count).abs() < 1e-6 * count);
            }
        }
        // More cells than photons: one each.
        assert_eq!(total(&[0.5; 20], 10.0), 20.0);
        assert_eq!(total(&[0.0; 3], 10.0), 3.0);
    }
}
