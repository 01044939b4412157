//! Rows R1 to R6: refraction.

use dualight::materials::fresnel::dielectric;
use dualight::math::DVec3;
use dualight::sampling::Rng;

use crate::exact::Q;
use crate::report::{Meter, Row};
use crate::scenes::{backends, in_cube, ray_to, refined, relative};

/// Cosine of refraction and transmittance to 200 bits; `None` under total internal reflection.
fn exact(cos: f64, eta: f64) -> Option<[f64; 2]> {
    let (c, n, one) = (Q::from(cos), Q::from(eta), Q::from(1.0));
    let n2 = n.clone() * n.clone();
    // η² cos²θt = η² − 1 + cos²θi.
    let inner = n2.clone() - one + c.clone() * c.clone();
    if inner.sign() <= 0 {
        return None;
    }
    let nct = inner.sqrt();
    let ct = nct.over(&n);
    let s = c.clone() + nct.clone();
    let p = n * c.clone() + ct.clone();
    let two = Q::from(2.0) * nct * c;
    let t = two.over(&(s.clone() * s)) + two.over(&(p.clone() * p));
    Some([ct.to_f64(), t.to_f64()])
}

pub fn r1(row: &mut Row) {
    row.tried("n = 1.5, θc ± 1e-2 to 1e-7, times 0.01 to 10, 1000 angles each");
    let [mut flag, mut cos_t] = [Meter::default(); 2];
    let eta: f64 = 1.0 / 1.5;
    let critical = eta.asin();
    for k in 2..=7 {
        for side in [-1.0, 1.0] {
            for j in 1..=1000 {
                let angle = critical + side * 10f64.powi(-k) * f64::from(j) / 100.0;
                let cos = angle.cos();
                let f = dielectric(cos, eta);
                let want = exact(cos, eta);
                flag.must((f.cos_t > 0.0) == want.is_some());
                if let Some([ct, _]) = want {
                    cos_t.see((f.cos_t - ct).abs());
                }
            }
        }
    }
    row.line("materials", "total reflection told wrongly", flag, 0.0);
    row.line(
        "materials",
        "cosine of refraction",
        cos_t,
        2.0 * f64::EPSILON.sqrt(),
    );
    slopes(row);
    row.note(
        "the derivative of the refracted direction is `cos θi / (η cos θt)`: its own error is ε/cos²θt, \
         as that of any double-precision cosine near its root. Below cos²θt = 1e-9 it is none, and \
         the ray keeps the spread it came with. Derivatives through two refractions: D9",
    );
}

/// How the refracted direction turns with the direction, next to the critical angle.
fn slopes(row: &mut Row) {
    use dualight::geometry::{Differential, Ray};
    let g = crate::scenes::mesh(crate::scenes::plane(1, DVec3::ZERO, 100.0));
    row.tried("the same, 100 angles each");
    let [mut slope, mut mirrored] = [Meter::default(); 2];
    let eta: f64 = 1.0 / 1.5;
    let critical = eta.asin();
    let exact_accel = backends(&g).pop().unwrap().1;
    for k in 2..=7 {
        for side in [-1.0, 1.0] {
            for j in 1..=100 {
                let angle = critical + side * 10f64.powi(-k) * f64::from(j) / 10.0;
                let (sin, cos) = angle.sin_cos();
                let ray = Ray::new(DVec3::new(0.3, 0.2, 2.0), DVec3::new(sin, 0.0, -cos));
                let hit = exact_accel.intersect(&ray).unwrap();
                let sp = g.surface_point(&ray, &hit);
                let cos = sp.wo.dot(sp.n);
                let turn = DVec3::new(cos, 0.0, (1.0 - cos * cos).sqrt());
                let bundle = Differential {
                    origin: [DVec3::ZERO; 2],
                    direction: [turn, DVec3::Y],
                };
                let landing = bundle.land(&g, &ray, &sp).unwrap();
                let tangent = -sp.wo + sp.n * cos;
                let Some([ct, _]) = exact(cos, eta) else {
                    let out = landing.follow(&sp, sp.n * cos + tangent);
                    mirrored.see((out.direction[0].length() - turn.length()).abs());
                    continue;
                };
                let out = landing.follow(&sp, tangent / eta - sp.n * ct);
                let got = out.direction[0];
                let want = turn.length() * cos / (eta * ct);
                slope.see(relative(got.length(), want) * ct * ct / f64::EPSILON);
            }
        }
    }
    row.line("dual", "derivative of refraction, in ε/cos²θt", slope, 16.0);
    row.line("dual", "derivative of reflection", mirrored, 1e-14);
}

pub fn r2(row: &mut Row) {
    row.tried("η = 1 + 1e-6, 1.33, 1.5, 2.4, 2/3; cos = 1 to 1e-10, 121 each");
    let [mut t, mut sum] = [Meter::default(); 2];
    for eta in [1.0 + 1e-6, 1.33, 1.5, 2.4, 1.0 / 1.5] {
        for k in 0..=120 {
            let cos = 10f64.powf(-f64::from(k) / 12.0);
            let f = dielectric(cos, eta);
            if let Some([_, want]) = exact(cos, eta) {
                t.see(relative(f.transmittance, want));
            }
            sum.see((f.reflectance + f.transmittance - 1.0).abs());
            sum.see(if (0.0..=1.0 + 1e-15).contains(&f.reflectance) {
                0.0
            } else {
                1.0
            });
        }
    }
    row.line("materials", "transmittance, relative", t, 1e-5);
    row.line("materials", "R + T − 1", sum, 2e-15);
}

pub fn r3(row: &mut Row) {
    row.tried("η = 1, 1 + 1e-6, 1.33, 1.5, 2.4");
    let mut m = Meter::default();
    for eta in [1.0, 1.0 + 1e-6, 1.33, 1.5, 2.4] {
        let want = ((eta - 1.0) / (eta + 1.0f64)).powi(2);
        m.see((dielectric(1.0, eta).reflectance - want).abs());
    }
    let straight = dielectric(0.3, 1.0);
    m.see((straight.cos_t - 0.3).abs());
    m.see(straight.reflectance);
    row.line("materials", "reflectance; direction at n = 1", m, 1e-15);
}

pub fn r4(row: &mut Row) {
    row.tried("cos 0 to 1, η 1 to 3; seed 4");
    let mut m = Meter::default();
    let mut rng = Rng::new(4);
    for _ in 0..100_000 {
        let (cos, eta) = (rng.next_1d(), 1.0 + 2.0 * rng.next_1d());
        let f = dielectric(cos, eta);
        m.see((f.reflectance - dielectric(f.cos_t, 1.0 / eta).reflectance).abs());
    }
    // Coming back, the cosine is that of a root: near grazing it has half of the digits.
    row.line("materials", "reflectance there and back", m, 1e-7);
    row.note(
        "the way back starts from a cosine that a root has rounded; at grazing incidence that \
         moves the reflectance by up to the root of the rounding",
    );
}

pub fn r5(row: &mut Row) {
    use crate::common::{add_sphere, glass, lambert, light};
    row.tried("a light in a cube of glass, 300 photons through every backend; seeds 0 to 2");
    let mut m = Meter::default();
    let mut b = dualight::scene::SceneBuilder::default();
    let glass = b.add_material(&glass(1.5)).unwrap();
    let wall = b
        .add_material(&lambert("wall", dualight::color::Rgb::splat(0.5)))
        .unwrap();
    // Fronts outward: the room's sides are those of a cube seen from within.
    let h = 0.5;
    for axis in 0..3 {
        for side in [1.0, -1.0] {
            let e = |k: usize| DVec3::AXES[(axis + k) % 3];
            let (e1, e2) = if side > 0.0 {
                (e(1), e(2))
            } else {
                (e(2), e(1))
            };
            let corner = (e(0) * side - e(1) - e(2)) * h;
            crate::common::add_quad(
                &mut b,
                "cube",
                glass,
                corner,
                e1 * (2.0 * h),
                e2 * (2.0 * h),
            );
        }
    }
    add_sphere(&mut b, "floor", wall, DVec3::NEG_Y * 3.0, 1.0);
    b.add_light(light("point", DVec3::new(0.1, 0.07, 0.03), DVec3::Y, 1.0));
    let scene = b.finish().unwrap();
    for (i, _) in dualight::accel::ACCELERATORS.iter().enumerate() {
        let c = crate::photons::counts(&scene, i as u64, 300);
        let spent = c.flux_absorbed + c.flux_escaped + c.flux_cut;
        m.see((c.flux_emitted - spent).abs() / c.flux_emitted);
    }
    row.line("photons", "flux unaccounted for", m, 1e-9);
    // Six cones of the sphere leave the cube; what is in none of them never does.
    let trapped = 1.0 - 3.0 * (1.0 - (1.0 - 1.0 / (1.5f64 * 1.5)).sqrt());
    let [mut books, mut cut] = [Meter::default(); 2];
    for (i, _) in dualight::accel::ACCELERATORS.iter().enumerate() {
        let c = crate::photons::counts_to(&scene, i as u64, 10_000, 64);
        let spent = c.flux_absorbed + c.flux_escaped + c.flux_cut;
        books.see((c.flux_emitted - spent).abs() / c.flux_emitted);
        cut.see((c.flux_cut / c.flux_emitted - trapped).abs());
    }
    row.tried(
        "the same, ended at the 64th surface, 10⁴ photons through every backend; seeds 0 to 2",
    );
    row.line("photons", "flux unaccounted for", books, 1e-9);
    row.line(
        "photons",
        "share cut off, against that of directions that no face lets out",
        cut,
        0.01,
    );
}

pub fn r6(row: &mut Row) {
    let cube = {
        let mut m = dualight::geometry::TriangleMesh::default();
        for k in 0..8u32 {
            m.positions
                .push([0, 1, 2].map(|i| if k >> i & 1 == 0 { -1.0 } else { 1.0 }));
        }
        for [a, b, c, d] in [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ] {
            m.indices.extend([[a, b, c], [a, c, d]]);
        }
        m
    };
    let g = crate::scenes::mesh(cube.clone());
    row.tried("the edge x = y = 1 and one last place aside, from within 30°; seed 6");
    for (name, accel) in backends(&g) {
        let [mut found, mut unit] = [Meter::default(); 2];
        let mut rng = Rng::new(6);
        for i in 0..20_000 {
            let x = (1.0f32 + [-1.0, 0.0, 1.0][i % 3] * f32::EPSILON).into();
            let target = DVec3::new(x, 1.0, 1.8 * (rng.next_1d() - 0.5));
            let out = (DVec3::new(1.0, 1.0, 0.0) + in_cube(&mut rng) * 0.4).normalize();
            let ray = ray_to(target + out * 3.0, target);
            let Some(sp) = refined(&g, &*accel, &ray) else {
                // One last place beside the edge a ray from here still runs into the cube.
                found.must(false);
                continue;
            };
            found.must(sp.ng == DVec3::X || sp.ng == DVec3::Y);
            let f = dielectric(sp.wo.dot(sp.ng), 1.5);
            let t = -sp.wo / 1.5 + sp.ng * (sp.wo.dot(sp.ng) / 1.5 - f.cos_t);
            unit.see((t.length() - 1.0).abs());
        }
        row.line(name, "neither of the two faces", found, 0.0);
        row.line(name, "length of the refracted direction", unit, 1e-12);
    }
    crate::bounces::edge(row, &cube);
}
