//! The search for hits, once for each set of instructions.

use super::lanes::{Lanes, Portable, Task};
use super::leaf::Block;
use super::node::{Slab, Visitor, traverse};
use super::{Bvh, Kind, Level, Prim};
use crate::accel::linear::{PreparedRay, PrimHit, uncut};
use crate::geometry::{Ray, ray_key, sphere};
use crate::math::Vec3;

/// The state of a search.
struct Search {
    tmin: f64,
    tmax: f64,
    /// The ray's key, if some hits are to be asked about.
    key: Option<u64>,
    best: Option<(PrimHit, u32, u32)>,
}

impl Search {
    /// Takes a hit within the bounds, if it is better than the best; of equal ones the first.
    #[inline]
    fn offer(&mut self, h: PrimHit, object: u32, prim: u32) {
        let better = match &self.best {
            None => true,
            Some((b, o, p)) => h.t < b.t || (h.t == b.t && (object, prim) < (*o, *p)),
        };
        if better {
            self.tmax = h.t;
            self.best = Some((h, object, prim));
        }
    }
}

#[inline(always)]
fn test(prim: &Prim, ray: &PreparedRay, search: &Search, tmin: f64) -> Option<PrimHit> {
    if prim.kind == Kind::Triangle {
        ray.watertight
            .intersect_single(&prim.data, tmin, search.tmax)
            .map(|h| PrimHit {
                t: h.t,
                u: h.b1,
                v: h.b2,
            })
    } else {
        let c = Vec3::from(prim.data[0]).as_dvec3();
        let r = f64::from(prim.data[1][0]);
        sphere::intersect(ray.o, ray.d, c, r, tmin, search.tmax).map(|t| PrimHit {
            t,
            u: 0.0,
            v: 0.0,
        })
    }
}

impl Bvh {
    /// Tests a primitive of `object`, and asks about the hit where that is not whole.
    #[inline(always)]
    fn test(
        &self,
        prim: &Prim,
        object: u32,
        ray: &PreparedRay,
        search: &Search,
    ) -> Option<PrimHit> {
        match search.key {
            None => test(prim, ray, search, search.tmin),
            Some(key) => self.test_uncut(prim, object, ray, search, key),
        }
    }

    #[inline(never)]
    fn test_uncut(
        &self,
        prim: &Prim,
        object: u32,
        ray: &PreparedRay,
        search: &Search,
        key: u64,
    ) -> Option<PrimHit> {
        let find = |tmin| test(prim, ray, search, tmin);
        let at = &self.geometry.objects[object as usize];
        match &at.coverage {
            _ if cfg!(dualight_without = "alpha") => find(search.tmin),
            None => find(search.tmin),
            Some(coverage) => {
                let shape = self.geometry.shape(at.shape);
                let which = (key, object, prim.prim);
                uncut(&**coverage, shape, ray, which, search.tmin, find)
            }
        }
    }

    /// Tests the primitives of a leaf, of which some are not triangles or not whole.
    #[inline(never)]
    fn mixed<L: Lanes, const ANY: bool>(
        &self,
        lanes: L,
        block: &Block,
        below: Option<u32>,
        ray: &PreparedRay,
        search: &mut Search,
    ) {
        for lane in 0..block.count() {
            let prim = block.get(lane);
            let object = below.unwrap_or(prim.object);
            if prim.kind == Kind::Instance {
                self.instance::<L, ANY>(lanes, &prim, ray, search);
            } else if let Some(h) = self.test(&prim, object, ray, search) {
                search.offer(h, object, prim.prim);
            }
            if ANY && search.best.is_some() {
                return;
            }
        }
    }

    /// Searches a tree; `below` is the object of which it is the shape.
    #[inline(always)]
    fn level<L: Lanes, const ANY: bool>(
        &self,
        lanes: L,
        level: &Level,
        (slab, ray): (&Slab, &PreparedRay),
        below: Option<u32>,
        search: &mut Search,
    ) {
        let bound = slab.bound(search.tmax);
        let tree = &level.tree;
        let mut at = AtLeaves::<L, ANY> {
            bvh: self,
            lanes,
            level,
            slab,
            ray,
            below,
            search,
        };
        traverse(lanes, &tree.nodes, tree.root, slab, bound, &mut at);
    }

    #[inline(always)]
    fn search<L: Lanes, const ANY: bool>(
        &self,
        lanes: L,
        ray: &Ray,
    ) -> Option<(PrimHit, u32, u32)> {
        if !ray.is_valid() {
            return None;
        }
        let mut search = Search {
            tmin: f64::from(ray.tmin),
            tmax: f64::from(ray.tmax),
            key: (!self.whole).then(|| ray_key(ray)),
            best: None,
        };
        let world = PreparedRay::new(ray.origin(), ray.direction());
        let slab = Slab::new(world.o, world.d, search.tmin, self.reach, self.slop)?;
        self.level::<L, ANY>(lanes, &self.top, (&slab, &world), None, &mut search);
        search.best
    }

    #[inline(always)]
    fn with<L: Lanes, const ANY: bool>(&self, lanes: L, ray: &Ray) -> Option<(PrimHit, u32, u32)> {
        struct Whole<'a, L, const ANY: bool>(&'a Bvh, L, &'a Ray);
        impl<L: Lanes, const ANY: bool> Task for Whole<'_, L, ANY> {
            type Output = Option<(PrimHit, u32, u32)>;

            #[inline(always)]
            fn run(self) -> Self::Output {
                self.0.search::<L, ANY>(self.1, self.2)
            }
        }
        lanes.run(Whole::<L, ANY>(self, lanes, ray))
    }

    /// The search with the best instructions there are.
    #[inline]
    pub(super) fn best<const ANY: bool>(&self, ray: &Ray) -> Option<(PrimHit, u32, u32)> {
        #[cfg(target_arch = "x86_64")]
        if let Some(wide) = self.wide {
            return self.with::<_, ANY>(wide, ray);
        }
        self.with::<_, ANY>(Portable, ray)
    }

    #[inline(never)]
    fn instance<L: Lanes, const ANY: bool>(
        &self,
        lanes: L,
        at: &Prim,
        world: &PreparedRay,
        search: &mut Search,
    ) {
        let Some(place) = &self.geometry.objects[at.object as usize].placement else {
            return;
        };
        let local = PreparedRay::new(
            place.object_from_world.transform_point3(world.o),
            place.object_from_world.transform_vector3(world.d),
        );
        let level = &self.shapes[at.prim as usize];
        let Some(slab) = Slab::new(local.o, local.d, search.tmin, level.tree.reach(), 1.0) else {
            return;
        };
        struct Below<'a, L, const ANY: bool> {
            bvh: &'a Bvh,
            lanes: L,
            level: &'a Level,
            ray: (&'a Slab, &'a PreparedRay),
            object: u32,
            search: &'a mut Search,
        }
        impl<L: Lanes, const ANY: bool> Task for Below<'_, L, ANY> {
            type Output = ();

            #[inline(always)]
            fn run(self) {
                let object = Some(self.object);
                self.bvh
                    .level::<L, ANY>(self.lanes, self.level, self.ray, object, self.search);
            }
        }
        lanes.run(Below::<L, ANY> {
            bvh: self,
            lanes,
            level,
            ray: (&slab, &local),
            object: at.object,
            search,
        });
    }
}

/// A search within one tree.
struct AtLeaves<'a, L, const ANY: bool> {
    bvh: &'a Bvh,
    lanes: L,
    level: &'a Level,
    slab: &'a Slab,
    ray: &'a PreparedRay,
    /// The object of which the tree is the shape.
    below: Option<u32>,
    search: &'a mut Search,
}

impl<L: Lanes, const ANY: bool> Visitor for AtLeaves<'_, L, ANY> {
    #[inline(always)]
    fn visit(&mut self, leaf: usize, bound: &mut f32) -> bool {
        let (block, ray, search) = (&self.level.blocks[leaf], self.ray, &mut *self.search);
        if block.is_of_triangles() && search.key.is_none() {
            let triangles = &ray.watertight;
            let found = (self.lanes).triangles(block, triangles, search.tmin, search.tmax);
            let Some((hits, mut mask)) = found else {
                return true;
            };
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize & 3;
                mask &= mask - 1;
                let h = PrimHit {
                    t: hits.t[lane],
                    u: hits.u[lane],
                    v: hits.v[lane],
                };
                let (object, prim) = block.name(lane);
                search.offer(h, self.below.unwrap_or(object), prim);
            }
        } else {
            (self.bvh).mixed::<L, ANY>(self.lanes, block, self.below, ray, search);
        }
        if ANY && search.best.is_some() {
            return false;
        }
        *bound = self.slab.bound(search.tmax);
        true
    }
}
