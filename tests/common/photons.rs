//! Photons of tiny scenes in tests.

use dualight::accel::ACCELERATORS;
use dualight::control::Control;
use dualight::effects::EffectSet;
use dualight::photons::{EMISSIONS, Photon, PhotonClass, PhotonSettings, trace_photons};
use dualight::scene::Scene;

/// Caustic photons of a scene, and the flux that was aimed at specular objects.
pub fn caustic_photons(scene: &Scene, seed: u64, n: u64) -> (Vec<Photon>, f64) {
    let backend = &ACCELERATORS[seed as usize % ACCELERATORS.len()];
    let accel = (backend.build)(&scene.geometry, 2).expect("built");
    let told = PhotonSettings {
        seed,
        global: 0,
        caustic: n,
        nearest: 50,
        max_depth: None,
        roulette: true,
        guidance: dualight::photons::Guidance::Off,
    };
    let (all, control) = (EffectSet::all(), Control::default());
    let maps = trace_photons(scene, &*accel, &EMISSIONS[0], all, &told, false, &control);
    let map = maps.caustic.expect("something is specular");
    assert!(
        map.photons()
            .iter()
            .all(|p| p.class == PhotonClass::Caustic)
    );
    (
        map.photons().to_vec(),
        maps.caustic_counts.flux_emitted / 3.0,
    )
}
