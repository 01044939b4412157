//! `uniform`: the conventional emission. Photons are shared among the lights by flux, or as the guide
//! says, and each light's photons are stratified over its surface and its directions.

use super::Guide;
use super::departure::leave;
use super::emit::{EmissionContext, EmissionEntry, EmittedPhoton, PhotonSource, Purpose};
use super::targets::Targets;
use crate::geometry::LightId;
use crate::sampling::{Sampler, stream};
use crate::scene::Scene;

struct Uniform<'a> {
    scene: &'a Scene,
    seed: u64,
    stream: u64,
    /// Present for caustic photons.
    targets: Option<Targets>,
    guide: Option<&'a Guide>,
    /// First photon of each light, and the total at the end.
    first: Vec<u64>,
}

impl PhotonSource for Uniform<'_> {
    fn len(&self) -> u64 {
        self.first.last().copied().unwrap_or(0)
    }

    fn emit(&self, i: u64) -> Option<EmittedPhoton> {
        let k = self.first.partition_point(|&f| f <= i) - 1;
        let count = self.first[k + 1] - self.first[k];
        let light = self.scene.light(LightId(k as u32));
        let mut sampler = Sampler::new(self.seed, self.stream, k as u64, i - self.first[k]);
        let (first, second) = (sampler.next_2d(), sampler.next_2d());
        let (second, density) = match self.guide {
            None => (second, 1.0),
            Some(guide) => guide.square(k).place(second),
        };
        let photon = leave(light, self.scene, self.targets.as_ref(), first, second)?;
        Some(EmittedPhoton {
            power: photon.power / (count as f64 * density),
            ..photon
        })
    }
}

/// Fluxes of the lights in W, luminance.
pub(super) fn fluxes(scene: &Scene) -> Vec<f64> {
    let lights = scene.lights.iter();
    lights.map(|l| l.power().luminance()).collect()
}

/// Shares `count` among lights in proportion to flux; every light with flux gets at least one.
pub(super) fn apportion(fluxes: &[f64], count: u64) -> Vec<u64> {
    let total: f64 = fluxes.iter().sum();
    let mut first = vec![0u64];
    // Rounding the running sum instead of each share keeps the total within one of `count`.
    let (mut acc, mut given) = (0.0, 0u64);
    for &f in fluxes {
        acc += f;
        let until = if total > 0.0 {
            (acc / total * count as f64).round() as u64
        } else {
            0
        };
        let mut n = until.saturating_sub(given);
        if f > 0.0 {
            n = n.max(1);
        }
        given += n;
        first.push(given);
    }
    first
}

fn build<'a>(cx: &EmissionContext<'a>) -> Box<dyn PhotonSource + 'a> {
    let shares = match cx.guide {
        None => fluxes(cx.scene),
        Some(guide) => guide.shares().to_vec(),
    };
    let (stream, targets) = match cx.purpose {
        Purpose::Global => (stream::GLOBAL_PHOTONS, None),
        Purpose::Caustic => (stream::CAUSTIC_PHOTONS, Some(Targets::new(cx.scene))),
    };
    let count = if targets.as_ref().is_some_and(Targets::is_empty) {
        0
    } else {
        cx.count
    };
    let first = if count == 0 {
        vec![0]
    } else {
        apportion(&shares, count)
    };
    Box::new(Uniform {
        scene: cx.scene,
        seed: cx.seed,
        stream,
        targets,
        guide: cx.guide,
        first,
    })
}

/// The table's line.
pub(super) const ENTRY: EmissionEntry = EmissionEntry {
    name: "uniform",
    doc: "the conventional emission: stratified over each light, shared among lights by flux",
    build,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photons_are_shared_by_flux_and_no_light_is_forgotten() {
        assert_eq!(apportion(&[1.0, 3.0], 100), [0, 25, 100]);
        assert_eq!(apportion(&[1.0, 0.0, 1.0], 10), [0, 5, 5, 10]);
        assert_eq!(apportion(&[1e-9, 1.0], 10), [0, 1, 10]);
        assert_eq!(apportion(&[], 10), [0]);
    }
}
