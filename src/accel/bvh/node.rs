//! Eight-wide nodes and the slab test against them.
//!
//! The test runs in `f32` and may say "hit" too often but never too rarely:
//! - The plane nearer along the ray is met from an origin moved a little forward, the farther one
//!   from an origin moved a little back (Woop et al. 2013, section 3.3). The little is one ulp of
//!   the origin, which covers its rounding to `f32`, plus `2⁻⁴⁰` of the largest distance in play,
//!   which exceeds the error of the exact tests in `f64` (under `2⁻⁴⁸` of it) by far. So flat boxes
//!   need no padding of their own.
//! - Each slab distance then carries three roundings (difference, reciprocal, product); the far
//!   end is scaled by `1 + 2⁻²¹ > 1 + 2γ₃` (Ize, *Robust BVH Ray Traversal*, JCGT 2(2), 2013).
//!   That needs distances that are not negative, so a segment that begins behind the origin is
//!   measured from its beginning.
//! - A direction component below `1e-18` of the length moves the ray by less than the padding: it
//!   becomes a huge finite reciprocal, so that no product `0·∞` can arise.

use bytemuck::{Pod, Zeroable};

use super::lanes::Lanes;
use crate::math::{DVec3, max_abs};

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Most primitives that a tree can hold.
pub(super) const MOST_PRIMS: usize = 1 << 27;
const LEAF: u32 = 1 << 31;
/// The leaf without primitives.
pub(super) const NOTHING: u32 = LEAF;
/// Most entries that wait during a traversal: seven for each level of the deepest tree.
const STACK: usize = 7 * 64;

/// Names a leaf by its number; number 0 is the one without primitives.
pub(super) fn leaf(number: usize) -> u32 {
    debug_assert!(number <= MOST_PRIMS);
    LEAF | number as u32
}

/// An inner node: the boxes of up to eight children, and their names.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Per axis: lower planes, upper planes.
    pub(super) planes: [[[f32; WIDTH]; 2]; 3],
    /// Inner nodes by their index, leaves as [`leaf`] names them.
    pub(super) child: [u32; WIDTH],
    /// Up to whole lines of the cache.
    pub(super) unused: [u32; WIDTH],
}

impl Node {
    /// A node whose boxes contain nothing.
    pub(super) const EMPTY: Self = Self {
        planes: [[[f32::MAX; WIDTH], [f32::MIN; WIDTH]]; 3],
        child: [NOTHING; WIDTH],
        unused: [0; WIDTH],
    };
}

/// A ray as the slab test sees it; distances are in metres from where the segment begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slab {
    pub(super) near: [f32; 3],
    pub(super) far: [f32; 3],
    pub(super) inv: [f32; 3],
    pub(super) sign: [usize; 3],
    pub(super) tmin: f32,
    len: f64,
    shift: f64,
}

impl Slab {
    /// What the far end is scaled by.
    pub(super) const FAR: f32 = 1.0 + 4.8e-7;

    /// The ray `o + t·d`, `t ≥ tmin`, for a tree whose coordinates stay below `reach`, which
    /// exact tests miss by at most `2⁻⁴⁸·slop` of the largest distance. `None` if `d` has no
    /// length.
    #[inline]
    pub(super) fn new(o: DVec3, d: DVec3, tmin: f64, reach: f64, slop: f64) -> Option<Self> {
        let len = d.length();
        if !(len > 0.0) {
            return None;
        }
        let dir = d * (1.0 / len);
        let shift = if tmin < 0.0 { tmin * len } else { 0.0 };
        let o = if tmin < 0.0 { o + dir * shift } else { o };
        let size = max_abs(o) + reach;
        if !(size < 1e37) {
            return Some(Self::everything(len));
        }
        let floor = size * slop * 9.1e-13 + 1e-36;
        let mut slab = Self::everything(len);
        slab.shift = shift;
        // Rounded down, as `bound` rounds up.
        slab.tmin = (tmin.max(0.0) * len * (1.0 - 2.4e-7)) as f32;
        for k in 0..3 {
            let pad = (o[k].abs() * 1.2e-7 + floor).copysign(dir[k]);
            slab.sign[k] = usize::from(dir[k].is_sign_negative());
            slab.near[k] = (o[k] + pad) as f32;
            slab.far[k] = (o[k] - pad) as f32;
            slab.inv[k] = if dir[k].abs() < 1e-18 {
                1e38f32.copysign(dir[k] as f32)
            } else {
                (1.0 / dir[k]) as f32
            };
        }
        Some(slab)
    }

    /// Meets every box: for numbers beyond single precision.
    #[inline]
    fn everything(len: f64) -> Self {
        Self {
            near: [0.0; 3],
            far: [0.0; 3],
            inv: [0.0; 3],
            sign: [0; 3],
            tmin: 0.0,
            len,
            shift: 0.0,
        }
    }

    /// The slab distance of the ray parameter `t`, rounded up.
    #[inline]
    pub(super) fn bound(&self, t: f64) -> f32 {
        let far = t * self.len - self.shift + 1e-15 * self.shift.abs();
        (far.max(0.0) * (1.0 + 2.4e-7)) as f32
    }
}

/// A node that waits: its distance above, so that comparing keys compares distances.
#[inline(always)]
fn key(near: f32, child: u32) -> u64 {
    // Not negative, but for a zero's sign.
    u64::from(near.to_bits() & 0x7fff_ffff) << 32 | u64::from(child)
}

/// What is done at leaves. Not a closure: those are inlined as the compiler likes, and what is
/// not inlined into a function for other instructions does not have them.
pub(super) trait Visitor {
    /// Gets a leaf's number and the bound, which it may lower; says whether to go on.
    fn visit(&mut self, leaf: usize, bound: &mut f32) -> bool;
}

/// Visits the leaves that the ray meets, near ones first.
#[inline(always)]
pub(super) fn traverse<L: Lanes>(
    lanes: L,
    nodes: &[Node],
    root: u32,
    slab: &Slab,
    mut tmax: f32,
    visitor: &mut impl Visitor,
) {
    let mut stack = arrayvec::ArrayVec::<u64, STACK>::new();
    let mut current = root;
    loop {
        if current & LEAF != 0 {
            if !visitor.visit((current & !LEAF) as usize, &mut tmax) {
                return;
            }
        } else {
            let node = &nodes[current as usize];
            let (near, mut mask) = lanes.boxes(node, slab, tmax);
            if mask != 0 {
                let i = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                if mask == 0 {
                    current = node.child[i];
                    continue;
                }
                // The nearest is next; the others wait, nearer ones above.
                let mut best = key(near[i], node.child[i]);
                let base = stack.len();
                while mask != 0 {
                    let i = mask.trailing_zeros() as usize & 7;
                    mask &= mask - 1;
                    let mut wait = key(near[i], node.child[i]);
                    if wait < best {
                        std::mem::swap(&mut wait, &mut best);
                    }
                    stack.push(wait);
                    let mut at = stack.len() - 1;
                    while at > base && stack[at - 1] < wait {
                        stack[at] = stack[at - 1];
                        at -= 1;
                    }
                    stack[at] = wait;
                }
                current = best as u32;
                continue;
            }
        }
        loop {
            let Some(next) = stack.pop() else {
                return;
            };
            if f32::from_bits((next >> 32) as u32) <= tmax {
                current = next as u32;
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::Portable;
    use super::*;
    use crate::sampling::Rng;

    /// A flat box: the slab test must agree for every ray that ends on it, however it grazes.
    #[test]
    fn flat_boxes_are_met_at_every_angle() {
        let mut rng = Rng::new(3);
        let mut missed = 0;
        for i in 0..200_000 {
            let scale = 10f64.powi(i % 13 - 6);
            let z = ((rng.next_1d() - 0.5) * scale) as f32;
            let mut node = Node::EMPTY;
            for k in 0..3 {
                let lo = if k == 2 { z } else { -scale as f32 };
                let hi = if k == 2 { z } else { scale as f32 };
                node.planes[k][0][0] = lo;
                node.planes[k][1][0] = hi;
            }
            let mut point = || (rng.next_1d() * 2.0 - 1.0) * scale;
            let target = DVec3::new(point(), point(), f64::from(z));
            let steep = 10f64.powi(-(i % 17));
            let o = DVec3::new(point(), point(), f64::from(z) + point() * steep)
                .as_vec3()
                .as_dvec3();
            // In doubles, as rays of an instance are.
            let d = (target - o) * 1.7;
            let Some(slab) = Slab::new(o, d, 0.0, scale, 1.0) else {
                continue;
            };
            let (near, mask) = Portable.boxes(&node, &slab, slab.bound(1.0 / 1.7));
            #[cfg(target_arch = "x86_64")]
            if let Some(wide) = super::super::lanes::Wide::try_new() {
                let other = wide.boxes(&node, &slab, slab.bound(1.0 / 1.7));
                assert_eq!((near, mask), other);
            }
            missed += usize::from(mask & 1 == 0);
        }
        assert_eq!(missed, 0, "of 200000");
    }
}
