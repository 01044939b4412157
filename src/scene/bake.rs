//! From shapes with placements to geometry in world space: what is placed once moves there, in
//! place and on all threads; what is placed more often stays an instance.

use std::sync::Arc;

use rayon::prelude::*;

use super::builder::MeshPlacement;
use crate::geometry::{
    COORDINATE_LIMIT, Geometry, Invalid, Object, Placement, Shape, ShapeId, SphereSet, TriangleMesh,
};
use crate::math::{Aabb, DAffine3, DMat3, DVec3, Vec3, max_abs};

/// What becomes of one placement.
enum Task {
    /// The shape is its own, and goes to the world.
    Own(Shape),
    /// The shape is shared, but cannot be an instance: a copy goes to the world.
    Copy(usize),
    /// The shape is shared.
    Instance(usize, Placement),
    /// Nothing of it can be hit: so many primitives, and why.
    Nothing(Invalid),
}

/// What became of one placement.
enum Done {
    World(Shape, Invalid),
    Instance(usize, Placement),
}

/// Places the shapes; all positions become relative to `center`. `tell` hears what was dropped,
/// by the name of the node.
pub(super) fn bake(
    mut shapes: Vec<Shape>,
    placements: Vec<MeshPlacement>,
    center: DVec3,
    mut tell: impl FnMut(Invalid, &str),
) -> Geometry {
    let mut users = vec![0usize; shapes.len()];
    for p in &placements {
        users[p.shape.index()] += 1;
    }
    let mut boxes = vec![None; shapes.len()];
    let tasks: Vec<(DAffine3, Task)> = placements
        .iter()
        .map(|p| {
            let mut world = p.world_from_object;
            world.translation -= center;
            let i = p.shape.index();
            let task = match task(&mut shapes, i, &users, &world) {
                Task::Instance(_, place) if leaves(&mut boxes[i], &shapes[i], &place) => {
                    copied(&shapes, i)
                }
                task => task,
            };
            (world, task)
        })
        .collect();
    let done: Vec<Done> = tasks
        .into_par_iter()
        .map(|(world, task)| match task {
            Task::Own(shape) => carry(shape, &world),
            Task::Copy(i) => carry(shapes[i].clone(), &world),
            Task::Instance(i, place) => Done::Instance(i, place),
            Task::Nothing(why) => Done::World(empty(), why),
        })
        .collect();
    let mut geometry = Geometry::default();
    let mut shared: Vec<Option<ShapeId>> = vec![None; shapes.len()];
    for (p, done) in placements.into_iter().zip(done) {
        let push = |geometry: &mut Geometry, shape: Shape| {
            geometry.shapes.push(shape);
            ShapeId(geometry.shapes.len() as u32 - 1)
        };
        let (shape, placement) = match done {
            Done::World(shape, dropped) => {
                tell(dropped, &p.name);
                if shape.is_empty() {
                    continue;
                }
                (push(&mut geometry, shape), None)
            }
            Done::Instance(i, place) => {
                if shared[i].is_none() && shapes[i].is_empty() {
                    continue;
                }
                let id = *shared[i].get_or_insert_with(|| {
                    let shape = std::mem::replace(&mut shapes[i], empty());
                    push(&mut geometry, shape)
                });
                (id, Some(place))
            }
        };
        geometry.objects.push(Object {
            shape,
            placement,
            material: p.material,
            light: None,
            coverage: None,
            name: Arc::from(p.name),
        });
    }
    geometry
}

fn empty() -> Shape {
    Shape::Spheres(SphereSet::default())
}

fn task(shapes: &mut [Shape], i: usize, users: &[usize], world: &DAffine3) -> Task {
    let place = Placement::new(*world);
    let alone = users[i] == 1;
    let keeps_round = is_similarity(world);
    match (&shapes[i], place) {
        // A sphere that stays round is cheaper than an instance of it.
        (Shape::Spheres(set), _) if keeps_round && set.spheres.len() == 1 => Task::Copy(i),
        (Shape::Spheres(_), _) if keeps_round && alone => {
            Task::Own(std::mem::replace(&mut shapes[i], empty()))
        }
        (Shape::Spheres(_), Some(place)) => Task::Instance(i, place),
        (Shape::Spheres(set), None) => Task::Nothing(flat(set.spheres.len())),
        (Shape::Mesh(_), _) if alone => Task::Own(std::mem::replace(&mut shapes[i], empty())),
        (Shape::Mesh(_), Some(place)) => Task::Instance(i, place),
        // Squashed to a line or a point it has no area: such instances are a way to hide things.
        (Shape::Mesh(m), None) if cofactor(&world.matrix3) == DMat3::ZERO => {
            Task::Nothing(flat(m.indices.len()))
        }
        (Shape::Mesh(_), None) => Task::Copy(i),
    }
}

fn flat(degenerate: usize) -> Invalid {
    Invalid {
        degenerate,
        ..Default::default()
    }
}

/// Whether part of an instance lies where no backend can hold it; `around` remembers the shape's
/// box.
fn leaves(around: &mut Option<Aabb>, shape: &Shape, place: &Placement) -> bool {
    let limit = f64::from(COORDINATE_LIMIT);
    let around = around.get_or_insert_with(|| shape.bounds());
    around
        .corners_under(&place.world_from_object)
        .any(|corner| !(max_abs(corner) <= limit))
}

/// What becomes of such an instance: each of its triangles has its own say once it is carried to
/// the world, which ellipsoids cannot be.
fn copied(shapes: &[Shape], i: usize) -> Task {
    match &shapes[i] {
        Shape::Mesh(_) => Task::Copy(i),
        Shape::Spheres(set) => Task::Nothing(Invalid {
            coordinate: set.spheres.len(),
            ..Default::default()
        }),
    }
}

/// Carries a shape to the world.
fn carry(shape: Shape, world: &DAffine3) -> Done {
    if *world == DAffine3::IDENTITY {
        return Done::World(shape, Invalid::default());
    }
    // Baking can flatten or overflow what was valid in its own space.
    match shape {
        Shape::Mesh(mut mesh) => {
            carry_mesh(&mut mesh, world);
            let dropped = mesh.drop_invalid();
            Done::World(Shape::Mesh(mesh), dropped)
        }
        Shape::Spheres(mut set) => {
            carry_spheres(&mut set, world);
            let dropped = set.drop_invalid();
            Done::World(Shape::Spheres(set), dropped)
        }
    }
}

/// `det M · M⁻ᵀ`, which exists for singular maps too.
fn cofactor(m: &DMat3) -> DMat3 {
    DMat3::from_cols(
        m.y_axis.cross(m.z_axis),
        m.z_axis.cross(m.x_axis),
        m.x_axis.cross(m.y_axis),
    )
}

/// Elements that a thread takes at a time.
const CHUNK: usize = 1 << 14;

fn carry_mesh(mesh: &mut TriangleMesh, world: &DAffine3) {
    let flip = world.matrix3.determinant() < 0.0;
    let normal_matrix = cofactor(&world.matrix3) * if flip { -1.0 } else { 1.0 };
    mesh.positions
        .par_iter_mut()
        .with_min_len(CHUNK)
        .for_each(|p| {
            let q = world.transform_point3(Vec3::from(*p).as_dvec3());
            *p = q.as_vec3().into();
        });
    mesh.normals
        .par_iter_mut()
        .with_min_len(CHUNK)
        .for_each(|n| {
            let turned = normal_matrix * Vec3::from(*n).as_dvec3();
            *n = turned.normalize_or_zero().as_vec3().into();
        });
    for [x, y, z, w] in &mut mesh.tangents {
        let t = world.transform_vector3(Vec3::new(*x, *y, *z).as_dvec3());
        [*x, *y, *z] = t.normalize_or_zero().as_vec3().into();
        if flip {
            *w = -*w;
        }
    }
    if flip {
        for [_, b, c] in &mut mesh.indices {
            std::mem::swap(b, c);
        }
    }
}

/// Whether spheres stay spheres under a map.
fn is_similarity(world: &DAffine3) -> bool {
    let m = world.matrix3;
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    let s2 = x.length_squared();
    let tolerance = 1e-10 * s2;
    (y.length_squared() - s2).abs() <= tolerance
        && (z.length_squared() - s2).abs() <= tolerance
        && x.dot(y).abs() <= tolerance
        && y.dot(z).abs() <= tolerance
        && z.dot(x).abs() <= tolerance
        && s2 > 0.0
}

/// Carries spheres by a similarity.
fn carry_spheres(set: &mut SphereSet, world: &DAffine3) {
    let scale = world.matrix3.x_axis.length();
    for [x, y, z, r] in &mut set.spheres {
        let c = world.transform_point3(Vec3::new(*x, *y, *z).as_dvec3());
        [*x, *y, *z] = c.as_vec3().into();
        *r = (f64::from(*r) * scale) as f32;
    }
}
