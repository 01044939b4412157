//! A balanced k-d tree: items in blocks at the leaves, and above them nothing but the planes that
//! split, so that a search touches little memory.
//!
//! Source: for the distance to a cell, built up axis by axis on the way down, Arya and Mount,
//! *Algorithms for Fast Vector Quantization*, DCC 1993.

use serde::{Deserialize, Serialize};

use crate::math::Vec3;

/// Items of a block. Their distances are computed side by side.
const WIDTH: usize = 8;

/// Ranges above this size are built in parallel.
const PARALLEL: usize = 1 << 15;

/// What a search is for.
pub trait Search {
    /// Whether of several items at hand the nearest is to be offered first, since with it the rest
    /// may be out of bounds.
    const NEAREST_FIRST: bool;

    /// Squared distance beyond which nothing is wanted any more.
    fn bound(&self) -> f32;

    /// Takes item `i` at squared distance `d2`, which is below [`bound`](Self::bound).
    fn offer(&mut self, i: u32, d2: f32);
}

/// A search for everything within a squared radius.
pub struct Within<F>(pub f32, pub F);

impl<F: FnMut(usize)> Search for Within<F> {
    const NEAREST_FIRST: bool = false;

    #[inline]
    fn bound(&self) -> f32 {
        self.0
    }

    #[inline]
    fn offer(&mut self, i: u32, _d2: f32) {
        (self.1)(i as usize);
    }
}

/// Positions of items that follow each other, coordinate by coordinate.
#[derive(Clone, Debug)]
struct Block([[f32; WIDTH]; 3]);

impl Block {
    /// Of at most [`WIDTH`] items; what is missing lies at infinity, which no search reaches.
    fn new<T>(items: &[T], position: &impl Fn(&T) -> [f32; 3]) -> Self {
        let mut block = Self([[f32::INFINITY; WIDTH]; 3]);
        for (j, item) in items.iter().enumerate() {
            for (axis, x) in position(item).into_iter().enumerate() {
                block.0[axis][j] = x;
            }
        }
        block
    }

    #[inline]
    fn position(&self, j: usize) -> Vec3 {
        Vec3::new(self.0[0][j], self.0[1][j], self.0[2][j])
    }

    /// Squared distances from `p`.
    #[inline]
    fn distances(&self, p: [f32; 3]) -> [f32; WIDTH] {
        std::array::from_fn(|j| {
            squared([
                self.0[0][j] - p[0],
                self.0[1][j] - p[1],
                self.0[2][j] - p[2],
            ])
        })
    }
}

/// Squared length. Points and cells are measured by the same sum, so that rounding never takes a
/// cell for farther than a point in it.
#[inline]
fn squared([x, y, z]: [f32; 3]) -> f32 {
    x * x + y * y + z * z
}

/// A plane that splits a range of blocks.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Plane {
    at: f32,
    axis: u32,
}

/// A range of blocks that a search has left for later.
#[derive(Clone, Copy, Default)]
struct Deferred {
    lo: u32,
    hi: u32,
    /// Distances to its cell along the axes.
    offset: [f32; 3],
}

/// How far from their positions items are wanted at all, at most: for every range of the tree.
#[derive(Debug, Default)]
pub struct Limits {
    /// Squared, of the range that is split before block `i`.
    ranges: Vec<f32>,
    /// Squared, of block `i`.
    blocks: Vec<f32>,
}

impl Limits {
    #[inline]
    fn of(&self, at: &Deferred) -> f32 {
        if at.hi - at.lo > 1 {
            self.ranges[at.lo.midpoint(at.hi) as usize]
        } else {
            self.blocks[at.lo as usize]
        }
    }

    fn fill(&mut self, lo: u32, hi: u32) -> f32 {
        if hi - lo <= 1 {
            return self.blocks[lo as usize];
        }
        let mid = lo.midpoint(hi);
        let most = self.fill(lo, mid).max(self.fill(mid, hi));
        self.ranges[mid as usize] = most;
        most
    }
}

/// The tree over a slice of items that it has sorted.
#[derive(Debug, Default)]
pub struct KdTree {
    blocks: Vec<Block>,
    /// Of the range that is split before block `i`, the plane; each block but the first begins
    /// the second half of exactly one range.
    planes: Vec<Plane>,
}

impl KdTree {
    /// Sorts `items` into tree order. The result does not depend on the number of threads.
    pub fn build<T: Copy + Send>(
        items: &mut [T],
        position: impl Fn(&T) -> [f32; 3] + Sync,
    ) -> Self {
        let mut planes = vec![Plane::default(); items.len().div_ceil(WIDTH)];
        split(items, &mut planes, &position);
        Self {
            blocks: items
                .chunks(WIDTH)
                .map(|c| Block::new(c, &position))
                .collect(),
            planes,
        }
    }

    /// The planes that split; the rest follows from the items in the order of the tree.
    pub(super) fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// The tree that sorted `items` by these planes before; `None` if they are of another number.
    pub(super) fn from_planes<T>(
        planes: Vec<Plane>,
        items: &[T],
        position: impl Fn(&T) -> [f32; 3],
    ) -> Option<Self> {
        let fits =
            planes.len() == items.len().div_ceil(WIDTH) && u32::try_from(items.len()).is_ok();
        fits.then(|| Self {
            blocks: items
                .chunks(WIDTH)
                .map(|c| Block::new(c, &position))
                .collect(),
            planes,
        })
    }

    /// Position of item `i`.
    #[inline]
    pub fn position(&self, i: usize) -> Vec3 {
        self.blocks[i / WIDTH].position(i % WIDTH)
    }

    /// Offers every item within the bound of `found` around `p` that `accept` takes; `accept`
    /// gets the index, the position and the squared radius that bounds the search at that moment.
    #[inline]
    pub fn visit_near(
        &self,
        p: Vec3,
        found: &mut impl Search,
        accept: impl Fn(usize, Vec3, f32) -> bool,
    ) {
        self.visit(p, found, accept, |_| f32::INFINITY);
    }

    /// As [`visit_near`](Self::visit_near), for an `accept` that takes no item beyond its limit:
    /// what is too far for all of its items is not looked at.
    #[inline]
    pub fn visit_wanted(
        &self,
        p: Vec3,
        limits: &Limits,
        found: &mut impl Search,
        accept: impl Fn(usize, Vec3, f32) -> bool,
    ) {
        self.visit(p, found, accept, |at| limits.of(at));
    }

    /// The limits of ranges by the squared ones of items.
    pub fn limits(&self, squared: impl Fn(usize) -> f32, items: usize) -> Limits {
        let all: Vec<f32> = (0..items).map(squared).collect();
        let mut out = Limits {
            ranges: vec![0.0; self.blocks.len()],
            blocks: all
                .chunks(WIDTH)
                .map(|c| c.iter().copied().fold(0.0, f32::max))
                .collect(),
        };
        if !self.blocks.is_empty() {
            out.fill(0, self.blocks.len() as u32);
        }
        out
    }

    #[inline(always)]
    fn visit(
        &self,
        p: Vec3,
        found: &mut impl Search,
        accept: impl Fn(usize, Vec3, f32) -> bool,
        limit: impl Fn(&Deferred) -> f32,
    ) {
        if self.blocks.is_empty() {
            return;
        }
        let p: [f32; 3] = p.into();
        // A balanced tree over 2³² items is less deep; each level defers one range.
        let mut stack = [Deferred::default(); 32];
        let mut top = 0;
        let mut at = Deferred {
            hi: self.blocks.len() as u32,
            ..Default::default()
        };
        loop {
            while at.hi - at.lo > 1 {
                let mid = at.lo.midpoint(at.hi);
                let plane = self.planes[mid as usize];
                let delta = p[plane.axis as usize % 3] - plane.at;
                // Not by an index: what is written to memory in parts is slow to be read whole.
                let offset = [0, 1, 2].map(|k| {
                    if plane.axis == k {
                        delta
                    } else {
                        at.offset[k as usize]
                    }
                });
                let mut far = Deferred { offset, ..at };
                if delta < 0.0 {
                    (at.hi, far.lo) = (mid, mid);
                } else {
                    (at.lo, far.hi) = (mid, mid);
                }
                if squared(offset) < found.bound() {
                    stack[top] = far;
                    top += 1;
                }
                if squared(at.offset) > limit(&at) {
                    break;
                }
            }
            if at.hi - at.lo == 1 && squared(at.offset) <= limit(&at) {
                self.offer(at.lo as usize, p, found, &accept);
            }
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                at = stack[top];
                let near = squared(at.offset);
                if near < found.bound() && near <= limit(&at) {
                    break;
                }
            }
        }
    }
}

impl KdTree {
    /// Offers the items of one block.
    #[inline(always)]
    fn offer<S: Search>(
        &self,
        block: usize,
        p: [f32; 3],
        found: &mut S,
        accept: &impl Fn(usize, Vec3, f32) -> bool,
    ) {
        let items = &self.blocks[block];
        let d2 = items.distances(p);
        let within = |bound: f32| (0..WIDTH).fold(0u32, |m, j| m | (u32::from(d2[j] < bound) << j));
        let mut left = within(found.bound());
        while left != 0 {
            let mut j = left.trailing_zeros() as usize;
            if S::NEAREST_FIRST {
                let others = (j + 1..WIDTH).filter(|k| left >> k & 1 == 1);
                j = others.fold(j, |best, k| if d2[k] < d2[best] { k } else { best });
            }
            left &= !(1 << j);
            let (i, bound) = (block * WIDTH + j, found.bound());
            if d2[j] < bound && accept(i, items.position(j), bound) {
                found.offer(i as u32, d2[j]);
                if S::NEAREST_FIRST {
                    left &= within(found.bound());
                }
            }
        }
    }
}

/// Sorts a range along its longest axis around the middle of its blocks, and both halves
/// likewise. `planes` has an element for every block.
fn split<T: Copy + Send>(
    items: &mut [T],
    planes: &mut [Plane],
    position: &(impl Fn(&T) -> [f32; 3] + Sync),
) {
    if planes.len() <= 1 {
        return;
    }
    let mut lo = [f32::INFINITY; 3];
    let mut hi = [f32::NEG_INFINITY; 3];
    for item in items.iter() {
        let p = position(item);
        for k in 0..3 {
            lo[k] = lo[k].min(p[k]);
            hi[k] = hi[k].max(p[k]);
        }
    }
    let extent = |k: usize| hi[k] - lo[k];
    let axis = (0..3)
        .max_by(|&a, &b| extent(a).total_cmp(&extent(b)))
        .unwrap_or(0);
    let mid = planes.len() / 2;
    let first = mid * WIDTH;
    let (_, at, _) = items.select_nth_unstable_by(first, |a, b| {
        position(a)[axis].total_cmp(&position(b)[axis])
    });
    planes[mid] = Plane {
        at: position(at)[axis],
        axis: axis as u32,
    };
    let n = items.len();
    let (left, right) = items.split_at_mut(first);
    let (left_planes, right_planes) = planes.split_at_mut(mid);
    if n > PARALLEL {
        rayon::join(
            || split(left, left_planes, position),
            || split(right, right_planes, position),
        );
    } else {
        split(left, left_planes, position);
        split(right, right_planes, position);
    }
}

#[cfg(test)]
mod tests {
    use super::super::Nearest;
    use super::*;
    use crate::sampling::Rng;

    #[test]
    fn nearest_neighbours_are_those_of_brute_force() {
        let mut rng = Rng::new(4);
        for n in [0usize, 1, 7, 8, 9, 100, 5000, 70_000] {
            let mut points: Vec<[f32; 3]> = (0..n)
                .map(|_| {
                    [
                        rng.next_1d() as f32,
                        rng.next_1d() as f32,
                        (rng.next_1d() * 0.01) as f32,
                    ]
                })
                .collect();
            let tree = KdTree::build(&mut points, |p| *p);
            let mut found = Nearest::new();
            for _ in 0..20 {
                let q = Vec3::new(rng.next_1d() as f32, rng.next_1d() as f32, 0.0);
                for (k, max) in [(1, 9.0f32), (10, 9.0), (60, 0.1)] {
                    found.reset(k, max * max);
                    tree.visit_near(q, &mut found, |_, _, _| true);
                    let mut all: Vec<f32> = points
                        .iter()
                        .map(|p| (Vec3::from(*p) - q).length_squared())
                        .filter(|d| *d < max * max)
                        .collect();
                    all.sort_by(f32::total_cmp);
                    all.truncate(k);
                    let mut got: Vec<f32> = found.iter().map(|(_, d)| d).collect();
                    got.sort_by(f32::total_cmp);
                    assert_eq!(got.len(), all.len(), "n {n} k {k}");
                    for (a, b) in got.iter().zip(&all) {
                        assert!((a - b).abs() <= 1e-6 * b.max(1e-6), "{a} {b}");
                    }
                }
            }
        }
    }

    #[test]
    fn coincident_items_build_and_are_found() {
        let mut points = vec![[0.5f32; 3]; 100_000];
        let tree = KdTree::build(&mut points, |p| *p);
        let mut found = Nearest::new();
        found.reset(50, 1.0);
        tree.visit_near(Vec3::splat(0.5), &mut found, |_, _, _| true);
        assert_eq!((found.len(), found.kernel().1), (50, 0.0));
    }

    #[test]
    fn limits_leave_out_nothing_that_is_wanted() {
        let mut rng = Rng::new(6);
        for n in [1usize, 8, 9, 1000] {
            let mut items: Vec<([f32; 3], f32)> = (0..n)
                .map(|_| {
                    let p = [0; 3].map(|_| rng.next_1d() as f32);
                    // Most reach a little way, a few far.
                    (p, (rng.next_1d() as f32).powi(8))
                })
                .collect();
            let tree = KdTree::build(&mut items, |i| i.0);
            let limits = tree.limits(|i| items[i].1, n);
            for _ in 0..200 {
                let q = Vec3::from([0; 3].map(|_| 1.4 * rng.next_1d() as f32 - 0.2));
                let wanted = |i: usize, p: Vec3| q.distance_squared(p) <= items[i].1;
                let mut got = Vec::new();
                let looked = std::cell::Cell::new(0);
                tree.visit_wanted(q, &limits, &mut Within(4.0, |i| got.push(i)), |i, p, _| {
                    looked.set(looked.get() + 1);
                    wanted(i, p)
                });
                got.sort_unstable();
                let all = (0..n).filter(|i| wanted(*i, items[*i].0.into()));
                assert_eq!(got, all.collect::<Vec<_>>());
                assert!(n < 1000 || looked.get() < n);
            }
        }
    }
}
