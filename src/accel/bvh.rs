//! `bvh`: bounding volume hierarchies in pure Rust, by the `obvhs` crate; two levels.
//!
//! Everything that is given in world space lies in one tree; instances lie in a second one, each
//! leading to the tree of its shape. Boxes are found in `f32`, primitives tested in `f64` by the
//! same code as the brute-force backend.
//!
//! No hit may be lost to rounding in the boxes. So each tree has units of its own, in which it is
//! [`EXTENT`] long and rays have unit length (the crate's tests are made for such numbers), a ray
//! from afar is moved up to the tree in `f64` first, and boxes are padded by more than the
//! rounding of a box test at that size.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb as TreeBox;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray as TreeRay, RayHit};

use super::linear::{PreparedRay, PrimHit, intersect_prim};
use super::{Accelerator, AcceleratorEntry, BuildStats};
use crate::error::Result;
use crate::geometry::{Geometry, Hit, ObjectId, Ray, Shape, ShapeId};
use crate::math::{Aabb, DVec3};

/// Longest side of a tree in its own units.
const EXTENT: f64 = 1024.0;

/// How far boxes are grown, in the tree's units: a slab distance `t ≤ 4 EXTENT` is rounded by at
/// most `3u·t` = 7e-4 there, and directions that `obvhs` takes for axis-parallel (components
/// below 1.2e-7) stray by 5e-4.
const PAD: f64 = 2e-3;

/// A tree over boxes.
struct Tree {
    bvh: CwBvh,
    /// Centre of everything, in the space of the boxes.
    center: DVec3,
    /// Tree units per unit of that space.
    scale: f64,
    /// Radius of a sphere around everything, in that space.
    radius: f64,
    /// Where the members of each distinct box begin, and the end of the last.
    first: Vec<u32>,
    /// Numbers of the boxes, those that coincide side by side.
    members: Vec<u32>,
}

/// Stack of the thread that builds: the crate recurses as deep as its tree, which clusters of
/// nearly coincident boxes make deep.
const BUILD_STACK: usize = 1 << 28;

impl Tree {
    fn build(boxes: &[Aabb]) -> Option<Self> {
        if boxes.is_empty() {
            return None;
        }
        let all = boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(*b));
        let center = all.center();
        let extent = all.extent();
        let longest = extent.max_element();
        let scale = if longest > 0.0 { EXTENT / longest } else { 1.0 };
        let local = |p: DVec3, pad: f64| Vec3A::from(((p - center) * scale + pad).as_vec3());
        let boxes: Vec<TreeBox> = boxes
            .iter()
            .map(|b| TreeBox::new(local(b.min, -PAD), local(b.max, PAD)))
            .collect();
        // Boxes that coincide cannot be told apart by any tree: it would become a chain. Each
        // distinct box is entered once and leads to all of its members.
        let key = |i: u32| {
            let b = &boxes[i as usize];
            [b.min.to_array(), b.max.to_array()].map(|c| c.map(f32::to_bits))
        };
        let mut members: Vec<u32> = (0..boxes.len() as u32).collect();
        members.sort_unstable_by_key(|&i| (key(i), i));
        let mut first = Vec::new();
        let mut distinct = Vec::new();
        for (at, &i) in members.iter().enumerate() {
            if at == 0 || key(members[at - 1]) != key(i) {
                first.push(at as u32);
                distinct.push(boxes[i as usize]);
            }
        }
        first.push(members.len() as u32);
        let params = if distinct.len() > 2_000_000 {
            BvhBuildParams::fast_build()
        } else {
            BvhBuildParams::medium_build()
        };
        let bvh = std::thread::scope(|scope| {
            std::thread::Builder::new()
                .stack_size(BUILD_STACK)
                .spawn_scoped(scope, || {
                    build_cwbvh(&distinct, params, &mut Duration::default())
                })
                .ok()
                .and_then(|thread| thread.join().ok())
        })?;
        Some(Self {
            bvh,
            center,
            scale,
            radius: 0.5 * extent.length(),
            first,
            members,
        })
    }

    /// Visits the boxes along `o + t·d`, `t ≤ tmax`, nearest first where that is cheap. `test`
    /// gets the number of a box and answers with the distance of a hit nearer than all before,
    /// if there is one. Stops at the first hit if `any` is set.
    #[inline]
    fn visit(
        &self,
        o: DVec3,
        d: DVec3,
        tmax: f64,
        any: bool,
        mut test: impl FnMut(usize) -> Option<f64>,
    ) {
        let length = d.length();
        let unit = d / length;
        let from = o - self.center;
        // Up to the tree in f64: far origins would lose their digits in f32.
        let skip = (-from.dot(unit) - 2.0 * self.radius).max(0.0);
        let start = (from + unit * skip) * self.scale;
        let per_t = length * self.scale;
        let shift = skip * self.scale;
        // Rounded up, so that a hit at the very end stays within.
        let to_tree = |t: f64| (((t * per_t - shift) * (1.0 + 1e-6)) as f32 + PAD as f32).min(1e30);
        let end = to_tree(tmax);
        let start = Vec3A::from(start.as_vec3());
        if end < 0.0 || !start.is_finite() {
            return;
        }
        // The crate takes the sign of a component from `< 0` in one place and from its sign bit in
        // another: adding zero turns −0 into +0, on which both agree.
        let unit = Vec3A::from(unit.as_vec3()) + Vec3A::ZERO;
        let ray = TreeRay::new(start, unit, 0.0, end);
        let mut visit = |_: &TreeRay, id: usize| {
            let group = self.bvh.primitive_indices[id] as usize;
            let range = self.first[group] as usize..self.first[group + 1] as usize;
            let nearest = self.members[range]
                .iter()
                .filter_map(|&i| test(i as usize))
                .reduce(f64::min);
            nearest.map_or(f32::INFINITY, to_tree)
        };
        if any {
            // Below the ray's end, whatever rounding made of it.
            self.bvh.ray_traverse_miss(ray, |r, id| {
                if visit(r, id).is_finite() {
                    -1.0
                } else {
                    f32::INFINITY
                }
            });
        } else {
            self.bvh.ray_traverse(ray, &mut RayHit::none(), visit);
        }
    }

    fn bytes(&self) -> u64 {
        let nodes = size_of_val(self.bvh.nodes.as_slice());
        let lists = [&self.bvh.primitive_indices, &self.first, &self.members];
        (nodes
            + lists
                .map(|l| size_of_val(l.as_slice()))
                .iter()
                .sum::<usize>()) as u64
    }
}

struct Bvh {
    geometry: Arc<Geometry>,
    /// What is given in world space.
    world: Option<Tree>,
    /// Object and primitive of each box of `world`.
    world_prims: Vec<(ObjectId, u32)>,
    /// Instances.
    top: Option<Tree>,
    /// Object of each box of `top`.
    instances: Vec<ObjectId>,
    /// Trees of the shapes that instances place.
    shapes: Vec<Option<Tree>>,
    seconds: f64,
}

/// The nearest hit so far.
struct Best {
    tmax: f64,
    hit: Option<(PrimHit, ObjectId, u32)>,
}

impl Best {
    /// Takes a hit if it is nearer; of equal distances the lower object and primitive stay, as
    /// with the brute-force backend.
    #[inline]
    fn offer(&mut self, h: PrimHit, object: ObjectId, prim: u32) -> Option<f64> {
        let better = match &self.hit {
            None => true,
            Some((b, o, p)) => h.t < b.t || (h.t == b.t && (object, prim) < (*o, *p)),
        };
        better.then(|| {
            self.tmax = h.t;
            self.hit = Some((h, object, prim));
            h.t
        })
    }
}

impl Bvh {
    #[inline]
    fn nearest(&self, ray: &Ray, any: bool) -> Option<Hit> {
        if !ray.is_valid() {
            return None;
        }
        let g = &*self.geometry;
        let tmin = f64::from(ray.tmin);
        let mut best = Best {
            tmax: f64::from(ray.tmax),
            hit: None,
        };
        let prepared = PreparedRay::new(ray.origin(), ray.direction());
        let (o, d) = (prepared.o, prepared.d);
        if let Some(tree) = &self.world {
            tree.visit(o, d, best.tmax, any, |i| {
                let (object, prim) = self.world_prims[i];
                let shape = g.shape(g.object(object).shape);
                let h = intersect_prim(shape, prim, &prepared, tmin, best.tmax)?;
                best.offer(h, object, prim)
            });
        }
        if let Some(top) = &self.top
            && !(any && best.hit.is_some())
        {
            top.visit(o, d, best.tmax, any, |i| {
                let object = self.instances[i];
                let id = g.object(object).shape;
                let place = g.object(object).placement.as_ref()?;
                let tree = self.shapes[id.index()].as_ref()?;
                let local = PreparedRay::new(
                    place.object_from_world.transform_point3(o),
                    place.object_from_world.transform_vector3(d),
                );
                let mut found = None;
                tree.visit(local.o, local.d, best.tmax, any, |prim| {
                    let prim = prim as u32;
                    let h = intersect_prim(g.shape(id), prim, &local, tmin, best.tmax)?;
                    found = best.offer(h, object, prim).or(found);
                    found
                });
                found
            });
        }
        let (h, object, prim) = best.hit?;
        Some(Hit {
            t: h.t as f32,
            u: h.u as f32,
            v: h.v as f32,
            prim,
            object,
        })
    }
}

impl Accelerator for Bvh {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.nearest(ray, false)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.nearest(ray, true).is_some()
    }

    fn stats(&self) -> BuildStats {
        let trees = self.shapes.iter().chain([&self.world, &self.top]);
        BuildStats {
            backend: "obvhs".into(),
            seconds: self.seconds,
            bytes: trees.flatten().map(Tree::bytes).sum::<u64>()
                + size_of_val(self.world_prims.as_slice()) as u64,
            primitives: self.geometry.shapes.iter().map(|s| s.len() as u64).sum(),
        }
    }
}

fn prim_bounds(shape: &Shape, prim: u32) -> Aabb {
    match shape {
        Shape::Mesh(m) => {
            let mut b = Aabb::EMPTY;
            for p in m.corners(prim) {
                b.grow(p);
            }
            b
        }
        Shape::Spheres(s) => {
            let (c, r) = s.get(prim);
            Aabb {
                min: c - r,
                max: c + r,
            }
        }
    }
}

fn shape_boxes(shape: &Shape) -> Vec<Aabb> {
    (0..shape.len() as u32)
        .map(|i| prim_bounds(shape, i))
        .collect()
}

fn build(geometry: &Arc<Geometry>, _threads: usize) -> Result<Box<dyn Accelerator>> {
    let start = Instant::now();
    let g = &**geometry;
    let (mut world_prims, mut world_boxes) = (Vec::new(), Vec::new());
    let (mut instances, mut instance_boxes) = (Vec::new(), Vec::new());
    let mut shapes: Vec<Option<Tree>> = (0..g.shapes.len()).map(|_| None).collect();
    for (i, object) in g.objects.iter().enumerate() {
        let id = ObjectId(i as u32);
        let shape = g.shape(object.shape);
        if object.placement.is_none() {
            world_boxes.extend(shape_boxes(shape));
            world_prims.extend((0..shape.len() as u32).map(|p| (id, p)));
            continue;
        }
        let slot = &mut shapes[object.shape.index()];
        if slot.is_none() {
            *slot = Tree::build(&shape_boxes(g.shape(ShapeId(object.shape.0))));
        }
        instances.push(id);
        instance_boxes.push(g.object_bounds(id));
    }
    Ok(Box::new(Bvh {
        geometry: geometry.clone(),
        world: Tree::build(&world_boxes),
        world_prims,
        top: Tree::build(&instance_boxes),
        instances,
        shapes,
        seconds: start.elapsed().as_secs_f64(),
    }))
}

/// The registry's line.
pub(super) const ENTRY: AcceleratorEntry = AcceleratorEntry {
    name: "bvh",
    doc: "bounding volume hierarchies in pure Rust, two levels",
    build,
};
