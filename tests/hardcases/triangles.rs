//! Rows T1, T5 to T12 and T15: triangles. T18 and T19 are pictures.

use std::sync::Arc;

use dualight::accel::Accelerator;
use dualight::ad::V3;
use dualight::geometry::triangle::plane_hit;
use dualight::geometry::{Geometry, Ray};
use dualight::math::robust::UNIT_ROUNDOFF as U;
use dualight::math::{DQuat, DVec3};
use dualight::sampling::Rng;

use crate::deposits;
use crate::dual::Seen;
use crate::exact::ExactTriangle;
use crate::report::{MEASURED, Meter, Row};
use crate::scenes::{backends, corners, exact, mesh, on_sphere, ray_to, relative, triangle};

/// What was seen of rays at one triangle: own barycentrics, refined ones, refined distance,
/// rays that missed, own distance.
struct One {
    raw: Meter,
    uv: Meter,
    t: Meter,
    missed: Meter,
    own: Meter,
}

/// Rays from all around at random points of one triangle, against exact arithmetic.
fn one(g: &Arc<Geometry>, accel: &dyn Accelerator, far: f64, n: u64, least: f64) -> One {
    let v = corners(g, 0);
    let [mut raw, mut uv, mut t, mut missed, mut own] = [Meter::default(); 5];
    let normal = (v[1] - v[0]).cross(v[2] - v[0]).normalize();
    let mut rng = Rng::new(31);
    while missed.n < n {
        let (a, b) = (0.05 + 0.4 * rng.next_1d(), 0.05 + 0.4 * rng.next_1d());
        let target = v[0] + (v[1] - v[0]) * a + (v[2] - v[0]) * b;
        let out = on_sphere(&mut rng);
        if out.dot(normal).abs() < least {
            continue;
        }
        let ray = ray_to(target + out * far, target);
        let exact = ExactTriangle::new(ray.origin(), ray.direction(), v);
        if !exact.inside() {
            continue;
        }
        let Some(hit) = accel.intersect(&ray) else {
            missed.must(false);
            continue;
        };
        missed.must(true);
        let [et, eb1, eb2] = exact.hit().unwrap();
        let off = |b: [f64; 2]| (b[0] - eb1).abs().max((b[1] - eb2).abs());
        raw.see(off([f64::from(hit.u), f64::from(hit.v)]));
        own.see(relative(f64::from(hit.t), et));
        let sp = g.surface_point(&ray, &hit);
        uv.see(off(sp.barycentrics));
        t.see(relative(sp.distance, et * ray.direction().length()));
    }
    One {
        raw,
        uv,
        t,
        missed,
        own,
    }
}

/// As [`one`], by the intersection that carries derivatives.
fn derivatives(row: &mut Row, v: [DVec3; 3], far: f64, least: f64, bounds: [f64; 2]) {
    let v = v.map(|p| p.as_vec3().as_dvec3());
    let normal = (v[1] - v[0]).cross(v[2] - v[0]).normalize();
    let mut rng = Rng::new(31);
    let mut seen = Seen::default();
    for _ in 0..400 {
        let (a, b) = (0.05 + 0.4 * rng.next_1d(), 0.05 + 0.4 * rng.next_1d());
        let target = v[0] + (v[1] - v[0]) * a + (v[2] - v[0]) * b;
        let out = on_sphere(&mut rng);
        if out.dot(normal).abs() >= least {
            let o = (target + out * far).as_vec3().as_dvec3();
            seen.triangle(o, (target - o).as_vec3().as_dvec3(), v);
        }
    }
    seen.report(row, bounds[0], bounds[1]);
}

/// A row on a single triangle of a size, seen from a distance: bounds of own and of refined
/// barycentrics.
fn single(row: &mut Row, edge: f64, far: f64, raw: f64, uv: f64) {
    let v = [DVec3::ZERO, DVec3::X * edge, DVec3::Y * edge];
    let g = mesh(triangle(v));
    row.tried(format!(
        "edge {edge:e}, D = {far:e}, 17° off the plane; seed 31"
    ));
    for (name, accel) in backends(&g) {
        let seen = one(&g, &*accel, far, 400, 0.3);
        // Of what is computed in double precision, only the last rounding is left.
        let raw = if exact(name) { U } else { raw };
        row.line(name, "own barycentrics", seen.raw, raw);
        row.line(name, "refined barycentrics", seen.uv, uv);
        row.line(name, "refined distance, relative", seen.t, 1e-12);
        row.line(name, "missed", seen.missed, 0.0);
    }
    derivatives(row, v, far, 0.3, [uv.min(1e-9), 1e-12]);
}

pub fn t1(row: &mut Row) {
    let g = mesh(triangle([DVec3::ZERO, DVec3::X, DVec3::Y]));
    row.tried("256 points from straight above");
    for (name, accel) in backends(&g) {
        let [mut raw, mut fine] = [Meter::default(); 2];
        for i in 0..256u32 {
            let (a, b) = (
                f64::from(i % 16) / 32.0 + 0.01,
                f64::from(i / 16) / 32.0 + 0.01,
            );
            let ray = Ray::new(DVec3::new(a, b, 3.0), -DVec3::Z);
            let want = ExactTriangle::new(ray.origin(), ray.direction(), corners(&g, 0));
            let [et, e1, e2] = want.hit().unwrap();
            let hit = accel.intersect(&ray).unwrap();
            for (x, e) in [(hit.t, et), (hit.u, e1), (hit.v, e2)] {
                raw.see((f64::from(x) - e).abs() / (2.0 * U));
            }
            let sp = g.surface_point(&ray, &hit);
            fine.see(
                (sp.barycentrics[0] - e1)
                    .abs()
                    .max((sp.barycentrics[1] - e2).abs()),
            );
            fine.see(relative(sp.distance, et));
            fine.see((sp.p - (ray.origin() + ray.direction() * et)).length());
            fine.see((sp.ng - DVec3::Z).length());
        }
        row.line(name, "own t, u, v in last places of 1", raw, 16.0);
        row.line(name, "refined t, u, v, place, normal", fine, 1e-15);
    }
    let mut seen = Seen::default();
    for i in 0..256u32 {
        let at = |k: u32| f64::from(k) / 32.0 + 0.01;
        let ray = Ray::new(DVec3::new(at(i % 16), at(i / 16), 3.0), -DVec3::Z);
        seen.triangle(ray.origin(), ray.direction(), corners(&g, 0));
    }
    seen.report(row, 1e-15, 1e-15);
}

pub fn t5(row: &mut Row) {
    let v = [-79.049_614f32, -87.092_27, -79.209_015].map(|y| {
        DVec3::new(
            f64::from(-1_113.454_6f32),
            f64::from(y),
            f64::from(-56.243_19f32),
        )
    });
    row.tried("pbrt's numbers");
    // As pbrt has it: the corners' other coordinates are those of one line.
    let g = mesh(triangle(v));
    let ray = Ray::new(
        DVec3::new(-1081.47925, 99.9999542, 87.7701111),
        DVec3::new(-32.1072998, -183.355865, -144.607635),
    );
    let mut m = Meter::default();
    m.must(!ExactTriangle::new(ray.origin(), ray.direction(), v).inside());
    row.line("exact", "hits", m, 0.0);
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        m.must(accel.intersect(&ray).is_none());
        row.line(name, "hits", m, 0.0);
    }
}

pub fn t6(row: &mut Row) {
    row.tried("a point, a line, NaN, ∞, 2e18, an index too large, beside a whole one");
    let good = triangle([DVec3::ZERO, DVec3::X, DVec3::Y]);
    let mut bad = good.clone();
    bad.positions.extend([
        [f32::NAN, 0.0, 0.0],
        [f32::INFINITY, 0.0, 0.0],
        [2e18, 0.0, 0.0],
        [2.0, 0.0, 0.0],
    ]);
    bad.indices.extend([
        [0, 0, 1],
        [0, 0, 0],
        [0, 1, 6],
        [0, 1, 3],
        [0, 1, 4],
        [0, 1, 5],
        [0, 1, 99],
    ]);
    let n = bad.indices.len();
    let dropped = bad.drop_invalid();
    let mut m = Meter::default();
    m.must(
        (
            dropped.total(),
            dropped.index,
            dropped.coordinate,
            dropped.degenerate,
        ) == (n - 1, 1, 3, 3),
    );
    row.line("import", "not dropped or not counted", m, 0.0);
    let g = mesh(bad);
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        m.must(accel.occluded(&Ray::new(DVec3::new(0.2, 0.2, 1.0), -DVec3::Z)));
        row.line(name, "the good one beside them missed", m, 0.0);
    }
}

pub fn t7(row: &mut Row) {
    for h in [1e-3, 1e-5, 1e-7] {
        row.tried(format!("base 1, height {h:e}, D = 10; seed 17"));
        let v = [DVec3::ZERO, DVec3::X, DVec3::new(0.5, h, 0.0)];
        let g = mesh(triangle(v));
        let v = corners(&g, 0);
        for (name, accel) in backends(&g) {
            let [mut wrong, mut uv] = [Meter::default(); 2];
            let mut rng = Rng::new(17);
            for _ in 0..2000 {
                let target = DVec3::new(rng.next_1d(), h * (2.0 * rng.next_1d() - 0.5), 0.0);
                let out = on_sphere(&mut rng);
                let ray = ray_to(target + out * 10.0, target);
                let truth = ExactTriangle::new(ray.origin(), ray.direction(), v);
                let hit = accel.intersect(&ray);
                // Within 16uD of an edge, as seen along the ray; in double precision with its u.
                let u = if exact(name) { U * U } else { U };
                let (o, d) = (ray.origin(), ray.direction());
                let near = (0..3).any(|i| {
                    let (p, q) = (v[i] - o, v[(i + 1) % 3] - o);
                    let area = d.dot(p.cross(q)).abs() / d.length();
                    let e = q - p;
                    let width = (e - d * (e.dot(d) / d.length_squared())).length();
                    area <= 16.0 * u * 10.0 * width
                });
                if !near {
                    wrong.must(hit.is_some() == truth.inside());
                }
                if let (Some(h), Some([_, e1, e2]), true) = (hit, truth.hit(), truth.inside()) {
                    let sp = g.surface_point(&ray, &h);
                    uv.see(
                        (sp.barycentrics[0] - e1)
                            .abs()
                            .max((sp.barycentrics[1] - e2).abs()),
                    );
                }
            }
            // Embree may err on all of the thinnest.
            if wrong.n > 0 {
                row.line(name, "wrong but within 16uD of an edge", wrong, 0.0);
            }
            if uv.n > 0 {
                // Rounding of the ray's f64 products over the height.
                row.line(name, "refined barycentrics", uv, 1e-13 * 10.0 / h);
            }
        }
        derivatives(row, v, 10.0, 0.3, [1e-13 * 10.0 / h, 1e-12]);
    }
}

pub fn t8(row: &mut Row) {
    for (edge, far) in [(1e-4, 1.0), (1e-6, 1e-2)] {
        single(row, edge, far, 64.0 * U * far / edge, 1e-9);
    }
}

pub fn t9(row: &mut Row) {
    let (edge, far) = (1e-10, 1e-9);
    let v = [DVec3::ZERO, DVec3::X * edge, DVec3::Y * edge];
    let alone = triangle(v);
    let mut beside = alone.clone();
    let other = [
        DVec3::ONE,
        DVec3::new(2.0, 1.0, 1.0),
        DVec3::new(1.0, 2.0, 1.0),
    ];
    beside
        .positions
        .extend(other.map(|p| <[f32; 3]>::from(p.as_vec3())));
    beside.indices.push([3, 4, 5]);
    for (m, own, tried) in [
        (
            alone,
            64.0 * U * far / edge,
            "edge 1e-10, D = 1e-9, 17° off the plane; seed 31",
        ),
        (beside, MEASURED, "the same in a scene of 2"),
    ] {
        let g = mesh(m);
        row.tried(tried);
        for (name, accel) in backends(&g) {
            let seen = one(&g, &*accel, far, 400, 0.3);
            let own = if exact(name) { U } else { own };
            row.line(name, "own barycentrics", seen.raw, own);
            row.line(name, "refined barycentrics", seen.uv, 1e-9);
            row.line(name, "refined distance, relative", seen.t, 1e-9);
            row.line(name, "missed", seen.missed, 0.0);
        }
    }
    row.tried("edge 1e-10, D = 1e-9, 17° off the plane; seed 31");
    derivatives(row, v, far, 0.3, [1e-9, 1e-12]);
    row.note(
        "scenes so small are traced at a common size. In a scene of common size Embree's own \
         barycentrics of so small a triangle are 0, 0; nothing relies on them but opacity",
    );
}

pub fn t10(row: &mut Row) {
    let far = 10.0;
    let flat = [DVec3::ZERO, DVec3::X * 1e6, DVec3::Y * 1e6];
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    for (v, tried) in [
        (
            flat,
            "edge 1e6 in z = 0, D = 10, 17° off the plane; seed 31",
        ),
        (
            flat.map(|p| turn * p),
            "the same turned by 0.7 about (1, 2, 3)",
        ),
    ] {
        let g = mesh(triangle(v));
        row.tried(tried);
        for (name, accel) in backends(&g) {
            let seen = one(&g, &*accel, far, 400, 0.3);
            row.line(name, "own barycentrics", seen.raw, 1e-6);
            // Where the plane is no plane of coordinates, what rounds are places of 1e6.
            let bound = if exact(name) || v == flat {
                2.0 * U
            } else {
                16.0 * U * 1e6 / (0.3 * far)
            };
            row.line(name, "own distance, relative", seen.own, bound);
            row.line(name, "refined barycentrics", seen.uv, 1e-6);
            let bound = if v == flat { 1e-12 } else { 1e-10 };
            row.line(name, "refined distance, relative", seen.t, bound);
            row.line(name, "missed", seen.missed, 0.0);
        }
    }
    row.note(
        "`t` to 2u is more than single precision can tell of a plane that is not one of \
         coordinates: with corners 1e6 away its own distance of 10 is off by up to 16·u·1e6/cos. \
         Nothing relies on it: the refined distance is",
    );
}

pub fn t11(row: &mut Row) {
    let g = mesh(triangle([DVec3::new(-1.0, -1.0, 0.0), DVec3::X, DVec3::Y]));
    for degrees in [1.0f64, 0.01, 1e-4] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        row.tried(format!("{degrees}° off the plane; seed 19"));
        let mut seen = Seen::default();
        for (name, accel) in backends(&g) {
            let [mut t, mut missed] = [Meter::default(); 2];
            let mut rng = Rng::new(19);
            for _ in 0..1000 {
                let a = rng.next_1d() * std::f64::consts::TAU;
                let target = DVec3::new(rng.next_1d() - 0.5, rng.next_1d() - 0.5, 0.0) * 0.1;
                let d = DVec3::new(a.cos() * cos, a.sin() * cos, -sin);
                let ray = ray_to(target - d, target);
                let truth = ExactTriangle::new(ray.origin(), ray.direction(), corners(&g, 0));
                if !truth.inside() {
                    continue;
                }
                if name == "bvh" {
                    seen.triangle(ray.origin(), ray.direction(), corners(&g, 0));
                }
                let hit = accel.intersect(&ray);
                missed.must(hit.is_some_and(|h| h.t >= 0.0));
                if let Some(h) = hit {
                    let want = truth.hit().unwrap()[0];
                    t.see(relative(f64::from(h.t), want));
                    let sp = g.surface_point(&ray, &h);
                    missed.must(relative(sp.distance, want * ray.direction().length()) < 1e-12);
                }
            }
            let bound = if exact(name) {
                U * 1.001
            } else {
                4.0 * U / sin
            };
            row.line(name, "own distance, relative", t, bound);
            row.line(
                name,
                "missed, behind, or refined distance off by 1e-12",
                missed,
                0.0,
            );
        }
        seen.report(row, 1e-15 / sin, 1e-15 / sin);
    }
}

pub fn t12(row: &mut Row) {
    let v = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let g = mesh(triangle(v));
    row.tried("o = (−1, 0.25, 0), d = (1, 0, 0)");
    let ray = Ray::new(DVec3::new(-1.0, 0.25, 0.0), DVec3::X);
    let (o, d) = (
        V3::<f64>::constant(ray.origin()),
        V3::constant(ray.direction()),
    );
    let mut m = Meter::default();
    m.must(plane_hit(o, d, v[0], v[1], v[2], DVec3::Z).is_none());
    row.line("dual", "a hit, or a division by zero", m, 0.0);
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        m.must(accel.intersect(&ray).is_none());
        row.line(name, "hits", m, 0.0);
    }
}

pub fn t15(row: &mut Row) {
    let mut m = triangle([DVec3::ZERO, DVec3::X, DVec3::Y]);
    m.indices = vec![[0, 1, 2], [0, 2, 1], [0, 1, 2]];
    let g = mesh(m);
    row.tried("three triangles in one place, one turned over, from 1; seed 37");
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        let mut rng = Rng::new(37);
        for _ in 0..10_000 {
            let target = DVec3::new(0.45 * rng.next_1d(), 0.45 * rng.next_1d(), 0.0);
            let ray = ray_to(target + on_sphere(&mut rng), target);
            let (a, b) = (accel.intersect(&ray), accel.intersect(&ray));
            m.must(
                a == b
                    && a.is_none_or(|h| {
                        !accel.occluded(&Ray {
                            tmin: h.t * 1.00001,
                            ..ray
                        })
                    }),
            );
        }
        row.line(name, "another answer, or a second hit", m, 0.0);
    }
    deposits::coincident_walls(row);
}
