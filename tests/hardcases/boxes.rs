//! Rows B1 to B6: boxes, intervals and backends against each other.

use std::sync::Arc;
use std::time::Instant;

use dualight::accel::{ACCELERATORS, Class, CrossCheck};
use dualight::geometry::{Geometry, Hit, Ray, TriangleMesh};
use dualight::math::robust::UNIT_ROUNDOFF as U;
use dualight::math::{DVec3, Vec3};
use dualight::sampling::Rng;
use rayon::prelude::*;

use crate::report::{MEASURED, Meter, Row, cases};
use crate::scenes::{PerPath, backends, ball, exact, in_cube, mesh, plane, spheres};

pub fn b1(row: &mut Row) {
    let g = crate::common::box_scene().geometry;
    let truth = (ACCELERATORS.last().unwrap().build)(&g, 1).unwrap();
    row.tried(
        "origins and directions of 0, −0, ±1 and 0.25: on faces, edges and corners of the box",
    );
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        for i in 0..3usize.pow(6) {
            let pick = |k: u32| [0.0f32, -0.0, 1.0][i / 3usize.pow(k) % 3];
            let at = |k: u32| [-1.0f32, 0.25, 1.0][i / 3usize.pow(k) % 3];
            let d = Vec3::new(pick(0), pick(1), pick(2));
            let ray = Ray {
                o: Vec3::new(at(3), at(4), at(5)),
                d,
                tmin: 0.0,
                tmax: f32::INFINITY,
            };
            let (a, b) = (accel.intersect(&ray), truth.intersect(&ray));
            m.must(a.is_none_or(|h| h.t >= 0.0 && h.t.is_finite()));
            if exact(name) {
                m.must(a == b);
            } else {
                let check = CrossCheck {
                    geometry: &g,
                    subject: &*accel,
                    reference: &*truth,
                };
                m.must(check.intersect(&ray).class != Class::Unexplained);
            }
        }
        row.line(name, "another answer than brute force", m, 0.0);
    }
}

pub fn b2(row: &mut Row) {
    for flat in [false, true] {
        row.tried(if flat {
            "10⁴ triangles in a plane"
        } else {
            "10⁴ triangles in one place"
        });
        let mut m = TriangleMesh::default();
        for i in 0..10_000u32 {
            let x = if flat { (i % 100) as f32 * 2.0 } else { 0.0 };
            let y = if flat { (i / 100) as f32 * 2.0 } else { 0.0 };
            m.positions
                .extend([[x, y, 0.0], [x + 1.0, y, 0.0], [x, y + 1.0, 0.0]]);
            m.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        let g = mesh(m);
        for (name, accel) in backends(&g) {
            let mut m = Meter::default();
            for i in 0..10_000u32 {
                let (x, y) = if flat { (i % 100, i / 100) } else { (0, 0) };
                let at = DVec3::new(f64::from(x) * 2.0 + 0.25, f64::from(y) * 2.0 + 0.25, 1.0);
                let hit = accel.intersect(&Ray::new(at, -DVec3::Z));
                m.must(hit.is_some_and(|h| !flat || h.prim == i));
            }
            row.line(name, "not found", m, 0.0);
        }
    }
    row.note("depth is bounded by construction: 64 at most, and 16 for 4e4 in one place or on a line (src/accel/bvh/build.rs); 1e5 in one place, on one line and in one plane: tests/accel_laws.rs");
}

pub fn b3(row: &mut Row) {
    let g = mesh(ball(40, DVec3::ZERO, 1.0));
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    row.tried("NaN and ±∞ in o, d, tmin, tmax; d = 0; tmin > tmax");
    for (name, accel) in backends(&g) {
        let good = Ray::new(DVec3::ZERO, DVec3::X);
        let mut m = Meter::default();
        let mut rays = vec![
            Ray {
                tmin: 2.0,
                tmax: 1.0,
                ..good
            },
            Ray {
                tmin: f32::NAN,
                ..good
            },
            Ray {
                tmax: f32::NAN,
                ..good
            },
            Ray {
                d: Vec3::ZERO,
                ..good
            },
            Ray {
                tmax: f32::NEG_INFINITY,
                ..good
            },
        ];
        for tmin in [f32::INFINITY, f32::NEG_INFINITY] {
            rays.push(Ray { tmin, ..good });
        }
        for b in bad {
            for k in 0..3 {
                let (mut o, mut d) = (good.o, good.d);
                o[k] = b;
                d[k] = b;
                rays.extend([Ray { o, ..good }, Ray { d, ..good }]);
            }
        }
        for ray in &rays {
            m.must(accel.intersect(ray).is_none() && !accel.occluded(ray));
        }
        row.line(name, "hits", m, 0.0);
        let time = |rays: &[Ray]| {
            (0..5)
                .map(|_| {
                    let start = Instant::now();
                    for i in 0..20_000 {
                        std::hint::black_box(accel.intersect(&rays[i % rays.len()]));
                    }
                    start.elapsed().as_secs_f64()
                })
                .fold(f64::INFINITY, f64::min)
        };
        let mut m = Meter::default();
        m.see(time(&rays) / time(&[good]));
        row.line(name, "time, of that of a good ray", m, 2.5);
    }
}

/// Last places from which on Embree tells on which side of an end a hit lies.
const ROUNDED_ENDS: u32 = 4;

/// Distances with and without a short reciprocal, that single precision holds.
const ENDS: [f32; 7] = [2.0, 3.0, 7.0, 0.1, 1e-3, 12345.678, 3e5];

pub fn b4(row: &mut Row) {
    let ahead = |t: f32| DVec3::Z * -f64::from(t);
    let ball = |z: f64| spheres(&[(DVec3::Z * z, 1.0)]);
    let plane = mesh(plane(1, DVec3::ZERO, 2.0));
    let aside = DVec3::new(0.25, 0.125, 0.0);
    // Where a sphere's poles are is exact at these.
    let whole = || ENDS.into_iter().filter(|t| t.fract() == 0.0 && *t < 10.0);
    let at = |list: Vec<f32>| {
        let list: Vec<String> = list.iter().map(f32::to_string).collect();
        list.join(", ")
    };
    let bodies = [
        (
            format!("a triangle at distances {}", at(ENDS.to_vec())),
            plane,
            aside,
            ENDS.to_vec(),
        ),
        (
            format!("a sphere entered at distances {}", at(whole().collect())),
            ball(1.0),
            DVec3::ZERO,
            whole().collect(),
        ),
        (
            format!("a sphere left at distances {}", at(whole().collect())),
            ball(-1.0),
            DVec3::ZERO,
            whole().collect(),
        ),
    ];
    for (tried, g, aside, distances) in bodies {
        row.tried(tried);
        for (name, accel) in backends(&g) {
            let ask = |ulps: u32| {
                let mut m = Meter::default();
                for t in &distances {
                    let step = |f: fn(f32) -> f32| (0..ulps).fold(*t, |t, _| f(t));
                    let (before, after) = (step(f32::next_down), step(f32::next_up));
                    // A sphere's other side lies 2 away.
                    let (near, far) = ((t - 1.0).max(0.5 * t), t + t.min(1.0));
                    for (tmin, tmax, want) in [
                        (before, far, true),
                        (near, after, true),
                        (before, after, true),
                        (after.next_up(), far, false),
                        (near, before.next_down(), false),
                    ] {
                        let ray = Ray {
                            tmin,
                            tmax,
                            ..Ray::new(aside + ahead(*t), DVec3::Z)
                        };
                        m.must(
                            accel.intersect(&ray).is_some() == want && accel.occluded(&ray) == want,
                        );
                    }
                }
                m
            };
            let ulps = if exact(name) { 0 } else { ROUNDED_ENDS };
            row.line(name, "an end of the segment told wrongly", ask(ulps), 0.0);
            if ulps > 0 {
                row.line(
                    name,
                    "an end told wrongly at its very bits",
                    ask(0),
                    MEASURED,
                );
            }
        }
    }
    row.note(
        "Embree divides by way of an approximate reciprocal, which is another one on each make of \
         processor: on some a distance of 2 comes out as a neighbour of 2, and ends are told by that. \
         They are told right from four last places on",
    );
}

/// The scenes that backends are compared on.
fn compared() -> Vec<Arc<Geometry>> {
    let mut list = vec![
        mesh(plane(60, DVec3::ZERO, 2.0)),
        mesh(plane(3, DVec3::splat(1e4), 200.0)),
        mesh(ball(30, DVec3::ZERO, 1.0)),
        mesh(ball(9, DVec3::splat(1e3), 1.0)),
        mesh(ball(60, DVec3::ZERO, 1e-4)),
        mesh(ball(60, DVec3::ZERO, 1e4)),
        spheres(&[(DVec3::ZERO, 1.0)]),
        spheres(&[(DVec3::X, 1.0), (DVec3::NEG_X, 1.0)]),
    ];
    let mut rng = Rng::new(49);
    let cloud: Vec<_> = (0..300)
        .map(|_| (in_cube(&mut rng), 0.2 * rng.next_1d()))
        .collect();
    list.push(spheres(&cloud));
    list.push(crate::common::box_scene().geometry);
    list
}

pub fn b5(row: &mut Row) {
    let found: Vec<Vec<_>> = compared()
        .into_par_iter()
        .enumerate()
        .map(|(k, g)| {
            let around = g.bounds().bounding_sphere();
            let bvh = ACCELERATORS.iter().find(|e| e.name == "bvh").unwrap();
            let reference = (bvh.build)(&g, 1).unwrap();
            let others = backends(&g).into_iter().filter(|b| b.0 != "bvh");
            others
                .map(|(name, subject)| {
                    let check = CrossCheck {
                        geometry: &g,
                        subject: &*subject,
                        reference: &*reference,
                    };
                    let [mut unexplained, mut same, mut law] = [Meter::default(); 3];
                    let mut rng = Rng::new(50 + k as u64);
                    for _ in 0..cases(1_000_000, 50_000) {
                        let o = around.center + in_cube(&mut rng) * around.radius * 2.0;
                        let ray = Ray::new(o, around.center + in_cube(&mut rng) - o);
                        let f = check.intersect(&ray);
                        unexplained.must(f.class != Class::Unexplained);
                        let of = |h: Option<Hit>| h.map(|h| (h.object, h.prim));
                        let agree = of(f.subject) == of(f.reference);
                        same.must(agree);
                        // At an outline within the bound one of them is behind the other.
                        law.see(match (f.class, f.subject, f.reference) {
                            (Class::Tie, Some(a), Some(b)) if !agree => {
                                let [a, b] = [a.t, b.t].map(f64::from);
                                (a - b).abs() / (8.0 * U * b)
                            }
                            _ => 0.0,
                        });
                    }
                    (name, [unexplained, same, law])
                })
                .collect()
        })
        .collect();
    let mut sum = PerPath::<3>::default();
    for (name, [unexplained, same, law]) in found.into_iter().flatten() {
        let [u, s, l] = sum.of(name);
        u.add(unexplained);
        s.add(same);
        l.n += law.n;
        l.worst = l.worst.max(law.worst);
    }
    row.tried(
        "10 scenes: planes, balls of 1e-4 to 1e4, spheres, the box; from within twice the scene; \
         seeds 50 to 59",
    );
    for (name, [unexplained, same, law]) in sum.into_iter() {
        row.line(name, "unexplained differences from bvh", unexplained, 0.0);
        row.line(
            name,
            "another primitive than bvh, of all",
            same.share(),
            1e-5,
        );
        row.line(
            name,
            "two primitives at one distance, apart in 8u·t",
            law,
            1.0,
        );
    }
    row.note(
        "of 1e7 rays, Embree names another primitive for 20: 17 are hits at one distance, at edges; 3 \
         pass the silhouette of a sphere within its rounding and meet what lies behind, which no bound \
         on distances covers",
    );
    row.note("`dualight compare` does this for whole scenes, with the rays of rendering");
}

/// Without Embree there are no sets to compare.
#[cfg(not(feature = "embree"))]
pub fn b6(_: &mut Row) {}

#[cfg(feature = "embree")]
pub fn b6(row: &mut Row) {
    use crate::scenes::relative;
    use dualight::accel::embree_with_instructions;
    use dualight::math::max_abs;

    let mut rng = Rng::new(61);
    let cloud: Vec<_> = (0..300)
        .map(|_| (in_cube(&mut rng), 0.2 * rng.next_1d()))
        .collect();
    let list = [
        mesh(plane(60, DVec3::ZERO, 2.0)),
        mesh(ball(60, DVec3::ZERO, 1.0)),
        spheres(&cloud),
        crate::common::box_scene().geometry,
    ];
    let exact = list.each_ref().map(|g| {
        let bvh = ACCELERATORS.iter().find(|e| e.name == "bvh").unwrap();
        (bvh.build)(g, 1).unwrap()
    });
    // The smallest set, which every processor has, is what others are held against.
    let base = list
        .each_ref()
        .map(|g| embree_with_instructions("sse2", g).unwrap());
    let mut sets = Vec::new();
    let [mut unexplained, mut own, mut other, mut apart, mut law] = [Meter::default(); 5];
    for set in ["sse2", "sse42", "avx", "avx2", "avx512"] {
        for (k, g) in list.iter().enumerate() {
            // A processor without the set leaves it out.
            let Ok(accel) = embree_with_instructions(set, g) else {
                continue;
            };
            let check = CrossCheck {
                geometry: g,
                subject: &*accel,
                reference: &*exact[k],
            };
            if sets.last() != Some(&set) {
                sets.push(set);
            }
            let around = g.bounds().bounding_sphere();
            let mut rng = Rng::new(62);
            for _ in 0..20_000 {
                let o = around.center + in_cube(&mut rng) * around.radius * 2.0;
                let ray = Ray::new(o, around.center + in_cube(&mut rng) - o);
                let found = check.intersect(&ray);
                unexplained.must(found.class != Class::Unexplained);
                own.see(found.distance);
                let first = base[k].intersect(&ray);
                let name = |h: Option<dualight::geometry::Hit>| h.map(|h| (h.object, h.prim));
                other.must(name(found.subject) == name(first));
                if let (Some(a), Some(b)) = (found.subject, first)
                    && (a.object, a.prim) == (b.object, b.prim)
                {
                    let t = [a.t, b.t].map(f64::from);
                    apart.must(relative(t[0], t[1]) <= 2e-6);
                    // Half of what either bound allows: `own` holds each to its own.
                    let reach = max_abs(ray.origin()) + t[0].abs() * ray.direction().length();
                    let n = g.surface_point(&ray, &a);
                    let slope = n.ng.dot(n.wo).abs();
                    law.see(
                        (t[0] - t[1]).abs() * ray.direction().length() * slope / (16.0 * U * reach),
                    );
                }
            }
        }
    }
    assert!(sets.contains(&"sse2"), "{sets:?}");
    row.tried("20000 rays at a plane, a ball, 300 spheres and the box with each set; seeds 61, 62");
    for (what, meter, bound) in [
        ("unexplained differences from bvh", unexplained, 0.0),
        ("own distance, of its bound", own, 1.0),
        (
            "another primitive than with sse2, of all",
            other.share(),
            1e-5,
        ),
        (
            "own distance farther than 2e-6 from that with sse2, of all",
            apart.share(),
            2e-4,
        ),
        ("own distance from that with sse2, of 16uD/cos", law, 1.0),
    ] {
        row.line("embree", what, meter, bound);
    }
    row.note(
        "each set runs in its own device of one machine; those the processor lacks are left out. sse2, \
         sse42 and avx agree to the bit, avx2 and avx512 fuse multiplications with additions. Distances \
         agree to 2e-6 but for hits so near or so grazing that the rounding of the way there is more",
    );
}
