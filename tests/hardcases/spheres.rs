//! Rows S1 to S17: spheres.

use dualight::ad::V3;
use dualight::geometry::{Geometry, Ray, Shape, sphere};
use dualight::math::robust::UNIT_ROUNDOFF as U;
use dualight::math::{DAffine3, DQuat, DVec3, Vec3};
use dualight::sampling::Rng;
use std::sync::Arc;

use crate::deposits;
use crate::dual::{Seen, by, variables};
use crate::exact::ExactSphere;
use crate::report::{Meter, Row};
use crate::scenes::{backends, object, on_sphere, refined, relative, spheres};

/// Bound of a refined distance: `1e-9·max(t, r)`.
fn refined_error(t: f64, want: f64, r: f64) -> f64 {
    (t - want).abs() / want.abs().max(r)
}

/// Spheres of rows S3 and S4.
const SPAWN: [(f64, f64); 6] = [
    (1e-4, 0.0),
    (1e-2, 1.0),
    (1.0, 0.0),
    (1.0, 1e3),
    (1e2, 1e5),
    (1e4, 1e4),
];

pub fn s1(row: &mut Row) {
    let g = spheres(&[(DVec3::ZERO, 1.0)]);
    for (name, accel) in backends(&g) {
        let [mut raw, mut t, mut p] = [Meter::default(); 3];
        for scale in [1.0, 3.0, 1e15, 1e-15] {
            let ray = Ray::new(DVec3::new(0.0, 0.0, -5.0), DVec3::Z * scale);
            let hit = accel.intersect(&ray).unwrap();
            let sp = g.surface_point(&ray, &hit);
            raw.see(relative(f64::from(hit.t) * ray.direction().length(), 4.0));
            t.see(relative(sp.distance, 4.0));
            p.see((sp.p + DVec3::Z).length());
            p.see((sp.ng + DVec3::Z).length());
        }
        row.line(name, "own distance, relative", raw, 1e-6);
        row.line(name, "refined distance, relative", t, 2.0 * f64::EPSILON);
        row.line(name, "position and normal", p, 2.0 * f64::EPSILON);
    }
    let mut seen = Seen::default();
    for scale in [1.0, 3.0, 1e15, 1e-15] {
        let o = DVec3::new(0.0, 0.0, -5.0);
        seen.sphere(o, DVec3::Z * scale, DVec3::ZERO, 1.0, false);
    }
    seen.report(row, 1e-15, 1e-15);
}

pub fn s2(row: &mut Row) {
    for (name, accel) in backends(&spheres(&[(DVec3::ZERO, 2.0)])) {
        let g = spheres(&[(DVec3::ZERO, 2.0)]);
        let [mut center, mut inside, mut outward] = [Meter::default(); 3];
        let mut rng = Rng::new(2);
        for _ in 0..10_000 {
            let d = on_sphere(&mut rng);
            let sp = refined(&g, &*accel, &Ray::new(DVec3::ZERO, d)).unwrap();
            center.see(relative(sp.distance, 2.0));
            outward.must(sp.ng.dot(sp.wo) < 0.0 && !sp.front);
            let o = on_sphere(&mut rng) * (2.0 * 0.999_999);
            let ray = Ray::new(o, d);
            let Some(sp) = refined(&g, &*accel, &ray) else {
                inside.see(f64::INFINITY);
                continue;
            };
            let exact = ExactSphere::new(ray.origin(), ray.direction(), DVec3::ZERO, 2.0);
            let want = exact.roots().unwrap()[1] * ray.direction().length();
            inside.see(refined_error(sp.distance, want, 2.0));
            outward.must(sp.ng.dot(sp.wo) < 0.0);
        }
        row.line(name, "distance from the centre, relative", center, 1e-12);
        row.line(name, "distance from inside, of max(t, r)", inside, 1e-9);
        row.line(name, "normals that do not point outward", outward, 0.0);
    }
    let mut seen = Seen::default();
    let mut rng = Rng::new(2);
    for _ in 0..5000 {
        let d = on_sphere(&mut rng).as_vec3().as_dvec3();
        seen.sphere(DVec3::ZERO, d, DVec3::ZERO, 2.0, true);
        let o = (on_sphere(&mut rng) * (2.0 * 0.999_999))
            .as_vec3()
            .as_dvec3();
        seen.sphere(o, d, DVec3::ZERO, 2.0, true);
    }
    // At a grazing exit the gradient is 1/cos, and its error 1/cos² of the rounding.
    seen.report(row, 1e-12, 1e-9);
    row.note(
        "directions that are unit up to their rounding are normalised by one Newton step, \
              which leaves 1e-13: the bound of one last place is for directions of another length",
    );
}

fn spawned(row: &mut Row, inward: bool) {
    let n = 100_000 / SPAWN.len();
    for k in 0..backends(&spheres(&[(DVec3::ZERO, 1.0)])).len() {
        let [mut hits, mut far] = [Meter::default(); 2];
        let mut path = "";
        for (r, offset) in SPAWN {
            let c = (DVec3::new(0.6, -0.48, 0.64) * offset).as_vec3().as_dvec3();
            let g = spheres(&[(c, r)]);
            let (name, accel) = backends(&g).swap_remove(k);
            path = name;
            let r = f64::from(r as f32);
            let mut rng = Rng::new(3);
            for _ in 0..n {
                let out = on_sphere(&mut rng);
                let aim = Ray::new(c + out * (3.0 * r), -out);
                let Some(sp) = refined(&g, &*accel, &aim) else {
                    continue;
                };
                let mut w = on_sphere(&mut rng);
                if (w.dot(sp.ng) < 0.0) != inward {
                    w = -w;
                }
                let ray = sp.spawn(w);
                let again = refined(&g, &*accel, &ray);
                if !inward {
                    hits.must(again.is_none());
                } else if w.dot(sp.ng) < -0.05 && sp.offset < 1e-2 * r {
                    // What the ray that was really sent must do.
                    let (o, d) = (ray.origin(), ray.direction());
                    let want = ExactSphere::new(o, d, c, r).roots().unwrap()[1] * d.length();
                    hits.must(again.is_some());
                    if let Some(sp) = again {
                        far.see(relative(sp.distance, want));
                    }
                }
            }
        }
        if inward {
            row.line(path, "far sides missed", hits, 0.0);
            row.line(path, "distance to the far side, relative", far, 1e-5);
        } else {
            row.line(path, "self-hits", hits, 0.0);
        }
    }
}

pub fn s3(row: &mut Row) {
    spawned(row, false);
}

pub fn s4(row: &mut Row) {
    spawned(row, true);
}

pub fn s5(row: &mut Row) {
    let (o, d) = (DVec3::new(1.0, 0.0, -5.0), DVec3::Z);
    let [vo, vd] = variables(o, d);
    let line = sphere::line_sphere(vo, vd, DVec3::ZERO, 1.0);
    let mut m = Meter::default();
    m.see(line.discriminant.value().abs());
    for (k, want) in [-2.0, 0.0, 0.0].into_iter().enumerate() {
        m.see((by(&line.discriminant)[k] - want).abs());
    }
    row.line("dual", "discriminant and its gradient", m, 0.0);
    let mut m = Meter::default();
    m.must(line.roots().unwrap()[0].gradient().is_none());
    row.line(
        "dual",
        "a derivative of the distance, which has none",
        m,
        0.0,
    );
    let g = spheres(&[(DVec3::ZERO, 1.0)]);
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        for k in -4i32..=4 {
            let x = 1.0 + f64::from(k) * f64::from(f32::EPSILON);
            let ray = Ray::new(DVec3::new(x, 0.0, -5.0), d);
            m.must(refined(&g, &*accel, &ray).is_none_or(|sp| {
                sp.p.is_finite() && (sp.ng.length() - 1.0).abs() < 1e-12 && sp.distance > 0.0
            }));
        }
        row.line(name, "hits that are not finite", m, 0.0);
    }
}

/// The sign of the discriminant, as the code sees it and exactly.
fn signs(o: DVec3, d: DVec3, c: DVec3, r: f64) -> (bool, bool) {
    let line = sphere::line_sphere(V3::<f64>::constant(o), V3::constant(d), c, r);
    let exact = ExactSphere::new(o, d, c, r).discriminant.sign() >= 0;
    (line.discriminant >= 0.0, exact)
}

pub fn s6(row: &mut Row) {
    let mut m = Meter::default();
    for k in -16i32..=16 {
        let b = 1.0 + f64::from(k) * 2f64.powi(-23);
        let (ours, exact) = signs(DVec3::new(b, 0.0, -5.0), DVec3::Z, DVec3::ZERO, 1.0);
        m.must(ours == exact);
    }
    row.line("dual", "wrong signs of the discriminant", m, 0.0);
}

/// Rays at a far sphere, with impact parameters up to 1.2 radii.
fn ladder(row: &mut Row, steps: &[(f64, f64)], n: usize) {
    let mut sign = Meter::default();
    for k in 0..backends(&spheres(&[(DVec3::ZERO, 1.0)])).len() {
        let [mut wrong, mut distance] = [Meter::default(); 2];
        let mut path = "";
        for &(r, far) in steps {
            let g = spheres(&[(DVec3::ZERO, r)]);
            let (name, accel) = backends(&g).swap_remove(k);
            path = name;
            let r = f64::from(r as f32);
            let mut rng = Rng::new(7);
            for _ in 0..n {
                let out = on_sphere(&mut rng);
                let side = out.any_orthonormal_vector();
                let ray = Ray::new(out * far, side * (r * 1.2 * rng.next_1d()) - out * far);
                let (o, d) = (ray.origin(), ray.direction());
                let exact = ExactSphere::new(o, d, DVec3::ZERO, r);
                let b = o.cross(d).length() / d.length();
                let law = 2.0 * U * far / r;
                let hit = refined(&g, &*accel, &ray);
                let truly = exact.discriminant.sign() >= 0;
                if name == "bvh" || (1.0 - b / r).abs() >= law {
                    wrong.must(hit.is_some() == truly);
                }
                if let (Some(sp), Some(roots)) = (hit, exact.roots()) {
                    distance.see(refined_error(sp.distance, roots[0] * d.length(), r));
                }
                if k == 0 {
                    let (ours, exact) = signs(o, d, DVec3::ZERO, r);
                    sign.must(ours == exact);
                }
            }
        }
        row.line(path, "wrong but within 2uD of the silhouette", wrong, 0.0);
        row.line(path, "refined distance, of max(t, r)", distance, 1e-9);
    }
    row.line("dual", "wrong signs of the discriminant", sign, 0.0);
}

pub fn s7(row: &mut Row) {
    ladder(row, &[1e1, 1e2, 1e3, 1e4, 1e5, 1e6].map(|d| (1.0, d)), 1500);
}

pub fn s8(row: &mut Row) {
    ladder(row, &[(1e-3, 1e3), (1e-4, 10.0), (1e-4, 1.0)], 1500);
}

pub fn s9(row: &mut Row) {
    let g = spheres(&[(DVec3::ZERO, 0.1)]);
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        let mut rng = Rng::new(9);
        for _ in 0..10_000 {
            let o = on_sphere(&mut rng) * 1e7;
            let ray = Ray::new(o, on_sphere(&mut rng) - o);
            m.must(
                refined(&g, &*accel, &ray).is_none_or(|sp| {
                    sp.p.is_finite() && sp.distance.is_finite() && sp.ng.is_finite()
                }),
            );
        }
        row.line(name, "hits that are not finite", m, 0.0);
    }
    let mut sign = Meter::default();
    let mut rng = Rng::new(9);
    for _ in 0..2000 {
        let out = on_sphere(&mut rng);
        let side = out.any_orthonormal_vector();
        let o = (out * 1e7).as_vec3().as_dvec3();
        let d = (side * 0.12 * rng.next_1d() - o).as_vec3().as_dvec3();
        let (ours, exact) = signs(o, d, DVec3::ZERO, f64::from(0.1f32));
        sign.must(ours == exact);
    }
    row.line("dual", "wrong signs of the discriminant", sign, 0.0);
    deposits::specks(row);
    let mut b = dualight::scene::SceneBuilder::default();
    let grey = crate::common::lambert("grey", dualight::color::Rgb::splat(0.5));
    let grey = b.add_material(&grey).unwrap();
    crate::common::add_sphere(&mut b, "speck", grey, DVec3::ZERO, 0.1);
    crate::common::add_sphere(&mut b, "far", grey, DVec3::X * 1e7, 1e3);
    let warnings = b.finish().unwrap().warnings;
    let mut m = Meter::default();
    m.must(warnings.len() == 1 && warnings[0].contains("'speck'"));
    row.line("import", "not warned of by name", m, 0.0);
}

pub fn s10(row: &mut Row) {
    for k in 0..backends(&spheres(&[(DVec3::ZERO, 1.0)])).len() {
        let [mut raw, mut distance] = [Meter::default(); 2];
        let mut path = "";
        for r in [1e3, 1e4, 1e5, 1e6] {
            let c = DVec3::new(0.0, -r, 0.0);
            let g = spheres(&[(c, r)]);
            let (name, accel) = backends(&g).swap_remove(k);
            path = name;
            for i in 0..500 {
                let (h, a) = (
                    0.5 + 9.5 * f64::from(i % 20) / 19.0,
                    f64::from(i) * 0.16f64.to_radians(),
                );
                let ray = Ray::new(DVec3::Y * h, DVec3::new(a.sin(), -a.cos(), 0.0));
                let (o, d) = (ray.origin(), ray.direction());
                let want = ExactSphere::new(o, d, c, r).roots().unwrap()[0];
                let Some(hit) = accel.intersect(&ray) else {
                    distance.see(f64::INFINITY);
                    continue;
                };
                raw.see(relative(f64::from(hit.t), want));
                let sp = g.surface_point(&ray, &hit);
                distance.see(relative(sp.distance, want * d.length()));
            }
        }
        row.line(path, "own distance, relative", raw, 0.5);
        row.line(path, "refined distance, relative", distance, 1e-9);
    }
    let mut seen = Seen::default();
    for r in [1e3, 1e4, 1e5, 1e6] {
        for i in 0..500 {
            let h = 0.5 + 9.5 * f64::from(i % 20) / 19.0;
            let a = f64::from(i) * 0.16f64.to_radians();
            let d = DVec3::new(a.sin(), -a.cos(), 0.0).as_vec3().as_dvec3();
            let o = (DVec3::Y * h).as_vec3().as_dvec3();
            seen.sphere(o, d, DVec3::Y * -r, r, false);
        }
    }
    seen.report(row, 1e-9, 1e-9);
    row.note(
        "the own distance of a single-precision backend loses up to u·r of t; nothing relies on it",
    );
}

pub fn s11(row: &mut Row) {
    let c = DVec3::splat(1e6);
    for r in [1.0, 0.1, 0.01] {
        let g = spheres(&[(c, r)]);
        for (name, accel) in backends(&g) {
            let [mut wrong, mut spawn] = [Meter::default(); 2];
            let mut rng = Rng::new(11);
            for _ in 0..2000 {
                let out = on_sphere(&mut rng);
                let ray = Ray::new(c + out * 10.0, -out);
                let (o, d) = (ray.origin(), ray.direction());
                let exact = ExactSphere::new(o, d, c, f64::from(r as f32));
                let b = (o - c).cross(d).length() / d.length();
                let hit = refined(&g, &*accel, &ray);
                // Coordinates are exact here; what rounds is the way from the origin.
                if name == "bvh" || (1.0 - b / r).abs() >= 2.0 * U * 10.0 / r {
                    wrong.must(hit.is_some() == (exact.discriminant.sign() >= 0));
                }
                if let Some(sp) = hit {
                    let w = on_sphere(&mut rng);
                    let w = if w.dot(sp.ng) < 0.0 { -w } else { w };
                    spawn.must(accel.intersect(&sp.spawn(w)).is_none());
                }
            }
            row.line(name, "wrong but within 2uD of the silhouette", wrong, 0.0);
            row.line(name, "self-hits", spawn, 0.0);
        }
    }
    row.note(
        "a spawned ray starts 1 m off here, farther than these spheres are wide: what lies so \
              far out is recentred at import (T19), or light does not enter it",
    );
}

pub fn s12(row: &mut Row) {
    use dualight::scene::SceneBuilder;
    let bad = [
        0.0,
        1e-40,
        1e-30,
        1e-19,
        -1.0,
        f32::NAN,
        f32::INFINITY,
        1.9e18,
    ];
    let mut m = Meter::default();
    let mut list: Vec<[f32; 4]> = bad.map(|r| [0.0, 0.0, 0.0, r]).to_vec();
    list.push([5.0, 0.0, 0.0, 1.0]);
    let mut set = dualight::geometry::SphereSet {
        spheres: list.clone(),
    };
    let dropped = set.drop_invalid();
    m.must(dropped.total() == bad.len() && set.spheres.len() == 1);
    let mut b = SceneBuilder::default();
    let grey = b
        .add_material(&crate::common::lambert(
            "grey",
            dualight::color::Rgb::splat(0.5),
        ))
        .unwrap();
    let shape = b.add_spheres(dualight::geometry::SphereSet { spheres: list }, "bad ones");
    b.place(dualight::scene::MeshPlacement {
        shape,
        material: grey,
        world_from_object: DAffine3::IDENTITY,
        name: "bad ones".into(),
    });
    let scene = b.finish().unwrap();
    m.must(
        scene
            .warnings
            .iter()
            .any(|w| w.contains("bad ones") && w.contains('8')),
    );
    row.line("import", "not dropped, not counted or not named", m, 0.0);
    for (name, accel) in backends(&scene.geometry) {
        let mut m = Meter::default();
        let g = &scene.geometry;
        let away = Ray::new(DVec3::new(-9.0, 0.0, 0.0) - scene.center, DVec3::X);
        m.must(refined(g, &*accel, &away).is_some_and(|sp| (sp.distance - 13.0).abs() < 1e-6));
        row.line(name, "the good one beside them missed", m, 0.0);
    }
}

pub fn s13(row: &mut Row) {
    let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 30f64.to_radians());
    let scale = DVec3::new(1.0, 100.0, 0.01);
    let world = DAffine3::from_scale_rotation_translation(scale, turn, DVec3::new(1.0, 2.0, 3.0));
    let g = Arc::new(Geometry {
        shapes: vec![Shape::Spheres(dualight::geometry::SphereSet {
            spheres: vec![[0.0, 0.0, 0.0, 1.0]],
        })],
        objects: vec![object(0, Some(world))],
    });
    let inverse = g.objects[0].placement.unwrap().object_from_world;
    let mut seen = Seen::default();
    for (name, accel) in backends(&g) {
        let [mut t, mut n] = [Meter::default(); 2];
        let mut rng = Rng::new(13);
        for _ in 0..5000 {
            let target = world.transform_point3(on_sphere(&mut rng) * 0.7);
            let o = target + on_sphere(&mut rng) * 200.0;
            let ray = Ray::new(o, target - o);
            let Some(sp) = refined(&g, &*accel, &ray) else {
                continue;
            };
            let (lo, ld) = (
                inverse.transform_point3(ray.origin()),
                inverse.transform_vector3(ray.direction()),
            );
            let Some(roots) = ExactSphere::new(lo, ld, DVec3::ZERO, 1.0).roots() else {
                continue;
            };
            let t_hit = sp.distance / ray.direction().length();
            if name == "bvh" {
                seen.sphere(lo, ld, DVec3::ZERO, 1.0, false);
            }
            t.see(
                roots
                    .iter()
                    .map(|r| relative(t_hit, *r))
                    .fold(f64::INFINITY, f64::min),
            );
            let want = inverse.matrix3.transpose() * (lo + ld * t_hit);
            n.see((sp.ng - want.normalize()).length());
            n.see((sp.ng.length() - 1.0).abs());
        }
        row.line(name, "refined distance, relative", t, 1e-6);
        // The normal of a place on the disc of 1 cm turns by 1e4 times the error of the place.
        row.line(name, "normal against the inverse transpose", n, 1e-6);
    }
    // As the discriminant's: at the rim the root has half of the digits.
    seen.report(row, 1e-6, 1e-6);
}

pub fn s14(row: &mut Row) {
    for gap in [1e-3, 4e-5, 1e-5] {
        let g = spheres(&[(DVec3::ZERO, 1.0), (DVec3::ZERO, 1.0 + gap)]);
        for (name, accel) in backends(&g) {
            let mut m = Meter::default();
            let mut rng = Rng::new(14);
            for _ in 0..10_000 {
                let out = on_sphere(&mut rng);
                let ray = Ray::new(out * 5.0, -out);
                let outer = refined(&g, &*accel, &ray);
                let inner = outer.and_then(|sp| {
                    (sp.prim == 1).then(|| refined(&g, &*accel, &sp.spawn(-sp.ng)))?
                });
                m.must(inner.is_some_and(|sp| sp.prim == 0 && sp.front));
            }
            row.line(name, "inner shell not found after the outer", m, 0.0);
        }
    }
    deposits::shells(row);
}

pub fn s15(row: &mut Row) {
    let g = spheres(&[(DVec3::ZERO, 1.0); 3]);
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        let mut rng = Rng::new(15);
        for _ in 0..10_000 {
            let o = on_sphere(&mut rng) * 5.0;
            let ray = Ray::new(o, on_sphere(&mut rng) * 0.7 - o);
            let (a, b) = (accel.intersect(&ray), accel.intersect(&ray));
            m.must(a == b && (name == "embree" || a.is_none_or(|h| h.prim == 0)));
        }
        row.line(name, "another answer, or not the lowest number", m, 0.0);
    }
    deposits::coincident_spheres(row);
    row.note("Embree names any one of coincident spheres, but always the same one for a ray");
}

pub fn s16(row: &mut Row) {
    use crate::common::{add_room, add_sphere, glass, lambert, light};
    let mut m = Meter::default();
    let mut b = dualight::scene::SceneBuilder::default();
    let glass = b.add_material(&glass(1.5)).unwrap();
    let wall = b
        .add_material(&lambert("wall", dualight::color::Rgb::splat(0.5)))
        .unwrap();
    add_room(&mut b, wall, 4.0);
    add_sphere(&mut b, "left", glass, -DVec3::X, 1.0);
    add_sphere(&mut b, "right", glass, DVec3::X, 1.0);
    b.add_light(light("point", DVec3::new(0.0, 3.0, 0.0), DVec3::NEG_Y, 1.0));
    let scene = b.finish().unwrap();
    for (i, _) in dualight::accel::ACCELERATORS.iter().enumerate() {
        let c = crate::photons::counts(&scene, i as u64, 20_000);
        let spent = c.flux_absorbed + c.flux_escaped + c.flux_cut;
        m.see((c.flux_emitted - spent).abs() / c.flux_emitted);
        m.see(c.flux_escaped / c.flux_emitted);
    }
    row.line(
        "photons",
        "flux unaccounted for, or lost from a closed room",
        m,
        1e-6,
    );
}

pub fn s17(row: &mut Row) {
    let g = spheres(&[(DVec3::ZERO, 1.0)]);
    let odd = [0.0f32, -0.0, 1e-40, -1e-40, 1.0, -1.0, 1e-7];
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        for scale in [1.0f32, 1e18, 1e-18] {
            for i in 0..odd.len().pow(3) {
                let pick = |k: u32| odd[i / odd.len().pow(k) % odd.len()] * scale;
                let mut ray = Ray::new(DVec3::new(0.0, 0.0, -5.0), DVec3::Z);
                ray.d = Vec3::new(pick(0), pick(1), pick(2));
                m.must(refined(&g, &*accel, &ray).is_none_or(|sp| {
                    sp.p.is_finite() && sp.distance.is_finite() && sp.distance >= 0.0
                }));
            }
        }
        row.line(name, "hits that are not finite", m, 0.0);
    }
    let mut m = Meter::default();
    for scale in [1.0f32, 1e18, 1e-18] {
        for i in 0..odd.len().pow(3) {
            let pick = |k: u32| f64::from(odd[i / odd.len().pow(k) % odd.len()] * scale);
            let d = DVec3::new(pick(0), pick(1), pick(2));
            if d == DVec3::ZERO {
                continue;
            }
            let o = DVec3::new(0.0, 0.0, -5.0);
            let [vo, vd] = variables(o, d);
            let line = sphere::line_sphere(vo, vd, DVec3::ZERO, 1.0);
            let exact = ExactSphere::new(o, d, DVec3::ZERO, 1.0);
            let same = (line.discriminant.value() >= 0.0) == (exact.discriminant.sign() >= 0);
            m.must(same && line.roots().is_none_or(|r| r[0].value().is_finite()));
        }
    }
    row.line("dual", "wrong sign, or a root that is not finite", m, 0.0);
}
