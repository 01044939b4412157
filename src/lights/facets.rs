//! Which of an emitter's triangles to sample for a point: a tree whose parts know how large they
//! look from where. Half of a lamp's surface faces away from any point, and choosing by area would
//! find it half of the time.
//!
//! Seen from afar along the unit vector `w`, normals `n` of flux `f` shed
//! `Σ f max(0, n·w) = ½ (V·w + Σ f |n·w|)`, where `V = Σ f n`; and by Cauchy and Schwarz
//! `Σ f |n·w| ≤ √(F wᵀMw)`, where `F = Σ f` and `M = Σ f n nᵀ`. That is exact for parts that face
//! one way, 15 % too much for a whole sphere, and 4 % of its flux instead of none for the far
//! half of one: better than what a cone around the normals tells.
//!
//! Source: for trees over lights, Conty Estevez and Kulla, *Importance Sampling of Many Lights with
//! Adaptive Tree Splitting*, PACMCGIT 1(2), 2018; there with cones.

use crate::math::{BoundingSphere, DMat3, DVec3};

/// Emitters of fewer triangles are sampled by their flux: walking a tree would cost more than the
/// noise it saves.
pub(super) const FEWEST: usize = 9;

/// What a part is thought to shed at least, of its flux, times its radius over its distance: the
/// direction to its places differs by that ratio from the one to its middle.
const LEAST: f64 = 0.1;

/// Least probability of one half of a part: what rounding takes for nothing could count.
const LEAST_SHARE: f64 = 1e-9;

/// A triangle as the tree sees it.
pub(super) struct Facet {
    /// Sphere around it.
    pub around: BoundingSphere,
    /// Unit normal on the side that emits.
    pub ng: DVec3,
    /// What it emits, in any unit; not negative.
    pub flux: f64,
}

/// A part of the emitter.
#[derive(Clone, Copy, Debug)]
struct Node {
    around: BoundingSphere,
    flux: f64,
    /// Sums of `f n` and `f n nᵀ`.
    vector: DVec3,
    moments: DMat3,
    parent: u32,
    /// The second half; the first follows the node. For a leaf, its triangle.
    next: u32,
    leaf: bool,
}

/// The tree, in depth-first order.
pub(super) struct Facets {
    nodes: Vec<Node>,
    /// The leaf of each triangle; none for one that does not emit.
    leaves: Vec<Option<u32>>,
    two_sided: bool,
}

impl Facets {
    /// Of triangles that emit on one side or, alike, on both.
    pub(super) fn new(facets: &[Facet], two_sided: bool) -> Self {
        let mut order: Vec<u32> = (0..facets.len() as u32)
            .filter(|&i| facets[i as usize].flux > 0.0)
            .collect();
        let mut tree = Self {
            nodes: Vec::with_capacity(2 * order.len()),
            leaves: vec![None; facets.len()],
            two_sided,
        };
        if !order.is_empty() {
            tree.grow(facets, &mut order, 0);
        }
        tree
    }

    /// Adds the tree over some triangles; returns its root. Halves are equal in number, so that
    /// it is as deep as the logarithm of that.
    fn grow(&mut self, facets: &[Facet], order: &mut [u32], parent: u32) -> u32 {
        let at = self.nodes.len();
        if let [i] = *order {
            let f = &facets[i as usize];
            self.leaves[i as usize] = Some(at as u32);
            self.nodes.push(Node {
                around: f.around,
                flux: f.flux,
                vector: f.ng * f.flux,
                moments: outer(f.ng) * f.flux,
                parent,
                next: i,
                leaf: true,
            });
            return at as u32;
        }
        // By place and facing alike: parts that lie together and face alike have narrow bounds.
        let key = |i: u32| {
            let f = &facets[i as usize];
            (f.around.center, f.ng)
        };
        let (mut lo, mut hi) = ([f64::INFINITY; 6], [f64::NEG_INFINITY; 6]);
        let coordinate = |i: u32, k: usize| match k {
            0..3 => key(i).0[k],
            _ => key(i).1[k - 3],
        };
        for &i in order.iter() {
            for k in 0..6 {
                lo[k] = lo[k].min(coordinate(i, k));
                hi[k] = hi[k].max(coordinate(i, k));
            }
        }
        let size = (0..3).map(|k| hi[k] - lo[k]).fold(0.0, f64::max);
        // Opposite normals weigh as much as the whole emitter's extent.
        let weight = |k: usize| if k < 3 { 1.0 } else { 0.5 * size };
        let axis = (0..6)
            .max_by(|&a, &b| {
                let extent = |k: usize| (hi[k] - lo[k]) * weight(k);
                extent(a).total_cmp(&extent(b))
            })
            .unwrap_or(0);
        let mid = order.len() / 2;
        order.select_nth_unstable_by(mid, |&a, &b| {
            coordinate(a, axis).total_cmp(&coordinate(b, axis))
        });
        // In its place before its parts are there.
        self.nodes.push(Node {
            around: facets[order[0] as usize].around,
            flux: 0.0,
            vector: DVec3::ZERO,
            moments: DMat3::ZERO,
            parent,
            next: 0,
            leaf: false,
        });
        let (first, second) = order.split_at_mut(mid);
        let a = self.grow(facets, first, at as u32) as usize;
        let b = self.grow(facets, second, at as u32) as usize;
        let (a, next, b) = (self.nodes[a], b as u32, self.nodes[b]);
        let node = &mut self.nodes[at];
        node.around = a.around.union(b.around);
        node.flux = a.flux + b.flux;
        node.vector = a.vector + b.vector;
        node.moments = a.moments + b.moments;
        node.next = next;
        at as u32
    }

    /// A guess of what a part sheds on `p`; positive.
    fn importance(&self, node: &Node, p: DVec3) -> f64 {
        let from = p - node.around.center;
        let r = node.around.radius;
        let d2 = from.length_squared().max(r * r).max(f64::MIN_POSITIVE);
        let inv = 1.0 / d2;
        let second = (node.flux * from.dot(node.moments * from).max(0.0) * inv).sqrt();
        let inv_d = inv.sqrt();
        let seen = if self.two_sided {
            second
        } else {
            0.5 * (second + node.vector.dot(from) * inv_d).max(0.0)
        };
        (seen + LEAST * node.flux * r * inv_d) * inv
    }

    /// Probability of the first half of a part, seen from `p`.
    fn first(&self, at: u32, p: DVec3) -> f64 {
        let a = self.importance(&self.nodes[at as usize + 1], p);
        let b = self.importance(&self.nodes[self.nodes[at as usize].next as usize], p);
        let sum = a + b;
        if sum > 0.0 && sum < f64::INFINITY {
            (a / sum).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE)
        } else {
            0.5
        }
    }

    /// A triangle for `p` chosen by `u`, its probability, and `u` rescaled to `[0, 1)`.
    pub(super) fn sample(&self, p: DVec3, mut u: f64) -> Option<(usize, f64, f64)> {
        let (mut at, mut pdf) = (0, 1.0);
        loop {
            let node = self.nodes.get(at as usize)?;
            if node.leaf {
                return Some((node.next as usize, pdf, u.min(1.0 - f64::EPSILON)));
            }
            let share = self.first(at, p);
            if u < share {
                (at, pdf, u) = (at + 1, pdf * share, u / share);
            } else {
                let share = 1.0 - share;
                (at, pdf, u) = (node.next, pdf * share, (u - (1.0 - share)) / share);
            }
        }
    }

    /// Probability that [`sample`](Self::sample) chooses triangle `i` for `p`.
    pub(super) fn probability(&self, p: DVec3, i: usize) -> f64 {
        let Some(Some(mut at)) = self.leaves.get(i).copied() else {
            return 0.0;
        };
        let mut pdf = 1.0;
        while at != 0 {
            let parent = self.nodes[at as usize].parent;
            let share = self.first(parent, p);
            pdf *= if at == parent + 1 { share } else { 1.0 - share };
            at = parent;
        }
        pdf
    }
}

/// The outer product of a vector with itself.
fn outer(n: DVec3) -> DMat3 {
    DMat3::from_cols(n * n.x, n * n.y, n * n.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{Rng, warp};

    fn facets(rng: &mut Rng, n: usize) -> Vec<Facet> {
        (0..n)
            .map(|i| {
                let n = warp::sphere(rng.next_2d());
                Facet {
                    around: BoundingSphere {
                        center: n * (1.0 + 0.1 * rng.next_1d()),
                        radius: 0.1 * rng.next_1d(),
                    },
                    ng: n,
                    // Some do not emit.
                    flux: if i % 7 == 3 { 0.0 } else { rng.next_1d() },
                }
            })
            .collect()
    }

    #[test]
    fn probabilities_are_those_of_the_samples_and_sum_to_one() {
        let mut rng = Rng::new(5);
        for (n, two_sided) in [(1, false), (2, true), (9, false), (300, false), (300, true)] {
            let facets = facets(&mut rng, n);
            let tree = Facets::new(&facets, two_sided);
            for distance in [0.0, 0.5, 1.05, 1.5, 30.0, 1e6, 1e200] {
                let p = warp::sphere(rng.next_2d()) * distance;
                let sum: f64 = (0..n).map(|i| tree.probability(p, i)).sum();
                assert!((sum - 1.0).abs() < 1e-9, "{n}, {distance}: {sum}");
                for k in 0..200 {
                    let u = (f64::from(k) + 0.5) / 200.0;
                    let (i, pdf, rest) = tree.sample(p, u).expect("something emits");
                    let expected = tree.probability(p, i);
                    assert!(
                        (pdf - expected).abs() <= 1e-9 * expected,
                        "{pdf} {expected}"
                    );
                    assert!((0.0..1.0).contains(&rest));
                }
            }
        }
    }

    #[test]
    fn what_faces_away_is_seldom_chosen_and_nothing_that_emits_never() {
        let mut rng = Rng::new(6);
        let facets = facets(&mut rng, 500);
        let tree = Facets::new(&facets, false);
        let mut wasted = 0.0;
        for _ in 0..100 {
            let p = warp::sphere(rng.next_2d()) * 3.0;
            for (i, f) in facets.iter().enumerate() {
                let pdf = tree.probability(p, i);
                assert_eq!(pdf > 0.0, f.flux > 0.0);
                let faces = f.ng.dot(p - f.around.center) > 0.0;
                wasted += if faces { 0.0 } else { pdf };
            }
        }
        // By area it would be two thirds, seen from three radii.
        assert!(wasted / 100.0 < 0.1, "{wasted}");
    }
}
