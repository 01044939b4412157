//! Row P4: the kernels that rendering estimates densities with, at walls as thin as paper, in
//! corners and at borders.

use std::sync::Arc;

use dualight::accel::ACCELERATORS;
use dualight::color::Rgb;
use dualight::control::Control;
use dualight::math::DVec3;
use dualight::photons::map::{IrradianceMap, Kernels, Nearest, Pilot, Site, Surroundings};
use dualight::photons::{Photon, PhotonClass, PhotonMap};
use dualight::sampling::{Rng, hash2};
use dualight::scene::{Scene, SceneBuilder};

use crate::common::{add_quad, add_room, lambert, light};
use crate::photons::gathered;
use crate::report::{Meter, Row, cases};

/// Half the thickness of walls, which is 1e-3; kernels are 0.1 wide.
const HALF: f64 = 5e-4;

/// Photons that a kernel of the usual width would hold, and how many it holds here: so many more
/// that what they say is the kernel's own error, not theirs.
const USUAL: u64 = 50;
const DENSE: u64 = 32;

/// Photons on the lit half of the floor, for kernels of 0.1.
const PHOTONS: u64 = 3200;

fn thin_wall(b: &mut SceneBuilder, material: dualight::geometry::MaterialId) {
    for (z, e1, e2) in [(HALF, DVec3::X, DVec3::Y), (-HALF, DVec3::Y, DVec3::X)] {
        let corner = DVec3::new(-1.0, -1.0, z);
        add_quad(b, "wall", material, corner, e1 * 2.0, e2 * 2.0);
    }
}

/// A floor of two metres by two that goes on under a thin wall at `z = 0`, another wall at
/// `x = 1`, and nothing at its other sides. What lies before the thin wall is a metre wide.
fn stage() -> Scene {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let long = z * (2.0 + HALF);
    add_quad(&mut b, "floor", grey, -x - y - z, long, x * 2.0);
    add_quad(&mut b, "side", grey, x - y - z, long, y * 2.0);
    thin_wall(&mut b, grey);
    b.finish().unwrap()
}

/// Photons all over the lit side of the stage, one in each cell of a grid, as dense on both walls
/// as on the floor, with their number on a square metre.
fn lit(n: u64, seed: u64) -> (Vec<Photon>, f64) {
    let mut rng = Rng::new(hash2(seed, 78));
    let side = ((n / 2) as f64).sqrt().round() as u64;
    let mut out = Vec::new();
    let mut strew =
        |corner: DVec3, [e1, e2]: [DVec3; 2], normal: DVec3, [columns, rows]: [u64; 2]| {
            for i in 0..rows * columns {
                let [a, b] = rng.next_2d();
                let a = ((i % columns) as f64 + a) / columns as f64;
                let b = ((i / columns) as f64 + b) / rows as f64;
                let p = corner + e1 * a + e2 * b;
                out.push(Photon::new(
                    p,
                    normal,
                    normal,
                    Rgb::ONE,
                    PhotonClass::Direct,
                ));
            }
        };
    let (x, y, z) = (DVec3::X * 2.0, DVec3::Y * 2.0, DVec3::Z);
    let low = DVec3::new(-1.0, -1.0, HALF);
    strew(low, [x, z], DVec3::Y, [2 * side, side]);
    strew(low + x, [y, z], -DVec3::X, [2 * side, side]);
    strew(low, [x, y], DVec3::Z, [2 * side, 2 * side]);
    (out, (side * side) as f64)
}

/// Places on the lit side, all around the edges of the stage, `aside` of them.
fn places(aside: f64, k: u64) -> [(DVec3, DVec3); 7] {
    // Along an edge, away from its ends.
    let s = (k as f64 * 0.618_034).fract() - 0.5;
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let (wall, end) = (HALF + aside, 1.0 + HALF - aside);
    let v = DVec3::new;
    [
        (v(s, -1.0, 0.5), y),
        // At the thin wall's foot, and on the wall above it.
        (v(s, -1.0, wall), y),
        (v(s, -1.0 + aside, HALF), z),
        // In the corner of floor and walls.
        (v(1.0 - aside, -1.0, wall), y),
        // At a border and at a corner without walls.
        (v(s, -1.0, end), y),
        (v(-1.0 + aside, -1.0, end), y),
        // On the side wall, above the floor.
        (v(1.0, -1.0 + aside, 0.5 + 0.2 * s), -x),
    ]
}

/// A map of the evenly lit stage, with the kernels that a pilot emission has decided, and the
/// density of its photons.
fn decided(around: Surroundings<'_>, seed: u64) -> (Arc<Kernels>, PhotonMap, f64) {
    let (pilot, _) = lit(PHOTONS / 8, !seed);
    let (dense, density) = lit(PHOTONS * DENSE, seed);
    let nearest = (USUAL * DENSE) as usize;
    let deciding = Pilot {
        around,
        nearest,
        ratio: dense.len() as f64 / pilot.len() as f64,
    };
    let area = 8.0;
    let kernels = deciding.kernels(pilot, area, |_| true, &Control::default());
    let kernels = Arc::new(kernels);
    let map = PhotonMap::build(dense, nearest, area);
    (kernels.clone(), map.with_kernels(kernels), density)
}

/// Errors in the mean over kernels, at the edges of a stage that is lit evenly.
fn edges(row: &mut Row) {
    let scene = stage();
    let accel = (ACCELERATORS[0].build)(&scene.geometry, 1).unwrap();
    let around = Surroundings {
        scene: &scene,
        accel: &*accel,
    };
    let asides = [1e-4, 0.005, 0.03];
    // By distance from the edge and place: of the densities, and of what the final gather takes,
    // which is the nearest sample of irradiance, or a density where there is none.
    let mut sums = [[[0.0; 7]; 3]; 2];
    let seeds = cases(64, 8);
    for seed in 0..seeds {
        let (kernels, map, density) = decided(around, seed);
        let irradiance = IrradianceMap::build(&map, kernels, |_| true, &Control::default());
        let mut found = Nearest::new();
        for (j, aside) in asides.into_iter().enumerate() {
            for k in 0..16 {
                for (i, (p, n)) in places(aside, 16 * seed + k).into_iter().enumerate() {
                    let site = Site::new(p, n);
                    let e = map.estimate(&site, around, &mut found, |_| true, |_| Rgb::ONE);
                    let near = irradiance.nearest(&site).map(|s| s.irradiance());
                    sums[0][j][i] += e.value.r / density;
                    sums[1][j][i] += near.unwrap_or(e.value).r / density;
                }
            }
        }
    }
    row.tried(
        "even light; inside, at walls, borders and in corners, 1e-4, 5e-3 and 3e-2 aside; \
         kernels of 0.1, 16 places for each seed from 0 on",
    );
    for (path, sums) in ["photons, kernels", "photons, gather"]
        .into_iter()
        .zip(sums)
    {
        let mut error = Meter::default();
        for sum in sums.as_flattened() {
            error.see((sum / (16 * seeds) as f64 - 1.0).abs());
        }
        row.line(path, "error of the mean at a place", error, 0.01);
    }
}

/// A room in two halves, light in one of them; kernels are far wider than the wall. Nothing may
/// be seen of the light on the wall's other side, nor on what goes on under the wall.
fn leaks(row: &mut Row) {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    add_room(&mut b, grey, 1.0);
    thin_wall(&mut b, grey);
    b.add_light(light("point", DVec3::Z * 0.5, DVec3::Y, 1.0));
    let scene = b.finish().unwrap();
    let [mut dark, mut leak, mut gathered_leak] = [Meter::default(); 3];
    for seed in 0..ACCELERATORS.len() as u64 {
        let accel = (ACCELERATORS[seed as usize].build)(&scene.geometry, 1).unwrap();
        let around = Surroundings {
            scene: &scene,
            accel: &*accel,
        };
        let maps = gathered(&scene, seed, 20_000);
        let (map, irradiance) = (maps.global.unwrap(), maps.irradiance.unwrap());
        dark.n += map.len() as u64;
        dark.worst += map.photons().iter().filter(|p| p.p[2] < -0.4e-3).count() as f64;
        let mut found = Nearest::new();
        let mut at = |p: DVec3, n: DVec3| {
            let site = Site::new(p, n);
            let e = map.estimate(&site, around, &mut found, |_| true, |_| Rgb::ONE);
            let near = irradiance.nearest(&site);
            [e.value.r, near.map_or(0.0, |s| s.irradiance().r)]
        };
        for k in 0..64 {
            let s = 1.8 * ((f64::from(k) * 0.618_034).fract() - 0.5);
            for aside in [0.0, 1e-5, 1e-4, 1e-3, 0.01, 0.03, 0.1] {
                let z = -HALF - aside;
                let sides = [
                    (DVec3::new(s, 0.3 * s, -HALF), -DVec3::Z),
                    (DVec3::new(s, -1.0 + aside, -HALF), -DVec3::Z),
                    (DVec3::new(s, -1.0, z), DVec3::Y),
                    (DVec3::new(s, 1.0, z), -DVec3::Y),
                    (DVec3::new(1.0, s, z), -DVec3::X),
                    (DVec3::new(-1.0, s, z), DVec3::X),
                ];
                for (p, n) in sides {
                    let lit = at(DVec3::new(p.x, p.y, -p.z), DVec3::new(n.x, n.y, -n.z));
                    let seen = at(p, n);
                    leak.see(seen[0] / lit[0].max(1e-3));
                    gathered_leak.see(seen[1] / lit[1].max(1e-3));
                }
            }
        }
    }
    row.tried(
        "a wall of 1e-3 through a room, 0 to 0.1 from its foot, through every backend; seeds 0 to 2",
    );
    row.line("photons", "photons behind the wall", dark, 0.0);
    let what = "light behind the wall, of that before it";
    row.line("photons, kernels", what, leak, 0.0);
    row.line("photons, gather", what, gathered_leak, 0.0);
}

pub fn p4(row: &mut Row) {
    leaks(row);
    edges(row);
}
