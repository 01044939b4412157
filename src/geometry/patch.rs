//! Patches: which triangles of a mesh continue each other smoothly, and where they end.
//!
//! A ray that leaves a triangle through an edge has left nothing as long as the surface goes on
//! beyond it. So only some edges are *features*: borders, creases, and, for a given ray origin,
//! silhouettes. [`Patches::walk`] goes from the triangle of a hit to the triangle that a check
//! ray meets, over smooth edges, and says which feature stopped it.
//!
//! Material and object change at borders only: a mesh here has one of each.

use rayon::prelude::*;

use super::TriangleMesh;
use super::forecast::{Moves, edge_functions};
use crate::ad::V3;
use crate::math::{DVec3, Vec3};

/// Why leaving a triangle through an edge changes what is hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// It does not: the surface goes on.
    Smooth,
    /// Nothing is beyond it, or more than one surface.
    Border,
    /// The surface bends: shading normals differ across it.
    Crease,
    /// Beyond it the surface turns its other side to the light.
    Silhouette,
}

/// Cosine of the angle (10°) between shading normals from which on an edge is a crease.
const CREASE: f64 = 0.984_807_753_012_208;

/// No neighbour, in the lower 30 bits of a link.
const NONE: u32 = (1 << 30) - 1;

/// Marks a link across a crease.
const CREASED: u32 = 1 << 31;

/// Where a walk over a mesh ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Walk {
    /// In this triangle, without meeting a feature.
    Arrived(u32),
    /// At a feature of this kind, in this triangle.
    Stopped(u32, Edge),
    /// Nowhere: more steps were needed than allowed, or the ray is parallel to the surface.
    Lost,
}

/// The adjacency of a mesh: 12 bytes per triangle.
#[derive(Clone, Debug, Default)]
pub struct Patches {
    /// The triangle beyond edge `i`, from corner `i` to `i + 1`, with the mark of a crease.
    links: Vec<[u32; 3]>,
}

impl Patches {
    /// Finds the neighbours of every triangle. Vertices are joined by position, since files split
    /// them where normals or texture coordinates change. `None` if the mesh has more than 2³⁰ − 1
    /// triangles.
    pub fn new(mesh: &TriangleMesh) -> Option<Self> {
        let n = u32::try_from(mesh.indices.len())
            .ok()
            .filter(|&n| n < NONE)?;
        let (joined, vertices) = join(&mesh.positions);
        // A counting sort of the half-edges by their lower vertex: about six in each bucket, so
        // partners are found by looking at all of it. Linear in time, without a map per edge.
        let edge = |t: u32, i: usize| {
            let tri = mesh.indices[t as usize];
            let (a, b) = (joined[tri[i] as usize], joined[tri[(i + 1) % 3] as usize]);
            (a.min(b), a.max(b), a < b)
        };
        let mut start = vec![0u32; vertices + 1];
        for t in 0..n {
            for i in 0..3 {
                start[edge(t, i).0 as usize + 1] += 1;
            }
        }
        for v in 0..vertices {
            start[v + 1] += start[v];
        }
        let mut next = start.clone();
        let mut sorted = vec![(0u32, 0u32); 3 * n as usize];
        for t in 0..n {
            for i in 0..3 {
                let (lo, hi, forward) = edge(t, i);
                let at = &mut next[lo as usize];
                sorted[*at as usize] = (hi, t << 2 | i as u32);
                *at += 1;
                debug_assert!(lo != hi || !forward);
            }
        }
        let mut links = vec![[NONE; 3]; n as usize];
        for v in 0..vertices {
            let bucket = &mut sorted[start[v] as usize..start[v + 1] as usize];
            bucket.sort_unstable();
            for group in bucket.chunk_by(|a, b| a.0 == b.0) {
                // One triangle, or more than two: a border.
                let &[(_, a), (_, b)] = group else { continue };
                let (ta, ia) = (a >> 2, (a & 3) as usize);
                let (tb, ib) = (b >> 2, (b & 3) as usize);
                // Both run along it the same way: the sides do not match.
                if ta == tb || edge(ta, ia).2 == edge(tb, ib).2 {
                    continue;
                }
                let mark = if creased(mesh, (ta, ia), (tb, ib)) {
                    CREASED
                } else {
                    0
                };
                links[ta as usize][ia] = tb | mark;
                links[tb as usize][ib] = ta | mark;
            }
        }
        Some(Self { links })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.links.len() * size_of::<[u32; 3]>()
    }

    /// The kind of edge `i` of triangle `prim` wherever it is seen from, and what lies beyond.
    #[inline]
    pub fn edge(&self, prim: u32, i: usize) -> (Edge, Option<u32>) {
        let link = self.links[prim as usize][i];
        match link & NONE {
            NONE => (Edge::Border, None),
            to if link & CREASED != 0 => (Edge::Crease, Some(to)),
            to => (Edge::Smooth, Some(to)),
        }
    }

    /// The kind of edge `i` of `prim` for light from `o` along `d` (any direction if it comes
    /// from a point).
    pub fn edge_from(
        &self,
        mesh: &TriangleMesh,
        prim: u32,
        i: usize,
        o: DVec3,
        d: DVec3,
        moves: Moves,
    ) -> (Edge, Option<u32>) {
        let (kind, to) = self.edge(prim, i);
        let Some(next) = to.filter(|_| kind == Edge::Smooth) else {
            return (kind, to);
        };
        let facing = |t| facing(mesh.corners(t), o, d, moves);
        if (facing(prim) < 0.0) == (facing(next) < 0.0) {
            (Edge::Smooth, to)
        } else {
            (Edge::Silhouette, to)
        }
    }

    /// Walks from the triangle `prim`, met by the ray from `o` along `d`, to the triangle that
    /// the check ray at `h` meets, in at most `steps` steps. Everything in the mesh's own space.
    #[expect(
        clippy::too_many_arguments,
        reason = "a ray, a check point and a limit"
    )]
    pub fn walk(
        &self,
        mesh: &TriangleMesh,
        prim: u32,
        o: DVec3,
        d: DVec3,
        h: DVec3,
        moves: Moves,
        steps: u32,
    ) -> Walk {
        let (co, cd) = match moves {
            Moves::Target => (o, d + h),
            Moves::Ray => (o + h, d),
        };
        // Between ray and check ray lies a plane through the origin of the light; the walk goes
        // along its trace. Its normal tells on which side of the trace a corner lies.
        let plane = d.cross(h);
        let mut here = prim;
        let mut entered: Option<u32> = None;
        for _ in 0..steps {
            let v = mesh.corners(here);
            let e = edge_functions(V3::<f64>::constant(co), V3::constant(cd), v);
            // Which way round the corners are seen by the light. (Not by the check ray: beyond the
            // triangle's horizon that would turn over.)
            let area = facing(v, o, d, moves);
            if area == 0.0 || !area.is_finite() {
                return Walk::Lost;
            }
            let outside = |i: usize| e[i] * area < 0.0;
            if !(0..3).any(outside) {
                return Walk::Arrived(here);
            }
            let side = |i: usize| plane.dot(v[i] - o);
            // The trace leaves through an edge with the check point outside, whose ends lie on
            // both sides of it; of two such edges one is where it came in.
            let leaves = |i: &usize| {
                outside(*i) && entered.is_none_or(|t| self.links[here as usize][*i] & NONE != t)
            };
            let crossed = |i: &usize| side(*i) * side((i + 1) % 3) <= 0.0;
            let exit = (0..3)
                .find(|i| leaves(i) && crossed(i))
                .or_else(|| (0..3).find(leaves));
            let Some(i) = exit else { return Walk::Lost };
            match self.edge_from(mesh, here, i, o, d, moves) {
                (Edge::Smooth, Some(to)) => {
                    entered = Some(here);
                    here = to;
                }
                (kind, _) => return Walk::Stopped(here, kind),
            }
        }
        Walk::Lost
    }
}

/// Negative if light sees the front of the triangle, positive if its back.
#[inline]
fn facing([a, b, c]: [DVec3; 3], o: DVec3, d: DVec3, moves: Moves) -> f64 {
    let n = (b - a).cross(c - a);
    match moves {
        Moves::Target => n.dot(a - o),
        Moves::Ray => n.dot(d),
    }
}

/// Gives vertices at one position one number; also how many numbers there are.
fn join(positions: &[[f32; 3]]) -> (Vec<u32>, usize) {
    // Adding zero turns −0 into +0.
    let key = |i: u32| positions[i as usize].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|&i| key(i));
    let mut joined = vec![0; positions.len()];
    let mut count = 0;
    for group in order.chunk_by(|&a, &b| key(a) == key(b)) {
        for &i in group {
            joined[i as usize] = count;
        }
        count += 1;
    }
    (joined, count as usize)
}

/// Whether the surface bends across the edge that two triangles share.
fn creased(mesh: &TriangleMesh, a: (u32, usize), b: (u32, usize)) -> bool {
    let face = |t: u32| {
        let [p, q, r] = mesh.corners(t);
        (q - p).cross(r - p).normalize_or_zero()
    };
    let normal = |(t, i): (u32, usize)| {
        let at = mesh.indices[t as usize][i % 3] as usize;
        let n = mesh.normals.get(at).map_or(DVec3::ZERO, |&n| {
            Vec3::from(n).as_dvec3().normalize_or_zero()
        });
        if n == DVec3::ZERO { face(t) } else { n }
    };
    // Corner i of one is corner i + 1 of the other.
    let differ = |x, y| normal(x).dot(normal(y)) < CREASE;
    differ(a, (b.0, b.1 + 1)) || differ((a.0, a.1 + 1), b)
}
