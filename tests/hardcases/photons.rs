//! Rows P1 and P3, and what other rows ask of photons.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::common::{add_quad, add_sphere, box_scene, lambert, light};
use crate::report::{Meter, Row};
use dualight::color::Rgb;
use dualight::math::DVec3;
use dualight::math::robust::UNIT_ROUNDOFF as U;
use dualight::photons::map::{Nearest, Pilot, Site, Surroundings};
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
    traced(scene, seed, photons, None, false)
}

/// As [`trace`], with what the final gather needs.
pub fn gathered(scene: &Scene, seed: u64, photons: u64) -> PhotonMaps {
    traced(scene, seed, photons, None, true)
}

fn traced(
    scene: &Scene,
    seed: u64,
    photons: u64,
    max_depth: Option<u32>,
    gather: bool,
) -> PhotonMaps {
    let backend = &ACCELERATORS[seed as usize % ACCELERATORS.len()];
    let accel = (backend.build)(&scene.geometry, 2).unwrap();
    let settings = PhotonSettings {
        seed,
        global: photons,
        caustic: photons,
        nearest: 50,
        max_depth,
        roulette: true,
        guidance: dualight::photons::Guidance::Off,
    };
    let (all, control) = (EffectSet::all(), Control::default());
    trace_photons(
        scene,
        &*accel,
        &EMISSIONS[0],
        all,
        &settings,
        gather,
        &control,
    )
}

/// What became of the global photons.
pub fn counts(scene: &Scene, seed: u64, photons: u64) -> PhotonCounts {
    trace(scene, seed, photons).global_counts
}

/// As [`counts`], but photons end at the `depth`-th surface.
pub fn counts_to(scene: &Scene, seed: u64, photons: u64, depth: u32) -> PhotonCounts {
    traced(scene, seed, photons, Some(depth), false).global_counts
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
    row.tried("the box, 20000 photons of both purposes, through every backend; seeds 0 to 5");
    row.line("photons", "flux unaccounted for", m, 1e-9);
    first_hits(row);
    row.tried("the box, every 2e5-th of 2³³ + 7 photons, low and high half; seed 3");
    row.line(
        "photons",
        "brightness of 2³³ photons",
        beyond_32_bits(&scene),
        3e-3,
    );
}

/// What is stored where light first arrives, and what escapes before, is all that the light
/// sends out.
fn first_hits(row: &mut Row) {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    let (x, z) = (DVec3::X * 2.0, DVec3::Z * 2.0);
    add_quad(&mut b, "floor", grey, DVec3::NEG_ONE, z, x);
    add_sphere(&mut b, "ball", grey, DVec3::new(0.4, -0.6, 0.1), 0.4);
    b.add_light(light("point", DVec3::new(0.1, 0.2, 0.3), DVec3::Y, 1.0));
    let scene = b.finish().unwrap();
    let [mut stored, mut books] = [Meter::default(); 2];
    for seed in 0..ACCELERATORS.len() as u64 {
        let maps = traced(&scene, seed, 20_000, Some(1), false);
        let (c, map) = (&maps.global_counts, maps.global.as_ref().unwrap());
        let power = map.photons().iter().map(|p| p.power());
        let sum: f64 = power.map(|p| p.r + p.g + p.b).sum();
        assert!(sum > 0.1 * c.flux_emitted && c.flux_escaped > 0.1 * c.flux_emitted);
        stored.see((sum + c.flux_escaped - c.flux_emitted).abs() / c.flux_emitted);
        books.see((c.flux_cut + c.flux_escaped - c.flux_emitted).abs() / c.flux_emitted);
    }
    row.tried(
        "a floor and a ball under a light, 20000 photons, through every backend; seeds 0 to 2",
    );
    row.line("photons", "flux that first arrives or escapes", books, 1e-9);
    // Half a unit in the last place of single precision, in which photons are stored.
    row.line("photons", "the same of the photons stored", stored, U);
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
        guide: None,
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

/// The estimate at the origin on a floor, with kernels that others have decided.
fn with_kernels(scene: &Scene, pilot: Vec<Photon>, list: Vec<Photon>, k: usize) -> f64 {
    let accel = (ACCELERATORS[0].build)(&scene.geometry, 1).unwrap();
    let around = Surroundings {
        scene,
        accel: &*accel,
    };
    let deciding = Pilot {
        around,
        nearest: k,
        ratio: 8.0,
    };
    let kernels = deciding.kernels(pilot, 4.0, |_| true, &Control::default());
    let map = PhotonMap::build(list, k, 4.0).with_kernels(Arc::new(kernels));
    let site = Site::new(DVec3::ZERO, DVec3::Y);
    map.estimate(&site, around, &mut Nearest::new(), |_| true, |_| Rgb::ONE)
        .value
        .r
}

pub fn p3(row: &mut Row) {
    extremes_of_kernels(row);
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
    row.tried("0 to 10⁵ photons in one place, for estimates of 2, 50 and 500");
    row.line(
        "photons, nearest",
        "estimates that are not finite",
        finite,
        0.0,
    );
    row.line(
        "photons, nearest",
        "flux at one distance, less one photon, relative",
        ring,
        1e-6,
    );
    row.note(
        "`nearest` is what serves where no pilot emission has decided kernels. Of more coincident photons than an estimate takes, those beyond it are not seen: the \
         estimate is that of the wanted number over the distance to them, or over the smallest \
         kernel (1e-4 of the largest)",
    );
}

/// What kernels do with no photon, one, fewer than are wanted, and very many in one place.
fn extremes_of_kernels(row: &mut Row) {
    let mut b = SceneBuilder::default();
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.5))).unwrap();
    let (x, z) = (DVec3::X * 2.0, DVec3::Z * 2.0);
    add_quad(&mut b, "floor", grey, -DVec3::X - DVec3::Z, z, x);
    let scene = b.finish().unwrap();
    let [mut finite, mut dark] = [Meter::default(); 2];
    for k in [2, 50, 500] {
        for pilot in [0, 1, 10, 10_000] {
            for n in [0, 1, 49, 100_000] {
                for at in [DVec3::ZERO, DVec3::X * 0.001, DVec3::X * 1e-30] {
                    let some = |n: usize| photons((0..n).map(|_| at));
                    let value = with_kernels(&scene, some(pilot), some(n), k);
                    // A kernel is no smaller than 1e-4 of the largest: 1e5 photons on 1e-12 m².
                    finite.must(value.is_finite() && (0.0..1e18).contains(&value));
                    if n == 0 {
                        dark.must(value == 0.0);
                    }
                }
            }
        }
    }
    row.tried(
        "0 to 10⁴ pilot photons and 0 to 10⁵ photons in one place, for estimates of 2, 50 and 500",
    );
    row.line(
        "photons, kernels",
        "estimates that are not finite",
        finite,
        0.0,
    );
    row.line("photons, kernels", "light without photons", dark, 0.0);
}
