//! Dual numbers and the forecasts made with them, against the library `num-dual`, exact rationals,
//! finite differences and closed forms.

mod common;

use common::oracle::Oracle;
use dualight::ad::{Dual, Real, V3};
use dualight::geometry::forecast::{Moves, Order, SphereForecast, edge_functions};
use dualight::geometry::{sphere::line_sphere, triangle::plane_hit};
use dualight::math::DVec3;
use dualight::sampling::{Rng, warp};
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};

type D3 = Dual<f64, 3>;

/// A point of the cube of half width `s`, rounded to single precision as scenes are.
fn point(rng: &mut Rng, s: f64) -> DVec3 {
    let mut x = || s * (2.0 * rng.next_1d() - 1.0);
    DVec3::new(x(), x(), x()).as_vec3().as_dvec3()
}

/// The edge functions of a ray and a triangle, with gradients by what moves.
fn edges(o: DVec3, d: DVec3, v: [DVec3; 3], moves: Moves) -> [D3; 3] {
    match moves {
        Moves::Target => edge_functions(V3::constant(o), V3::variable(d), v),
        Moves::Ray => edge_functions(V3::variable(o), V3::constant(d), v),
    }
}

fn close(a: f64, b: f64, scale: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * (scale + b.abs())
}

#[track_caller]
fn same_gradient(what: &str, ours: D3, library: Oracle, tolerance: f64) {
    let g = ours.gradient().unwrap_or_else(|| panic!("{what}: none"));
    let l = library.gradient();
    let size = l.iter().map(|x| x.abs()).fold(0.0, f64::max);
    assert_eq!(ours.value(), library.re(), "{what}");
    for k in 0..3 {
        assert!(close(g[k], l[k], size, tolerance), "{what}: {g:?} {l:?}");
    }
}

#[test]
fn every_operation_agrees_with_the_library() {
    let mut rng = Rng::new(1);
    for _ in 0..20_000 {
        let x = [0, 1, 2].map(|_| 4.0 * rng.next_1d() - 2.0);
        let mine = [0, 1, 2].map(|k| D3::variable(x[k], k));
        let theirs = [0, 1, 2].map(|k| Oracle::variable(x[k], k));
        fn all<R: Real>([x, y, z]: [R; 3]) -> [R; 9] {
            let u = x * y - z;
            [
                x + y,
                u,
                (u / y) / z,
                -u * u,
                (u * u + R::constant(0.5)).sqrt(),
                u.sin_cos().0 * u.sin_cos().1,
                (u * x).exp(),
                u.scale(-3.5),
                u.abs().larger(x),
            ]
        }
        for (i, (a, b)) in all(mine).into_iter().zip(all(theirs)).enumerate() {
            // The library divides by way of the inverse; values differ in the last place.
            assert!(close(a.value(), b.re(), 0.0, 1e-14), "operation {i}");
            let (g, l) = (a.gradient().unwrap(), b.gradient());
            let size = l.iter().map(|x| x.abs()).fold(0.0, f64::max);
            for k in 0..3 {
                assert!(close(g[k], l[k], size, 1e-12), "{i}: {g:?} {l:?}");
            }
        }
    }
}

#[test]
fn intersections_on_duals_agree_with_the_library_and_keep_the_plain_value() {
    let mut rng = Rng::new(2);
    let (mut hits, mut tangent) = (0, 0);
    for _ in 0..100_000 {
        let (c, r) = (point(&mut rng, 1.0), 0.1 + rng.next_1d());
        let o = point(&mut rng, 3.0);
        let d = (c + point(&mut rng, r) - o).as_vec3().as_dvec3();
        let plain = line_sphere(V3::<f64>::constant(o), V3::constant(d), c, r);
        for moving in [false, true] {
            let (mo, md) = if moving {
                (V3::variable(o), V3::constant(d))
            } else {
                (V3::constant(o), V3::variable(d))
            };
            let (lo, ld) = if moving {
                (Oracle::inputs(o), V3::constant(d))
            } else {
                (V3::constant(o), Oracle::inputs(d))
            };
            let mine = line_sphere(mo, md, c, r);
            let theirs = line_sphere(lo, ld, c, r);
            assert_eq!(mine.discriminant.value(), plain.discriminant);
            let g = mine.discriminant.gradient().expect("smooth everywhere");
            let l = theirs.discriminant.gradient();
            let size = l.iter().map(|x| x.abs()).fold(0.0, f64::max);
            for k in 0..3 {
                assert!(close(g[k], l[k], size, 1e-11), "{g:?} {l:?}");
            }
            let (Some(a), Some(b)) = (mine.roots(), theirs.roots()) else {
                assert!(plain.roots().is_none());
                continue;
            };
            for k in 0..2 {
                assert_eq!(a[k].value(), plain.roots().unwrap()[k]);
                if plain.discriminant < 1e-6 {
                    assert!(a[k].gradient().is_none());
                    tangent += 1;
                } else if plain.discriminant > 1e-3 {
                    hits += 1;
                    let (g, l) = (a[k].gradient().unwrap(), b[k].gradient());
                    let size = l.iter().map(|x| x.abs()).fold(0.0, f64::max);
                    for j in 0..3 {
                        assert!(close(g[j], l[j], size, 1e-9), "{g:?} {l:?}");
                    }
                }
            }
            let v = [
                point(&mut rng, 1.0),
                point(&mut rng, 1.0),
                point(&mut rng, 1.0),
            ];
            let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
            let n = e1.cross(e2);
            // Both round; at grazing incidence and on slivers what they round is amplified.
            let thin = n.length() / (e1.length() * e2.length());
            if (d.dot(n) / (d.length() * n.length())).abs() < 1e-2 || thin < 1e-2 {
                continue;
            }
            let a = plane_hit(mo, md, v[0], e1, e2, n).expect("not parallel");
            let b = plane_hit(lo, ld, v[0], e1, e2, n).expect("not parallel");
            for (x, y) in [(a.t, b.t), (a.b1, b.b1), (a.b2, b.b2)] {
                let (g, l) = (x.gradient().unwrap(), y.gradient());
                // Terms of order one may cancel.
                let size = l.iter().map(|x| x.abs()).fold(1.0, f64::max);
                for j in 0..3 {
                    assert!(close(g[j], l[j], size, 1e-11), "{g:?} {l:?}");
                }
            }
            for (x, y) in edge_functions(mo, md, v)
                .into_iter()
                .zip(edge_functions(lo, ld, v))
            {
                same_gradient("edge function", x, y, 1e-14);
            }
        }
    }
    println!("{hits} roots compared");
    // Tangency by chance is rare; the test of signs has it by construction.
    assert!(hits > 50_000, "{hits}, {tangent}");
}

#[test]
fn derivatives_are_those_of_finite_differences() {
    // Central differences: the error is h² times the third derivative, and rounding over h.
    let mut rng = Rng::new(3);
    let h = 1e-5;
    for _ in 0..20_000 {
        let (c, r) = (point(&mut rng, 1.0), 0.3 + rng.next_1d());
        let (o, d) = (
            point(&mut rng, 3.0),
            point(&mut rng, 1.0) + DVec3::splat(0.01),
        );
        let roots = |d: DVec3| line_sphere(V3::<f64>::constant(o), V3::constant(d), c, r);
        if roots(d).discriminant < 0.1 || d.length() < 0.3 {
            continue;
        }
        let dual = line_sphere(V3::constant(o), V3::<D3>::variable(d), c, r);
        let (near, far) = (dual.roots().unwrap(), dual.discriminant.gradient().unwrap());
        for k in 0..3 {
            let e = DVec3::AXES[k] * h;
            let (a, b) = (roots(d + e), roots(d - e));
            let slope = (a.discriminant - b.discriminant) / (2.0 * h);
            assert!(close(far[k], slope, 100.0, 1e-6));
            for (i, t) in near.iter().enumerate() {
                let slope = (a.roots().unwrap()[i] - b.roots().unwrap()[i]) / (2.0 * h);
                let g = t.gradient().unwrap();
                assert!(close(g[k], slope, 1e3, 1e-6), "{g:?} {slope}");
            }
        }
    }
}

/// Exact arithmetic on vectors.
type Q = BigRational;
type Q3 = [Q; 3];

fn q(x: f64) -> Q {
    Q::from_float(x).unwrap()
}

fn q3(v: DVec3) -> Q3 {
    v.to_array().map(q)
}

fn sub(a: &Q3, b: &Q3) -> Q3 {
    [0, 1, 2].map(|k| &a[k] - &b[k])
}

fn dot(a: &Q3, b: &Q3) -> Q {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn cross(a: &Q3, b: &Q3) -> Q3 {
    [0, 1, 2].map(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        &a[i] * &b[j] - &a[j] * &b[i]
    })
}

/// `1 − (b/r)²` without rounding.
fn exact_discriminant(o: DVec3, d: DVec3, c: DVec3, r: f64) -> Q {
    let (f, d) = (sub(&q3(o), &q3(c)), q3(d));
    let m = cross(&f, &d);
    q(1.0) - dot(&m, &m) / (dot(&d, &d) * q(r) * q(r))
}

#[test]
fn the_sign_of_the_discriminant_is_exact_up_to_far_spheres_and_beside_tangency() {
    let mut rng = Rng::new(4);
    let (mut wrong, mut worst, mut textbook) = (0, 0.0f64, 0);
    for ladder in 1..=6 {
        let dist = 10f64.powi(ladder);
        for _ in 0..1500 {
            // The direction to a point beside the sphere, in single precision like every ray.
            let from = warp::sphere(rng.next_2d()) * dist;
            let o = from.as_vec3().as_dvec3();
            let side = warp::sphere(rng.next_2d()).cross(from).normalize() * 1.2 * rng.next_1d();
            let d = (side - o).as_vec3().as_dvec3();
            let exact = exact_discriminant(o, d, DVec3::ZERO, 1.0);
            let forecast = SphereForecast::new(o, d, DVec3::ZERO, 1.0, Moves::Target).unwrap();
            let ours = forecast.discriminant;
            wrong += u32::from((ours >= 0.0) == exact.is_negative());
            let error = (exact - q(ours)).to_f64().unwrap().abs();
            worst = worst.max(error / dist);
            let (of, df) = (o.as_vec3(), d.as_vec3());
            let b = of.dot(df);
            let classic = b * b - df.dot(df) * (of.dot(of) - 1.0);
            textbook += u32::from((classic >= 0.0) != (ours >= 0.0));
        }
    }
    println!(
        "wrong signs of 9000: {wrong}; largest error over distance {worst:.1e}; b² − ac in f32: {textbook}"
    );
    assert_eq!(wrong, 0);
    assert!(worst < 1e-14);
    // Within sixteen units in the last place of an f32 of tangency.
    for k in -16..=16 {
        let b = 1.0 + f64::from(k) * f64::from(f32::EPSILON);
        let o = DVec3::new(b, 0.0, -5.0);
        let f = SphereForecast::new(o, DVec3::Z, DVec3::ZERO, 1.0, Moves::Ray).unwrap();
        assert_eq!(f.discriminant > 0.0, k < 0, "{k}");
        assert_eq!(f.discriminant == 0.0, k == 0, "{k}");
    }
    // Exactly tangent: the gradient is finite, that of the distance does not exist.
    let line = line_sphere(
        V3::<D3>::variable(DVec3::new(1.0, 0.0, -5.0)),
        V3::constant(DVec3::Z),
        DVec3::ZERO,
        1.0,
    );
    assert_eq!(line.discriminant.gradient(), Some([-2.0, 0.0, 0.0]));
    assert!(line.roots().unwrap()[0].gradient().is_none());
}

#[test]
fn gradients_and_edge_functions_match_exact_rationals() {
    let mut rng = Rng::new(5);
    let mut worst = [0.0f64; 3];
    for _ in 0..2000 {
        let (c, r) = (point(&mut rng, 1.0), 0.1 + rng.next_1d());
        let (o, d) = (point(&mut rng, 3.0), point(&mut rng, 1.0));
        let v = [
            point(&mut rng, 1.0),
            point(&mut rng, 1.0),
            point(&mut rng, 1.0),
        ];
        // ∂/∂o of 1 − (b/r)² is −2 perp / r².
        let f = SphereForecast::new(o, d, c, r, Moves::Ray).unwrap();
        let (fq, dq) = (sub(&q3(o), &q3(c)), q3(d));
        let t = dot(&fq, &dq) / dot(&dq, &dq);
        let exact = [0, 1, 2].map(|k| {
            let perp = &fq[k] - &t * &dq[k];
            (q(-2.0) * perp / (q(r) * q(r))).to_f64().unwrap()
        });
        let exact = DVec3::from_array(exact);
        let size = 2.0 * (o - c).length() / (r * r);
        worst[0] = worst[0].max((f.gradient - exact).length() / size);
        // Edge functions and their gradients by the target: a × b.
        let e = edges(o, d, v, Moves::Target);
        for i in 0..3 {
            let (a, b) = (sub(&q3(v[i]), &q3(o)), sub(&q3(v[(i + 1) % 3]), &q3(o)));
            let normal = cross(&a, &b);
            let value = dot(&dq, &normal);
            let size = (v[i] - o).length() * (v[(i + 1) % 3] - o).length();
            let exact = DVec3::from_array(normal.map(|x| x.to_f64().unwrap()));
            let gradient = DVec3::from_array(e[i].gradient().unwrap());
            worst[1] = worst[1].max((gradient - exact).length() / size);
            let off = (value - q(e[i].value())).to_f64().unwrap().abs();
            worst[2] = worst[2].max(off / (size * d.length()));
        }
    }
    println!(
        "largest relative errors: ∇D {:.1e}, ∇U {:.1e}, U {:.1e}",
        worst[0], worst[1], worst[2]
    );
    assert!(worst.iter().all(|&w| w < 1e-12), "{worst:?}");
}

#[test]
fn the_quadratic_forecast_misses_nothing_and_the_linear_one_the_far_rim() {
    let mut rng = Rng::new(6);
    for moves in [Moves::Ray, Moves::Target] {
        for spacing in [0.1, 0.5, 1.0, 2.0] {
            let (mut changes, mut missed, mut exact_missed, mut exact_false) = (0, 0, 0, 0);
            for _ in 0..100_000 {
                // A ray that meets a unit sphere, and a check point beside it.
                let from = warp::sphere(rng.next_2d()) * 5.0;
                let across = warp::sphere(rng.next_2d()).cross(from).normalize();
                let b = across * rng.next_1d().sqrt();
                let turn = warp::sphere(rng.next_2d());
                let h = (turn - from * (turn.dot(from) / 25.0)).normalize() * spacing;
                let (o, d) = match moves {
                    Moves::Ray => (from + b, -from),
                    Moves::Target => (from, b - from),
                };
                let f = SphereForecast::new(o, d, DVec3::ZERO, 1.0, moves).unwrap();
                let (co, cd) = match moves {
                    Moves::Ray => (o + h, d),
                    Moves::Target => (o, d + h),
                };
                let exact = exact_sign(co, cd);
                let here = exact_sign(o, d);
                if exact == 0.0 || here <= 0.0 {
                    continue;
                }
                let changed = exact < 0.0;
                changes += u32::from(changed);
                missed += u32::from(changed && f.meets(h, Order::Linear));
                exact_missed += u32::from(changed && f.meets(h, Order::Quadratic));
                exact_false += u32::from(!changed && !f.meets(h, Order::Quadratic));
            }
            let share = f64::from(missed) / f64::from(changes);
            println!(
                "{moves:?}, check points {spacing} r apart: of {changes} changes the linear \
                 forecast misses {:.1} %, the quadratic {exact_missed}, false alarms {exact_false}",
                100.0 * share
            );
            assert_eq!((exact_missed, exact_false), (0, 0));
            assert!(
                share > 0.03,
                "the linear forecast is better than its theory"
            );
        }
    }
}

/// The sign of `r² − b²` for the unit sphere at the origin, away from rounding.
fn exact_sign(o: DVec3, d: DVec3) -> f64 {
    let m = o.cross(d);
    let q = d.dot(d) - m.dot(m);
    if q.abs() < 1e-12 * d.dot(d) * o.dot(o) {
        0.0
    } else {
        q
    }
}

#[test]
fn the_quadratic_term_is_the_hessian_that_duals_of_duals_find() {
    type Second = Dual<Dual<f64, 3>, 3>;
    let mut rng = Rng::new(7);
    for _ in 0..2000 {
        let (c, r) = (point(&mut rng, 1.0), 0.3 + rng.next_1d());
        let (o, d, h) = (
            point(&mut rng, 3.0),
            point(&mut rng, 1.0),
            point(&mut rng, 0.5),
        );
        let input = |x: f64, k: usize| {
            let ones = [0, 1, 2].map(|i| Dual::constant(f64::from(u8::from(i == k))));
            Second::new(Dual::variable(x, k), ones)
        };
        let od = V3 {
            x: input(o.x, 0),
            y: input(o.y, 1),
            z: input(o.z, 2),
        };
        let line = line_sphere(od, V3::constant(d), c, r);
        let g = line.discriminant.gradient().unwrap();
        let h3 = h.to_array();
        let mut second = line.discriminant.re();
        for i in 0..3 {
            second += g[i].value() * h3[i];
            let row = g[i].gradient().unwrap();
            second += (0..3).map(|j| 0.5 * row[j] * h3[i] * h3[j]).sum::<f64>();
        }
        let f = SphereForecast::new(o, d, c, r, Moves::Ray).unwrap();
        assert!(close(f.at(h, Order::Quadratic), second, 1e2, 1e-12));
    }
}

#[test]
fn edge_functions_forecast_every_crossing_exactly() {
    let mut rng = Rng::new(8);
    let mut changes = 0;
    for _ in 0..10_000 {
        let v = [
            point(&mut rng, 1.0),
            point(&mut rng, 1.0),
            point(&mut rng, 1.0),
        ];
        let (o, target) = (point(&mut rng, 4.0), point(&mut rng, 1.0));
        let h = point(&mut rng, 0.5);
        for moves in [Moves::Ray, Moves::Target] {
            let e = edges(o, target - o, v, moves);
            let meets = |h: DVec3| {
                let at = e.map(|e| {
                    e.value() + DVec3::from_array(e.gradient().unwrap_or([f64::NAN; 3])).dot(h)
                });
                at.iter().all(|x| *x >= 0.0) || at.iter().all(|x| *x <= 0.0)
            };
            let (co, cd) = match moves {
                Moves::Ray => (o + h, target - o),
                Moves::Target => (o, target - o + h),
            };
            let exact: Vec<Q> = (0..3)
                .map(|i| {
                    let (a, b) = (sub(&q3(v[i]), &q3(co)), sub(&q3(v[(i + 1) % 3]), &q3(co)));
                    dot(&q3(cd), &cross(&a, &b))
                })
                .collect();
            // Where rounding could decide, nothing is claimed.
            if exact.iter().any(|e| e.to_f64().unwrap().abs() < 1e-12) {
                continue;
            }
            let inside =
                exact.iter().all(|e| *e > Q::zero()) || exact.iter().all(|e| *e < Q::zero());
            assert_eq!(meets(h), inside);
            changes += u32::from(inside != meets(DVec3::ZERO));
        }
    }
    println!("{changes} crossings");
    assert!(changes > 1000);
}

#[test]
fn decisions_do_not_depend_on_units() {
    let mut rng = Rng::new(9);
    for _ in 0..20_000 {
        let (c, r) = (point(&mut rng, 1.0), 0.1 + rng.next_1d());
        let (o, d, h) = (
            point(&mut rng, 3.0),
            point(&mut rng, 1.0),
            point(&mut rng, 0.3),
        );
        for moves in [Moves::Ray, Moves::Target] {
            let at = |scale: f64, stretch: f64| {
                let f = SphereForecast::new(
                    o * scale,
                    d * (scale * stretch),
                    c * scale,
                    r * scale,
                    moves,
                );
                let h = match moves {
                    Moves::Ray => h * scale,
                    Moves::Target => h * (scale * stretch),
                };
                f.unwrap().at(h, Order::Quadratic)
            };
            // Powers of two change no digit.
            let base = at(1.0, 1.0);
            for (scale, stretch) in [(1024.0, 1.0), (1.0 / 1024.0, 1.0), (1.0, 512.0)] {
                assert_eq!(at(scale, stretch).to_bits(), base.to_bits());
            }
            assert!(close(at(1e3, 1e-3), base, 100.0, 1e-12));
        }
    }
}
