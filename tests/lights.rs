//! Lights emit what they say, and light what they should.
//!
//! Power against the flux of emitted photons for every kind of the table, and the classical
//! closed forms, each measured twice: by `sample_li` as camera paths see lights, and by photons.
//!
//! Sources: Howell, *A Catalog of Radiation Heat Transfer Configuration Factors* (disc and
//! rectangle form factors); `KHR_lights_punctual` (falloff of spots).

mod common;

use std::f64::consts::PI;

use common::stats::Samples;
use common::{add_disc, add_quad, add_sphere, lamp, light};
use dualight::accel::ACCELERATORS;
use dualight::color::Rgb;
use dualight::geometry::{MaterialId, Ray, SphereSet, TriangleMesh};
use dualight::lights::{LIGHTS, Light, LightDesc};
use dualight::math::{BoundingSphere, DAffine3, DMat3, DQuat, DVec3, Frame};
use dualight::sampling::{Rng, hash2, warp};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};

const SEEDS: u64 = 32;

/// Lights of every kind, and their flux in W by hand.
fn zoo() -> Vec<(String, Box<dyn Light>, Rgb)> {
    let strength = Rgb::new(1.0, 2.0, 0.5);
    let base = LightDesc {
        strength,
        direction: DVec3::new(0.2, -1.0, 0.3),
        position: DVec3::new(1.0, 2.0, 3.0),
        triangles: vec![
            [DVec3::ZERO, DVec3::X, DVec3::Y],
            [
                DVec3::ONE,
                DVec3::ONE + DVec3::Z * 2.0,
                DVec3::ONE + DVec3::X * 1.5,
            ],
        ],
        spheres: [(0.0, 1.0), (3.0, 0.5)]
            .map(|(x, radius)| BoundingSphere {
                center: DVec3::X * x,
                radius,
            })
            .to_vec(),
        scene: BoundingSphere {
            center: DVec3::ONE,
            radius: 3.0,
        },
        ..Default::default()
    };
    let mut out = Vec::new();
    for entry in LIGHTS {
        let mut add = |what: &str, desc: LightDesc, flux: f64| {
            let light = (entry.build)(&desc).expect("valid parameters");
            out.push((format!("{}{what}", entry.name), light, strength * flux));
        };
        match entry.name {
            "area" => {
                add("", base.clone(), 2.0 * PI);
                let both = LightDesc {
                    double_sided: true,
                    ..base.clone()
                };
                add(", both sides", both, 4.0 * PI);
            }
            "sphere" => add("", base.clone(), PI * 4.0 * PI * 1.25),
            "ellipsoid" => {
                // Prolate spheroids with axes 1 : 1 : 2 of the same spheres.
                let world = DAffine3::from_scale_rotation_translation(
                    DVec3::new(-1.0, 1.0, 2.0),
                    DQuat::from_axis_angle(DVec3::ONE.normalize(), 1.0),
                    DVec3::NEG_Y,
                );
                let e = 0.75f64.sqrt();
                let growth = 0.5 * (1.0 + 2.0 / e * e.asin());
                let desc = LightDesc {
                    world,
                    ..base.clone()
                };
                add("", desc, PI * 4.0 * PI * 1.25 * growth);
            }
            "panel" => {
                let edges = [DVec3::X * 2.0, DVec3::new(0.5, 0.0, 1.5)];
                for (what, round, area) in [
                    (" a parallelogram", false, 3.0),
                    (" an ellipse", true, 0.75 * PI),
                ] {
                    let desc = LightDesc {
                        edges,
                        round,
                        ..base.clone()
                    };
                    add(what, desc, PI * area);
                }
            }
            "point" => {
                add("", base.clone(), 4.0 * PI);
                let ball = LightDesc {
                    radius: 0.25,
                    ..base.clone()
                };
                add(" a ball", ball, 4.0 * PI);
            }
            "directional" => add("", base.clone(), 9.0 * PI),
            // Radiance 1 through the disc from every direction.
            "environment" => add("", base.clone(), 4.0 * PI * 9.0 * PI),
            "spot" => {
                for (inner, outer) in [(0.0f64, 0.5f64), (0.3, 0.5), (0.5, 0.5), (1.0, PI)] {
                    // The falloff is a squared ramp in the cosine: it weighs a third.
                    let (ci, co) = (inner.cos(), outer.cos());
                    let desc = LightDesc {
                        inner_cone: inner,
                        outer_cone: outer,
                        ..base.clone()
                    };
                    let flux = 2.0 * PI * (1.0 - ci + (ci - co) / 3.0);
                    add(&format!(" {inner} to {outer}"), desc.clone(), flux);
                    let ball = LightDesc {
                        radius: 0.5,
                        ..desc
                    };
                    add(&format!(" {inner} to {outer}, a ball"), ball, flux);
                }
            }
            other => panic!("light kind '{other}' has no closed form here: add it"),
        }
    }
    out
}

#[test]
fn photons_carry_the_power_of_their_light() {
    for (name, light, flux) in zoo() {
        let claimed = light.power();
        let off = (claimed - flux).map(f64::abs).max_channel();
        assert!(
            off < 1e-12 * flux.max_channel(),
            "{name}: {claimed:?} is {flux:?}"
        );
        let carried = Samples::over_seeds(SEEDS, |seed| {
            let mut rng = Rng::new(hash2(seed, 1));
            let n = 20_000;
            let mut sum = Rgb::ZERO;
            for _ in 0..n {
                let u = rng.next_2d();
                if let Some(beam) = light.sample_distant(u) {
                    sum += beam.irradiance * (9.0 * PI);
                    continue;
                }
                let from = light.sample_origin(u).expect("an origin");
                let (dir, pdf) = light.sample_direction(&from, rng.next_2d());
                sum += light.emitted(&from, dir) / (pdf * from.pdf_area);
            }
            assert!((sum.g / sum.r - 2.0).abs() < 1e-9 && (sum.b / sum.r - 0.5).abs() < 1e-9);
            sum.r / f64::from(n)
        });
        carried.assert_mean(&format!("flux of {name}"), flux.r, 0.005);
    }
}

#[test]
fn surfaces_emit_to_their_front_alone_unless_they_are_double_sided() {
    for (name, light, _) in zoo() {
        let both = name.contains("both");
        let mut rng = Rng::new(5);
        let (mut front, mut back) = (0, 0);
        for _ in 0..10_000 {
            let Some(from) = light.sample_origin(rng.next_2d()) else {
                break;
            };
            let Some(ng) = from.ng else { break };
            let (dir, _) = light.sample_direction(&from, rng.next_2d());
            if dir.dot(ng) > 0.0 {
                front += 1;
            } else {
                back += 1;
            }
            let behind = light.emitted(&from, -ng);
            assert_eq!(behind.is_black(), !both, "{name} shines backward");
            if light.is_bodiless() {
                // No ray can meet it again, and a spot of some radius chooses its cone first.
                continue;
            }
            // Rays start outside the surface on the side they go to.
            let start = from.ray(dir).origin() - from.p;
            assert!(start.dot(ng) * dir.dot(ng) > 0.0, "{name}");
        }
        let surface = !light.is_bodiless();
        assert!(
            back == 0 || !surface || both && i32::abs(front - back) < 500,
            "{name}"
        );
        if name.starts_with("area") {
            // Seen from behind the one triangle and from before it.
            let eye = DVec3::new(0.2, 0.2, -1.0);
            let seen = (0..1000).filter_map(|_| light.sample_li(eye, rng.next_2d()));
            let near = seen.filter(|li| li.wi.z > 0.9).count();
            assert_eq!(near > 0, both, "{name}: seen {near} times from behind");
        }
    }
}

/// Irradiance at `p` on a plane of normal `n`, by `sample_li`, nothing being in the way.
fn irradiance(scene: &Scene, p: DVec3, n: DVec3, seed: u64, samples: u32) -> f64 {
    let mut rng = Rng::new(hash2(seed, 2));
    let light = &scene.lights[0];
    let at = p - scene.center;
    let draw = |_| light.sample_li(at, rng.next_2d());
    let sum: f64 = (0..samples)
        .filter_map(draw)
        .map(|li| li.radiance.r * li.wi.dot(n).max(0.0) / li.pdf)
        .sum();
    sum / f64::from(samples)
}

/// Share of the light's flux that photons carry through the disc of radius `r` around `center`
/// with normal `-y`, and the photons through it counted alike in any light kind.
fn flux_through(scene: &Scene, center: DVec3, r: f64, seed: u64, photons: u32) -> f64 {
    let mut rng = Rng::new(hash2(seed, 3));
    let light = &scene.lights[0];
    let center = center - scene.center;
    let mut sum = 0.0;
    for _ in 0..photons {
        let from = light.sample_origin(rng.next_2d()).expect("an origin");
        let (dir, pdf) = light.sample_direction(&from, rng.next_2d());
        let ray: Ray = from.ray(dir);
        let t = (center.y - ray.origin().y) / ray.direction().y;
        let at = ray.origin() + ray.direction() * t - center;
        if t > 0.0 && at.x * at.x + at.z * at.z < r * r {
            sum += light.emitted(&from, dir).r / (pdf * from.pdf_area);
        }
    }
    sum / f64::from(photons)
}

/// A light at height `h` over the origin, shining down, and whatever scene it needs.
fn lit(add: impl FnOnce(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::default();
    add(&mut b);
    b.finish().expect("valid")
}

const UP: DVec3 = DVec3::Y;

#[test]
fn a_point_lights_a_plane() {
    let (h, flux) = (1.5, 4.0 * PI);
    let scene = lit(|b| b.add_light(light("point", UP * h, UP, 1.0)));
    for x in [0.0, 0.7, 4.0] {
        let e = irradiance(&scene, DVec3::X * x, UP, 0, 1);
        let expected = h / (h * h + x * x).powf(1.5);
        assert!((e / expected - 1.0).abs() < 1e-12, "{e} is not {expected}");
    }
    for r in [0.5, 1.5, 6.0] {
        let expected = 0.5 * (1.0 - h / (h * h + r * r).sqrt());
        let share = Samples::over_seeds(SEEDS, |seed| {
            flux_through(&scene, DVec3::ZERO, r, seed, 100_000) / flux
        });
        share.assert_mean(
            &format!("point light through a disc of {r}"),
            expected,
            0.005,
        );
    }
}

#[test]
fn a_disc_lights_a_point_below_it() {
    // E = π L a²/(a² + h²), on the axis.
    let (a, h) = (0.5f64, 2.0f64);
    let scene = lit(|b| {
        let m = b.add_material(&lamp(Rgb::ONE)).expect("a lamp");
        add_disc(b, "disc", m, UP * h, -UP, a);
    });
    let expected = PI * a * a / (a * a + h * h);
    assert!((expected / PI - 0.058_823_5).abs() < 1e-7);
    let e = Samples::over_seeds(SEEDS, |s| irradiance(&scene, DVec3::ZERO, UP, s, 5000));
    // A polygon of 128 sides and equal area is a disc to 1e-5 here.
    e.assert_mean_with_bias("disc to point", expected, 0.002, 1e-5);
    // From below a small disc is met by the flux E·πr²; its mean over r differs from the axis
    // by (r/h)².
    let r = 0.1;
    let exact = disc_to_disc(a, r, h) * PI * PI * a * a;
    let flux = Samples::over_seeds(SEEDS, |s| flux_through(&scene, DVec3::ZERO, r, s, 400_000));
    flux.assert_mean("disc to a small disc, by photons", exact, 0.01);
    assert!((exact / (PI * r * r * expected) - 1.0).abs() < 0.005);
}

/// Share of the flux of a disc of radius `a` that meets a parallel one of radius `r` at `h`.
fn disc_to_disc(a: f64, r: f64, h: f64) -> f64 {
    let (x, y) = (a / h, r / h);
    let s = 1.0 + (1.0 + y * y) / (x * x);
    0.5 * (s - (s * s - 4.0 * (r / a).powi(2)).sqrt())
}

#[test]
fn a_disc_lights_a_disc() {
    let expected = disc_to_disc(1.0, 1.0, 2.0);
    assert!((expected - 0.171_573).abs() < 1e-6);
    let scene = lit(|b| {
        let m = b.add_material(&lamp(Rgb::ONE)).expect("a lamp");
        add_disc(b, "disc", m, UP * 2.0, -UP, 1.0);
    });
    let flux = PI * PI;
    let photons = Samples::over_seeds(SEEDS, |s| {
        flux_through(&scene, DVec3::ZERO, 1.0, s, 50_000) / flux
    });
    photons.assert_mean_with_bias("disc to disc, by photons", expected, 0.003, 2e-5);
    let sampled = Samples::over_seeds(SEEDS, |seed| {
        let mut rng = Rng::new(hash2(seed, 4));
        let n = 20_000;
        let mut sum = 0.0;
        for k in 0..n {
            let [x, y] = dualight::sampling::warp::disc(rng.next_2d());
            sum += irradiance(&scene, DVec3::new(x, 0.0, y), UP, hash2(seed, k), 1);
        }
        sum / n as f64 * PI / flux
    });
    sampled.assert_mean_with_bias("disc to disc, by light samples", expected, 0.003, 2e-5);
}

#[test]
fn a_rectangle_lights_a_point_below_its_corner_and_its_centre() {
    let corner = |x: f64, y: f64| {
        let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
        (x / p * (y / p).atan() + y / q * (x / q).atan()) / (2.0 * PI)
    };
    let (w, d, h) = (1.0, 1.0, 2.0);
    let scene = lit(|b| {
        let m = b.add_material(&lamp(Rgb::ONE)).expect("a lamp");
        let p = DVec3::new(0.0, h, 0.0);
        add_quad(b, "lamp", m, p, DVec3::X * w, DVec3::Z * d);
    });
    let centre = 4.0 * corner(0.25, 0.25);
    assert!((centre - 0.073_477_6).abs() < 1e-7);
    for (what, p, expected) in [
        ("corner", DVec3::ZERO, corner(0.5, 0.5)),
        ("centre", DVec3::new(0.5, 0.0, 0.5), centre),
    ] {
        let e = Samples::over_seeds(SEEDS, |s| irradiance(&scene, p, UP, s, 5000) / PI);
        e.assert_mean(&format!("rectangle over its {what}"), expected, 0.002);
        let r = 0.1;
        let by_photons = Samples::over_seeds(SEEDS, |s| {
            flux_through(&scene, p, r, s, 800_000) / (PI * PI * r * r)
        });
        // Over so small a disc the form factor differs from its middle's by about (r/h)²/4.
        let what = format!("rectangle over its {what}, by photons");
        by_photons.assert_mean_with_bias(&what, expected, 0.006, 0.25 * (r / h).powi(2));
    }
}

#[test]
fn a_sphere_lights_like_a_point_of_its_intensity() {
    // E = π L (R/d)² at normal incidence, at any distance: Lambert's law of the sphere.
    let scene = lit(|b| {
        let m = b.add_material(&lamp(Rgb::ONE)).expect("a lamp");
        add_sphere(b, "ball", m, UP * 2.0, 0.5);
    });
    for d in [0.6, 2.0, 50.0] {
        let p = UP * (2.0 - d);
        let e = Samples::over_seeds(SEEDS, |s| irradiance(&scene, p, UP, s, 5000));
        e.assert_mean(&format!("sphere at {d}"), PI * (0.5 / d).powi(2), 0.005);
    }
}

/// A ball of triangles, with normals outward.
fn add_mesh_ball(b: &mut SceneBuilder, material: MaterialId, c: DVec3, r: f64) {
    let (rings, sectors) = (24u32, 48u32);
    let at = |i: u32, j: u32| -> [f32; 3] {
        let theta = PI * f64::from(i) / f64::from(rings);
        let phi = 2.0 * PI * f64::from(j % sectors) / f64::from(sectors);
        let (x, z) = (theta.sin() * phi.cos(), theta.sin() * phi.sin());
        (c + DVec3::new(x, theta.cos(), z) * r).as_vec3().into()
    };
    let mut mesh = TriangleMesh::default();
    for i in 0..rings {
        for j in 0..sectors {
            let n = mesh.positions.len() as u32;
            mesh.positions
                .extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            mesh.indices.extend([[n, n + 3, n + 2], [n, n + 2, n + 1]]);
        }
    }
    let shape = b.add_mesh(mesh, "ball");
    b.place(MeshPlacement {
        shape,
        material,
        world_from_object: DAffine3::IDENTITY,
        name: "ball".into(),
    });
}

/// Half of a lamp faces away from any point: samples go to the other half, and the mean stays what
/// the closed form says.
#[test]
fn a_ball_of_triangles_lights_like_a_sphere_with_little_noise() {
    let scene = lit(|b| {
        let m = b.add_material(&lamp(Rgb::ONE)).expect("a lamp");
        add_mesh_ball(b, m, UP * 2.0, 0.5);
    });
    // By the area of the polyhedron; what is seen of it is a quarter on average (Cauchy).
    let area = scene.lights[0].power().r / PI;
    let r2 = area / (4.0 * PI);
    // By area alone the deviation of one sample would be 1.3 times the mean far away, and more
    // from near by, where less is seen.
    for (d, most) in [(0.8, 1.0), (2.0, 0.4), (50.0, 0.4)] {
        let p = UP * (2.0 - d);
        let expected = PI * r2 / (d * d);
        let e = Samples::over_seeds(SEEDS, |s| irradiance(&scene, p, UP, s, 5000));
        e.assert_mean_with_bias(&format!("ball at {d}"), expected, 0.01, 0.004);
        let one = Samples::over_seeds(2000, |s| irradiance(&scene, p, UP, s, 1));
        let deviation = one.sigma() * 2000f64.sqrt() / expected;
        println!("at {d}: deviation {deviation:.2}");
        assert!(deviation < most, "at {d}: deviation {deviation}");
    }
}

/// A ball that a node stretches emits from the surface that rays meet: light sampling, and rays
/// of every backend, find the same irradiance, and the densities agree point by point.
#[test]
fn a_stretched_ball_lights_as_it_is_seen() {
    let maps = [
        (DVec3::new(1.0, 0.2, 2.0), 0.7),
        (DVec3::new(-0.5, 1.0, 0.1), -1.1),
        (DVec3::new(0.3, 0.3, 0.6), 0.0),
    ];
    for (k, (scale, angle)) in maps.into_iter().enumerate() {
        let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle);
        let shear = DAffine3::from_mat3(DMat3::from_cols(
            DVec3::X,
            DVec3::new(0.4, 1.0, 0.0),
            DVec3::Z,
        ));
        let world =
            DAffine3::from_scale_rotation_translation(scale, turn, DVec3::new(0.3, 2.5, -0.2))
                * shear;
        let scene = lit(|b| {
            let m = b.add_material(&lamp(Rgb::ONE)).expect("a lamp");
            let set = SphereSet {
                spheres: vec![[0.2, 0.0, 0.1, 0.8]],
            };
            let shape = b.add_spheres(set, "ball");
            b.place(MeshPlacement {
                shape,
                material: m,
                world_from_object: world,
                name: "ball".into(),
            });
        });
        assert_eq!(scene.light_names[0].1, "ellipsoid");
        let light = &scene.lights[0];
        let by_light = Samples::over_seeds(SEEDS, |s| irradiance(&scene, DVec3::ZERO, UP, s, 5000));
        for entry in ACCELERATORS {
            let accel = (entry.build)(&scene.geometry, 1).expect("builds");
            let frame = Frame::from_normal(UP);
            let by_rays = Samples::over_seeds(SEEDS, |seed| {
                let mut rng = Rng::new(hash2(seed, 4));
                let mut sum = 0.0;
                for _ in 0..20_000 {
                    let d = frame.to_world(warp::cosine_hemisphere(rng.next_2d()));
                    let ray = Ray::new(-scene.center, d);
                    if let Some(hit) = accel.intersect(&ray) {
                        let sp = scene.surface_point(&ray, &hit);
                        sum += scene.emitted(&sp, None).r * PI / 20_000.0;
                    }
                }
                sum
            });
            let what = format!("stretched ball {k}, light against {}", entry.name);
            by_light.assert_agrees(&by_rays, &what, 0.01, 0.0);
            let mut rng = Rng::new(6);
            for _ in 0..1000 {
                let Some(li) = light.sample_li(-scene.center, rng.next_2d()) else {
                    continue;
                };
                let ray = Ray::new(-scene.center, li.wi);
                // At the rim a ray may miss by its rounding.
                let Some(hit) = accel.intersect(&ray) else {
                    continue;
                };
                let sp = scene.surface_point(&ray, &hit);
                let pdf = light.pdf_li(-scene.center, &sp);
                assert!(
                    (pdf / li.pdf - 1.0).abs() < 1e-5,
                    "{what}: {pdf} {}",
                    li.pdf
                );
                let target = li.target.expect("a surface");
                let off = (target - sp.p).length();
                let cos = sp.ng.dot(sp.wo);
                assert!(cos < 0.01 || off < 1e-4, "{what}: {off}");
            }
        }
    }
}

#[test]
fn spots_light_what_lies_in_their_cone() {
    let scene = lit(|b| {
        b.add_light(LightDesc {
            inner_cone: 0.2,
            outer_cone: 0.6,
            ..light("spot", UP * 2.0, -UP, 3.0)
        });
    });
    // Irradiance by samples and flux by photons, over the same disc, by quadrature of the former.
    let r = 2.0 * 0.4f64.tan();
    let n = 20_000;
    let flux: f64 = (0..n)
        .map(|k| {
            let x = r * (f64::from(k) + 0.5) / f64::from(n);
            2.0 * PI * x * irradiance(&scene, DVec3::X * x, UP, 0, 1) * r / f64::from(n)
        })
        .sum();
    let photons = Samples::over_seeds(SEEDS, |s| flux_through(&scene, DVec3::ZERO, r, s, 50_000));
    photons.assert_mean("spot through a disc", flux, 0.003);
    assert_eq!(irradiance(&scene, DVec3::X * 1.4, UP, 0, 1), 0.0);
}
