//! The two inner loops, eight boxes and four triangles at a time, in the instructions that there
//! are.
//!
//! Both versions do the same operations in the same order, without fused ones: whichever runs, a
//! triangle's hit has the same bits.

use glam::Vec4;

use super::leaf::{Block, WIDTH};
use super::node::{Node, Slab};
use crate::geometry::triangle::Watertight;

/// Hits of the triangles in a block, as `t` and two barycentrics of each.
#[derive(Clone, Copy)]
pub(super) struct Hits {
    pub(super) t: [f64; WIDTH],
    pub(super) u: [f64; WIDTH],
    pub(super) v: [f64; WIDTH],
}

/// A function that is inlined where it is called, as closures need not be.
pub(super) trait Task {
    /// What it returns.
    type Output;

    /// Does it.
    fn run(self) -> Self::Output;
}

/// Instructions for the inner loops.
pub(super) trait Lanes: Copy {
    /// Runs what is to be compiled with these instructions.
    fn run<T: Task>(self, task: T) -> T::Output;

    /// Distances to the eight boxes, and which of them are met before `tmax`.
    fn boxes(self, node: &Node, slab: &Slab, tmax: f32) -> ([f32; 8], u32);

    /// Hits with the triangles of a block in `tmin ≤ t ≤ tmax`, and which of them there are.
    fn triangles(
        self,
        block: &Block,
        ray: &Watertight,
        tmin: f64,
        tmax: f64,
    ) -> Option<(Hits, u32)>;
}

/// What every processor has.
#[derive(Clone, Copy)]
pub(super) struct Portable;

impl Lanes for Portable {
    #[inline(always)]
    fn run<T: Task>(self, task: T) -> T::Output {
        task.run()
    }

    #[inline(always)]
    fn boxes(self, node: &Node, slab: &Slab, tmax: f32) -> ([f32; 8], u32) {
        let half = |h: usize| {
            let axis = |k: usize| {
                let s = slab.sign[k] & 1;
                let planes = |s: usize| Vec4::from_slice(&node.planes[k][s][4 * h..]);
                (
                    (planes(s) - Vec4::splat(slab.near[k])) * Vec4::splat(slab.inv[k]),
                    (planes(s ^ 1) - Vec4::splat(slab.far[k])) * Vec4::splat(slab.inv[k]),
                )
            };
            let ((nx, fx), (ny, fy), (nz, fz)) = (axis(0), axis(1), axis(2));
            let near = nx.max(ny).max(nz.max(Vec4::splat(slab.tmin)));
            let far = (fx.min(fy).min(fz) * Slab::FAR).min(Vec4::splat(tmax));
            (near, near.cmple(far).bitmask())
        };
        let ((a, low), (b, high)) = (half(0), half(1));
        let mut near = [0.0; 8];
        a.write_to_slice(&mut near[..4]);
        b.write_to_slice(&mut near[4..]);
        (near, low | high << 4)
    }

    #[inline(always)]
    fn triangles(
        self,
        block: &Block,
        ray: &Watertight,
        tmin: f64,
        tmax: f64,
    ) -> Option<(Hits, u32)> {
        let mut hits = Hits {
            t: [0.0; WIDTH],
            u: [0.0; WIDTH],
            v: [0.0; WIDTH],
        };
        let mut mask = 0;
        for lane in 0..block.count() {
            if let Some(h) = ray.intersect_single(&block.corners(lane), tmin, tmax) {
                (hits.t[lane], hits.u[lane], hits.v[lane]) = (h.t, h.b1, h.b2);
                mask |= 1 << lane;
            }
        }
        (mask != 0).then_some((hits, mask))
    }
}

/// AVX2.
#[cfg(target_arch = "x86_64")]
pub(super) use pulp::x86::V3 as Wide;

#[cfg(target_arch = "x86_64")]
impl Lanes for Wide {
    #[inline(always)]
    fn run<T: Task>(self, task: T) -> T::Output {
        struct Op<T>(T);
        impl<T: Task> pulp::NullaryFnOnce for Op<T> {
            type Output = T::Output;

            #[inline(always)]
            fn call(self) -> T::Output {
                self.0.run()
            }
        }
        self.vectorize(Op(task))
    }

    #[inline(always)]
    fn boxes(self, node: &Node, slab: &Slab, tmax: f32) -> ([f32; 8], u32) {
        use std::arch::x86_64::{__m256, _CMP_LE_OQ};
        let v = self.avx;
        macro_rules! splat {
            ($x:expr) => {
                v._mm256_set1_ps($x)
            };
        }
        // Macros and not closures: see `Visitor`.
        macro_rules! axis {
            ($k:expr) => {{
                let s = slab.sign[$k] & 1;
                let [near, far]: [__m256; 2] = [
                    pulp::cast(node.planes[$k][s]),
                    pulp::cast(node.planes[$k][s ^ 1]),
                ];
                let inv = splat!(slab.inv[$k]);
                (
                    v._mm256_mul_ps(v._mm256_sub_ps(near, splat!(slab.near[$k])), inv),
                    v._mm256_mul_ps(v._mm256_sub_ps(far, splat!(slab.far[$k])), inv),
                )
            }};
        }
        let ((nx, fx), (ny, fy), (nz, fz)) = (axis!(0), axis!(1), axis!(2));
        let near = v._mm256_max_ps(
            v._mm256_max_ps(nx, ny),
            v._mm256_max_ps(nz, splat!(slab.tmin)),
        );
        let far = v._mm256_min_ps(v._mm256_min_ps(fx, fy), fz);
        let far = v._mm256_min_ps(v._mm256_mul_ps(far, splat!(Slab::FAR)), splat!(tmax));
        let met = v._mm256_cmp_ps::<_CMP_LE_OQ>(near, far);
        (pulp::cast(near), v._mm256_movemask_ps(met) as u32)
    }

    #[inline(always)]
    fn triangles(
        self,
        block: &Block,
        ray: &Watertight,
        tmin: f64,
        tmax: f64,
    ) -> Option<(Hits, u32)> {
        use std::arch::x86_64::{_CMP_GE_OQ, _CMP_GT_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _CMP_NEQ_UQ};
        let s = self.avx;
        let ([kx, ky, kz], o, shear) = ray.parts();
        let (ox, oy, oz) = (
            s._mm256_set1_pd(o.x),
            s._mm256_set1_pd(o.y),
            s._mm256_set1_pd(o.z),
        );
        let (sx, sy, sz) = (
            s._mm256_set1_pd(shear.x),
            s._mm256_set1_pd(shear.y),
            s._mm256_set1_pd(shear.z),
        );
        macro_rules! corner {
            ($k:expr) => {{
                let c = &block.data[$k];
                macro_rules! at {
                    ($axis:expr, $o:expr) => {
                        s._mm256_sub_pd(s._mm256_cvtps_pd(pulp::cast(c[$axis % 3])), $o)
                    };
                }
                let (x, y, z) = (at!(kx, ox), at!(ky, oy), at!(kz, oz));
                (
                    s._mm256_sub_pd(x, s._mm256_mul_pd(sx, z)),
                    s._mm256_sub_pd(y, s._mm256_mul_pd(sy, z)),
                    s._mm256_mul_pd(z, sz),
                )
            }};
        }
        let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (corner!(0), corner!(1), corner!(2));
        macro_rules! cross {
            ($a:expr, $b:expr, $c:expr, $d:expr) => {
                s._mm256_sub_pd(s._mm256_mul_pd($a, $b), s._mm256_mul_pd($c, $d))
            };
        }
        let u = cross!(cx, by, cy, bx);
        let w = cross!(bx, ay, by, ax);
        let v = cross!(ax, cy, ay, cx);
        let zero = s._mm256_set1_pd(0.0);
        macro_rules! any {
            ($how:expr) => {
                s._mm256_or_pd(
                    s._mm256_or_pd(
                        s._mm256_cmp_pd::<{ $how }>(u, zero),
                        s._mm256_cmp_pd::<{ $how }>(v, zero),
                    ),
                    s._mm256_cmp_pd::<{ $how }>(w, zero),
                )
            };
        }
        let (below, above) = (any!(_CMP_LT_OQ), any!(_CMP_GT_OQ));
        let det = s._mm256_add_pd(s._mm256_add_pd(u, v), w);
        let flat = s._mm256_cmp_pd::<_CMP_NEQ_UQ>(det, zero);
        let outside = s._mm256_movemask_pd(s._mm256_and_pd(below, above));
        let mut mask = !outside & s._mm256_movemask_pd(flat) & block.lanes();
        if mask == 0 {
            return None;
        }
        let inv = s._mm256_div_pd(s._mm256_set1_pd(1.0), det);
        let sum = s._mm256_add_pd(
            s._mm256_add_pd(s._mm256_mul_pd(u, az), s._mm256_mul_pd(v, bz)),
            s._mm256_mul_pd(w, cz),
        );
        let t = s._mm256_mul_pd(sum, inv);
        let within = s._mm256_and_pd(
            s._mm256_cmp_pd::<_CMP_GE_OQ>(t, s._mm256_set1_pd(tmin)),
            s._mm256_cmp_pd::<_CMP_LE_OQ>(t, s._mm256_set1_pd(tmax)),
        );
        mask &= s._mm256_movemask_pd(within);
        if mask == 0 {
            return None;
        }
        let hits = Hits {
            t: pulp::cast(t),
            u: pulp::cast(s._mm256_mul_pd(v, inv)),
            v: pulp::cast(s._mm256_mul_pd(w, inv)),
        };
        Some((hits, mask as u32))
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::super::{Kind, Prim};
    use super::*;
    use crate::math::DVec3;
    use crate::sampling::Rng;

    /// Corners on a coarse grid, so that rays meet edges, corners and flat triangles often.
    #[test]
    fn both_versions_find_the_same_bits() {
        let Some(wide) = Wide::try_new() else {
            eprintln!("skipped: no AVX2");
            return;
        };
        let mut rng = Rng::new(7);
        let mut found = 0;
        for i in 0..100_000 {
            let mut grid = |n: f64| (rng.next_1d() * n).floor() - n / 2.0;
            let mut prim = |_| Prim {
                data: [(); 3].map(|()| [(); 3].map(|()| grid(6.0) as f32)),
                kind: Kind::Triangle,
                object: 0,
                prim: 0,
            };
            let block = Block::new((0..1 + i % 4).map(&mut prim));
            let o = DVec3::new(grid(5.0), grid(5.0), grid(5.0) * 0.5);
            let d = DVec3::new(grid(5.0), grid(5.0), grid(5.0) + 0.5);
            let ray = Watertight::new(o, d);
            let [a, b] = [
                Portable.triangles(&block, &ray, 0.0, 9.0),
                wide.triangles(&block, &ray, 0.0, 9.0),
            ];
            assert_eq!(a.is_some(), b.is_some(), "{block:?} {o} {d}");
            if let (Some((a, mask)), Some((b, other))) = (a, b) {
                assert_eq!(mask, other, "{block:?} {o} {d}");
                for lane in (0..WIDTH).filter(|lane| mask >> lane & 1 != 0) {
                    let bits = |h: &Hits| [h.t, h.u, h.v].map(|x| x[lane].to_bits());
                    assert_eq!(bits(&a), bits(&b), "{block:?} {o} {d}");
                    found += 1;
                }
            }
        }
        assert!(found > 5000, "{found}");
    }
}
