//! Adjacency, feature edges and walks over meshes, against closed forms and brute force.

mod common;

use std::time::Instant;

use dualight::accel::ACCELERATORS;
use dualight::ad::V3;
use dualight::geometry::forecast::{Moves, edge_functions};
use dualight::geometry::{
    Edge, Geometry, MaterialId, Object, Patches, Ray, Shape, ShapeId, TriangleMesh, Walk,
};
use dualight::math::{DVec3, Frame};
use dualight::sampling::{Rng, warp};

/// A grid of `n × n` squares over the unit square of the plane `z = 0`, front toward `+z`, whose
/// vertices are split at every triangle as a file with seams has them.
fn grid(n: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let at = |i: u32, j: u32| [i as f32 / n as f32, j as f32 / n as f32, 0.0];
    for j in 0..n {
        for i in 0..n {
            let c = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            for t in [[c[0], c[1], c[2]], [c[0], c[2], c[3]]] {
                let first = mesh.positions.len() as u32;
                mesh.positions.extend(t);
                mesh.indices.push([first, first + 1, first + 2]);
            }
        }
    }
    mesh
}

/// A unit sphere of `n` by `2n` quads with exact normals, triangles at the poles.
fn globe(n: u32, smooth: bool) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let m = 2 * n;
    for i in 0..=n {
        for j in 0..=m {
            let (s, c) = (f64::from(i) / f64::from(n) * std::f64::consts::PI).sin_cos();
            let turn = f64::from(j % m) / f64::from(m) * std::f64::consts::TAU;
            let s = if i == 0 || i == n { 0.0 } else { s };
            let p = DVec3::new(s * turn.cos(), s * turn.sin(), c).as_vec3();
            mesh.positions.push(p.into());
            if smooth {
                mesh.normals.push(p.into());
            }
        }
    }
    let at = |i: u32, j: u32| i * (m + 1) + j;
    for i in 0..n {
        for j in 0..m {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            if i + 1 < n {
                mesh.indices.push([a, b, c]);
            }
            if i > 0 {
                mesh.indices.push([a, c, d]);
            }
        }
    }
    mesh
}

#[test]
fn a_flat_grid_has_no_feature_inside() {
    let (n, mesh) = (100, grid(100));
    let patches = Patches::new(&mesh).expect("small");
    let (mut border, mut smooth) = (0, 0);
    for t in 0..mesh.indices.len() as u32 {
        for i in 0..3 {
            match patches.edge(t, i).0 {
                Edge::Border => border += 1,
                Edge::Smooth => smooth += 1,
                other => panic!("{other:?}"),
            }
        }
    }
    assert_eq!((border, smooth), (4 * n, 6 * n * n - 4 * n));
    // From anywhere to anywhere a walk arrives where a ray would.
    let mut rng = Rng::new(1);
    let o = DVec3::new(0.3, 0.7, 2.0);
    let locate = |p: DVec3| {
        let (x, y) = (p.x * 100.0, p.y * 100.0);
        let first = 2 * (y.floor() as u32 * 100 + x.floor() as u32);
        first + u32::from(y.fract() > x.fract())
    };
    for _ in 0..20_000 {
        let mut inside =
            || DVec3::new(rng.next_1d(), rng.next_1d(), 0.0) * 0.98 + 0.01 * (DVec3::X + DVec3::Y);
        let (p, to) = (inside(), inside());
        for moves in [Moves::Ray, Moves::Target] {
            let d = p - o;
            let walk = patches.walk(&mesh, locate(p), o, d, to - p, moves, 1000);
            // At an edge, either side will do.
            let Walk::Arrived(t) = walk else {
                panic!("{walk:?}")
            };
            let v = mesh.corners(t);
            let (co, cd) = match moves {
                Moves::Target => (o, to - o),
                Moves::Ray => (o + to - p, d),
            };
            let e = edge_functions(V3::<f64>::constant(co), V3::constant(cd), v);
            assert!(e.iter().all(|&x| x <= 1e-15), "{e:?}");
            assert!(t == locate(to) || e.iter().any(|&x| x.abs() < 1e-12));
        }
        // Beyond the rim there is a border.
        let out = DVec3::new(1.5, to.y, 0.0);
        let walk = patches.walk(&mesh, locate(p), o, p - o, out - p, Moves::Target, 1000);
        assert!(matches!(walk, Walk::Stopped(_, Edge::Border)), "{walk:?}");
    }
}

#[test]
fn creases_borders_and_doubled_edges_are_features() {
    // A cube of split vertices: every edge of a face is a crease, its diagonal is not.
    let mut cube = TriangleMesh::default();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let n = DVec3::AXES[axis] * side;
            let f = Frame::from_normal(n);
            let c: [[f32; 3]; 4] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y)| (n + f.x * x + f.y * y).round().as_vec3().into());
            let first = cube.positions.len() as u32;
            cube.positions.extend(c);
            cube.indices.push([first, first + 1, first + 2]);
            cube.indices.push([first, first + 2, first + 3]);
        }
    }
    let count = |mesh: &TriangleMesh| {
        let patches = Patches::new(mesh).expect("small");
        let mut n = [0; 3];
        for t in 0..mesh.indices.len() as u32 {
            for i in 0..3 {
                n[match patches.edge(t, i).0 {
                    Edge::Smooth => 0,
                    Edge::Crease => 1,
                    _ => 2,
                }] += 1;
            }
        }
        n
    };
    assert_eq!(count(&cube), [12, 24, 0]);
    // A third triangle on one edge, and one turned over: neither continues the surface.
    let mut flags = grid(1);
    flags.positions.push([0.5, 0.5, 1.0]);
    flags.indices.push([0, 2, 6]);
    assert_eq!(count(&flags), [0, 0, 9]);
    let mut turned = grid(1);
    turned.indices[1].swap(0, 1);
    assert_eq!(count(&turned), [0, 0, 6]);
    // Shading normals decide: a coarse globe with exact ones has no crease, a faceted one has.
    assert_eq!(count(&globe(8, true))[1..], [0, 0]);
    assert!(count(&globe(8, false))[1] > 300);
    // Finely faceted, it is smooth again.
    assert_eq!(count(&globe(64, false))[1..], [0, 0]);
}

#[test]
fn walks_over_a_globe_stop_at_its_silhouette_and_nowhere_else() {
    let mesh = globe(48, true);
    let patches = Patches::new(&mesh).expect("small");
    let mut geometry = Geometry::default();
    geometry.shapes.push(Shape::Mesh(mesh.clone()));
    geometry.objects.push(Object {
        shape: ShapeId(0),
        placement: None,
        material: MaterialId(0),
        light: None,
        name: "globe".into(),
        coverage: None,
    });
    let entry = ACCELERATORS.iter().find(|a| a.name == "bvh").unwrap();
    let accel = (entry.build)(&std::sync::Arc::new(geometry), 1).unwrap();
    let mut rng = Rng::new(2);
    let (mut arrived, mut stopped, mut lost, mut wrong) = (0, 0, 0, 0);
    for k in 0..40_000 {
        let o = (warp::sphere(rng.next_2d()) * 4.0).as_vec3().as_dvec3();
        let f = Frame::from_normal(-o.normalize());
        let mut aim = || {
            let [x, y] = warp::disc(rng.next_2d());
            ((f.x * x + f.y * y) * 1.1).as_vec3().as_dvec3()
        };
        let moves = [Moves::Ray, Moves::Target][k % 2];
        let (a, b) = (aim(), aim());
        let (ray, check) = match moves {
            Moves::Target => (Ray::new(o, a - o), Ray::new(o, b - o)),
            Moves::Ray => (Ray::new(o + a, -o), Ray::new(o + b, -o)),
        };
        let Some(hit) = accel.intersect(&ray) else {
            continue;
        };
        let h = match moves {
            Moves::Target => check.direction() - ray.direction(),
            Moves::Ray => check.origin() - ray.origin(),
        };
        let walk = patches.walk(
            &mesh,
            hit.prim,
            ray.origin(),
            ray.direction(),
            h,
            moves,
            500,
        );
        let truth = accel.intersect(&check);
        match (walk, truth) {
            // The straight way on a convex body is all lit, so whoever hits is reached.
            (Walk::Arrived(t), Some(there)) => {
                arrived += 1;
                // Two triangles own their edge.
                wrong += u32::from(t != there.prim);
            }
            (Walk::Stopped(_, Edge::Silhouette), None) => stopped += 1,
            (Walk::Lost, _) => lost += 1,
            // The rim itself, within rounding.
            _ => wrong += 1,
        }
    }
    println!(
        "{arrived} arrived, {stopped} stopped at the silhouette, {lost} lost, {wrong} at odds"
    );
    assert!(arrived > 15_000 && stopped > 3000);
    assert!(lost == 0 && wrong <= 4, "{lost} lost, {wrong} wrong");
}

#[test]
fn a_million_triangles_take_a_moment_and_little_memory() {
    let mesh = grid(708);
    let start = Instant::now();
    let patches = Patches::new(&mesh).expect("small");
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{} triangles with {} vertices: {seconds:.2} s, {} MB kept",
        mesh.indices.len(),
        mesh.positions.len(),
        patches.bytes() >> 20
    );
    assert_eq!(patches.bytes(), 12 * mesh.indices.len());
    let borders = (0..mesh.indices.len() as u32)
        .flat_map(|t| [0, 1, 2].map(|i| patches.edge(t, i).0))
        .filter(|e| *e == Edge::Border)
        .count();
    assert_eq!(borders, 4 * 708);
}
