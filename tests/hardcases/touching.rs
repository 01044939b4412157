//! Row S16: two spheres of glass that touch.

use dualight::accel::{ACCELERATORS, Accelerator};
use dualight::color::Rgb;
use dualight::geometry::Ray;
use dualight::math::DVec3;
use dualight::sampling::Rng;
use dualight::scene::{Inside, Scene, SceneBuilder};

use crate::common::{add_room, add_sphere, glass, lambert, light};
use crate::photons::counts;
use crate::report::{Meter, Row};
use crate::scenes::{backends, on_sphere, ray_to};

fn scene() -> Scene {
    let mut b = SceneBuilder::default();
    let glass = b.add_material(&glass(1.5)).unwrap();
    let wall = b.add_material(&lambert("wall", Rgb::splat(0.5))).unwrap();
    add_sphere(&mut b, "left", glass, -DVec3::X, 1.0);
    add_sphere(&mut b, "right", glass, DVec3::X, 1.0);
    add_room(&mut b, wall, 4.0);
    b.add_light(light("point", DVec3::new(0.0, 3.0, 0.0), DVec3::NEG_Y, 1.0));
    b.finish().unwrap()
}

/// Whether a straight path from the air ends in the air at a wall, in as many steps as two
/// spheres may take.
fn sound(scene: &Scene, accel: &dyn Accelerator, mut ray: Ray) -> bool {
    let (d, mut inside) = (ray.direction(), scene.enclosing(ray.origin()));
    if inside != Inside::default() {
        return false;
    }
    for _ in 0..5 {
        let Some(hit) = accel.intersect(&ray) else {
            return false;
        };
        if hit.object.0 > 1 {
            return inside == Inside::default();
        }
        let sp = scene.surface_point(&ray, &hit);
        inside = scene.crossing(inside, &sp).beyond(true);
        ray = sp.spawn(d);
    }
    false
}

pub fn s16(row: &mut Row) {
    let scene = scene();
    row.tried("20000 rays within 4 last places of the point of contact or of x = 0; seed 16");
    for (name, accel) in backends(&scene.geometry) {
        let mut m = Meter::default();
        let mut rng = Rng::new(16);
        for i in 0..20_000 {
            let x = f64::from(i % 9 - 4) * f64::from(f32::EPSILON);
            let (y, z) = match i % 3 {
                0 => (0.0, 0.0),
                1 => (0.01 * rng.next_1d(), 0.0),
                _ => (0.3 * rng.next_1d(), 0.3 * rng.next_1d()),
            };
            let mut out = on_sphere(&mut rng);
            if i % 2 == 0 {
                out = DVec3::new(0.0, out.y, out.z).normalize_or(DVec3::Y);
            }
            // From 2.5 away of a place so near to the middle, the start is in the air.
            let target = DVec3::new(x, y, z);
            let ray = ray_to(target + out * 2.5, target);
            m.must(sound(&scene, &*accel, ray));
        }
        row.line(name, "not in the air at the end, or lost", m, 0.0);
    }
    let mut m = Meter::default();
    for seed in 0..ACCELERATORS.len() as u64 {
        let c = counts(&scene, seed, 20_000);
        let spent = c.flux_absorbed + c.flux_escaped + c.flux_cut;
        m.see((c.flux_emitted - spent).abs() / c.flux_emitted);
        m.see(c.flux_escaped / c.flux_emitted);
    }
    row.tried("20000 photons through every backend; seeds 0 to 2");
    row.line(
        "photons",
        "flux unaccounted for, or lost from a closed room",
        m,
        1e-6,
    );
}
