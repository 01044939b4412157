//! Builds eight-wide trees from the top, by the surface area heuristic over bins.
//!
//! Source: Wald, *On fast Construction of SAH-based Bounding Volume Hierarchies*, 2007. Below a
//! fixed depth, and wherever the bins cannot tell primitives apart, ranges are halved by number:
//! time is `O(n log n)` and depth is bounded whatever the input.

use glam::Vec3A;
use rayon::prelude::*;

use super::leaf::WIDTH as MAX_LEAF;
use super::node::{MOST_PRIMS, NOTHING, Node, WIDTH, leaf};
use super::table::Table;

/// Levels that may follow the heuristic; halving 2²⁷ primitives takes another 26.
const SAH_LEVELS: usize = 32;
const BINS: usize = 16;
/// Bits of a range that say where it starts.
const OFFSET_BITS: u32 = MOST_PRIMS.trailing_zeros();
/// Ranges above this are built in parallel.
const PARALLEL: usize = 1 << 14;

/// The box of a primitive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ref {
    pub(super) min: Vec3A,
    pub(super) max: Vec3A,
    /// Which primitive.
    pub(super) index: u32,
}

impl Ref {
    const EMPTY: Self = Self {
        min: Vec3A::INFINITY,
        max: Vec3A::NEG_INFINITY,
        index: 0,
    };

    #[inline]
    fn grow(&mut self, other: &Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    /// Half the area, with lengths in units of `1 / scale`; a touch of length keeps boxes apart
    /// that have no area.
    #[inline]
    fn half_area(&self, scale: f32) -> f32 {
        let e = (self.max - self.min) * scale;
        e.x * e.y + e.y * e.z + e.z * e.x + 1e-4 * (e.x + e.y + e.z)
    }

    #[inline]
    fn center(&self) -> Vec3A {
        self.min * 0.5 + self.max * 0.5
    }
}

fn bounds(refs: &[Ref]) -> Ref {
    refs.iter().fold(Ref::EMPTY, |mut b, r| {
        b.grow(r);
        b
    })
}

/// A leaf while the tree grows: its first primitive and their number.
fn range(first: usize, count: usize) -> u32 {
    debug_assert!(first < MOST_PRIMS && count <= MAX_LEAF);
    NOTHING | (count as u32) << OFFSET_BITS | first as u32
}

/// A tree; leaves hold ranges of the primitives in the order that [`build`] leaves the references in.
#[derive(Debug)]
pub(super) struct Tree {
    pub(super) nodes: Table<Node>,
    pub(super) root: u32,
    /// First primitive of each leaf and their number; leaf 0 is the one without any.
    pub(super) leaves: Vec<(u32, u32)>,
    /// Lower corner of the whole; zero if there is nothing.
    pub(super) min: Vec3A,
    /// Upper corner of the whole.
    pub(super) max: Vec3A,
}

impl Tree {
    /// Largest absolute coordinate.
    #[inline]
    pub(super) fn reach(&self) -> f64 {
        f64::from(self.min.abs().max(self.max.abs()).max_element())
    }
}

/// Builds a tree and puts `refs` in the order of its leaves.
pub(super) fn build(refs: &mut [Ref], parallel: bool) -> Tree {
    let all = if refs.is_empty() {
        Ref {
            min: Vec3A::ZERO,
            max: Vec3A::ZERO,
            index: 0,
        }
    } else {
        bounds(refs)
    };
    let mut nodes = Vec::with_capacity(refs.len() / 2);
    let mut root = if refs.is_empty() {
        NOTHING
    } else {
        emit(&mut nodes, refs, 0, 0, parallel)
    };
    // In the order in which nodes lie, so that leaves lie near what leads to them.
    let mut leaves = Vec::with_capacity(1 + nodes.len() * WIDTH * 3 / 4);
    leaves.push((0, 0));
    let children = nodes.iter_mut().flat_map(|n| &mut n.child);
    for code in children.chain([&mut root]) {
        let count = (*code & !NOTHING) >> OFFSET_BITS;
        if *code & NOTHING != 0 && count > 0 {
            leaves.push((*code & (MOST_PRIMS as u32 - 1), count));
            *code = leaf(leaves.len() - 1);
        }
    }
    Tree {
        nodes: Table::from_vec(nodes),
        root,
        leaves,
        min: all.min,
        max: all.max,
    }
}

struct Range {
    start: usize,
    end: usize,
    bounds: Ref,
    whole: bool,
}

/// Appends the node over `refs`, the first of which is number `first`; returns its code.
fn emit(
    nodes: &mut Vec<Node>,
    refs: &mut [Ref],
    first: usize,
    depth: usize,
    parallel: bool,
) -> u32 {
    let mut ranges = arrayvec::ArrayVec::<Range, WIDTH>::new();
    ranges.push(Range {
        start: 0,
        end: refs.len(),
        bounds: bounds(refs),
        whole: false,
    });
    while ranges.len() < WIDTH {
        // The largest first: by area, or by number where areas no longer count.
        let scale = 1.0 / longest(&ranges[0].bounds).max(f32::MIN_POSITIVE);
        let weight = |r: &Range| {
            let by_area = if depth < SAH_LEVELS {
                r.bounds.half_area(scale)
            } else {
                0.0
            };
            (by_area, r.end - r.start)
        };
        let Some(pick) = (0..ranges.len())
            .filter(|&i| !ranges[i].whole)
            .max_by(|&a, &b| {
                let (a, b) = (weight(&ranges[a]), weight(&ranges[b]));
                a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
            })
        else {
            break;
        };
        let range = &mut ranges[pick];
        let part = &mut refs[range.start..range.end];
        match split(part, &range.bounds, depth) {
            None => range.whole = true,
            Some(at) => {
                let right = Range {
                    start: range.start + at,
                    end: range.end,
                    bounds: bounds(&part[at..]),
                    whole: false,
                };
                range.bounds = bounds(&part[..at]);
                range.end = right.start;
                ranges.push(right);
            }
        }
    }
    if ranges.len() == 1 {
        return range(first, refs.len());
    }
    let mut node = Node::EMPTY;
    for (i, r) in ranges.iter().enumerate() {
        for k in 0..3 {
            node.planes[k][0][i] = r.bounds.min[k];
            node.planes[k][1][i] = r.bounds.max[k];
        }
    }
    let index = nodes.len();
    nodes.push(node);
    let mut parts = Vec::with_capacity(WIDTH);
    let mut rest = &mut refs[..];
    let mut sorted: arrayvec::ArrayVec<(usize, &Range), WIDTH> =
        ranges.iter().enumerate().collect();
    sorted.sort_by_key(|(_, r)| r.start);
    for (i, r) in sorted {
        let (part, tail) = rest.split_at_mut(r.end - r.start);
        rest = tail;
        parts.push((i, first + r.start, part, r.whole));
    }
    if parallel && refs_len(&parts) > PARALLEL {
        let built: Vec<_> = parts
            .into_par_iter()
            .map(|(i, start, part, whole)| {
                let mut own = Vec::new();
                let code = child(&mut own, part, start, depth, true, whole);
                (i, own, code)
            })
            .collect();
        for (i, own, code) in built {
            let base = nodes.len() as u32;
            let moved = |c: u32| if c & NOTHING == 0 { c + base } else { c };
            nodes.extend(own.into_iter().map(|n| Node {
                child: n.child.map(moved),
                ..n
            }));
            nodes[index].child[i] = moved(code);
        }
    } else {
        for (i, start, part, whole) in parts {
            let code = child(nodes, part, start, depth, false, whole);
            nodes[index].child[i] = code;
        }
    }
    index as u32
}

fn refs_len(parts: &[(usize, usize, &mut [Ref], bool)]) -> usize {
    parts.iter().map(|p| p.2.len()).sum()
}

fn child(
    nodes: &mut Vec<Node>,
    refs: &mut [Ref],
    first: usize,
    depth: usize,
    parallel: bool,
    whole: bool,
) -> u32 {
    if whole || refs.len() == 1 {
        range(first, refs.len())
    } else {
        emit(nodes, refs, first, depth + 1, parallel)
    }
}

fn longest(b: &Ref) -> f32 {
    (b.max - b.min).max_element()
}

/// Where to split, after reordering; `None` if the range is best left whole.
fn split(refs: &mut [Ref], total: &Ref, depth: usize) -> Option<usize> {
    let n = refs.len();
    if n <= MAX_LEAF {
        return None;
    }
    let halves = Some(n / 2);
    if depth >= SAH_LEVELS {
        return halves;
    }
    // In units of the longest edge, areas neither overflow nor vanish.
    let scale = 1.0 / longest(total);
    let (mut lo, mut hi) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for r in refs.iter() {
        lo = lo.min(r.center());
        hi = hi.max(r.center());
    }
    let k = Vec3A::splat(BINS as f32) / (hi - lo);
    // A cast of NaN gives 0, of infinity the last bin.
    let bin_of = |r: &Ref| {
        let b = (r.center() - lo) * k;
        [b.x, b.y, b.z].map(|x| (x as usize).min(BINS - 1))
    };
    let mut bins = [[(Ref::EMPTY, 0u32); BINS]; 3];
    for r in refs.iter() {
        let at = bin_of(r);
        for axis in 0..3 {
            let (b, count) = &mut bins[axis][at[axis]];
            b.grow(r);
            *count += 1;
        }
    }
    let mut best = (f32::INFINITY, 0, 0);
    for (axis, bins) in bins.iter().enumerate() {
        let mut right = [(0.0, 0u32); BINS];
        let (mut b, mut count) = (Ref::EMPTY, 0);
        for i in (1..BINS).rev() {
            b.grow(&bins[i].0);
            count += bins[i].1;
            right[i] = (b.half_area(scale), count);
        }
        let (mut b, mut count) = (Ref::EMPTY, 0);
        for i in 1..BINS {
            b.grow(&bins[i - 1].0);
            count += bins[i - 1].1;
            let (right_area, right_count) = right[i];
            if count == 0 || right_count == 0 {
                continue;
            }
            let blocks = |n: u32| n.div_ceil(MAX_LEAF as u32) as f32;
            let cost = b.half_area(scale) * blocks(count) + right_area * blocks(right_count);
            if cost < best.0 {
                best = (cost, axis, i);
            }
        }
    }
    let (cost, axis, at) = best;
    if !cost.is_finite() {
        return halves;
    }
    // The order within each side is kept: the tree is the same on every run.
    let mut side = Vec::with_capacity(n);
    let mut mid = 0;
    for i in 0..n {
        let r = refs[i];
        if bin_of(&r)[axis] < at {
            refs[mid] = r;
            mid += 1;
        } else {
            side.push(r);
        }
    }
    refs[mid..].copy_from_slice(&side);
    Some(mid)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::Rng;

    fn point(p: [f32; 3], size: f32, index: usize) -> Ref {
        let p = Vec3A::from(p);
        Ref {
            min: p,
            max: p + size,
            index: index as u32,
        }
    }

    /// Depth of the tree; checks that every primitive is in one leaf and in all boxes above.
    fn check(refs: &mut [Ref], parallel: bool) -> usize {
        let n = refs.len();
        let tree = build(refs, parallel);
        let mut seen = vec![0; n];
        let mut deepest = 0;
        let mut todo = vec![(tree.root, 1, Vec3A::NEG_INFINITY, Vec3A::INFINITY)];
        while let Some((code, depth, lo, hi)) = todo.pop() {
            if code & NOTHING != 0 {
                let (first, count) = tree.leaves[(code & !NOTHING) as usize];
                for r in &refs[first as usize..(first + count) as usize] {
                    seen[r.index as usize] += 1;
                    assert!(r.min.cmpge(lo).all() && r.max.cmple(hi).all());
                }
                continue;
            }
            deepest = deepest.max(depth);
            let node = &tree.nodes[code as usize];
            for i in 0..WIDTH {
                let corner = |s: usize| Vec3A::from([0, 1, 2].map(|k| node.planes[k][s][i]));
                if node.child[i] != NOTHING {
                    todo.push((node.child[i], depth + 1, corner(0), corner(1)));
                }
            }
        }
        assert!(seen.iter().all(|&s| s == 1));
        deepest
    }

    #[test]
    fn trees_hold_everything_once_and_stay_shallow() {
        let mut rng = Rng::new(1);
        let mut unit = || rng.next_1d() as f32;
        for n in [0, 1, 2, 5, 1000, 40_000] {
            for parallel in [false, true] {
                let mut random: Vec<_> = (0..n)
                    .map(|i| point([unit(), unit(), unit()], 0.01, i))
                    .collect();
                assert!(check(&mut random, parallel) <= 24);
            }
            let mut same: Vec<_> = (0..n).map(|i| point([1.0; 3], 0.0, i)).collect();
            assert!(check(&mut same, false) <= 16);
            let mut line: Vec<_> = (0..n)
                .map(|i| point([i as f32, 0.0, 0.0], 0.0, i))
                .collect();
            assert!(check(&mut line, false) <= 16);
            // Each primitive twice as far as the one before: the heuristic peels them off singly.
            let mut peel: Vec<_> = (0..n)
                .map(|i| point([2f32.powi(i as i32 % 250 - 125); 3], 0.0, i))
                .collect();
            assert!(check(&mut peel, false) <= SAH_LEVELS + 27);
            let mut huge: Vec<_> = (0..n)
                .map(|i| point([unit() * 3e38 - 1e38, unit() * 1e18, -3e38], 0.0, i))
                .collect();
            assert!(check(&mut huge, false) <= SAH_LEVELS + 27);
        }
    }

    #[test]
    fn threads_do_not_change_the_tree() {
        let mut rng = Rng::new(2);
        let refs: Vec<_> = (0..50_000)
            .map(|i| point([(); 3].map(|()| rng.next_1d() as f32), 0.01, i))
            .collect();
        let (mut a, mut b) = (refs.clone(), refs);
        let (ta, tb) = (build(&mut a, false), build(&mut b, true));
        assert_eq!(ta.nodes.len(), tb.nodes.len());
        assert!(
            ta.nodes
                .iter()
                .zip(&*tb.nodes)
                .all(|(x, y)| x.child == y.child && x.planes == y.planes)
        );
    }
}
