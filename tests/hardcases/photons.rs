//! Rows P1, P3 and P4, and what other rows ask of photons.

use std::f64::consts::PI;

use crate::common::{add_quad, add_room, box_scene, lambert, light};
use crate::report::{Meter, Row};
use dualight::color::Rgb;
use dualight::math::DVec3;
use dualight::photons::map::{Nearest, Site};
use dualight::photons::{Photon, PhotonClass, PhotonMap};
use dualight::scene::SceneBuilder;

use dualight::accel::ACCELERATORS;
use dualight::control::Control;
use dualight::effects::EffectSet;
use dualight::photons::{
    EMISSIONS, EmissionContext, PhotonMaps, PhotonSettings, Purpose, trace_photons,
};
use dualight::scene::Scene;
use dualight::stats::PhotonCounts;

/// Photons of a scene, through the backend that the seed picks.
pub fn trace(scene: &Scene, seed: u64, photons: u64) -> PhotonMaps {
    let backend = &ACCELERATORS[seed as usize % ACCELERATORS.len()];
    let accel = (backend.build)(&scene.geometry, 2).unwrap();
    let settings = PhotonSettings {
        seed,
        global: photons,
        caustic: photons,
        nearest: 50,
        max_depth: None,
        roulette: true,
    };
    let (all, control) = (EffectSet::all(), Control::default());
    trace_photons(
        scene,
        &*accel,
        &EMISSIONS[0],
        all,
        &settings,
        false,
        &control,
    )
}

/// What became of the global photons.
pub fn counts(scene: &Scene, seed: u64, photons: u64) -> PhotonCounts {
    trace(scene, seed, photons).global_counts
}

pub fn p1(row: &mut Row) {
    let mut m = Meter::default();
    let scene = box_scene();
    for seed in 0..6 {
        let maps = trace(&scene, seed, 20_000);
        for c in [maps.global_counts, maps.caustic_counts] {
            let spent = c.flux_absorbed + c.flux_escaped + c.flux_cut;
            m.see((c.flux_emitted - spent).abs() / c.flux_emitted);
        }
    }
    row.line("photons", "flux unaccounted for", m, 1e-9);
    row.line(
        "photons",
        "brightness of 2³³ photons",
        beyond_32_bits(&scene),
        3e-3,
    );
}

/// Of an emission with more photons than 32 bits count, every so many-th: their share of the
/// flux is their share of the number, and they go as those of a small emission go.
fn beyond_32_bits(scene: &Scene) -> Meter {
    const ALL: u64 = (1 << 33) + 7;
    let accel = (ACCELERATORS[0].build)(&scene.geometry, 2).unwrap();
    let source = (EMISSIONS[0].build)(&EmissionContext {
        scene,
        accel: &*accel,
        seed: 3,
        purpose: Purpose::Global,
        count: ALL,
    });
    let mut m = Meter::default();
    m.see((source.len() as f64 / ALL as f64 - 1.0).abs());
    // The low half, and the half that a 32-bit count would take for the low one again.
    for half in 0..2 {
        let picked = (0..20_000u64).map(|k| half * (1 << 32) + k * ((1 << 32) / 20_000));
        let (mut sum, mut n) = (Rgb::ZERO, 0);
        let mut met = 0;
        for i in picked {
            n += 1;
            let Some(photon) = source.emit(i) else {
                continue;
            };
            sum += photon.power;
            met += u32::from(accel.intersect(&photon.ray).is_some());
        }
        let flux = (sum / f64::from(n) * ALL as f64).luminance();
        m.see((flux / scene.flux().luminance() - 1.0).abs());
        assert!(met > 9000, "photons of the box meet it: {met}");
    }
    // Books of that many photons: a sum of shares is the whole.
    let first = source.emit(0).unwrap();
    let last = source.emit(ALL - 1).unwrap();
    m.see((first.power.luminance() * ALL as f64 / scene.flux().luminance() - 1.0).abs());
    m.see((last.power.luminance() / first.power.luminance() - 1.0).abs());
    m
}

fn photons(places: impl Iterator<Item = DVec3>) -> Vec<Photon> {
    places
        .map(|p| Photon::new(p, DVec3::Y, DVec3::Y, Rgb::ONE, PhotonClass::Direct))
        .collect()
}

/// The estimate at the origin: its value, and that times the kernel's area, in photons.
fn estimate(list: Vec<Photon>, k: usize) -> (f64, f64) {
    let map = PhotonMap::build(list, k, 1.0);
    let e = map.estimate_nearest(
        &Site::new(DVec3::ZERO, DVec3::Y),
        &mut Nearest::new(),
        |_| true,
        |_| Rgb::ONE,
    );
    (e.value.r, e.value.r * PI * e.radius * e.radius)
}

pub fn p3(row: &mut Row) {
    let [mut finite, mut ring] = [Meter::default(); 2];
    for k in [2, 50, 500] {
        for n in [0, 1, 2, 49, 50, 51, 1000, 100_000] {
            for at in [
                DVec3::ZERO,
                DVec3::X * 0.001,
                DVec3::X * 1e-30,
                DVec3::X * 1e9,
            ] {
                let (value, _) = estimate(photons((0..n).map(|_| at)), k);
                finite.must(value.is_finite() && (0.0..1e15).contains(&value));
            }
        }
        // As many photons as are wanted, all at one distance: all but one of them count.
        let places = (0..k).map(|i| {
            let right = i % 2 == 0;
            DVec3::new(if right { 0.01 } else { -0.01 }, 0.0, 0.0)
        });
        let (_, counted) = estimate(photons(places), k);
        ring.see((counted - (k as f64 - 1.0)).abs() / k as f64);
    }
    row.line("photons", "estimates that are not finite", finite, 0.0);
    row.line(
        "photons",
        "flux at one distance, less one photon, relative",
        ring,
        1e-6,
    );
    row.note(
        "of more coincident photons than an estimate takes, those beyond it are not seen: the \
         estimate is that of the wanted number over the distance to them, or over the smallest \
         kernel (1e-4 of the largest)",
    );
}

pub fn p4(row: &mut Row) {
    // A room in two halves, light in one of them; kernels are far wider than the wall.
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    add_room(&mut b, grey, 1.0);
    for (z, e1, e2) in [(5e-4, DVec3::X, DVec3::Y), (-5e-4, DVec3::Y, DVec3::X)] {
        let corner = DVec3::new(-1.0, -1.0, z);
        add_quad(&mut b, "wall", grey, corner, e1 * 2.0, e2 * 2.0);
    }
    b.add_light(light("point", DVec3::Z * 0.5, DVec3::Y, 1.0));
    let scene = b.finish().unwrap();
    let [mut dark, mut leak] = [Meter::default(); 2];
    for seed in 0..3 {
        let maps = trace(&scene, seed, 20_000);
        let map = maps.global.unwrap();
        dark.see(map.photons().iter().filter(|p| p.p[2] < -4e-4).count() as f64);
        let mut found = Nearest::new();
        let mut at = |z: f64, n: f64| {
            let site = Site::new(DVec3::new(0.1, 0.2, z), DVec3::Z * n);
            map.estimate_nearest(&site, &mut found, |_| true, |_| Rgb::ONE)
                .value
                .r
        };
        leak.see(at(-5e-4, -1.0) / at(5e-4, 1.0));
    }
    row.line("photons", "photons behind the wall", dark, 0.0);
    row.line(
        "photons",
        "light behind the wall, of that before it",
        leak,
        0.0,
    );
}
