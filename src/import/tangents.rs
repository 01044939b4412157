//! Tangents for meshes that carry none: glTF 2.0, 3.7.2.1 asks for MikkTSpace, since normal maps
//! are baked with it.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};

use super::Problem;
use super::json::Cursor;
use crate::geometry::TriangleMesh;
use crate::math::Vec3;

/// Along what a material wants tangents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Wanted {
    /// The set of texture coordinates.
    set: usize,
    /// Without these, around the vertical axis: only anisotropy can do with that.
    around: bool,
}

/// Along what a material wants tangents; `None` if it needs none.
pub(super) fn wanted(material: &Cursor<'_>) -> Result<Option<Wanted>, Problem> {
    let coat = material.extension("KHR_materials_clearcoat");
    let anisotropy = material.extension("KHR_materials_anisotropy");
    let slots = [
        material.get("normalTexture"),
        coat.and_then(|e| e.get("clearcoatNormalTexture")),
        anisotropy.as_ref().and_then(|e| e.get("anisotropyTexture")),
    ];
    let Some(info) = slots.into_iter().flatten().next() else {
        return Ok(anisotropy.map(|_| Wanted {
            set: 0,
            around: true,
        }));
    };
    let own = info.index_or("texCoord", 0)?;
    let set = match info.extension("KHR_texture_transform") {
        Some(e) => e.index_or("texCoord", own)?,
        None => own,
    };
    Ok(Some(Wanted { set, around: false }))
}

/// Most triangles around one vertex. The library's time grows with their square and its stack
/// with their number; at this one it takes 20 µs for each.
const MAX_FAN: u32 = 1024;

/// What is told of meshes that have more.
pub(super) const CROWDED: &str =
    "meshes with more than 1024 triangles around a vertex get their tangents triangle by triangle";

/// Gives a mesh without tangents those of MikkTSpace along its texture coordinates. Vertices
/// are split where their triangles disagree, and nowhere else. Nothing happens to a mesh that
/// has tangents, or lacks the coordinates where nothing else serves. `false` if too many triangles share a vertex: such a
/// mesh stays without.
pub(super) fn complete(mesh: &mut TriangleMesh, wanted: Wanted) -> bool {
    let n = mesh.positions.len();
    let Wanted { set, around } = wanted;
    let fits = |attribute: usize| attribute == 0 || attribute == n;
    let has_set = mesh.uv_sets.get(set).is_some_and(|s| s.len() == n);
    if around && mesh.tangents.is_empty() && mesh.uv_sets.is_empty() {
        mesh.tangents = around_vertical(&mesh.positions);
        return true;
    }
    if !mesh.tangents.is_empty() || !has_set || !fits(mesh.normals.len()) || n == 0 {
        return true;
    }
    let faces: Vec<usize> = (0..mesh.indices.len())
        .filter(|&f| mesh.indices[f].iter().all(|&i| (i as usize) < n))
        .collect();
    let mut corners = Corners {
        mesh,
        set,
        tangents: vec![[[1.0, 0.0, 0.0, 1.0]; 3]; faces.len()],
        faces,
    };
    if corners.are_crowded() {
        return false;
    }
    // The library's error has no cases: what is degenerate gets no tangent, and keeps a default.
    let done = generate_tangents(&mut corners).is_ok();
    let Corners {
        faces, tangents, ..
    } = corners;
    if done {
        split(mesh, &faces, &tangents);
    }
    done
}

/// Tangents around the `y` axis through the middle of the mesh's box, counter-clockwise seen from
/// above: what Cycles takes where a mesh has no texture coordinates, and the specification has
/// nothing for.
fn around_vertical(positions: &[[f32; 3]]) -> Vec<[f32; 4]> {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for p in positions.iter().map(|p| Vec3::from(*p)) {
        (low, high) = (low.min(p), high.max(p));
    }
    let (middle, extent) = (0.5 * (low + high), high - low);
    let tangent = |p: &[f32; 3]| {
        let r = (Vec3::from(*p) - middle) / extent;
        let t = Vec3::new(r.z, 0.0, -r.x).try_normalize();
        let [x, y, z] = t.unwrap_or(Vec3::X).to_array();
        [x, y, z, 1.0]
    };
    positions.iter().map(tangent).collect()
}

/// Writes a tangent per corner into the vertices.
fn split(mesh: &mut TriangleMesh, faces: &[usize], tangents: &[[[f32; 4]; 3]]) {
    let n = mesh.positions.len();
    // What is out of range must stay so when vertices are added.
    for i in mesh.indices.iter_mut().flatten() {
        if *i as usize >= n {
            *i = u32::MAX;
        }
    }
    let mut own: Vec<Option<[f32; 4]>> = vec![None; n];
    let mut copies: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    let mut added: Vec<(u32, [f32; 4])> = Vec::new();
    for (&f, corners) in faces.iter().zip(tangents) {
        for (i, t) in mesh.indices[f].iter_mut().zip(corners) {
            let slot = &mut own[*i as usize];
            if slot.get_or_insert(*t) == t {
                continue;
            }
            let Ok(next) = u32::try_from(n + added.len()) else {
                continue;
            };
            *i = *copies.entry((*i, t.map(f32::to_bits))).or_insert_with(|| {
                added.push((*i, *t));
                next
            });
        }
    }
    let origins: Vec<usize> = added.iter().map(|(i, _)| *i as usize).collect();
    extend(&mut mesh.positions, &origins);
    extend(&mut mesh.normals, &origins);
    extend(&mut mesh.colors, &origins);
    for set in &mut mesh.uv_sets {
        extend(set, &origins);
    }
    let default = [1.0, 0.0, 0.0, 1.0];
    mesh.tangents = own.into_iter().map(|t| t.unwrap_or(default)).collect();
    mesh.tangents.extend(added.into_iter().map(|(_, t)| t));
}

/// Copies elements to the end of an attribute, if the mesh has it.
fn extend<T: Copy>(attribute: &mut Vec<T>, origins: &[usize]) {
    if !attribute.is_empty() {
        let copies: Vec<T> = origins.iter().map(|&i| attribute[i]).collect();
        attribute.extend(copies);
    }
}

/// A mesh as the library sees it: corners of triangles.
struct Corners<'a> {
    mesh: &'a TriangleMesh,
    set: usize,
    faces: Vec<usize>,
    tangents: Vec<[[f32; 4]; 3]>,
}

impl Corners<'_> {
    fn index(&self, face: usize, vert: usize) -> usize {
        self.mesh.indices[self.faces[face]][vert] as usize
    }

    /// Whether more triangles than the library can take meet at a vertex, vertices that agree in
    /// all that it looks at being one.
    fn are_crowded(&self) -> bool {
        let mut count: HashMap<[u32; 8], u32> = HashMap::new();
        (0..self.faces.len()).any(|f| {
            (0..3).any(|v| {
                let ([x, y, z], [a, b, c], [s, t]) =
                    (self.position(f, v), self.normal(f, v), self.tex_coord(f, v));
                // Both zeros are one.
                let key = [x, y, z, a, b, c, s, t].map(|x| (x + 0.0).to_bits());
                let n = count.entry(key).or_insert(0);
                *n += 1;
                *n > MAX_FAN
            })
        })
    }
}

/// What is not a number would break the order that the library sorts by.
fn finite<const N: usize>(v: [f32; N]) -> [f32; N] {
    v.map(|x| if x.is_finite() { x } else { 0.0 })
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.faces.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        finite(self.mesh.positions[self.index(face, vert)])
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        if let Some(n) = self.mesh.normals.get(self.index(face, vert)) {
            return finite(*n);
        }
        // Without normals the surface is flat (glTF 2.0, 3.7.2.1).
        let [a, b, c] = [0, 1, 2].map(|k| Vec3::from(self.position(face, k)));
        (b - a).cross(c - a).normalize_or_zero().into()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        finite(self.mesh.uv_sets[self.set][self.index(face, vert)])
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, vert: usize) {
        if let Some(space) = space {
            let [x, y, z, sign] = space.tangent_encoded();
            // The library's second axis follows growing v, which glTF counts downward.
            self.tangents[face][vert] = [x, y, z, -sign];
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

    use proptest::prelude::*;
    use serde_json::json;

    use super::*;

    fn along(set: usize) -> Wanted {
        Wanted { set, around: false }
    }

    /// A square in the plane of x and y, facing z, whose texture runs along x and, as images do,
    /// down y; mirrored on request.
    fn square(mirrored: bool) -> TriangleMesh {
        let uv = |x: f32, y: f32| [if mirrored { -x } else { x }, 1.0 - y];
        TriangleMesh {
            positions: vec![[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]],
            indices: vec![[0, 1, 2], [0, 2, 3]],
            normals: vec![[0., 0., 1.]; 4],
            uv_sets: vec![vec![], vec![uv(0., 0.), uv(1., 0.), uv(1., 1.), uv(0., 1.)]],
            colors: vec![[1.0; 4]; 4],
            ..Default::default()
        }
    }

    #[test]
    fn tangents_follow_u_and_the_second_axis_goes_up_the_image() {
        for (mirrored, expected) in [(false, [1., 0., 0., 1.]), (true, [-1., 0., 0., -1.])] {
            let mut mesh = square(mirrored);
            complete(&mut mesh, along(1));
            assert_eq!(mesh.tangents, vec![expected; 4]);
            assert_eq!(mesh.indices, square(mirrored).indices);
        }
        // Without the coordinates, or with tangents of its own, a mesh stays as it is.
        let mut mesh = square(false);
        complete(&mut mesh, along(0));
        complete(&mut mesh, along(7));
        assert!(mesh.tangents.is_empty());
        mesh.tangents = vec![[0., 1., 0., 1.]; 4];
        complete(&mut mesh, along(1));
        assert_eq!(mesh.tangents, vec![[0., 1., 0., 1.]; 4]);
    }

    #[test]
    fn without_coordinates_brushing_goes_around_the_vertical() {
        let around = Wanted {
            set: 0,
            around: true,
        };
        // Seen from above, a turn counter-clockwise takes +x by way of -z to -x.
        let mut mesh = TriangleMesh {
            positions: vec![[9., 1., 0.], [7., 1., 0.], [8., 5., 2.], [8., 5., -2.]],
            indices: vec![[0, 1, 2]],
            ..Default::default()
        };
        assert!(complete(&mut mesh, around));
        let [a, b, c, d] = [[0., -1.], [0., 1.], [1., 0.], [-1., 0.]];
        let expected = [a, b, c, d].map(|[x, z]| [x, 0.0, z, 1.0]);
        assert_eq!(mesh.tangents, expected);
        // Where there are coordinates, these go before.
        let mut mesh = square(false);
        mesh.uv_sets.swap(0, 1);
        assert!(complete(&mut mesh, around));
        assert_eq!(mesh.tangents, vec![[1., 0., 0., 1.]; 4]);
    }

    #[test]
    fn vertices_are_split_at_mirrored_seams_only() {
        // Two squares that share an edge, with the texture mirrored about it.
        let mut mesh = TriangleMesh {
            positions: (0..6)
                .map(|i| [(i % 3) as f32, (i / 3) as f32, 0.0])
                .collect(),
            indices: vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]],
            normals: vec![[0., 0., 1.]; 6],
            uv_sets: vec![
                (0..6)
                    .map(|i| [((i % 3) as f32 - 1.0).abs(), 1.0 - (i / 3) as f32])
                    .collect(),
            ],
            ..Default::default()
        };
        complete(&mut mesh, along(0));
        assert_eq!(mesh.positions.len(), 8, "the two vertices of the seam");
        assert_eq!(mesh.normals.len(), 8);
        assert_eq!(mesh.uv_sets[0].len(), 8);
        for (f, tri) in mesh.indices.iter().enumerate() {
            for &i in tri {
                let [x, _, _, w] = mesh.tangents[i as usize];
                let sign = if f < 2 { -1.0 } else { 1.0 };
                assert!((x - sign).abs() < 1e-6 && w == sign, "face {f}");
                // Copies are copies.
                let p = mesh.positions[i as usize];
                let origin = mesh.uv_sets[0][i as usize];
                assert_eq!(origin, [(p[0] - 1.0).abs(), 1.0 - p[1]]);
            }
        }
    }

    #[test]
    fn a_smooth_grid_keeps_its_vertices_and_takes_little_time() {
        let n = 200_u32;
        let at = |x: u32, y: u32| (x as f32 / n as f32, y as f32 / n as f32);
        let grid = || (0..=n).flat_map(|y| (0..=n).map(move |x| (x, y)));
        let mut mesh = TriangleMesh {
            positions: grid()
                .map(|(x, y)| {
                    let (u, v) = at(x, y);
                    [u, v, (3.0 * u).sin()]
                })
                .collect(),
            normals: grid()
                .map(|(x, y)| {
                    let (u, _) = at(x, y);
                    Vec3::new(-3.0 * (3.0 * u).cos(), 0.0, 1.0)
                        .normalize()
                        .into()
                })
                .collect(),
            uv_sets: vec![grid().map(|(x, y)| at(x, y).into()).collect()],
            indices: (0..n)
                .flat_map(|y| (0..n).map(move |x| y * (n + 1) + x))
                .flat_map(|i| [[i, i + 1, i + n + 2], [i, i + n + 2, i + n + 1]])
                .collect(),
            ..Default::default()
        };
        let count = mesh.positions.len();
        let start = std::time::Instant::now();
        complete(&mut mesh, along(0));
        println!("{} triangles: {:?}", mesh.indices.len(), start.elapsed());
        assert_eq!((mesh.positions.len(), mesh.tangents.len()), (count, count));
        for (t, n) in mesh.tangents.iter().zip(&mesh.normals) {
            let (v, n) = (Vec3::new(t[0], t[1], t[2]), Vec3::from(*n));
            assert!((v.length() - 1.0).abs() < 1e-5 && v.dot(n).abs() < 1e-3);
            assert!(v.x > 0.0 && t[3] == -1.0, "v grows with y here");
        }
    }

    #[test]
    fn endless_fans_are_left_alone() {
        let n = 3000;
        let mut mesh = TriangleMesh {
            positions: (0..=n)
                .map(|i| [(i as f32).cos(), (i as f32).sin(), 0.0])
                .collect(),
            normals: vec![[0., 0., 1.]; n + 1],
            uv_sets: vec![(0..=n).map(|i| [i as f32, 0.5]).collect()],
            indices: (1..n as u32).map(|i| [0, i, i + 1]).collect(),
            ..Default::default()
        };
        assert!(!complete(&mut mesh, along(0)) && mesh.tangents.is_empty());
        mesh.indices.truncate(1000);
        assert!(complete(&mut mesh, along(0)) && !mesh.tangents.is_empty());
    }

    #[test]
    fn the_material_says_along_which_coordinates() {
        let set = |m: serde_json::Value| wanted(&Cursor::root(&m)).unwrap();
        assert_eq!(set(json!({})), None);
        assert_eq!(
            set(json!({"normalTexture": {"index": 0, "texCoord": 2}})),
            Some(along(2))
        );
        let moved = json!({"normalTexture": {"index": 0, "texCoord": 2,
            "extensions": {"KHR_texture_transform": {"texCoord": 1}}}});
        assert_eq!(set(moved), Some(along(1)));
        let coat = json!({"extensions": {"KHR_materials_clearcoat":
            {"clearcoatNormalTexture": {"index": 0, "texCoord": 3}}}});
        assert_eq!(set(coat), Some(along(3)));
        let brushed = json!({"extensions": {"KHR_materials_anisotropy": {}}});
        let around = Wanted {
            set: 0,
            around: true,
        };
        assert_eq!(set(brushed), Some(around));
    }

    proptest! {
        /// Whatever a file holds: no panic, attributes of equal length, indices in range where
        /// they were.
        #[test]
        fn any_mesh_survives(
            positions in proptest::collection::vec(proptest::array::uniform3(number()), 1..12),
            uvs in proptest::collection::vec(proptest::array::uniform2(number()), 12),
            normals in proptest::collection::vec(proptest::array::uniform3(number()), 12),
            indices in proptest::collection::vec(proptest::array::uniform3(0_u32..13), 0..20),
            flat: bool,
        ) {
            let n = positions.len();
            let mut mesh = TriangleMesh {
                positions,
                normals: if flat { vec![] } else { normals[..n].to_vec() },
                uv_sets: vec![uvs[..n].to_vec()],
                indices,
                ..Default::default()
            };
            let before = mesh.clone();
            complete(&mut mesh, along(0));
            prop_assert_eq!(mesh.tangents.len(), mesh.positions.len());
            prop_assert_eq!(mesh.uv_sets[0].len(), mesh.positions.len());
            for (a, b) in before.indices.iter().flatten().zip(mesh.indices.iter().flatten()) {
                prop_assert_eq!((*a as usize) < n, (*b as usize) < mesh.positions.len());
            }
        }
    }

    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![
            (-3_i32..3).prop_map(|i| i as f32),
            any::<f32>(),
            -1.0_f32..1.0,
            Just(f32::NAN),
        ]
    }
}
