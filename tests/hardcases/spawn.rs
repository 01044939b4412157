//! Rows S3, S4, T13 and T14: rays that start on what they must not hit again.

use dualight::geometry::Ray;
use dualight::math::DVec3;
use dualight::sampling::Rng;

use crate::bounces;
use crate::exact::ExactSphere;
use crate::report::{Meter, Row, cases};
use crate::scenes::{
    PerPath, backends, corners, icosphere, mesh, on_sphere, ray_to, refined, relative, spheres,
    triangle,
};

/// Radii of spheres, and how far out they lie.
pub const SPHERES: [(f64, f64); 6] = [
    (1e-4, 0.0),
    (1e-2, 1.0),
    (1.0, 0.0),
    (1.0, 1e3),
    (1e2, 1e5),
    (1e4, 1e4),
];

const TRIED: &str = "r = 1e-4 to 1e4, at 0 to 1e5 from the origin; seed 3";

/// Where a sphere of [`SPHERES`] lies.
pub fn place(offset: f64) -> DVec3 {
    (DVec3::new(0.6, -0.48, 0.64) * offset).as_vec3().as_dvec3()
}

fn spawned(row: &mut Row, inward: bool) {
    let n = 100_000u64.div_ceil(SPHERES.len() as u64);
    let mut found = PerPath::<2>::default();
    for (r, offset) in SPHERES {
        let c = place(offset);
        let g = spheres(&[(c, r)]);
        let r = f64::from(r as f32);
        for (name, accel) in backends(&g) {
            let [hits, far] = found.of(name);
            let mut rng = Rng::new(3);
            let before = hits.n;
            // What starts too deep below the surface, or misses, is tried again.
            while hits.n < before + n {
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
                } else if w.dot(sp.ng) < -0.05 {
                    assert!(sp.offset < 1e-2 * r, "a sphere of the table is too far out");
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
    }
    row.tried(TRIED);
    for (name, [hits, far]) in found.into_iter() {
        if inward {
            row.line(name, "far sides missed", hits, 0.0);
            row.line(name, "distance to the far side, relative", far, 1e-5);
        } else {
            row.line(name, "self-hits", hits, 0.0);
        }
    }
}

pub fn s3(row: &mut Row) {
    spawned(row, false);
    bounces::spheres(row);
}

pub fn s4(row: &mut Row) {
    spawned(row, true);
    bounces::chords(row);
}

/// Triangles with every coordinate of a size of its own, from 1e-8 to 1e8, as pbrt has them, each
/// with a point on it.
pub fn wild(count: u64) -> impl Iterator<Item = (dualight::geometry::TriangleMesh, DVec3, u64)> {
    let mut rng = Rng::new(23);
    let mut next = move || {
        loop {
            let mut corner = || {
                let mut c = || (rng.next_1d() - 0.5) * 2.0 * 10f64.powf(16.0 * rng.next_1d() - 8.0);
                DVec3::new(c(), c(), c())
            };
            let mut m = triangle([corner(), corner(), corner()]);
            if m.drop_invalid().total() == 0 {
                let v = m.corners(0);
                return (m, v[0] * 0.3 + v[1] * 0.3 + v[2] * 0.4);
            }
        }
    };
    (0..count).map(move |i| {
        let (m, p) = next();
        (m, p, i)
    })
}

pub fn t13(row: &mut Row) {
    let mut found = PerPath::<1>::default();
    for (m, target, i) in wild(1000) {
        let g = mesh(m);
        let far = corners(&g, 0)
            .map(DVec3::length)
            .into_iter()
            .fold(0.0, f64::max);
        for (name, accel) in backends(&g) {
            let mut rng = Rng::new(23 ^ i << 32);
            let mut seen = (0..100).filter_map(|_| {
                let o = target + on_sphere(&mut rng) * far * 2.0;
                refined(&g, &*accel, &ray_to(o, target))
            });
            // A needle may be missed from everywhere: then there is nothing to start from.
            let Some(sp) = seen.next() else { continue };
            for _ in 0..cases(1000, 200) {
                let again = accel.intersect(&sp.spawn(on_sphere(&mut rng)));
                found.of(name)[0].must(again.is_none());
            }
        }
    }
    row.tried("up to 1000 triangles, each coordinate 1e-8 to 1e8; seed 23");
    for (name, [hits]) in found.into_iter() {
        row.line(name, "self-hits", hits, 0.0);
    }
    bounces::triangles(row);
    row.note("needles so thin that rounding lets every ray to a point on them pass are left out");
}

pub fn t14(row: &mut Row) {
    let g = mesh(icosphere(5, DVec3::ZERO, 1.0));
    row.tried("a convex ball of 20480 triangles, within 1e-6 of an edge; seed 29");
    for (name, accel) in backends(&g) {
        let mut m = Meter::default();
        let mut rng = Rng::new(29);
        let n = g.shapes[0].len() as u64;
        while m.n < cases(1_000_000, 60_000) {
            let v = corners(&g, (rng.next_u64() % n) as u32);
            // Within 1e-6 of an edge.
            let on = v[0] + (v[1] - v[0]) * rng.next_1d();
            let target = on + (v[2] - on) * 1e-6;
            let Some(sp) = refined(&g, &*accel, &Ray::new(target * 3.0, -target)) else {
                continue;
            };
            let w = on_sphere(&mut rng);
            let w = if w.dot(sp.ng) < 0.0 { -w } else { w };
            m.must(accel.intersect(&sp.spawn(w)).is_none());
        }
        row.line(name, "neighbours hit", m, 0.0);
    }
    bounces::balls(row);
}
