//! The nearest of what a search offers.

use super::kdtree::Search;

/// A bounded max-heap of squared distances; reused between searches.
#[derive(Clone, Debug, Default)]
pub struct Nearest {
    heap: Vec<(f32, u32)>,
    k: usize,
    max2: f32,
    /// How many heap entries are kept: beyond `k` they replace the farthest.
    full: bool,
}

impl Nearest {
    /// Scratch space for searches.
    pub fn new() -> Self {
        Self::default()
    }

    /// Begins a search for `k` items within squared distance `max2`.
    #[inline]
    pub fn reset(&mut self, k: usize, max2: f32) {
        self.heap.clear();
        self.k = k.max(1);
        self.max2 = max2;
        self.full = false;
    }

    #[inline]
    fn sift_down(&mut self, mut at: usize) {
        let n = self.heap.len();
        let item = self.heap[at];
        loop {
            let mut child = 2 * at + 1;
            if child >= n {
                break;
            }
            if child + 1 < n && self.heap[child + 1].0 > self.heap[child].0 {
                child += 1;
            }
            if self.heap[child].0 <= item.0 {
                break;
            }
            self.heap[at] = self.heap[child];
            at = child;
        }
        self.heap[at] = item;
    }

    /// Whether `k` items were found, and the squared radius that holds them (that of the search
    /// otherwise).
    #[inline]
    pub fn kernel(&self) -> (bool, f32) {
        (self.full, self.max2)
    }

    /// Squared distance of the `k`-th nearest of what was found, counted from 1; the end of a search,
    /// since it leaves the items in another order.
    pub(super) fn nth(&mut self, k: usize) -> Option<f32> {
        if k == 0 || k > self.heap.len() {
            return None;
        }
        let (_, nth, _) = (self.heap).select_nth_unstable_by(k - 1, |a, b| a.0.total_cmp(&b.0));
        Some(nth.0)
    }

    /// Items found.
    #[inline]
    pub fn len(&self) -> usize {
        self.heap.len()
    }

    /// Whether none was found.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.heap.is_empty()
    }

    /// Indices and squared distances of what was found, in no particular order.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        self.heap.iter().map(|&(d2, i)| (i as usize, d2))
    }
}

impl Search for Nearest {
    const NEAREST_FIRST: bool = false;

    #[inline]
    fn bound(&self) -> f32 {
        self.max2
    }

    #[inline]
    fn offer(&mut self, i: u32, d2: f32) {
        if !self.full {
            self.heap.push((d2, i));
            if self.heap.len() == self.k {
                self.full = true;
                // Heapify once, when it fills.
                for at in (0..self.k / 2).rev() {
                    self.sift_down(at);
                }
                self.max2 = self.heap[0].0;
            }
        } else {
            self.heap[0] = (d2, i);
            self.sift_down(0);
            self.max2 = self.heap[0].0;
        }
    }
}

/// The one nearest of what a search offers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Closest {
    /// Which, if any was offered.
    pub(super) item: Option<u32>,
    /// Its squared distance; that of the search if there is none.
    pub(super) d2: f32,
}

impl Closest {
    /// A search within squared distance `max2`.
    #[inline]
    pub(super) fn new(max2: f32) -> Self {
        Self {
            item: None,
            d2: max2,
        }
    }
}

impl Search for Closest {
    const NEAREST_FIRST: bool = true;

    #[inline]
    fn bound(&self) -> f32 {
        self.d2
    }

    #[inline]
    fn offer(&mut self, i: u32, d2: f32) {
        *self = Self { item: Some(i), d2 };
    }
}
