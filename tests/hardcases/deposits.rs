//! What rows on geometry ask of photons: that they are stored once, where they should be.

use dualight::accel::ACCELERATORS;
use dualight::color::Rgb;
use dualight::lights::LightDesc;
use dualight::math::DVec3;
use dualight::photons::{PhotonClass, PhotonMaps};
use dualight::scene::{Scene, SceneBuilder};

use crate::bounces::hold_place;
use crate::common::{add_quad, add_room, add_sphere, glass, lambert, light};
use crate::photons::trace;
use crate::report::{MEASURED, Meter, Row};
use crate::slabs::{SLABS, told_apart};

fn scene(f: impl FnOnce(&mut SceneBuilder)) -> Scene {
    let mut b = SceneBuilder::default();
    f(&mut b);
    b.finish().unwrap()
}

/// Global photons through every backend.
fn each(scene: &Scene, photons: u64) -> impl Iterator<Item = PhotonMaps> {
    (0..ACCELERATORS.len() as u64).map(move |seed| trace(scene, seed, photons))
}

/// Share of the flux that is in none of the books.
fn unaccounted(maps: &PhotonMaps) -> f64 {
    let c = &maps.global_counts;
    let spent = c.flux_absorbed + c.flux_escaped + c.flux_cut;
    (c.flux_emitted - spent).abs() / c.flux_emitted
}

/// Flux of the stored photons of a class, of all that is emitted.
fn stored(maps: &PhotonMaps, class: PhotonClass) -> f64 {
    let map = maps.global.as_ref().unwrap();
    let of_class = map.photons().iter().filter(|p| p.class == class);
    let sum: f64 = of_class.map(|p| p.power()).map(|c| c.r + c.g + c.b).sum();
    sum / maps.global_counts.flux_emitted
}

/// S9: a sphere of 0.1 seen from 1e7, a grey one beside it.
pub fn specks(row: &mut Row) {
    let scene = scene(|b| {
        let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
        add_sphere(b, "speck", grey, DVec3::X, 0.1);
        add_sphere(b, "far", grey, DVec3::X * 1e7, 1e3);
        add_sphere(b, "near", grey, DVec3::NEG_Y * 2.0, 1.0);
        b.add_light(light("point", DVec3::ZERO, DVec3::Y, 1.0));
    });
    let mut m = Meter::default();
    for maps in each(&scene, 10_000) {
        m.see(unaccounted(&maps));
    }
    row.tried("10⁴ photons through every backend; seeds 0 to 2");
    row.line("photons", "flux unaccounted for", m, 1e-9);
}

/// S14: light within two shells, the inner of index 1. Whatever leaves the inner one must meet
/// the outer one, also on its way back.
pub fn shells(row: &mut Row) {
    let mut m = Meter::default();
    for gap in [1e-3, 4e-5, 1e-5] {
        let scene = scene(|b| {
            let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
            let clear = b.add_material(&glass(1.0)).unwrap();
            add_sphere(b, "inner", clear, DVec3::ZERO, 1.0);
            add_sphere(b, "outer", grey, DVec3::ZERO, 1.0 + gap);
            b.add_light(light("point", DVec3::ZERO, DVec3::Y, 1.0));
        });
        for maps in each(&scene, 10_000) {
            m.see(unaccounted(&maps));
            m.see(maps.global_counts.flux_escaped);
        }
    }
    row.tried("light within each of these shells, 10⁴ photons through every backend; seeds 0 to 2");
    row.line(
        "photons",
        "flux unaccounted for, or lost from the shells",
        m,
        1e-9,
    );
}

/// Light in a closed body that is there twice: all of it is stored once at first.
fn once(row: &mut Row, scene: &Scene) {
    let [mut first, mut lost] = [Meter::default(); 2];
    for maps in each(scene, 10_000) {
        first.see((stored(&maps, PhotonClass::Direct) - 1.0).abs());
        lost.see(unaccounted(&maps));
        lost.see(maps.global_counts.flux_escaped);
    }
    row.tried("light inside, 10⁴ photons through every backend; seeds 0 to 2");
    row.line(
        "photons",
        "flux stored at first, of the light's",
        first,
        1e-6,
    );
    row.line("photons", "flux unaccounted for, or lost", lost, 1e-9);
}

/// S15: the sphere around the light is there twice.
pub fn coincident_spheres(row: &mut Row) {
    once(
        row,
        &scene(|b| {
            let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
            for name in ["one", "other"] {
                add_sphere(b, name, grey, DVec3::ZERO, 1.0);
            }
            b.add_light(light("point", DVec3::X * 0.3, DVec3::Y, 1.0));
        }),
    );
}

/// T15: the room around the light is there twice, and once more with its faces turned.
pub fn coincident_walls(row: &mut Row) {
    once(
        row,
        &scene(|b| {
            let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
            add_room(b, grey, 1.0);
            add_room(b, grey, 1.0);
            for axis in 0..3 {
                for side in [1.0, -1.0] {
                    let e = |k: usize| DVec3::AXES[(axis + k) % 3];
                    let (e1, e2) = if side > 0.0 {
                        (e(1), e(2))
                    } else {
                        (e(2), e(1))
                    };
                    let corner = e(0) * side - e(1) - e(2);
                    add_quad(b, "turned", grey, corner, e1 * 2.0, e2 * 2.0);
                }
            }
            b.add_light(light("point", DVec3::X * 0.3, DVec3::Y, 1.0));
        }),
    );
}

/// T16: a narrow beam through a slab of glass onto a floor; `2n/(n² + 1)` of it arrives.
pub fn slabs(row: &mut Row) {
    let [mut thick, mut thin] = [Meter::default(); 2];
    for (at, thickness) in SLABS {
        let scene = scene(|b| {
            hold_place(b);
            let black = b.add_material(&lambert("black", Rgb::splat(1e-3))).unwrap();
            let clear = b.add_material(&glass(1.5)).unwrap();
            let (x, z) = (DVec3::X * 4.0, DVec3::Z * 4.0);
            let corner = DVec3::new(at - 2.0, 0.0, -2.0);
            // Thickness as single precision has it.
            let h = f64::from(thickness as f32);
            add_quad(b, "floor", black, corner - DVec3::Y, z, x);
            add_quad(b, "top", clear, corner, z, x);
            add_quad(b, "bottom", clear, corner - DVec3::Y * h, x, z);
            b.add_light(LightDesc {
                inner_cone: 0.04,
                outer_cone: 0.05,
                ..light("spot", DVec3::new(at, 1.0, 0.0), DVec3::NEG_Y, 1.0)
            });
        });
        assert_eq!(
            scene.center,
            DVec3::ZERO,
            "what is far out is to stay there"
        );
        for maps in each(&scene, 100_000) {
            let n: f64 = 1.5;
            let want = 2.0 * n / (n * n + 1.0);
            let error = (stored(&maps, PhotonClass::Caustic) / want - 1.0).abs();
            if told_apart(at, thickness) {
                thick.see(error);
            } else {
                thin.see(error);
            }
        }
    }
    row.tried("thickness 1e-2, 1e-4, 1e-5 at x = 1, 1e-2 at 1e3, 10⁵ photons through every backend; seeds 0 to 2");
    row.line("photons", "light through a slab, relative", thick, 5e-3);
    row.tried("thickness 1e-4 and 1e-5 at x = 1e3; the same");
    row.line(
        "photons",
        "light through a slab thinner than the offset, relative",
        thin,
        MEASURED,
    );
}

/// T20: light above a floor that is not watertight; what falls through is in the books.
pub fn junction(row: &mut Row) {
    let scene = scene(|b| {
        let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
        let v = [
            [0.0; 3],
            [1.0, 0.3, 0.0],
            [0.0, 1.0, 0.0],
            [1.0 / 3.0, 0.1, 0.0],
            [1.0, -1.0, 0.0],
        ];
        let shape = b.add_mesh(
            dualight::geometry::TriangleMesh {
                positions: v.to_vec(),
                indices: vec![[0, 1, 2], [0, 4, 3], [3, 4, 1]],
                ..Default::default()
            },
            "floor",
        );
        b.place(dualight::scene::MeshPlacement {
            shape,
            material: grey,
            world_from_object: dualight::math::DAffine3::IDENTITY,
            name: "floor".into(),
        });
        b.add_light(light("point", DVec3::new(0.4, 0.1, 0.5), DVec3::Z, 1.0));
    });
    let mut m = Meter::default();
    row.tried("light above the same floor, 20000 photons through every backend; seeds 0 to 2");
    for maps in each(&scene, 20_000) {
        m.see(unaccounted(&maps));
        // Light beside the floor: seen under less than half of all directions.
        m.must(
            (0.5..1.0)
                .contains(&(maps.global_counts.flux_escaped / maps.global_counts.flux_emitted)),
        );
    }
    row.line("photons", "flux unaccounted for", m, 1e-9);
}
