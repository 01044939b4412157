//! `bvh`: bounding volume hierarchies, in Rust alone.
//!
//! Objects that are given in world space share one tree over all their triangles and spheres; an
//! instance is one more primitive of that tree and has a tree of its shape below it. Leaves hold
//! copies of their primitives in traversal order. The boxes are tested conservatively in `f32`
//! (see [`node`]), the primitives in `f64` by the very code that `linear` runs on the very same
//! numbers: both backends return the same bits, also for the tie between coincident primitives
//! (the lowest object, then the lowest primitive).
//!
//! One exception is deliberate: where rounding makes `linear` report a triangle that the ray
//! passes at a distance (seen edge-on to `2⁻⁵⁰`), a box may rightly rule it out.

mod build;
mod lanes;
mod leaf;
mod node;
mod search;
mod table;

use std::sync::Arc;
use std::time::Instant;

use glam::Vec3A;
use rayon::prelude::*;

use self::build::{Ref, Tree};
use self::leaf::Block;
use self::node::MOST_PRIMS;
use self::table::Table;
use super::{Accelerator, AcceleratorEntry, BuildStats};
use crate::error::{Error, Result};
use crate::geometry::{Geometry, Hit, Object, ObjectId, Placement, Ray, Shape};
use crate::math::{Aabb, DMat3, DVec3, Vec3, max_abs};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum Kind {
    Triangle,
    Sphere,
    Instance,
}

impl Kind {
    /// By their numbers.
    const ALL: [Self; 3] = [Self::Triangle, Self::Sphere, Self::Instance];
}

/// A primitive as leaves hold it.
#[derive(Clone, Copy, Debug)]
struct Prim {
    /// Corners; or centre, then radius; unused for an instance.
    data: [[f32; 3]; 3],
    kind: Kind,
    /// Index of the object; unused below an instance.
    object: u32,
    /// Index within the shape; for an instance, of the shape's tree.
    prim: u32,
}

#[derive(Debug)]
struct Level {
    tree: Tree,
    blocks: Table<Block>,
    /// Primitives in all blocks.
    count: usize,
}

impl Level {
    fn new(entries: Vec<(Prim, Bounds)>, parallel: bool) -> Result<Self> {
        if entries.len() >= MOST_PRIMS {
            return Err(Error::Accelerator {
                backend: "bvh",
                problem: format!("{} primitives are more than it can hold", entries.len()),
                remedy: "use --accel embree, or instances".into(),
            });
        }
        let mut refs: Vec<Ref> = entries
            .iter()
            .enumerate()
            .map(|(i, (_, b))| Ref {
                min: b.0,
                max: b.1,
                index: i as u32,
            })
            .collect();
        let mut tree = build::build(&mut refs, parallel);
        let block = |&(first, count): &(u32, u32)| {
            let range = &refs[first as usize..(first + count) as usize];
            Block::new(range.iter().map(|r| entries[r.index as usize].0))
        };
        let leaves = &tree.leaves[..];
        let blocks = Table::new(leaves.len(), |out: &mut [Block]| {
            let fill = |(out, leaf): (&mut Block, _)| *out = block(leaf);
            if parallel {
                out.par_iter_mut().zip(leaves).for_each(fill);
            } else {
                out.iter_mut().zip(leaves).for_each(fill);
            }
        });
        tree.leaves = Vec::new();
        let count = refs.len();
        Ok(Self {
            tree,
            blocks,
            count,
        })
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.tree.nodes[..]) + size_of_val(&self.blocks[..])
    }
}

/// Lower and upper corner, rounded outward.
type Bounds = (Vec3A, Vec3A);

fn round_out(lo: DVec3, hi: DVec3) -> Bounds {
    let down = |x: f64| {
        let f = x as f32;
        if f64::from(f) > x { f.next_down() } else { f }.max(f32::MIN)
    };
    let up = |x: f64| {
        let f = x as f32;
        if f64::from(f) < x { f.next_up() } else { f }.min(f32::MAX)
    };
    (
        Vec3A::new(down(lo.x), down(lo.y), down(lo.z)),
        Vec3A::new(up(hi.x), up(hi.y), up(hi.z)),
    )
}

/// The primitives of a shape with their boxes; those that are not finite can never be hit.
fn primitives(shape: &Shape, object: u32) -> impl Iterator<Item = (Prim, Bounds)> {
    (0..shape.len() as u32).filter_map(move |prim| {
        let entry = match shape {
            Shape::Mesh(mesh) => {
                let data = mesh.indices[prim as usize].map(|i| mesh.positions[i as usize]);
                let [a, b, c] = data.map(Vec3A::from);
                let finite = a.is_finite() && b.is_finite() && c.is_finite();
                finite.then(|| (Kind::Triangle, data, (a.min(b).min(c), a.max(b).max(c))))
            }
            Shape::Spheres(set) => {
                let [x, y, z, r] = set.spheres[prim as usize];
                let c = Vec3::new(x, y, z);
                (c.is_finite() && r.is_finite()).then(|| {
                    let (center, radius) = (c.as_dvec3(), f64::from(r).abs());
                    (
                        Kind::Sphere,
                        [[x, y, z], [r, 0.0, 0.0], [0.0; 3]],
                        round_out(center - radius, center + radius),
                    )
                })
            }
        };
        entry.map(|(kind, data, bounds)| {
            let prim = Prim {
                data,
                kind,
                object,
                prim,
            };
            (prim, bounds)
        })
    })
}

/// How much a placement can amplify rounding: the norm of `|W|·|W⁻¹|`.
fn amplification(p: &Placement) -> f64 {
    let product = absolute(p.world_from_object.matrix3) * absolute(p.object_from_world.matrix3);
    max_abs(product * DVec3::ONE)
}

fn absolute(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

/// World-space box of an instance of `level` with room for the rounding of both its maps, and the
/// size of the largest term in them.
fn instance_bounds(level: &Level, p: &Placement) -> (Bounds, f64) {
    let w = &p.world_from_object;
    let (lo, hi) = (level.tree.min.as_dvec3(), level.tree.max.as_dvec3());
    let mut b = Aabb::EMPTY;
    for k in 0..8 {
        let pick = |bit: usize| if k >> bit & 1 == 0 { lo[bit] } else { hi[bit] };
        b.grow(w.transform_point3(DVec3::new(pick(0), pick(1), pick(2))));
    }
    let size = max_abs(absolute(w.matrix3) * lo.abs().max(hi.abs())) + max_abs(w.translation);
    let pad = DVec3::splat(size * amplification(p) * 9.1e-13);
    (round_out(b.min - pad, b.max + pad), size)
}

struct Bvh {
    geometry: Arc<Geometry>,
    /// Whether no hit need be asked about.
    whole: bool,
    top: Level,
    /// Trees of the shapes that instances place.
    shapes: Vec<Level>,
    /// Largest amplification of rounding by an instance, at least 1.
    slop: f64,
    /// Largest coordinate, and largest term of an instance's map.
    reach: f64,
    stats: BuildStats,
    /// The instructions for the inner loops, if there are better ones than all processors have.
    #[cfg(target_arch = "x86_64")]
    wide: Option<lanes::Wide>,
}

impl Accelerator for Bvh {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.best::<false>(ray).map(|(h, object, prim)| Hit {
            t: h.t as f32,
            u: h.u as f32,
            v: h.v as f32,
            prim,
            object: ObjectId(object),
        })
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.best::<true>(ray).is_some()
    }

    fn watertight(&self) -> bool {
        true
    }

    fn stats(&self) -> BuildStats {
        self.stats.clone()
    }
}

fn build(geometry: &Arc<Geometry>, threads: usize) -> Result<Box<dyn Accelerator>> {
    let pool = (threads > 1)
        .then(|| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .ok()
        })
        .flatten();
    let bvh = match &pool {
        Some(pool) => pool.install(|| build_with(geometry, true)),
        // Without threads of its own the build is slower, and the same.
        None => build_with(geometry, false),
    }?;
    Ok(Box::new(bvh))
}

fn build_with(geometry: &Arc<Geometry>, parallel: bool) -> Result<Bvh> {
    let start = Instant::now();
    let mut shapes = Vec::new();
    let mut tree_of: Vec<Option<u32>> = vec![None; geometry.shapes.len()];
    let mut entries = Vec::new();
    let (mut slop, mut reach, mut instances) = (1f64, 0f64, 0u64);
    for (
        i,
        Object {
            shape, placement, ..
        },
    ) in geometry.objects.iter().enumerate()
    {
        let geo = geometry.shape(*shape);
        let Some(place) = placement else {
            entries.extend(primitives(geo, i as u32));
            continue;
        };
        let tree = match tree_of[shape.index()] {
            Some(tree) => tree,
            None => {
                shapes.push(Level::new(primitives(geo, 0).collect(), parallel)?);
                *tree_of[shape.index()].insert(shapes.len() as u32 - 1)
            }
        };
        if shapes[tree as usize].count == 0 {
            continue;
        }
        slop = slop.max(amplification(place));
        let (bounds, size) = instance_bounds(&shapes[tree as usize], place);
        reach = reach.max(size);
        let prim = Prim {
            data: [[0.0; 3]; 3],
            kind: Kind::Instance,
            object: i as u32,
            prim: tree,
        };
        entries.push((prim, bounds));
        instances += 1;
    }
    let top = Level::new(entries, parallel)?;
    reach = reach.max(top.tree.reach());
    let levels = || shapes.iter().chain([&top]);
    let stats = BuildStats {
        backend: "bvh".into(),
        seconds: start.elapsed().as_secs_f64(),
        bytes: levels().map(|l| l.bytes() as u64).sum(),
        primitives: levels().map(|l| l.count as u64).sum::<u64>() - instances,
    };
    Ok(Bvh {
        whole: geometry.is_whole(),
        geometry: geometry.clone(),
        top,
        shapes,
        slop,
        reach,
        stats,
        #[cfg(target_arch = "x86_64")]
        wide: lanes::Wide::try_new(),
    })
}

/// The registry's line.
pub(super) const ENTRY: AcceleratorEntry = AcceleratorEntry {
    name: "bvh",
    doc: "bounding volume hierarchies in pure Rust, two levels",
    build,
};
