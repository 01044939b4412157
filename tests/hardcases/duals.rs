//! Rows D1 to D6, D9 and D10: derivatives, by a scalar of the tests' own.

use dualight::ad::{Real, V3};
use dualight::geometry::{sphere, triangle};
use dualight::math::DVec3;
use dualight::sampling::Rng;

use crate::dual::{Dual, by, variables};
use crate::exact::{ExactSphere, Q, V};
use crate::report::{Meter, Row};
use crate::scenes::{in_cube, on_sphere};

fn discriminant(o: DVec3, d: DVec3, c: DVec3, r: f64) -> Dual {
    let [vo, vd] = variables(o, d);
    sphere::line_sphere(vo, vd, c, r).discriminant
}

pub fn d1(row: &mut Row) {
    let [mut exact, mut difference, mut edges] = [Meter::default(); 3];
    let mut rng = Rng::new(1);
    for _ in 0..5000 {
        let o = (in_cube(&mut rng) * 5.0).as_vec3().as_dvec3();
        let d = (on_sphere(&mut rng) * (0.5 + rng.next_1d()))
            .as_vec3()
            .as_dvec3();
        let r = f64::from((0.5 + rng.next_1d()) as f32);
        let dual = discriminant(o, d, DVec3::ZERO, r);
        // ∂D/∂o = −2 perp / r², perp = o − d (o·d)/(d·d).
        let (vo, vd) = (V::from(o), V::from(d));
        let s = vo.dot(&vd).over(&vd.dot(&vd));
        let r2 = Q::from(r) * Q::from(r);
        let perp: Vec<f64> = (0..3)
            .map(|k| {
                let p = vo.0[k].clone() - vd.0[k].clone() * s.clone();
                (Q::from(-2.0) * p).over(&r2).to_f64()
            })
            .collect();
        let size = perp.iter().fold(1.0f64, |m, x| m.max(x.abs()));
        for (got, want) in by(&dual).iter().zip(&perp) {
            exact.see((got - want).abs() / size);
        }
        for k in 0..6 {
            let h = 1e-5;
            let at = |s: f64| {
                let (mut o, mut d) = (o, d);
                if k < 3 {
                    o[k] += s
                } else {
                    d[k - 3] += s
                }
                sphere::line_sphere(V3::<f64>::constant(o), V3::constant(d), DVec3::ZERO, r)
                    .discriminant
            };
            let slope = (at(h) - at(-h)) / (2.0 * h);
            difference.see((by(&dual)[k] - slope).abs() / slope.abs().max(size * 10.0));
        }
        let v: [DVec3; 3] = std::array::from_fn(|_| in_cube(&mut rng).as_vec3().as_dvec3());
        let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
        let n = e1.cross(e2);
        if d.dot(n).abs() < 0.1 {
            continue;
        }
        let [vo, vd] = variables(o, d);
        let Some(hit) = triangle::plane_hit(vo, vd, v[0], e1, e2, n) else {
            continue;
        };
        // ∂t/∂o = −n/(d·n), ∂t/∂d = −t n/(d·n).
        for k in 0..3 {
            let want = -n[k] / d.dot(n);
            edges.see((by(&hit.t)[k] - want).abs() / want.abs().max(1.0));
            let want = want * hit.t.value();
            edges.see((by(&hit.t)[k + 3] - want).abs() / want.abs().max(1.0));
        }
    }
    row.line(
        "dual",
        "gradient of the discriminant against exact",
        exact,
        1e-12,
    );
    row.line("dual", "against central differences", difference, 1e-6);
    row.line("dual", "gradient of the plane's distance", edges, 1e-11);
}

pub fn d2(row: &mut Row) {
    let mut m = Meter::default();
    let mut rng = Rng::new(2);
    for _ in 0..2000 {
        let out = on_sphere(&mut rng);
        let side = out.any_orthonormal_vector();
        let o = (out * 1e4).as_vec3().as_dvec3();
        let d = (side * 1.2 * rng.next_1d() - o).as_vec3().as_dvec3();
        let ours = discriminant(o, d, DVec3::ZERO, 1.0).value() >= 0.0;
        m.must(ours == (ExactSphere::new(o, d, DVec3::ZERO, 1.0).discriminant.sign() >= 0));
    }
    row.line("dual", "wrong signs at D/r = 1e4", m, 0.0);
}

pub fn d3(row: &mut Row) {
    let mut m = Meter::default();
    for k in 2..=16 {
        for side in [1.0, -1.0] {
            let b = (1.0 - side * 10f64.powi(-k)).sqrt();
            let dual = discriminant(DVec3::new(b, 0.0, -5.0), DVec3::Z, DVec3::ZERO, 1.0);
            m.must(dual.value().is_finite() && by(&dual).iter().all(|x| x.is_finite()));
            m.must((by(&dual)[0] + 2.0 * b).abs() < 1e-12);
        }
    }
    row.line("dual", "value or gradient not finite or wrong", m, 0.0);
    row.note("the distance itself has no derivative at tangency: predictions use the discriminant");
}

pub fn d4(row: &mut Row) {
    // Parallel light: D(h) = D + grad·h − |h⊥|² exactly, also through the centre.
    let [mut exact, mut sign] = [Meter::default(); 2];
    let mut rng = Rng::new(4);
    for spacing in [0.1, 0.5, 1.0, 2.0, 4.0] {
        for _ in 0..2000 {
            let o = DVec3::new(rng.next_1d() - 0.5, rng.next_1d() - 0.5, -5.0);
            let h = DVec3::new(rng.next_1d() - 0.5, rng.next_1d() - 0.5, 0.0) * spacing;
            let at = |o| discriminant(o, DVec3::Z, DVec3::ZERO, 1.0);
            let here = at(o);
            let linear = by(&here)[0] * h.x + by(&here)[1] * h.y;
            let forecast = here.value() + linear - h.length_squared();
            let there = at(o + h).value();
            exact.see((forecast - there).abs());
            sign.must((forecast >= 0.0) == (there >= 0.0) || there.abs() < 1e-12);
        }
    }
    row.line("dual", "forecast of the discriminant", exact, 1e-12);
    row.line("dual", "signs forecast wrongly", sign, 0.0);
}

pub fn d5(row: &mut Row) {
    let mut m = Meter::default();
    let mut rng = Rng::new(5);
    for _ in 0..5000 {
        let (o, d) = (in_cube(&mut rng) * 5.0, on_sphere(&mut rng));
        let want = discriminant(o, d, DVec3::ZERO, 1.0).value();
        for s in [1e-3, 1e3] {
            let size = 1.0 + o.length_squared();
            m.see((discriminant(o, d * s, DVec3::ZERO, 1.0).value() - want).abs() / size);
            m.see((discriminant(o * s, d, DVec3::ZERO, s).value() - want).abs() / size);
        }
    }
    row.line("dual", "change with the length of d and the unit", m, 1e-12);
}

pub fn d6(row: &mut Row) {
    let mut m = Meter::default();
    let mut rng = Rng::new(6);
    for i in 0..5000 {
        // From outside the near root, from inside the far one.
        let inside = i % 2 == 0;
        let o = on_sphere(&mut rng) * if inside { 0.5 } else { 3.0 };
        let d = on_sphere(&mut rng) * 0.3 - if inside { DVec3::ZERO } else { o };
        let pick = usize::from(inside);
        let f = |o: DVec3| {
            let line =
                sphere::line_sphere(V3::<f64>::constant(o), V3::constant(d), DVec3::ZERO, 1.0);
            Some((line.roots()?[pick], line.discriminant))
        };
        let Some((_, disc)) = f(o) else { continue };
        if disc < 0.05 {
            continue;
        }
        let [vo, vd] = variables(o, d);
        let t = sphere::line_sphere(vo, vd, DVec3::ZERO, 1.0)
            .roots()
            .unwrap()[pick];
        for k in 0..3 {
            let h = 1e-6;
            let mut e = DVec3::ZERO;
            e[k] = h;
            let (Some(a), Some(b)) = (f(o + e), f(o - e)) else {
                continue;
            };
            let slope = (a.0 - b.0) / (2.0 * h);
            m.see((by(&t)[k] - slope).abs() / slope.abs().max(10.0));
        }
    }
    row.line(
        "dual",
        "derivative of the chosen root against differences",
        m,
        1e-6,
    );
}

/// Angle at which parallel light with impact parameter `b` leaves a glass sphere, twice
/// refracted: `2 (θi − θt)`, followed through the code's own intersection.
fn exit_angle<R: Real>(b: R, atan: impl Fn(R, R) -> R) -> R {
    let n = 1.5;
    let zero = R::constant(0.0);
    let o = V3 {
        x: b,
        y: zero,
        z: R::constant(-5.0),
    };
    let mut d = V3 {
        x: zero,
        y: zero,
        z: R::constant(1.0),
    };
    let mut p = o;
    for eta in [n, 1.0 / n] {
        let line = sphere::line_sphere(p, d, DVec3::ZERO, 1.0);
        let roots = line.roots().unwrap();
        let t = if eta == n { roots[0] } else { roots[1] };
        p = p + d * t;
        let normal = if eta == n { p } else { -p };
        let cos = -d.dot(normal);
        let e = R::constant(1.0 / eta);
        let ct = (R::constant(1.0) - (R::constant(1.0) - cos * cos) * e * e).sqrt();
        d = d * e + normal * (cos * e - ct);
    }
    atan(d.x, d.z)
}

pub fn d9(row: &mut Row) {
    let mut m = Meter::default();
    for i in 1..=990 {
        let b = f64::from(i) / 1000.0;
        let angle = exit_angle(Dual::variable(b, 0), |x, z| {
            let (dx, dz) = (by(&x), by(&z));
            let (x, z) = (x.value(), z.value());
            let d = x * x + z * z;
            let slope = |k: usize| (dx[k] * z - dz[k] * x) / d;
            Dual::new(x.atan2(z), std::array::from_fn(slope))
        });
        // Deflection 2(asin b − asin(b/n)), toward the axis.
        let n = 1.5f64;
        let want = -2.0 * (1.0 / (1.0 - b * b).sqrt() - 1.0 / (n * n - b * b).sqrt());
        m.see(((by(&angle)[0] - want) / want).abs());
    }
    row.line("dual", "derivative of the exit angle, relative", m, 1e-9);
}

pub fn d10(row: &mut Row) {
    let mut m = Meter::default();
    let mut rng = Rng::new(10);
    for _ in 0..2000 {
        let s = 1e-20;
        let o = on_sphere(&mut rng) * (5.0 * s);
        let d = on_sphere(&mut rng) * (1.2 * s) - o;
        let (o, d) = (o.as_vec3().as_dvec3(), d.as_vec3().as_dvec3());
        let r = f64::from(s as f32);
        let ours = discriminant(o, d, DVec3::ZERO, r);
        m.must(
            (ours.value() >= 0.0)
                == (ExactSphere::new(o, d, DVec3::ZERO, r).discriminant.sign() >= 0),
        );
    }
    row.line("dual", "wrong signs at r = 1e-20", m, 0.0);
}
