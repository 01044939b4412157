//! What is divided: the squares of random numbers from which photons leave a light.
//!
//! A light makes a photon from two points of the unit square, one for its origin and one for its
//! direction. Dividing these squares instead of space works for every kind of light, and needs no
//! integral: a cell's flux is its share of the square times the flux of what it holds.

use std::sync::Arc;

use super::super::departure::leave;
use crate::geometry::Ray;
use crate::geometry::forecast::Moves;
use crate::lights::Light;
use crate::math::DVec3;
use crate::photons::{EmittedPhoton, Targets};
use crate::sampling::{Sampler, stream};
use crate::scene::Scene;

/// Deepest division: beyond it the directions of neighbouring cells are equal in single precision.
pub(super) const DEEPEST: u32 = 21;

/// How far inside a cell its corners are taken: a light's map may jump from one cell to the next.
const INSET: f64 = 1e-3;

/// What is left of the parallax between origins if the map follows the objects: about their
/// radius over their distance.
const AIMED: f64 = 0.25;

/// Points by which the flux toward the objects is guessed, to share photons by.
const FLUX_POINTS: u64 = 64;

/// A square of a quadtree over the unit square.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cell {
    /// Number of divisions.
    pub(super) level: u32,
    x: u32,
    y: u32,
}

impl Cell {
    /// Number `i` of the `4^level` cells of a level.
    pub(super) fn number(level: u32, i: u32) -> Self {
        let mask = (1 << level) - 1;
        Self {
            level,
            x: i & mask,
            y: i >> level,
        }
    }

    /// Quarter `k`: bit 0 in the first dimension, bit 1 in the second.
    pub(super) fn child(self, k: u32) -> Self {
        Self {
            level: self.level + 1,
            x: self.x << 1 | (k & 1),
            y: self.y << 1 | k >> 1,
        }
    }

    /// The quarters that lead to it from the whole square.
    pub(super) fn quarters(self) -> impl Iterator<Item = usize> {
        let bit = |x: u32, l: u32| (x >> l & 1) as usize;
        (0..self.level)
            .rev()
            .map(move |l| bit(self.x, l) | bit(self.y, l) << 1)
    }

    /// Its share of the square.
    pub(super) fn measure(self) -> f64 {
        0.25f64.powi(self.level as i32)
    }

    /// A point of it.
    #[inline]
    pub(super) fn at(self, [u, v]: [f64; 2]) -> [f64; 2] {
        let size = 0.5f64.powi(self.level as i32);
        [
            (f64::from(self.x) + u) * size,
            (f64::from(self.y) + v) * size,
        ]
    }

    /// One of nine points: corners, middles of edges and the middle, `i` and `j` from 0 to 2.
    pub(super) fn knot(self, i: usize, j: usize) -> [f64; 2] {
        let x = [INSET, 0.5, 1.0 - INSET];
        self.at([x[i], x[j]])
    }

    /// A name that no other cell has.
    pub(super) fn key(self) -> u64 {
        u64::from(self.level) << 56 | u64::from(self.x) << 28 | u64::from(self.y)
    }
}

/// A tree of cells: all photons of a light whose other square lies in one stratum.
pub(super) struct Tree<'a> {
    pub(super) light: &'a dyn Light,
    /// Number of the light.
    pub(super) index: u32,
    scene: &'a Scene,
    /// What it aims at, if it does: directions are then spread over the cones (for light from
    /// infinity: discs) under which each origin sees the specular objects. This map follows the
    /// objects from one origin to the next, so that a cell shows the same part of them to a whole
    /// stratum.
    aim: Option<Arc<Targets>>,
    /// The stratum of the first square, which is not divided.
    pub(super) stratum: Cell,
    /// All rays of the stratum pass within this distance of where those of its middle do.
    pub(super) spread: f64,
    flat: bool,
    /// How its rays differ.
    pub(super) moves: Moves,
    /// Luminance of its flux.
    pub(super) flux: f64,
}

impl Tree<'_> {
    /// The photon at `u` of the divided square and `v` of the stratum, with the flux that it had
    /// if it were the only one of its tree.
    #[inline]
    pub(super) fn leave(&self, u: [f64; 2], v: [f64; 2]) -> Option<EmittedPhoton> {
        // A corner of a cell may be the square's own border, which belongs to no sample.
        let u = u.map(|x| x.clamp(0.0, 1.0 - f64::EPSILON));
        let v = self.stratum.at(v);
        let photon = leave(self.light, self.scene, self.aim.as_deref(), v, u)?;
        Some(EmittedPhoton {
            power: photon.power * self.stratum.measure(),
            ..photon
        })
    }

    /// Luminance of its flux by a few points: what reaches the cones is known by samples only.
    fn mean_flux(&self) -> f64 {
        let points = (0..FLUX_POINTS).map(|i| {
            let mut s = Sampler::new(0, stream::TOOL, self.stratum.key(), i);
            self.leave(s.next_2d(), s.next_2d())
        });
        let sum: f64 = points.flatten().map(|p| p.power.luminance()).sum();
        sum / FLUX_POINTS as f64
    }

    /// Whether the ray from the middle of the stratum speaks for its other points: not on a curved
    /// light, whose directions turn with the normal.
    pub(super) fn is_flat(&self) -> bool {
        self.flat
    }

    /// Whether directions are the light's own, so that what lies beside an object is seen too.
    pub(super) fn is_own(&self) -> bool {
        self.aim.is_none()
    }

    /// By how much what a cell shows differs from one origin of the stratum to another. Where the
    /// map follows the objects, only their depth makes a difference.
    pub(super) fn parallax(&self) -> f64 {
        if self.is_own() {
            self.spread
        } else {
            AIMED * self.spread
        }
    }

    /// By how much the rays of a cell differ from that of its middle, in the sense of
    /// [`Moves`]: the largest offset among points of its outline, and a little more.
    pub(super) fn reach(&self, cell: Cell, middle: &Ray) -> f64 {
        let mut most = 0.0f64;
        for k in [0, 1, 2, 3, 5, 6, 7, 8] {
            let Some(l) = self.leave(cell.knot(k % 3, k / 3), [0.5; 2]) else {
                return f64::INFINITY;
            };
            most = most.max(self.offset(middle, &l.ray).length_squared());
        }
        1.1 * most.sqrt()
    }

    /// What turns or shifts ray `a` into ray `b`.
    #[inline]
    pub(super) fn offset(&self, a: &Ray, b: &Ray) -> DVec3 {
        match self.moves {
            Moves::Target => b.direction() - a.direction(),
            Moves::Ray => b.origin() - a.origin(),
        }
    }
}

/// The trees of a light: one for parallel light and for a point; for a surface one for each of
/// `4^levels` strata of its points, for a wide sun and a sky as many strata of directions.
pub(super) fn trees<'a>(
    light: &'a dyn Light,
    index: u32,
    levels: u32,
    scene: &'a Scene,
    aim: Option<&Arc<Targets>>,
) -> Vec<Tree<'a>> {
    let flux = light.power().luminance();
    let (whole, _) = extent(light, scene, Cell::default());
    let levels = if whole > 0.0 { levels } else { 0 };
    let moves = match light.sample_distant([0.5; 2]) {
        Some(_) => Moves::Ray,
        None => Moves::Target,
    };
    (0..1 << (2 * levels))
        .map(|i| {
            let stratum = Cell::number(levels, i);
            let (spread, flat) = extent(light, scene, stratum);
            let mut tree = Tree {
                light,
                index,
                scene,
                aim: aim.cloned(),
                stratum,
                spread,
                flat,
                moves,
                flux: flux * stratum.measure(),
            };
            if !tree.is_own() {
                tree.flux = tree.mean_flux();
            }
            tree
        })
        .collect()
}

/// Most by which the directions of a stratum may differ, if its middle is to speak for it.
const NARROW: f64 = 0.02;

/// By how much the rays of a stratum pass beside those of its middle, and whether their directions
/// are alike.
fn extent(light: &dyn Light, scene: &Scene, stratum: Cell) -> (f64, bool) {
    let around = scene.bounds.bounding_sphere();
    let at = |u: [f64; 2]| {
        if let Some(d) = light.sample_distant(u) {
            return Some((DVec3::ZERO, Some(d.direction)));
        }
        light.sample_origin(u).map(|from| (from.p, from.ng))
    };
    let Some((p, axis)) = at(stratum.at([0.5; 2])) else {
        return (0.0, true);
    };
    let distant = light.sample_distant([0.5; 2]).is_some();
    let (mut far, mut turn) = (0.0f64, 0.0f64);
    for i in 0..25u32 {
        let x = |k: u32| f64::from(k) * 0.2499 + 2e-4;
        let Some((q, b)) = at(stratum.at([x(i % 5), x(i / 5)])) else {
            continue;
        };
        far = far.max((p - q).length());
        if let (Some(a), Some(b)) = (axis, b) {
            turn = turn.max((a - b).length());
        }
    }
    if distant {
        // Beams that turn move across the whole depth of the scene.
        return (2.2 * turn * around.radius, turn < NARROW);
    }
    // A surface's own directions turn with its normal.
    (1.1 * far, turn < 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Rgb;
    use crate::lights::{LIGHTS, LightDesc};
    use crate::math::BoundingSphere;
    use crate::sampling::Rng;
    use crate::scene::SceneBuilder;

    fn light(kind: &str) -> Box<dyn Light> {
        let desc = LightDesc {
            direction: DVec3::new(0.3, -1.0, 0.2),
            strength: Rgb::ONE,
            inner_cone: 0.3,
            outer_cone: 0.7,
            triangles: vec![[DVec3::ZERO, DVec3::X, DVec3::Z]],
            spheres: vec![BoundingSphere {
                center: DVec3::ZERO,
                radius: 0.5,
            }],
            scene: BoundingSphere {
                center: DVec3::ZERO,
                radius: 3.0,
            },
            ..Default::default()
        };
        let entry = LIGHTS.iter().find(|e| e.name == kind).expect("a light");
        (entry.build)(&desc).expect("valid")
    }

    /// A unit ball, so that light from infinity has a disc.
    fn scene() -> Scene {
        let mut b = SceneBuilder::default();
        let material = b.add_material(&Default::default()).expect("valid");
        let set = crate::geometry::SphereSet {
            spheres: vec![[0.0, 0.0, 0.0, 1.0]],
        };
        let shape = b.add_spheres(set, "ball");
        b.place(crate::scene::MeshPlacement {
            shape,
            material,
            world_from_object: crate::math::DAffine3::IDENTITY,
            name: "ball".into(),
        });
        b.finish().expect("valid")
    }

    #[test]
    fn children_partition_a_cell() {
        let parent = Cell::number(3, 37);
        assert!((0..4).map(|k| parent.child(k).measure()).sum::<f64>() == parent.measure());
        let mut rng = Rng::new(1);
        for _ in 0..1000 {
            let k = (rng.next_1d() * 4.0) as u32;
            let p = parent.child(k).at(rng.next_2d());
            let [lo, hi] = [parent.at([0.0; 2]), parent.at([1.0; 2])];
            assert!((0..2).all(|i| lo[i] <= p[i] && p[i] < hi[i]));
        }
        let mut keys: Vec<u64> = (0..5)
            .flat_map(|l| (0..1 << (2 * l)).map(move |i| Cell::number(l, i).key()))
            .collect();
        let n = keys.len();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), n);
    }

    #[test]
    fn the_reach_of_a_cell_holds_its_rays() {
        let (mut rng, scene) = (Rng::new(2), scene());
        for kind in ["point", "spot", "directional", "area"] {
            let light = light(kind);
            for tree in trees(&*light, 0, 0, &scene, None) {
                for level in 3..9 {
                    for _ in 0..60 {
                        let i = (rng.next_1d() * 4f64.powi(level as i32)) as u32;
                        let cell = Cell::number(level, i);
                        let middle = tree.leave(cell.at([0.5; 2]), [0.5; 2]).expect("leaves").ray;
                        let reach = tree.reach(cell, &middle);
                        for _ in 0..50 {
                            let l = tree
                                .leave(cell.at(rng.next_2d()), [0.5; 2])
                                .expect("leaves");
                            let h = tree.offset(&middle, &l.ray).length();
                            assert!(h <= reach, "{kind}, level {level}: {h} {reach}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn lights_without_extent_have_one_tree_and_surfaces_have_strata() {
        let scene = scene();
        for (kind, count) in [
            ("point", 1),
            ("spot", 1),
            ("directional", 1),
            ("area", 16),
            ("sphere", 16),
        ] {
            let light = light(kind);
            let trees = trees(&*light, 0, 2, &scene, None);
            assert_eq!(trees.len(), count, "{kind}");
            let flux: f64 = trees.iter().map(|t| t.flux).sum();
            assert!((flux / light.power().luminance() - 1.0).abs() < 1e-12);
            assert_eq!(trees.iter().all(Tree::is_flat), kind != "sphere");
        }
    }
}
