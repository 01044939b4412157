//! A balanced k-d tree without nodes: the items themselves are sorted so that the middle one of
//! every range splits it.

use crate::math::Vec3;

/// Ranges up to this size are searched item by item.
const LEAF: usize = 8;

/// Ranges above this size are built in parallel.
const PARALLEL: usize = 1 << 15;

/// What a search is for.
pub trait Search {
    /// Squared distance beyond which nothing is wanted any more.
    fn bound(&self) -> f32;

    /// Takes item `i` at squared distance `d2`, which is below [`bound`](Self::bound).
    fn offer(&mut self, i: u32, d2: f32);
}

/// A search for everything within a squared radius.
pub struct Within<F>(pub f32, pub F);

impl<F: FnMut(usize)> Search for Within<F> {
    #[inline]
    fn bound(&self) -> f32 {
        self.0
    }

    #[inline]
    fn offer(&mut self, i: u32, _d2: f32) {
        (self.1)(i as usize);
    }
}

/// The tree over a slice of items that it has sorted.
#[derive(Debug, Default)]
pub struct KdTree {
    /// Positions in tree order, apart from the items: searches read little else.
    points: Vec<[f32; 3]>,
    /// Axis of the split at each position.
    axes: Vec<u8>,
}

impl KdTree {
    /// Sorts `items` into tree order. The result does not depend on the number of threads.
    pub fn build<T: Copy + Send>(
        items: &mut [T],
        position: impl Fn(&T) -> [f32; 3] + Sync,
    ) -> Self {
        let mut axes = vec![0; items.len()];
        split(items, &mut axes, &position);
        Self {
            points: items.iter().map(position).collect(),
            axes,
        }
    }

    /// Offers every item within the bound of `found` around `p` that `accept` takes; `accept`
    /// gets the index and the squared radius that bounds the search at that moment.
    #[inline]
    pub fn visit_near(
        &self,
        p: Vec3,
        found: &mut impl Search,
        accept: impl Fn(usize, f32) -> bool,
    ) {
        if self.points.is_empty() {
            return;
        }
        let p: [f32; 3] = p.into();
        // Depth of a balanced tree over 2³² items is below 32; each level defers one range.
        let mut stack = [(0u32, 0u32, 0f32); 40];
        let mut top = 0;
        let mut range = (0usize, self.points.len());
        loop {
            let (lo, hi) = range;
            if hi - lo <= LEAF {
                for i in lo..hi {
                    self.test(p, i, found, &accept);
                }
            } else {
                let mid = (lo + hi) / 2;
                let axis = self.axes[mid] as usize;
                let delta = p[axis] - self.points[mid][axis];
                let (near, far) = if delta < 0.0 {
                    ((lo, mid), (mid + 1, hi))
                } else {
                    ((mid + 1, hi), (lo, mid))
                };
                self.test(p, mid, found, &accept);
                stack[top] = (far.0 as u32, far.1 as u32, delta * delta);
                top += 1;
                range = near;
                continue;
            }
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                let (lo, hi, d2) = stack[top];
                if d2 < found.bound() {
                    range = (lo as usize, hi as usize);
                    break;
                }
            }
        }
    }

    #[inline]
    fn test(
        &self,
        p: [f32; 3],
        i: usize,
        found: &mut impl Search,
        accept: &impl Fn(usize, f32) -> bool,
    ) {
        let q = self.points[i];
        let (x, y, z) = (q[0] - p[0], q[1] - p[1], q[2] - p[2]);
        let d2 = x * x + y * y + z * z;
        let bound = found.bound();
        if d2 < bound && accept(i, bound) {
            found.offer(i as u32, d2);
        }
    }
}

/// Sorts a range around its median along its longest axis, and both halves likewise.
fn split<T: Copy + Send>(
    items: &mut [T],
    axes: &mut [u8],
    position: &(impl Fn(&T) -> [f32; 3] + Sync),
) {
    let n = items.len();
    if n <= LEAF {
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
    let mid = n / 2;
    items.select_nth_unstable_by(mid, |a, b| position(a)[axis].total_cmp(&position(b)[axis]));
    axes[mid] = axis as u8;
    let (left, right) = items.split_at_mut(mid);
    let (left_axes, right_axes) = axes.split_at_mut(mid);
    let (right, right_axes) = (&mut right[1..], &mut right_axes[1..]);
    if n > PARALLEL {
        rayon::join(
            || split(left, left_axes, position),
            || split(right, right_axes, position),
        );
    } else {
        split(left, left_axes, position);
        split(right, right_axes, position);
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
                    tree.visit_near(q, &mut found, |_, _| true);
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
        tree.visit_near(Vec3::splat(0.5), &mut found, |_, _| true);
        assert_eq!((found.len(), found.kernel().1), (50, 0.0));
    }
}
