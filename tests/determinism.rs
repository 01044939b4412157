//! One seed, one image: bit for bit, however many threads share the work.

mod common;

use common::box_scene;
use common::render::{MODES, Mode, Size, backends, rendering, settings};
use dualight::accel::ACCELERATORS;
use dualight::control::Control;
use dualight::effects::EffectSet;
use dualight::film::Image;
use dualight::photons::{EMISSIONS, PhotonMaps, PhotonSettings, trace_photons};
use dualight::scene::Scene;

const SIZE: Size = Size {
    pixels: 20,
    spp: 5,
    photons: 20_000,
};

fn image(scene: &Scene, mode: Mode, backend: &str, seed: u64, threads: usize) -> Image {
    let mut told = settings(mode, SIZE, seed);
    told.threads = Some(threads);
    told.accelerator = Some(backend.into());
    rendering(scene, &told).film.develop()
}

/// Every number of every layer, as bits: `NaN` and `−0` are told apart too.
fn bits(image: &Image) -> Vec<(String, Vec<u32>)> {
    let layers = image.layers.iter();
    layers
        .flat_map(|l| {
            l.channels
                .iter()
                .map(|c| (format!("{}.{}", l.name, c.name), c))
        })
        .map(|(name, c)| (name, c.data.iter().map(|x| x.to_bits()).collect()))
        .collect()
}

#[test]
fn images_do_not_depend_on_threads() {
    let scene = box_scene();
    for mode in MODES {
        for backend in backends() {
            let one = image(&scene, mode, backend, 7, 1);
            for threads in [1, 2, 3] {
                let other = image(&scene, mode, backend, 7, threads);
                for ((name, a), (_, b)) in bits(&one).iter().zip(&bits(&other)) {
                    assert_eq!(a, b, "{name}, {}, {backend}, {threads} threads", mode.name);
                }
            }
            let other = image(&scene, mode, backend, 8, 2);
            for layer in ["", "direct", "specular", "indirect"] {
                assert_ne!(one.rgb(layer), other.rgb(layer), "another seed, {layer}");
            }
        }
    }
}

#[test]
fn a_pixel_does_not_depend_on_the_rest_of_the_image() {
    let scene = box_scene();
    for mode in MODES {
        let mut told = settings(mode, SIZE, 3);
        let whole = rendering(&scene, &told).film.develop();
        told.crop = Some([3, 5, 11, 17]);
        let part = rendering(&scene, &told).film.develop();
        for ((name, a), (_, b)) in bits(&whole).iter().zip(&bits(&part)) {
            for y in 5..17 {
                let row = y * 20 + 3..y * 20 + 11;
                assert_eq!(a[row.clone()], b[row], "{name}, {}, row {y}", mode.name);
            }
        }
    }
}

fn maps(scene: &Scene, backend: usize, seed: u64, threads: usize) -> PhotonMaps {
    let told = PhotonSettings {
        seed,
        global: 40_000,
        caustic: 40_000,
        nearest: 50,
        max_depth: None,
        roulette: true,
        guidance: dualight::photons::Guidance::Light,
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("threads").install(|| {
        let accel = (ACCELERATORS[backend].build)(&scene.geometry, threads).expect("built");
        let (all, control) = (EffectSet::all(), Control::default());
        trace_photons(scene, &*accel, &EMISSIONS[0], all, &told, true, &control)
    })
}

#[test]
fn photon_maps_do_not_depend_on_threads() {
    let scene = box_scene();
    for backend in 0..ACCELERATORS.len() {
        let one = maps(&scene, backend, 5, 1);
        for threads in [1, 2, 3] {
            let other = maps(&scene, backend, 5, threads);
            assert_eq!(one.global_counts, other.global_counts, "{threads} threads");
            assert_eq!(
                one.caustic_counts, other.caustic_counts,
                "{threads} threads"
            );
            assert_eq!(one.rays, other.rays);
            for (a, b) in [(&one.global, &other.global), (&one.caustic, &other.caustic)] {
                let (a, b) = (a.as_ref().expect("a map"), b.as_ref().expect("a map"));
                assert!(a.photons() == b.photons(), "order or values differ");
            }
            let lengths = [&one, &other].map(|m| m.irradiance.as_ref().map(|i| i.len()));
            assert_eq!(lengths[0], lengths[1]);
        }
        let other = maps(&scene, backend, 6, 2);
        let stored = |m: &PhotonMaps| m.global.as_ref().map(|g| g.photons()[0]);
        assert!(
            stored(&one) != stored(&other),
            "another seed, the same photons"
        );
    }
}
