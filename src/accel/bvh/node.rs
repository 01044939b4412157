//! Four-wide nodes and the slab test against them.
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

use glam::Vec4;

use crate::math::{DVec3, max_abs};

/// Most primitives in a leaf.
pub(super) const MAX_LEAF: usize = 4;
/// Bits of a leaf's code that say where it starts.
pub(super) const OFFSET_BITS: u32 = 27;
const LEAF: u32 = 1 << 31;
/// A leaf without primitives.
pub(super) const NOTHING: u32 = LEAF;
/// Most entries that wait during a traversal: three for each level of the deepest tree.
const STACK: usize = 192;

/// Names an inner node, or a leaf by its first primitive and their number.
pub(super) fn leaf(first: usize, count: usize) -> u32 {
    debug_assert!(first < 1 << OFFSET_BITS && count <= MAX_LEAF);
    LEAF | (count as u32) << OFFSET_BITS | first as u32
}

/// An inner node: the boxes of up to four children, and their codes.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Node {
    /// Per axis: lower planes, upper planes.
    pub(super) planes: [[Vec4; 2]; 3],
    /// See [`leaf`].
    pub(super) child: [u32; 4],
}

impl Node {
    /// A node whose boxes contain nothing.
    pub(super) const EMPTY: Self = Self {
        planes: [[Vec4::MAX, Vec4::MIN]; 3],
        child: [NOTHING; 4],
    };
}

/// A ray as the slab test sees it; distances are in metres from where the segment begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slab {
    near: [Vec4; 3],
    far: [Vec4; 3],
    inv: [Vec4; 3],
    sign: [usize; 3],
    tmin: Vec4,
    len: f64,
    shift: f64,
}

impl Slab {
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
        slab.tmin = Vec4::splat((tmin.max(0.0) * len * (1.0 - 2.4e-7)) as f32);
        for k in 0..3 {
            let pad = (o[k].abs() * 1.2e-7 + floor).copysign(dir[k]);
            slab.sign[k] = usize::from(dir[k].is_sign_negative());
            slab.near[k] = Vec4::splat((o[k] + pad) as f32);
            slab.far[k] = Vec4::splat((o[k] - pad) as f32);
            slab.inv[k] = Vec4::splat(if dir[k].abs() < 1e-18 {
                1e38f32.copysign(dir[k] as f32)
            } else {
                (1.0 / dir[k]) as f32
            });
        }
        Some(slab)
    }

    /// Meets every box: for numbers beyond single precision.
    #[inline]
    fn everything(len: f64) -> Self {
        Self {
            near: [Vec4::ZERO; 3],
            far: [Vec4::ZERO; 3],
            inv: [Vec4::ZERO; 3],
            sign: [0; 3],
            tmin: Vec4::ZERO,
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

    /// Distances to the four boxes, and which of them are met before `tmax`.
    #[inline(always)]
    fn test(&self, node: &Node, tmax: f32) -> (Vec4, u32) {
        let axis = |k: usize| {
            let s = self.sign[k] & 1;
            (
                (node.planes[k][s] - self.near[k]) * self.inv[k],
                (node.planes[k][s ^ 1] - self.far[k]) * self.inv[k],
            )
        };
        let ((nx, fx), (ny, fy), (nz, fz)) = (axis(0), axis(1), axis(2));
        let near = nx.max(ny).max(nz.max(self.tmin));
        let far = (fx.min(fy).min(fz) * (1.0 + 4.8e-7)).min(Vec4::splat(tmax));
        (near, near.cmple(far).bitmask())
    }
}

/// Visits the leaves that the ray meets, near ones first as far as that is cheap. `visit` gets
/// the first primitive, their number and the bound, which it may lower; it says whether to go on.
#[inline(always)]
pub(super) fn traverse(
    nodes: &[Node],
    root: u32,
    slab: &Slab,
    mut tmax: f32,
    mut visit: impl FnMut(usize, usize, &mut f32) -> bool,
) {
    let mut stack = arrayvec::ArrayVec::<(u32, f32), STACK>::new();
    let mut current = root;
    loop {
        if current & LEAF != 0 {
            let first = (current & ((1 << OFFSET_BITS) - 1)) as usize;
            let count = ((current & !LEAF) >> OFFSET_BITS) as usize;
            if !visit(first, count, &mut tmax) {
                return;
            }
        } else {
            let node = &nodes[current as usize];
            let (near, mut mask) = slab.test(node, tmax);
            if mask != 0 {
                let near = near.to_array();
                let mut best = mask.trailing_zeros() as usize & 3;
                mask &= mask - 1;
                // The nearest is next; the others wait, nearer ones above.
                let base = stack.len();
                while mask != 0 {
                    let i = mask.trailing_zeros() as usize & 3;
                    mask &= mask - 1;
                    let mut wait = i;
                    if near[i] < near[best] {
                        wait = best;
                        best = i;
                    }
                    stack.push((node.child[wait], near[wait]));
                }
                let new = &mut stack[base..];
                for (i, j) in [(0, 1), (1, 2), (0, 1)] {
                    if j < new.len() && new[i].1 < new[j].1 {
                        new.swap(i, j);
                    }
                }
                current = node.child[best];
                continue;
            }
        }
        loop {
            let Some((next, near)) = stack.pop() else {
                return;
            };
            if near <= tmax {
                current = next;
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
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
                node.planes[k][0].x = lo;
                node.planes[k][1].x = hi;
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
            let (_, mask) = slab.test(&node, slab.bound(1.0 / 1.7));
            missed += usize::from(mask & 1 == 0);
        }
        assert_eq!(missed, 0, "of 200000");
    }
}
