//! Photons that leave a body and must not meet it again, or must meet its far side.

use dualight::accel::ACCELERATORS;
use dualight::color::Rgb;
use dualight::geometry::{MaterialId, ShapeId, SphereSet, TriangleMesh};
use dualight::lights::LightDesc;
use dualight::materials::MaterialDesc;
use dualight::math::robust::spawn_offset;
use dualight::math::{DAffine3, DVec3, Vec3};
use dualight::photons::{PhotonClass, PhotonMaps};
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};

use crate::common::{add_room, add_sphere, glass, lambert, light};
use crate::mirrored::maps;
use crate::photons::trace;
use crate::report::{Meter, Row, cases};
use crate::scenes::icosphere;
use crate::spawn::{SPHERES, place, wild};

const BACKENDS: &str = "through every backend";

/// A black speck at the origin. With it a scene that lies far out is not moved to the middle.
pub fn hold_place(b: &mut SceneBuilder) {
    let black = b.add_material(&lambert("black", Rgb::ZERO)).unwrap();
    add_sphere(b, "speck", black, DVec3::ZERO, 1e-3);
}

fn each(scene: &Scene, photons: u64) -> impl Iterator<Item = PhotonMaps> {
    (0..ACCELERATORS.len() as u64).map(move |seed| trace(scene, seed, photons))
}

/// A spot from `o` at `target` that fills a half angle of `angle`.
fn spot(o: DVec3, target: DVec3, angle: f64) -> LightDesc {
    LightDesc {
        inner_cone: 0.9 * angle,
        outer_cone: angle,
        ..light("spot", o, (target - o).normalize(), 1.0)
    }
}

/// Photons stored after a bounce near a place: from a convex body there are none.
fn again(maps: &PhotonMaps, near: DVec3, reach: f64, hits: &mut Meter) {
    let mut direct = 0;
    for p in maps.global.as_ref().unwrap().photons() {
        let p_at = Vec3::from(p.p).as_dvec3();
        if (p_at - near).length() > reach {
            continue;
        }
        direct += u32::from(p.class == PhotonClass::Direct);
        if p.class != PhotonClass::Direct {
            hits.must(false);
        }
    }
    hits.n += u64::from(direct);
}

/// A bright body alone in the world, held where it is, under a spot.
fn bright(add: impl FnOnce(&mut SceneBuilder, MaterialId), spot: LightDesc) -> Scene {
    let mut b = SceneBuilder::default();
    hold_place(&mut b);
    let white = b.add_material(&lambert("white", Rgb::splat(0.99))).unwrap();
    add(&mut b, white);
    b.add_light(spot);
    b.finish().unwrap()
}

/// S3: a sphere, seen from three radii.
pub fn spheres(row: &mut Row) {
    let mut hits = Meter::default();
    for (r, offset) in SPHERES {
        let c = place(offset);
        // A sphere around the origin needs no speck, which would be in its way.
        let from = (c + DVec3::new(0.36, 0.48, 0.8) * (3.0 * r))
            .as_vec3()
            .as_dvec3();
        let scene = bright(
            |b, white| add_sphere(b, "ball", white, c, r),
            spot(from, c, 0.34),
        );
        for maps in each(&scene, 20_000) {
            again(&maps, c, 1.5 * r, &mut hits);
        }
    }
    row.tried(format!(
        "the same spheres under a spot, {BACKENDS}; seeds 0 to 2"
    ));
    row.line(
        "photons",
        "self-hits, of the photons that arrive",
        hits,
        0.0,
    );
}

/// S11: far out, where the light itself is placed by 1/16 m.
pub fn far_spheres(row: &mut Row) {
    let c = DVec3::splat(1e6);
    let mut hits = Meter::default();
    for r in [1.0, 0.1, 0.01] {
        let from = (c + DVec3::new(6.0, 0.0, 8.0)).as_vec3().as_dvec3();
        let angle = f64::max(1.5 * r, 0.15) / 10.0;
        let scene = bright(
            |b, white| add_sphere(b, "ball", white, c, r),
            spot(from, c, angle),
        );
        for maps in each(&scene, 20_000) {
            again(&maps, c, 1.5 * r + 0.1, &mut hits);
        }
    }
    row.tried(format!("under a spot at 10 m, {BACKENDS}; seeds 0 to 2"));
    row.line(
        "photons",
        "self-hits, of the photons that arrive",
        hits,
        0.0,
    );
}

fn put(b: &mut SceneBuilder, m: MaterialId, mesh: TriangleMesh) {
    let shape = b.add_mesh(mesh, "body");
    place_at(b, m, shape, DAffine3::IDENTITY);
}

fn place_at(b: &mut SceneBuilder, material: MaterialId, shape: ShapeId, map: DAffine3) {
    b.place(MeshPlacement {
        shape,
        material,
        world_from_object: map,
        name: "body".into(),
    });
}

/// T13: wild triangles.
pub fn triangles(row: &mut Row) {
    let mut hits = Meter::default();
    for (mesh, target, i) in wild(cases(1000, 100)) {
        let v = mesh.corners(0);
        let far = v.map(DVec3::length).into_iter().fold(0.0, f64::max);
        let (n, longest) = ((v[1] - v[0]).cross(v[2] - v[0]), v[1].distance(v[2]));
        // As near as a needle is thick, so that it is met, but not within rounding.
        let longest = longest.max(v[0].distance(v[1])).max(v[0].distance(v[2]));
        let near = (n.length() / longest).clamp(1e-5 * far, far);
        let from = target + n.normalize() * near;
        let scene = bright(|b, white| put(b, white, mesh), spot(from, target, 0.7));
        let maps = trace(&scene, i, 1000);
        again(&maps, DVec3::ZERO, f64::INFINITY, &mut hits);
    }
    row.tried("the first of them under a spot, through one backend each; seed 23");
    row.line(
        "photons",
        "self-hits, of the photons that arrive",
        hits,
        0.0,
    );
}

/// T14: the convex ball of triangles.
pub fn balls(row: &mut Row) {
    let mut hits = Meter::default();
    let ball = icosphere(5, DVec3::X * 4.0, 1.0);
    let from = DVec3::new(4.0, 1.2, 0.0);
    let scene = bright(
        |b, white| put(b, white, ball),
        spot(from, DVec3::X * 4.0, 0.9),
    );
    for maps in (0..2).map(|seed| trace(&scene, seed, cases(1_000_000, 50_000))) {
        again(&maps, DVec3::X * 4.0, 1.1, &mut hits);
    }
    row.tried("the same ball under a spot, through two backends; seeds 0 and 1");
    row.line(
        "photons",
        "neighbours hit, of the photons that arrive",
        hits,
        0.0,
    );
}

/// A ball of clear ink in a shell of five radii.
struct Ink {
    center: DVec3,
    r: f64,
    map: DAffine3,
}

/// Light that crosses balls of ink. What is left of each photon tells the way it went inside, and
/// where it arrives beyond tells which way that was.
fn ink(row: &mut Row, balls: &[Ink], photons: u64) {
    let [mut chord, mut lost] = [Meter::default(); 2];
    for ball in balls {
        let (c, r) = (ball.center, f64::from(ball.r as f32));
        let mut b = SceneBuilder::default();
        if c.length() > 5.0 * r {
            hold_place(&mut b);
        }
        let ink = MaterialDesc {
            attenuation_distance: r,
            attenuation_color: Rgb::splat(0.5),
            ..glass(1.0)
        };
        let ink = b.add_material(&ink).unwrap();
        let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
        let set = SphereSet {
            spheres: vec![[c.x as f32, c.y as f32, c.z as f32, r as f32]],
        };
        let shape = b.add_spheres(set, "ink");
        place_at(&mut b, ink, shape, ball.map);
        // Where the node puts it.
        let c = ball.map.transform_point3(c);
        add_sphere(&mut b, "shell", grey, c, 5.0 * r);
        let from = (c + DVec3::new(0.36, 0.48, 0.8) * (1.2 * r))
            .as_vec3()
            .as_dvec3();
        b.add_light(light("point", from, DVec3::Y, 1.0));
        let scene = b.finish().unwrap();
        assert_eq!(
            scene.center,
            DVec3::ZERO,
            "what is far out is to stay there"
        );
        // Coordinates of the shell reach this far, and so do the offsets of rays.
        let offset = spawn_offset(c.abs().max_element() + 5.0 * r);
        for maps in each(&scene, photons) {
            let counts = &maps.global_counts;
            lost.see(counts.flux_escaped / counts.flux_emitted);
            let whole = counts.flux_emitted / counts.emitted as f64 / 3.0;
            for p in maps.global.as_ref().unwrap().photons() {
                let d = (Vec3::from(p.p).as_dvec3() - from).normalize();
                let b2 = (c - from).cross(d).length_squared() / (r * r);
                let cos = (1.0 - b2).max(0.0).sqrt();
                if p.class == PhotonClass::Caustic && cos >= 0.05 {
                    let way = -(p.power().r / whole).log2();
                    chord.see((way - 2.0 * cos).abs() * cos * r / (offset + 1e-6 * r));
                }
            }
        }
    }
    row.line(
        "photons",
        "way inside, in offsets over the cosine",
        chord,
        4.0,
    );
    row.line("photons", "light lost from the shell", lost, 0.0);
}

/// S4: the spheres of the rays.
pub fn chords(row: &mut Row) {
    row.tried(format!(
        "the same spheres of ink within a shell, {BACKENDS}; seeds 0 to 2"
    ));
    let balls = SPHERES.map(|(r, offset)| Ink {
        center: place(offset),
        r,
        map: DAffine3::IDENTITY,
    });
    ink(row, &balls, 10_000);
}

/// T17: inside and outside of bodies that are mirrored.
pub fn mirrored_chords(row: &mut Row) {
    row.tried(format!(
        "a ball of ink placed by each of these nodes, {BACKENDS}; seeds 0 to 2"
    ));
    let balls = maps().map(|map| Ink {
        center: DVec3::new(0.5, -0.25, 1.0),
        r: 1.0,
        map,
    });
    ink(row, &balls, 4_000);
}

/// R6: a beam at the edge of a cube of glass, as narrow as single precision lets it be. Light that
/// arrives straight beyond it has slipped between two faces.
pub fn edge(row: &mut Row, cube: &TriangleMesh) {
    let [mut slipped, mut lost] = [Meter::default(); 2];
    for z in [-0.7, 0.1, 0.4] {
        let mut b = SceneBuilder::default();
        let glass = b.add_material(&glass(1.5)).unwrap();
        let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
        put(&mut b, glass, cube.clone());
        add_room(&mut b, grey, 4.0);
        let edge = DVec3::new(1.0, 1.0, z);
        b.add_light(spot(edge + DVec3::new(2.0, 2.2, 0.3), edge, 1e-6));
        let scene = b.finish().unwrap();
        for maps in each(&scene, 10_000) {
            let c = &maps.global_counts;
            let spent = c.flux_absorbed + c.flux_escaped + c.flux_cut;
            lost.see((c.flux_emitted - spent).abs() / c.flux_emitted);
            lost.see(c.flux_escaped / c.flux_emitted);
            slipped.n += c.emitted;
            let all = maps.global.as_ref().unwrap().photons();
            let direct = all.iter().filter(|p| p.class == PhotonClass::Direct);
            slipped.worst += direct.count() as f64;
        }
    }
    row.tried(format!(
        "a spot of 1e-6 rad at the edge, in a room, {BACKENDS}; seeds 0 to 2"
    ));
    row.line(
        "photons",
        "light that slips between the faces",
        slipped,
        0.0,
    );
    row.line("photons", "flux unaccounted for, or lost", lost, 1e-9);
}
