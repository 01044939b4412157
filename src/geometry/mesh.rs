//! Indexed triangle meshes.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::facet::Facet;
use crate::math::{Aabb, DVec3, Vec3};

/// How many primitives were dropped, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Invalid {
    /// An index outside the vertices.
    pub index: usize,
    /// A coordinate or radius that is NaN, infinite or beyond ±1e18.
    pub coordinate: usize,
    /// No area, or a radius that is not positive.
    pub degenerate: usize,
}

impl Invalid {
    /// All of them.
    pub fn total(&self) -> usize {
        self.index + self.coordinate + self.degenerate
    }
}

/// What is wrong with a triangle.
enum Fault {
    Index,
    Coordinate,
    Degenerate,
}

/// Largest coordinate a backend can hold (Embree drops primitives beyond 1.844e18 silently).
pub(crate) const COORDINATE_LIMIT: f32 = 1e18;

/// An indexed triangle mesh in its own (object) space.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Vertex positions.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices of each triangle; counter-clockwise seen from the front.
    pub indices: Vec<[u32; 3]>,
    /// Shading normals per vertex; empty for flat shading.
    pub normals: Vec<[f32; 3]>,
    /// Sets of texture coordinates per vertex; a set may be empty.
    pub uv_sets: Vec<Vec<[f32; 2]>>,
    /// Linear colour and alpha per vertex; may be empty.
    pub colors: Vec<[f32; 4]>,
    /// Tangents per vertex along growing `u`, with the sign of the bitangent; may be empty.
    pub tangents: Vec<[f32; 4]>,
    /// The triangles prepared for refinement, all of them or none.
    pub facets: OnceLock<Vec<Facet>>,
}

/// Meshes of up to so many triangles are prepared for refinement: walls, floors and furniture,
/// which most rays hit, in half a megabyte. The large ones stay small in memory.
const PREPARED: usize = 4096;

impl TriangleMesh {
    /// Drops triangles that no backend can hold or that have no area, and says how many.
    pub fn drop_invalid(&mut self) -> Invalid {
        /// Triangles that a thread takes at a time.
        const CHUNK: usize = 1 << 13;
        let positions = &self.positions;
        let fault = |tri: &[u32; 3]| {
            let Some(v) = corners(positions, *tri) else {
                return Some(Fault::Index);
            };
            if v.iter()
                .any(|p| p.iter().any(|c| !(c.abs() <= COORDINATE_LIMIT)))
            {
                return Some(Fault::Coordinate);
            }
            let [a, b, c] = v.map(|p| Vec3::from(p).as_dvec3());
            ((b - a).cross(c - a) == DVec3::ZERO).then_some(Fault::Degenerate)
        };
        // Most meshes have none, and all threads find that.
        let chunks = self.indices.par_chunks(CHUNK);
        let dropped = chunks
            .map(|chunk| {
                let mut n = Invalid::default();
                for fault in chunk.iter().filter_map(fault) {
                    match fault {
                        Fault::Index => n.index += 1,
                        Fault::Coordinate => n.coordinate += 1,
                        Fault::Degenerate => n.degenerate += 1,
                    }
                }
                n
            })
            .reduce(Invalid::default, |a, b| Invalid {
                index: a.index + b.index,
                coordinate: a.coordinate + b.coordinate,
                degenerate: a.degenerate + b.degenerate,
            });
        if dropped.total() > 0 {
            self.indices.retain(|tri| fault(tri).is_none());
        }
        dropped
    }

    /// Prepares the triangles for refinement, if they are few. Corners must not change afterwards.
    /// Hits are the same without, but take longer.
    pub fn prepare(&self) {
        if self.indices.len() <= PREPARED {
            let all = 0..self.indices.len() as u32;
            self.facets
                .get_or_init(|| all.map(|i| Facet::new(self.corners(i))).collect());
        }
    }

    /// Triangle `prim` as refinement needs it.
    #[inline(always)]
    pub fn facet(&self, prim: u32) -> Facet {
        match self.facets.get().and_then(|f| f.get(prim as usize)) {
            Some(facet) => *facet,
            None => Facet::new(self.corners(prim)),
        }
    }

    /// Corner positions of triangle `prim`.
    #[inline]
    pub fn corners(&self, prim: u32) -> [DVec3; 3] {
        self.indices[prim as usize].map(|i| Vec3::from(self.positions[i as usize]).as_dvec3())
    }

    /// Interpolated shading normal, object space, not normalised; `None` for a flat mesh.
    #[inline]
    pub fn normal(&self, prim: u32, b1: f64, b2: f64) -> Option<DVec3> {
        if self.normals.is_empty() {
            return None;
        }
        let [a, b, c] =
            self.indices[prim as usize].map(|i| Vec3::from(self.normals[i as usize]).as_dvec3());
        Some(a * (1.0 - b1 - b2) + b * b1 + c * b2)
    }

    /// Texture coordinates of a triangle's corners in one set; zero if the mesh has none.
    #[inline]
    pub fn corner_uvs(&self, set: usize, prim: u32) -> [[f64; 2]; 3] {
        let uvs = self.uv_sets.get(set).filter(|uvs| !uvs.is_empty());
        match uvs {
            None => [[0.0; 2]; 3],
            Some(uvs) => self.indices[prim as usize].map(|i| uvs[i as usize].map(f64::from)),
        }
    }

    /// Texture coordinates of one set at barycentric weights; zero if the mesh has none.
    #[inline]
    pub fn uv(&self, set: usize, prim: u32, [b1, b2]: [f64; 2]) -> [f64; 2] {
        let [a, b, c] = self.corner_uvs(set, prim);
        let mix = |k: usize| a[k] + (b[k] - a[k]) * b1 + (c[k] - a[k]) * b2;
        [mix(0), mix(1)]
    }

    /// A vertex attribute interpolated over a triangle; `None` if the mesh lacks it.
    #[inline]
    pub fn interpolate<const N: usize>(
        &self,
        attribute: &[[f32; N]],
        prim: u32,
        [b1, b2]: [f64; 2],
    ) -> Option<[f64; N]> {
        if attribute.is_empty() {
            return None;
        }
        let [a, b, c] = self.indices[prim as usize].map(|i| attribute[i as usize]);
        Some(std::array::from_fn(|k| {
            f64::from(a[k]) * (1.0 - b1 - b2) + f64::from(b[k]) * b1 + f64::from(c[k]) * b2
        }))
    }

    /// Box around the vertices that triangles use.
    pub fn bounds(&self) -> Aabb {
        let around = |mut b: Aabb, triangles: &[[u32; 3]]| {
            for &i in triangles.as_flattened() {
                b.grow(Vec3::from(self.positions[i as usize]).as_dvec3());
            }
            b
        };
        self.indices
            .par_chunks(1 << 16)
            .map(|part| around(Aabb::EMPTY, part))
            .reduce(|| Aabb::EMPTY, Aabb::union)
    }
}

fn corners(positions: &[[f32; 3]], tri: [u32; 3]) -> Option<[[f32; 3]; 3]> {
    let at = |i: u32| positions.get(i as usize).copied();
    Some([at(tri[0])?, at(tri[1])?, at(tri[2])?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_triangles_are_dropped_and_counted_and_the_rest_stays() {
        let mut mesh = TriangleMesh {
            positions: vec![
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [f32::NAN, 0.0, 0.0],
                [2e18, 0.0, 0.0],
                [2.0, 0.0, 0.0],
            ],
            indices: vec![
                [0, 1, 2],
                [0, 1, 9],
                [0, 1, 3],
                [0, 2, 4],
                [0, 1, 5],
                [0, 0, 1],
            ],
            ..Default::default()
        };
        let dropped = mesh.drop_invalid();
        assert_eq!(
            dropped,
            Invalid {
                index: 1,
                coordinate: 2,
                degenerate: 2
            }
        );
        assert_eq!(dropped.total(), 5);
        assert_eq!(mesh.indices, [[0, 1, 2]]);
        assert_eq!(mesh.drop_invalid(), Invalid::default());

        // As many as several threads share, in their order.
        let (good, none) = ([[0, 1, 2], [1, 2, 0], [2, 0, 1]], [0, 0, 1]);
        let keep = |i: usize| !i.is_multiple_of(7);
        let all = |i: usize| if keep(i) { good[i % 3] } else { none };
        let n = 100_000;
        mesh.indices = (0..n).map(all).collect();
        let dropped = mesh.drop_invalid();
        assert_eq!((dropped.degenerate, dropped.total()), (14286, 14286));
        let kept: Vec<_> = (0..n).filter(|i| keep(*i)).map(|i| good[i % 3]).collect();
        assert_eq!(mesh.indices, kept);
    }
}
