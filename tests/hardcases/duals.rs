//! Rows D1 to D6, D9 and D10: derivatives, by a scalar of the tests' own.

use dualight::accel::ACCELERATORS;
use dualight::ad::{Real, V3};
use dualight::geometry::{Ray, ScenePatches, sphere, triangle};
use dualight::math::{DQuat, DVec3};
use dualight::sampling::{Rng, hash2};
use rayon::prelude::*;

use crate::dual::{Dual, by, variables};
use crate::exact::{ExactSphere, Q, V};
use crate::flushed::Flushed;
use crate::report::{MEASURED, Meter, Row, cases};
use crate::scenes::{in_cube, on_sphere, spheres};

fn discriminant(o: DVec3, d: DVec3, c: DVec3, r: f64) -> Dual {
    let [vo, vd] = variables(o, d);
    sphere::line_sphere(vo, vd, c, r).discriminant
}

/// How far a gradient is from the exact one, relative to its length.
fn apart(got: [f64; 6], want: [f64; 6]) -> f64 {
    let length = |v: [f64; 6]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    length(std::array::from_fn(|k| got[k] - want[k])) / length(want)
}

/// The gradient by central differences of a function of a ray.
fn differences(o: DVec3, d: DVec3, h: f64, f: impl Fn(DVec3, DVec3) -> f64) -> [f64; 6] {
    std::array::from_fn(|k| {
        let at = |s: f64| {
            let (mut o, mut d) = (o, d);
            if k < 3 {
                o[k] += s
            } else {
                d[k - 3] += s
            }
            f(o, d)
        };
        (at(h) - at(-h)) / (2.0 * h)
    })
}

/// `∂D/∂o = −2 perp / r²` and `∂D/∂d = 2 s perp / r²`, with `s = (o·d)/(d·d)` and
/// `perp = o − s d`, exactly.
fn exact_discriminant(o: DVec3, d: DVec3, r: f64) -> [f64; 6] {
    let (vo, vd) = (V::from(o), V::from(d));
    let s = vo.dot(&vd).over(&vd.dot(&vd));
    let r2 = Q::from(r) * Q::from(r);
    std::array::from_fn(|k| {
        let perp = vo.0[k % 3].clone() - vd.0[k % 3].clone() * s.clone();
        let twice = Q::from(2.0) * perp;
        let slope = if k < 3 { -twice } else { twice * s.clone() };
        slope.over(&r2).to_f64()
    })
}

/// Gradients of the distance and of the weights of the second and third corner, exactly. The
/// hit moves by `I − d nᵀ/(d·n)` with the origin, by `t` times that with the direction; a weight
/// is a linear function of the hit.
fn exact_weights(o: DVec3, d: DVec3, v: [DVec3; 3]) -> [[f64; 6]; 3] {
    let [o, d] = [o, d].map(V::from);
    let v = v.map(V::from);
    let (e1, e2) = (v[1].sub(&v[0]), v[2].sub(&v[0]));
    let n = e1.cross(&e2);
    let dn = d.dot(&n);
    let t = v[0].sub(&o).dot(&n).over(&dn);
    let of = |by_origin: [Q; 3]| -> [f64; 6] {
        std::array::from_fn(|k| {
            let slope = by_origin[k % 3].clone();
            if k < 3 {
                slope.to_f64()
            } else {
                (slope * t.clone()).to_f64()
            }
        })
    };
    let weight = |g: V| {
        let (nn, gd) = (n.dot(&n), g.dot(&d));
        // (g − n (g·d)/(d·n)) / |n|²
        std::array::from_fn(|k| {
            (g.0[k].clone() * dn.clone() - n.0[k].clone() * gd.clone())
                .over(&(dn.clone() * nn.clone()))
        })
    };
    let distance = std::array::from_fn(|k| (-n.0[k].clone()).over(&dn));
    [
        of(distance),
        of(weight(e2.cross(&n))),
        of(weight(n.cross(&e1))),
    ]
}

pub fn d1(row: &mut Row) {
    let n = cases(100_000, 20_000);
    let found: Vec<[Meter; 4]> = (0..n.div_ceil(500))
        .into_par_iter()
        .map(|block| {
            let mut meters = [Meter::default(); 4];
            let mut rng = Rng::new(hash2(1, block));
            for _ in 0..500 {
                gradients(&mut rng, &mut meters);
            }
            meters
        })
        .collect();
    let meters: [Meter; 4] = std::array::from_fn(|k| {
        found.iter().fold(Meter::default(), |a, m| Meter {
            n: a.n + m[k].n,
            worst: a.worst.max(m[k].worst),
        })
    });
    row.tried(
        "o within 5, |d| = 0.5 to 1.5, r = 0.5 to 1.5; corners within 1, 3° off the plane; seed 1",
    );
    let [sphere, weights, by_sphere, by_weights] = meters;
    for (what, meter, bound) in [
        ("gradient of the discriminant, against exact", sphere, 1e-12),
        ("gradients of t, V, W, against exact", weights, 1e-12),
        ("of the discriminant, against differences", by_sphere, 1e-6),
        ("of t, V, W, against differences", by_weights, 1e-6),
    ] {
        row.line("dual", what, meter, bound);
    }
    row.note(
        "V and W are those over U + V + W, the weights of two corners; that of the third is what \
         they leave of one. A gradient is that by all six numbers of a ray, and errors are \
         relative to its length. Differences are tried from 17° off the plane on, where their own \
         error is small enough",
    );
}

/// One ray of [`d1`] at a sphere and at a triangle.
fn gradients(rng: &mut Rng, [sphere, weights, by_sphere, by_weights]: &mut [Meter; 4]) {
    let f32s = |v: DVec3| v.as_vec3().as_dvec3();
    let o = f32s(in_cube(rng) * 5.0);
    let d = f32s(on_sphere(rng) * (0.5 + rng.next_1d()));
    let r = f64::from((0.5 + rng.next_1d()) as f32);
    let got = by(&discriminant(o, d, DVec3::ZERO, r));
    sphere.see(apart(got, exact_discriminant(o, d, r)));
    let plain = |o, d| {
        sphere::line_sphere(V3::<f64>::constant(o), V3::constant(d), DVec3::ZERO, r).discriminant
    };
    by_sphere.see(apart(differences(o, d, 1e-5, plain), got));
    let v: [DVec3; 3] = std::array::from_fn(|_| f32s(in_cube(rng)));
    let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
    let n = e1.cross(e2);
    let cos = d.dot(n).abs() / (d.length() * n.length());
    if cos < 0.05 || n.length() < 0.05 {
        return;
    }
    let [vo, vd] = variables(o, d);
    let hit = triangle::plane_hit(vo, vd, v[0], e1, e2, n).unwrap();
    let want = exact_weights(o, d, v);
    for (k, dual) in [hit.t, hit.b1, hit.b2].iter().enumerate() {
        weights.see(apart(by(dual), want[k]));
        if cos > 0.3 {
            let plain = |o, d| {
                let (o, d) = (V3::<f64>::constant(o), V3::constant(d));
                let hit = triangle::plane_hit(o, d, v[0], e1, e2, n).unwrap();
                [hit.t, hit.b1, hit.b2][k]
            };
            by_weights.see(apart(differences(o, d, 1e-5, plain), want[k]));
        }
    }
}

pub fn d2(row: &mut Row) {
    let [mut ours, mut classic, mut single] = [Meter::default(); 3];
    let mut rng = Rng::new(2);
    for i in 0..20_000 {
        let out = on_sphere(&mut rng);
        let side = out.any_orthonormal_vector();
        let o = (out * 1e4).as_vec3();
        // Anywhere, and where it is hard to tell.
        let b = if i % 2 == 0 {
            1.2 * rng.next_1d()
        } else {
            1.0 + (rng.next_1d() - 0.5) * 10f64.powf(-1.0 - 9.0 * rng.next_1d())
        };
        let d = (side * b - o.as_dvec3()).as_vec3();
        let want = ExactSphere::new(o.as_dvec3(), d.as_dvec3(), DVec3::ZERO, 1.0);
        let want = want.discriminant.sign() >= 0;
        let got = discriminant(o.as_dvec3(), d.as_dvec3(), DVec3::ZERO, 1.0);
        ours.must((got.value() >= 0.0) == want);
        let half = o.dot(d);
        single.must((half * half - d.dot(d) * (o.dot(o) - 1.0) >= 0.0) == want);
        let (o, d) = (o.as_dvec3(), d.as_dvec3());
        let half = o.dot(d);
        classic.must((half * half - d.dot(d) * (o.dot(o) - 1.0) >= 0.0) == want);
    }
    row.tried("D/r = 1e4, half with b ≤ 1.2 r, half with |b/r − 1| ≤ 5e-2 to 5e-11; seed 2");
    row.line("dual", "wrong signs", ours, 0.0);
    row.line(
        "f64",
        "wrong signs of b² − ac, of all",
        classic.share(),
        MEASURED,
    );
    row.line(
        "f32",
        "wrong signs of b² − ac, of all",
        single.share(),
        MEASURED,
    );
}

pub fn d3(row: &mut Row) {
    let [mut finite, mut value, mut flag] = [Meter::default(); 3];
    let mut rng = Rng::new(3);
    for k in 2..=16 {
        for side in [1.0, -1.0] {
            for i in 0..200 {
                let b = (1.0 - side * 10f64.powi(-k)).sqrt();
                // Along the axis, where numbers are exact, and turned.
                let turn = if i == 0 {
                    DQuat::IDENTITY
                } else {
                    DQuat::from_rotation_arc(DVec3::X, on_sphere(&mut rng))
                };
                let [o, d] = [DVec3::new(b, 0.0, -5.0), DVec3::Z].map(|v| turn * v);
                let [vo, vd] = variables(o, d);
                let line = sphere::line_sphere(vo, vd, DVec3::ZERO, 1.0);
                let dual = line.discriminant;
                finite.must(dual.value().is_finite() && by(&dual).iter().all(|x| x.is_finite()));
                value.see((dual.value() - exact_value(o, d)).abs());
                value.see(apart(by(&dual), exact_discriminant(o, d, 1.0)));
                // Beyond the rounding of the discriminant itself.
                let close = dual.value() < 1e-6;
                flag.must(match line.roots() {
                    None => dual.value() < 0.0,
                    Some(roots) => roots.iter().all(|t| t.gradient().is_none() == close),
                });
            }
        }
    }
    row.tried("D/r² = ±1e-2 to ±1e-16, 200 directions each; seed 3");
    row.line("dual", "value or gradient not finite", finite, 0.0);
    row.line("dual", "value and gradient, against exact", value, 1e-14);
    row.line(
        "dual",
        "distances with a derivative below 1e-6, or without one above",
        flag,
        0.0,
    );
    row.note("the distance itself has no derivative at tangency: predictions use the discriminant");
}

/// `D/r²` at the unit sphere, exactly.
fn exact_value(o: DVec3, d: DVec3) -> f64 {
    let (vo, vd) = (V::from(o), V::from(d));
    let (dd, od) = (vd.dot(&vd), vo.dot(&vd));
    let b2 = (vo.dot(&vo) * dd.clone() - od.clone() * od).over(&dd);
    (Q::from(1.0) - b2).to_f64()
}

pub fn d4(row: &mut Row) {
    // Parallel light: D(h) = D + grad·h − |h⊥|² exactly, also through the centre.
    row.tried("parallel light, b ≤ 0.7 r, spacing 0.1, 0.5, 1, 2, 4 r, 2000 each; seed 4");
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
    row.tried("d and scene times 1e-3 and 1e3, 5000 rays; seed 5");
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
    row.tried("from inside and outside, D/r² > 0.05; seed 6");
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
    row.tried("rays from either side of a sphere's surface, down to 1e-6 r from it; seed 61");
    row.line(
        "emission",
        "the root switches, and what is met counts as the same",
        switches(),
        0.0,
    );
}

/// Rays along one line from just outside and from just inside a sphere: near root and far root. A cell of
/// an emission is divided where its rays meet different things.
fn switches() -> Meter {
    let g = spheres(&[(DVec3::ZERO, 1.0)]);
    let accel = (ACCELERATORS[0].build)(&g, 1).unwrap();
    let patches = ScenePatches::new(&g);
    let mut m = Meter::default();
    let mut rng = Rng::new(61);
    for i in 0..3000 {
        let p = on_sphere(&mut rng);
        let d = (on_sphere(&mut rng) * 0.9 - p).normalize();
        let off = 10f64.powi(-1 - i % 6);
        let met = [p * (1.0 + off), p * (1.0 - off)].map(|o| {
            let ray = Ray::new(o, d);
            let hit = accel.intersect(&ray)?;
            Some(patches.id(&g, ray.origin(), ray.direction(), &hit))
        });
        // The one that misses is another thing as well.
        m.must(met[0] != met[1] && met[1].is_some());
    }
    m
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
    row.tried("n = 1.5, b = 0.001 to 0.99 r");
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
    let [mut wrong, mut flushed] = [Meter::default(); 2];
    let mut rng = Rng::new(10);
    let r = f64::from(1e-20f32);
    for _ in 0..20_000 {
        let f32s = |v: DVec3| v.as_vec3().as_dvec3();
        let c = f32s(in_cube(&mut rng) * 1e-22);
        let o = f32s(on_sphere(&mut rng) * (5.0 * r));
        let d = f32s(on_sphere(&mut rng) * (1.2 * r) - o);
        let ours = discriminant(o, d, c, r).value();
        wrong.must((ours >= 0.0) == (ExactSphere::new(o, d, c, r).discriminant.sign() >= 0));
        let zero = V3::<Flushed>::constant(o);
        let line = sphere::line_sphere(zero, V3::constant(d), c, r);
        let same = line.discriminant.re().to_bits() == ours.to_bits();
        flushed.must(same);
    }
    row.tried("r = 1e-20, D = 5 r, centre within 1e-22; seed 10");
    row.line("dual", "wrong signs", wrong, 0.0);
    row.line(
        "dual",
        "another value where denormal numbers are zero",
        flushed,
        0.0,
    );
    row.note(
        "Rust forbids to switch a processor's treatment of denormal numbers; a scalar that takes \
         them for zero in every operation stands for it. In double precision nothing here is as \
         small as 1e-308",
    );
}
