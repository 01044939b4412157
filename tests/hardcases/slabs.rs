//! Row T16: slabs of glass, down to ones that rounding cannot tell from a single surface.

use dualight::math::DVec3;
use dualight::math::robust::spawn_offset;
use dualight::sampling::Rng;

use crate::deposits;
use crate::report::{MEASURED, Row};
use crate::scenes::{PerPath, backends, mesh, on_sphere, plane, refined};
use dualight::geometry::Ray;

/// Where slabs lie, and how thick they are.
pub const SLABS: [(f64, f64); 6] = [
    (1.0, 1e-2),
    (1.0, 1e-4),
    (1.0, 1e-5),
    (1e3, 1e-2),
    (1e3, 1e-4),
    (1e3, 1e-5),
];

/// Whether a ray that starts off one face of a slab starts before the other one. What is thinner
/// than the offset of its corners is a known limit.
pub fn told_apart(at: f64, thickness: f64) -> bool {
    thickness > 2.0 * spawn_offset(at + 2.0)
}

pub fn t16(row: &mut Row) {
    let [mut thick, mut thin] = [(); 2].map(|()| PerPath::<1>::default());
    for (x, thickness) in SLABS {
        let mut m = plane(2, DVec3::ZERO, 2.0);
        let back = plane(2, DVec3::Z * -thickness, 2.0);
        let n = m.positions.len() as u32;
        m.positions.extend(back.positions);
        let turned = back.indices.iter();
        m.indices
            .extend(turned.map(|[a, b, c]| [a + n, c + n, b + n]));
        for p in &mut m.positions {
            p[0] += x as f32;
        }
        let g = mesh(m);
        for (name, accel) in backends(&g) {
            let list = if told_apart(x, thickness) {
                &mut thick
            } else {
                &mut thin
            };
            let mut rng = Rng::new(43);
            for _ in 0..2000 {
                let target = DVec3::new(
                    x + 0.9 * (rng.next_1d() - 0.5),
                    0.9 * (rng.next_1d() - 0.5),
                    0.0,
                );
                let mut out = on_sphere(&mut rng);
                out.z = out.z.abs().max(0.2);
                let ray = Ray::new(target + out, -out);
                let front = refined(&g, &*accel, &ray);
                let back = front.and_then(|sp| refined(&g, &*accel, &sp.spawn(-out)));
                let ok = front.is_some_and(|f| f.front) && back.is_some_and(|b| !b.front);
                list.of(name)[0].must(ok);
            }
        }
    }
    row.tried("thickness 1e-2, 1e-4, 1e-5 at x = 1, 1e-2 at 1e3; seed 43");
    for (name, [wrong]) in thick.into_iter() {
        row.line(name, "front or back not found in order", wrong, 0.0);
    }
    row.tried("thickness 1e-4 and 1e-5 at x = 1e3; seed 43");
    for (name, [wrong]) in thin.into_iter() {
        row.line(name, "back passed by, of all", wrong.share(), MEASURED);
    }
    deposits::slabs(row);
    row.note(
        "the bound on light is 5.5 standard errors of 1e5 photons; seeds are fixed. Pictures through slabs \
         are compared with the closed form in tests/specular.rs. A slab must \
         be thicker than the spawn offset 16·u·x of its corners, 1e-3 at x = 1000: what is thinner \
         is crossed in one step, and light is reflected once where it should be twice. Import moves \
         a scene to its middle, so that this is a slab of 0.01 mm in a scene of 10 m, or of 1 mm in \
         one of 1 km",
    );
}
