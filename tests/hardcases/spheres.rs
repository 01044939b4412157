//! Rows S1, S2 and S5 to S17: spheres.

use dualight::geometry::{Geometry, Ray, Shape, sphere};
use dualight::math::robust::UNIT_ROUNDOFF as U;
use dualight::math::{DAffine3, DQuat, DVec3, Vec3};
use dualight::sampling::Rng;
use std::sync::Arc;

use crate::bounces;
use crate::deposits;
use crate::dual::{Seen, by, variables};
use crate::exact::ExactSphere;
use crate::report::{Meter, Row};
use crate::scenes::{PerPath, backends, exact, object, on_sphere, refined, relative, spheres};

/// Bound of a refined distance: `1e-9·max(t, r)`.
fn refined_error(t: f64, want: f64, r: f64) -> f64 {
    (t - want).abs() / want.abs().max(r)
}

pub fn s1(row: &mut Row) {
    let g = spheres(&[(DVec3::ZERO, 1.0)]);
    row.tried("|d| = 1, 3, 1e15, 1e-15");
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
    row.tried("10⁴ directions from the centre, 10⁴ rays from 0.999999 r; seed 2");
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

pub fn s5(row: &mut Row) {
    row.tried("o = (1, 0, −5), d = (0, 0, 1)");
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
    row.tried("there and up to 4 last places aside");
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
    let [vo, vd] = variables(o, d);
    let line = sphere::line_sphere(vo, vd, c, r);
    let exact = ExactSphere::new(o, d, c, r).discriminant.sign() >= 0;
    (line.discriminant.value() >= 0.0, exact)
}

/// What a backend itself says of a distance, in units of what single precision may do to it at
/// `far` from the centre: `16·u·far`, over the cosine or, near the silhouette, its floor.
fn of_the_law(t: f64, want: f64, far: f64, cos: f64, r: f64) -> f64 {
    (t - want).abs() * cos.max((U * far / r).sqrt()) / (16.0 * U * far)
}

pub fn s6(row: &mut Row) {
    row.tried("b = 1 + k·2⁻²³, |k| ≤ 16");
    let aside =
        || (-16i32..=16).map(|k| DVec3::new(1.0 + f64::from(k) * 2f64.powi(-23), 0.0, -5.0));
    let mut m = Meter::default();
    for o in aside() {
        let (ours, exact) = signs(o, DVec3::Z, DVec3::ZERO, 1.0);
        m.must(ours == exact);
    }
    row.line("dual", "wrong signs of the discriminant", m, 0.0);
    let g = spheres(&[(DVec3::ZERO, 1.0)]);
    for (name, accel) in backends(&g) {
        let mut wrong = Meter::default();
        for o in aside() {
            let ray = Ray::new(o, DVec3::Z);
            // Coordinates between 1 and 2 are exact in single precision.
            assert_eq!(ray.origin(), o);
            let law = if exact(name) { 0.0 } else { 2.0 * U * 5.0 };
            if (1.0 - o.x).abs() >= law {
                wrong.must(accel.intersect(&ray).is_some() == (o.x <= 1.0));
            }
        }
        row.line(name, WRONG, wrong, 0.0);
    }
}

/// Hit or miss, wrong where it may not be. Double precision is granted nothing.
const WRONG: &str = "wrong but within 2uD of the silhouette";

/// Rows of spheres seen from afar: `(r, D)`, `n` random lines each.
fn ladder(row: &mut Row, steps: &[(f64, f64)], n: usize) {
    let mut sign = Meter::default();
    let mut found = PerPath::<3>::default();
    for &(r, far) in steps {
        let g = spheres(&[(DVec3::ZERO, r)]);
        let r = f64::from(r as f32);
        for (name, accel) in backends(&g) {
            let [wrong, own, distance] = found.of(name);
            let mut rng = Rng::new(7);
            for _ in 0..n {
                let out = on_sphere(&mut rng);
                let side = out.any_orthonormal_vector();
                let ray = Ray::new(out * far, side * (r * 1.2 * rng.next_1d()) - out * far);
                let (o, d) = (ray.origin(), ray.direction());
                let truth = ExactSphere::new(o, d, DVec3::ZERO, r);
                let b = o.cross(d).length() / d.length();
                let law = 2.0 * U * far / r;
                let hit = accel.intersect(&ray);
                if exact(name) || (1.0 - b / r).abs() >= law {
                    wrong.must(hit.is_some() == (truth.discriminant.sign() >= 0));
                }
                if let (Some(hit), Some(roots)) = (hit, truth.roots()) {
                    let sp = g.surface_point(&ray, &hit);
                    let want = roots[0] * d.length();
                    distance.see(refined_error(sp.distance, want, r));
                    let cos = (1.0 - b * b / (r * r)).max(0.0).sqrt();
                    let t = f64::from(hit.t) * d.length();
                    own.see(of_the_law(t, want, far, cos, r));
                }
                if name == "bvh" {
                    let (ours, exact) = signs(o, d, DVec3::ZERO, r);
                    sign.must(ours == exact);
                }
            }
        }
    }
    for (name, [wrong, own, distance]) in found.into_iter() {
        row.line(name, WRONG, wrong, 0.0);
        row.line(name, LAW, own, 1.0);
        row.line(name, "refined distance, of max(t, r)", distance, 1e-9);
    }
    row.line("dual", "wrong signs of the discriminant", sign, 0.0);
}

/// See [`of_the_law`].
const LAW: &str = "own distance, of 16uD/max(cos, √(uD/r))";

pub fn s7(row: &mut Row) {
    row.tried("r = 1, D = 1e1 to 1e6, 1500 lines each with b ≤ 1.2 r; seed 7");
    ladder(row, &[1e1, 1e2, 1e3, 1e4, 1e5, 1e6].map(|d| (1.0, d)), 1500);
}

pub fn s8(row: &mut Row) {
    row.tried("r, D = 1e-3, 1e3; 1e-4, 10; 1e-4, 1; 1500 lines each with b ≤ 1.2 r; seed 7");
    ladder(row, &[(1e-3, 1e3), (1e-4, 10.0), (1e-4, 1.0)], 1500);
}

pub fn s9(row: &mut Row) {
    row.tried("r = 0.1, D = 1e7; seed 9");
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
    row.tried("a speck of 0.1 in a scene of 1e7");
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
    row.tried("r = 1e3 to 1e6, eye 0.5 to 10 above, 0 to 80°, 500 rays each");
    let mut found = PerPath::<2>::default();
    for r in [1e3, 1e4, 1e5, 1e6] {
        let c = DVec3::new(0.0, -r, 0.0);
        let g = spheres(&[(c, r)]);
        for (name, accel) in backends(&g) {
            let [raw, distance] = found.of(name);
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
    }
    for (name, [raw, distance]) in found.into_iter() {
        let bound = if exact(name) { 2.0 * U } else { 0.5 };
        row.line(name, "own distance, relative", raw, bound);
        row.line(name, "refined distance, relative", distance, 1e-9);
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
    for (r, tried) in [
        (1.0, "r = 1, c = 1e6 in each coordinate, from 10 m; seed 11"),
        (0.1, "r = 0.1, there; seed 11"),
        (0.01, "r = 0.01, there; seed 11"),
    ] {
        let g = spheres(&[(c, r)]);
        let r = f64::from(r as f32);
        row.tried(tried);
        for (name, accel) in backends(&g) {
            let [mut wrong, mut own, mut spawn] = [Meter::default(); 3];
            let mut rng = Rng::new(11);
            for _ in 0..2000 {
                let out = on_sphere(&mut rng);
                let ray = Ray::new(c + out * 10.0, -out);
                let (o, d) = (ray.origin(), ray.direction());
                let truth = ExactSphere::new(o, d, c, r);
                let b = (o - c).cross(d).length() / d.length();
                let hit = accel.intersect(&ray);
                // Coordinates are exact here; what rounds is the way from the origin.
                if exact(name) || (1.0 - b / r).abs() >= 2.0 * U * 10.0 / r {
                    wrong.must(hit.is_some() == (truth.discriminant.sign() >= 0));
                }
                if let (Some(hit), Some(roots)) = (hit, truth.roots()) {
                    let want = roots[0] * d.length();
                    let cos = (1.0 - b * b / (r * r)).max(0.0).sqrt();
                    let t = f64::from(hit.t) * d.length();
                    own.see(of_the_law(t, want, 10.0, cos, r));
                    let sp = g.surface_point(&ray, &hit);
                    let w = on_sphere(&mut rng);
                    let w = if w.dot(sp.ng) < 0.0 { -w } else { w };
                    spawn.must(accel.intersect(&sp.spawn(w)).is_none());
                }
            }
            row.line(name, WRONG, wrong, 0.0);
            row.line(name, LAW, own, 1.0);
            row.line(name, "self-hits", spawn, 0.0);
        }
    }
    bounces::far_spheres(row);
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
    row.tried("r = 0, 1e-40, 1e-30, 1e-19, −1, NaN, ∞, 1.9e18, beside one of 1");
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
    row.tried("scale (1, 100, 0.01), turned by 30°, from 200; seed 13");
    let mut seen = Seen::default();
    for (name, accel) in backends(&g) {
        let [mut t, mut n, mut unit] = [Meter::default(); 3];
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
            unit.see((sp.ng.length() - 1.0).abs());
        }
        row.line(name, "refined distance, relative", t, 1e-6);
        row.line(name, "normal against the inverse transpose", n, 2.0 * U);
        row.line(name, "length of the normal", unit, 2.0 * U);
    }
    // As the discriminant's: at the rim the root has half of the digits.
    seen.report(row, 1e-6, 1e-6);
}

pub fn s14(row: &mut Row) {
    for (gap, tried) in [
        (1e-3, "r = 1 and 1 + 1e-3, from 5 along the normal; seed 14"),
        (4e-5, "r = 1 and 1 + 4e-5; seed 14"),
        (1e-5, "r = 1 and 1 + 1e-5; seed 14"),
    ] {
        row.tried(tried);
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
    row.tried("three spheres in one place, from 5; seed 15");
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        let mut rng = Rng::new(15);
        for _ in 0..10_000 {
            let o = on_sphere(&mut rng) * 5.0;
            let ray = Ray::new(o, on_sphere(&mut rng) * 0.7 - o);
            let (a, b) = (accel.intersect(&ray), accel.intersect(&ray));
            m.must(a == b && (!exact(name) || a.is_none_or(|h| h.prim == 0)));
        }
        row.line(name, "another answer, or not the lowest number", m, 0.0);
    }
    deposits::coincident_spheres(row);
    row.note("Embree names any one of coincident spheres, but always the same one for a ray");
}

pub fn s17(row: &mut Row) {
    let g = spheres(&[(DVec3::ZERO, 1.0)]);
    let odd = [0.0f32, -0.0, 1e-40, -1e-40, 1.0, -1.0, 1e-7];
    row.tried("components 0, −0, ±1e-40, ±1, 1e-7, times 1, 1e18 and 1e-18");
    for (name, accel) in backends(&g) {
        let [mut m, mut wrong] = [Meter::default(); 2];
        for scale in [1.0f32, 1e18, 1e-18] {
            for i in 0..odd.len().pow(3) {
                let pick = |k: u32| odd[i / odd.len().pow(k) % odd.len()] * scale;
                let mut ray = Ray::new(DVec3::new(0.0, 0.0, -5.0), DVec3::Z);
                ray.d = Vec3::new(pick(0), pick(1), pick(2));
                let hit = refined(&g, &*accel, &ray);
                // Lengths at which neither `|d|²` nor its inverse leaves single precision.
                let length = ray.direction().length();
                if (0.999e-18..2e18).contains(&length) {
                    let truth = ExactSphere::new(ray.origin(), ray.direction(), DVec3::ZERO, 1.0);
                    let ahead = truth.roots().is_some_and(|t| t[0] >= 0.0);
                    wrong.must(hit.is_some() == ahead);
                }
                m.must(hit.is_none_or(|sp| {
                    sp.p.is_finite() && sp.distance.is_finite() && sp.distance >= 0.0
                }));
            }
        }
        row.line(name, "hits that are not finite", m, 0.0);
        row.line(
            name,
            "hit or miss told wrongly, lengths of 1e-18 to 1e18",
            wrong,
            0.0,
        );
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
