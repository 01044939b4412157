//! How points change with the pixel, against differences of real rays: through mirrors and
//! glass, on spheres, flat triangles, smooth meshes and instances.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{add_quad, add_sphere, lambert, look_at};
use dualight::accel::{ACCELERATORS, Accelerator};
use dualight::cameras::{CAMERAS, Camera};
use dualight::color::Rgb;
use dualight::geometry::{Differential, Geometry, Ray, SurfacePoint, TriangleMesh};
use dualight::integrators::Spacing;
use dualight::math::{DAffine3, DQuat, DVec3, Frame};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};
use glam::EulerRot;

/// Edge of the image in pixels.
const PIXELS: u32 = 400;

/// Names of what is followed as if it were a mirror or glass, by the name of its object.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Mirror,
    Glass,
}

/// The next direction at a surface, or `None` at one that ends the path.
fn next(scene: &Scene, sp: &SurfacePoint, kind: Kind) -> Option<DVec3> {
    if &*scene.geometry.object(sp.object).name != "thing" {
        return None;
    }
    let d = -sp.wo;
    let n = if sp.wo.dot(sp.n) < 0.0 { -sp.n } else { sp.n };
    let cos = -d.dot(n);
    if kind == Kind::Glass {
        let eta = if sp.front { 1.0 / 1.5 } else { 1.5 };
        let cos2 = 1.0 - eta * eta * (1.0 - cos * cos);
        if cos2 > 0.0 {
            return Some((d * eta + n * (eta * cos - cos2.sqrt())).normalize());
        }
    }
    Some((d + n * (2.0 * cos)).normalize())
}

/// Surfaces met by one ray, up to the one that ends its path.
fn trace(
    scene: &Scene,
    accel: &dyn Accelerator,
    mut ray: Ray,
    kind: Kind,
) -> Vec<(Ray, SurfacePoint)> {
    let mut out = Vec::new();
    while out.len() < 6
        && let Some(hit) = accel.intersect(&ray)
    {
        let sp = scene.geometry.surface_point(&ray, &hit);
        out.push((ray, sp));
        let Some(wi) = next(scene, &sp, kind) else {
            break;
        };
        ray = sp.spawn(wi);
    }
    out
}

/// Footprints along a path, by differentials.
fn footprints(
    scene: &Scene,
    path: &[(Ray, SurfacePoint)],
    start: Differential,
    kind: Kind,
) -> Vec<[DVec3; 2]> {
    let (mut out, mut differential) = (Vec::new(), start);
    for (ray, sp) in path {
        let landing = differential.land(&scene.geometry, ray, sp).unwrap();
        let f = landing.footprint();
        out.push([f.dpdx, f.dpdy]);
        if let Some(wi) = next(scene, sp, kind) {
            differential = landing.follow(sp, wi);
        }
    }
    out
}

/// Compares all pixels of a coarse grid; returns how many chains of each length agreed.
fn compare(scene: &Scene, camera: &dyn Camera, kind: Kind, tolerance: f64) -> Vec<usize> {
    let accel = (ACCELERATORS.last().unwrap().build)(&scene.geometry, 1).unwrap();
    let spacing = Spacing::new(PIXELS, PIXELS, 1);
    let mut counts = vec![0; 8];
    for j in (3..PIXELS).step_by(13) {
        for i in (3..PIXELS).step_by(13) {
            let (x, y) = (f64::from(i) + 0.5, f64::from(j) + 0.5);
            let at = |x, y| {
                let r = spacing.camera_ray(camera, x, y, [0.5; 2], true);
                (trace(scene, &*accel, r.ray, kind), r.differential.unwrap())
            };
            let (path, start) = at(x, y);
            let h = 0.06;
            let around = [1.0, 2.0].map(|s| {
                let h = s * h;
                [[-h, 0.0], [h, 0.0], [0.0, -h], [0.0, h]].map(|[dx, dy]| at(x + dx, y + dy).0)
            });
            let key = |p: &[(Ray, SurfacePoint)]| -> Vec<_> {
                p.iter()
                    .map(|(_, sp)| (sp.object, sp.prim, sp.front))
                    .collect()
            };
            if around.iter().flatten().any(|p| key(p) != key(&path)) {
                continue;
            }
            let found = footprints(scene, &path, start, kind);
            for (k, f) in found.iter().enumerate() {
                let [near, far] = [(0, h), (1, 2.0 * h)].map(|(s, h)| {
                    let p = &around[s];
                    [0, 2].map(|a: usize| (p[a + 1][k].1.p - p[a][k].1.p) / (2.0 * h))
                });
                let size = near[0].length() + near[1].length();
                for a in 0..2 {
                    // How far differences are from derivatives, two of them tell.
                    let doubt = (near[a] - far[a]).length();
                    let error = (f[a] - near[a]).length();
                    assert!(
                        error <= tolerance * size + doubt + 1e-4,
                        "pixel {i} {j}, surface {k}: {:?} but really {:?}",
                        f[a],
                        near[a]
                    );
                }
            }
            counts[path.len()] += 1;
        }
    }
    counts
}

fn camera(desc: &dualight::cameras::CameraDesc) -> Box<dyn Camera> {
    let entry = CAMERAS.iter().find(|c| c.name == desc.kind).unwrap();
    (entry.build)(desc, 1.0).unwrap()
}

fn room(b: &mut SceneBuilder) -> dualight::geometry::MaterialId {
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    let (x, z) = (DVec3::X * 40.0, DVec3::Z * 40.0);
    add_quad(b, "floor", grey, DVec3::new(-20.0, -1.0, -20.0), z, x);
    add_quad(
        b,
        "back",
        grey,
        DVec3::new(-20.0, -20.0, -6.0),
        x,
        DVec3::Y * 40.0,
    );
    grey
}

/// A sphere of triangles with its own normals.
fn globe(n: u32) -> TriangleMesh {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for j in 0..=n {
        for i in 0..=2 * n {
            let (a, b) = (
                f64::from(j) * std::f64::consts::PI / f64::from(n),
                f64::from(i) * std::f64::consts::PI / f64::from(n),
            );
            let p = DVec3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos());
            positions.push(<[f32; 3]>::from(p.as_vec3()));
            if i < 2 * n && j < n {
                let k = j * (2 * n + 1) + i;
                indices.push([k, k + 2 * n + 1, k + 2 * n + 2]);
                indices.push([k, k + 2 * n + 2, k + 1]);
            }
        }
    }
    TriangleMesh {
        normals: positions.clone(),
        positions,
        indices,
        ..Default::default()
    }
}

/// The scene with a mesh twice, turned and stretched, so that both are instances.
fn instances(mesh: TriangleMesh) -> Scene {
    let mut b = SceneBuilder::default();
    let material = room(&mut b);
    let shape = b.add_mesh(mesh, "globe");
    for (x, turn) in [(-1.2, 0.4), (1.2, 2.0)] {
        b.place(MeshPlacement {
            shape,
            material,
            world_from_object: DAffine3::from_scale_rotation_translation(
                DVec3::new(0.8, 1.1, -1.3),
                DQuat::from_euler(EulerRot::XYZ, turn, 0.3, -turn),
                DVec3::new(x, 0.3, 0.0),
            ),
            name: "thing".into(),
        });
    }
    b.finish().unwrap()
}

fn views() -> [Box<dyn Camera>; 2] {
    let eye = DVec3::new(0.5, 2.0, 5.0);
    [("perspective", 0.8), ("orthographic", 3.0)]
        .map(|(kind, vertical)| camera(&look_at(kind, eye, DVec3::new(0.0, 0.2, 0.0), vertical)))
}

#[test]
fn footprints_on_flat_surfaces_are_exact() {
    let mut b = SceneBuilder::default();
    room(&mut b);
    let scene = b.finish().unwrap();
    for view in views() {
        let counts = compare(&scene, &*view, Kind::Mirror, 1e-3);
        assert!(counts[1] > 800, "{counts:?}");
    }
}

#[test]
fn footprints_follow_mirror_and_glass_spheres() {
    let mut b = SceneBuilder::default();
    let material = room(&mut b);
    add_sphere(&mut b, "thing", material, DVec3::new(0.0, 0.2, 0.0), 1.2);
    let scene = b.finish().unwrap();
    for view in views() {
        let counts = compare(&scene, &*view, Kind::Mirror, 0.01);
        assert!(counts[2] > 50, "{counts:?}");
        // In and out of the glass, then the wall.
        let counts = compare(&scene, &*view, Kind::Glass, 0.02);
        assert!(counts[3] > 50, "{counts:?}");
    }
}

#[test]
fn footprints_follow_smooth_meshes_and_instances() {
    let scene = instances(globe(24));
    for view in views() {
        let counts = compare(&scene, &*view, Kind::Mirror, 0.01);
        assert!(counts[2] > 50, "{counts:?}");
        let counts = compare(&scene, &*view, Kind::Glass, 0.03);
        assert!(counts[3] > 20, "{counts:?}");
    }
    // Flat facets do not spread what they reflect.
    let flat = TriangleMesh {
        normals: Vec::new(),
        ..globe(6)
    };
    let counts = compare(&instances(flat), &*views()[0], Kind::Mirror, 1e-3);
    assert!(counts[2] > 50, "{counts:?}");
}

/// The differential of a sample from a wide lobe: a share of the lobe, or the mirror's if larger.
#[test]
fn wide_lobes_spread_footprints() {
    let mut b = SceneBuilder::default();
    room(&mut b);
    let scene = b.finish().unwrap();
    let ray = Ray::new(DVec3::new(0.0, 1.0, 3.0), DVec3::new(0.0, -1.0, -1.0));
    let accel = (ACCELERATORS[0].build)(&scene.geometry, 1).unwrap();
    let sp = scene
        .geometry
        .surface_point(&ray, &accel.intersect(&ray).unwrap());
    let frame = Frame::from_normal(-sp.wo);
    let start = |s: f64| Differential {
        origin: [DVec3::ZERO; 2],
        direction: [frame.x * s, frame.y * s],
    };
    let wi = DVec3::new(0.3, 0.8, -0.2).normalize();
    let solid_angle = |d: &Differential| {
        let [x, y] = d.direction;
        assert!(x.dot(wi).abs() < 1e-9 && y.dot(wi).abs() < 1e-9);
        std::f64::consts::PI * x.cross(y).length()
    };
    let land = |s: f64| start(s).land(&scene.geometry, &ray, &sp).unwrap();
    for pdf in [0.3, 10.0, 1e4] {
        let d = land(1e-4).spread(&sp, wi, pdf);
        assert!((solid_angle(&d) * pdf * 16.0 - 1.0).abs() < 1e-9);
        assert_eq!(d.origin[0], land(1e-4).footprint().dpdx);
    }
    // A density next to nothing stands for no more than a share of the hemisphere.
    let d = land(1e-4).spread(&sp, wi, 1e-30);
    assert!((solid_angle(&d) * 16.0 / std::f64::consts::TAU - 1.0).abs() < 1e-9);
    // Wider before than the lobe: kept.
    let mirror = sp.n * (2.0 * sp.n.dot(sp.wo)) - sp.wo;
    let d = land(0.5).spread(&sp, mirror, 1e6);
    assert!(d.direction[0].cross(d.direction[1]).length() > 0.2);
}

/// Rays that graze, start inside, or carry nonsense: no panic, and no derivative where there is
/// none.
#[test]
fn nonsense_lands_nowhere() {
    let mut b = SceneBuilder::default();
    let material = room(&mut b);
    add_sphere(&mut b, "thing", material, DVec3::ZERO, 1.0);
    let scene = b.finish().unwrap();
    let accel = (ACCELERATORS[0].build)(&scene.geometry, 1).unwrap();
    let geometry: &Geometry = &scene.geometry;
    for (o, d) in [
        (DVec3::new(1.0, 0.0, 5.0), -DVec3::Z),
        (DVec3::ZERO, DVec3::X),
        (DVec3::new(0.0, 0.0, 5.0), -DVec3::Z),
    ] {
        let ray = Ray::new(o, d);
        let Some(hit) = accel.intersect(&ray) else {
            continue;
        };
        let sp = geometry.surface_point(&ray, &hit);
        for x in [0.0, 1e-3, 1e300, f64::NAN, f64::INFINITY] {
            let differential = Differential {
                origin: [DVec3::splat(x), DVec3::ZERO],
                direction: [DVec3::X * x, DVec3::Y],
            };
            if let Some(landing) = differential.land(geometry, &ray, &sp) {
                assert!(landing.footprint().dpdx.is_finite());
                for wi in [sp.n, -sp.n, sp.wo, -sp.wo, DVec3::Y] {
                    landing.follow(&sp, wi);
                    landing.spread(&sp, wi, 1.0);
                    landing.spread(&sp, wi, f64::INFINITY);
                }
            }
        }
    }
}
