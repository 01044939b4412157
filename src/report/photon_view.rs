//! Stored photons as the camera sees them: where an emission puts them, and how finely.

use crate::accel::Accelerator;
use crate::cameras::Camera;
use crate::control::Control;
use crate::effects::EffectSet;
use crate::film::{Channel, Image, Layer};
use crate::geometry::Ray;
use crate::math::DVec3;
use crate::photons::{
    EmissionContext, EmissionEntry, Photon, PhotonClass, PhotonSettings, PhotonSource, Purpose,
    follow_photons,
};
use crate::scene::Scene;
use crate::stats::PhotonCounts;

/// How far in front of a photon, in parts of its distance, nothing may lie if it is to be seen.
/// Photons are stored in single precision.
const CLEARANCE: f64 = 1e-4;

/// What one photon covers of its pixel. Dots add up as layers of paint do, so that pictures of few
/// and of many photons can be set side by side.
const OPACITY: f32 = 0.6;

/// Radiance that shows as the colour of a global photon, and of a caustic one.
const COLORS: [[f32; 3]; 2] = [[0.8; 3], [1.0, 0.35, 0.02]];

/// What is looked at, and through what.
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its ray tracer.
    pub accel: &'a dyn Accelerator,
    /// The camera.
    pub camera: &'a dyn Camera,
    /// Width of the picture in pixels.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
}

/// Photons per pixel.
#[derive(Clone, Debug)]
pub struct PhotonView {
    width: u32,
    height: u32,
    /// Photons of the global and of the caustic map in each pixel.
    pub seen: [Vec<u32>; 2],
    /// Sum over the first hits of global photons in each pixel of their cells' levels, and their
    /// number; empty if the emission has no cells.
    levels: Vec<(u32, u32)>,
    /// What became of the photons of either map.
    pub counts: [PhotonCounts; 2],
}

impl View<'_> {
    /// Emits, follows and finds the photons that the camera sees; of their paths all that is
    /// stored, or the part up to the `first` diffuse surface.
    pub fn photons(
        &self,
        emission: &EmissionEntry,
        settings: &PhotonSettings,
        first: bool,
        control: &Control,
    ) -> PhotonView {
        let pixels = self.width as usize * self.height as usize;
        let mut out = PhotonView {
            width: self.width,
            height: self.height,
            seen: [vec![0; pixels], vec![0; pixels]],
            levels: Vec::new(),
            counts: Default::default(),
        };
        for (map, purpose) in [Purpose::Global, Purpose::Caustic].into_iter().enumerate() {
            let source = (emission.build)(&EmissionContext {
                scene: self.scene,
                accel: self.accel,
                seed: settings.seed,
                purpose,
                count: [settings.global, settings.caustic][map],
                guide: None,
            });
            let stored = follow_photons(
                self.scene,
                self.accel,
                &*source,
                purpose,
                EffectSet::all(),
                settings,
                control,
            );
            out.counts[map] = stored.counts;
            let all = stored.photons.iter();
            for p in all.filter(|p| !first || p.class != PhotonClass::Indirect) {
                if let Some(i) = self.pixel_of(p) {
                    out.seen[map][i] += 1;
                }
            }
            if purpose == Purpose::Global && source.cells() > 0 {
                out.levels = self.levels(&*source);
            }
        }
        out
    }

    /// The pixel that shows a photon, if the camera sees the place and the side it arrived at.
    fn pixel_of(&self, photon: &Photon) -> Option<usize> {
        let p = DVec3::from(photon.p.map(f64::from));
        self.pixel(p, photon.ng().as_dvec3())
    }

    /// The pixel that shows the side `ng` of the surface at `p`.
    fn pixel(&self, p: DVec3, ng: DVec3) -> Option<usize> {
        let ([x, y], from) = self.camera.project(p)?;
        if !((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y)) || ng.dot(from - p) <= 0.0 {
            return None;
        }
        let near = p + (from - p) * CLEARANCE;
        if self.accel.occluded(&Ray::segment(from, near)) {
            return None;
        }
        let at = |x: f64, n: u32| ((x * f64::from(n)) as u32).min(n - 1) as usize;
        Some(at(y, self.height) * self.width as usize + at(x, self.width))
    }

    /// Levels of the cells that the first hits in each pixel come from.
    fn levels(&self, source: &dyn PhotonSource) -> Vec<(u32, u32)> {
        let mut out = vec![(0, 0); self.width as usize * self.height as usize];
        for i in 0..source.len() {
            let (Some(level), Some(photon)) = (source.level(i), source.emit(i)) else {
                continue;
            };
            let Some(hit) = self.accel.intersect(&photon.ray) else {
                continue;
            };
            let sp = self.scene.surface_point(&photon.ray, &hit);
            let ng = if sp.front { sp.ng } else { -sp.ng };
            if let Some(k) = self.pixel(sp.p, ng) {
                out[k].0 += level;
                out[k].1 += 1;
            }
        }
        out
    }
}

impl PhotonView {
    /// As an image: dots in the main layer, the numbers behind them in layers of their own.
    pub fn image(&self) -> Image {
        let channel = |name: &str, half, data| Channel {
            name: name.into(),
            half,
            data,
        };
        let cover = |map: usize, i: usize| {
            let bare = (1.0 - OPACITY).powf(self.seen[map][i] as f32);
            1.0 - bare
        };
        let shown = |c: usize| -> Vec<f32> {
            (0..self.seen[0].len())
                .map(|i| {
                    let [below, above] = [0, 1].map(|map| cover(map, i));
                    below * COLORS[0][c] * (1.0 - above) + above * COLORS[1][c]
                })
                .collect()
        };
        let numbers = |map: usize| self.seen[map].iter().map(|n| *n as f32).collect();
        let mut layers = vec![
            Layer {
                name: String::new(),
                channels: ["R", "G", "B"]
                    .iter()
                    .enumerate()
                    .map(|(c, name)| channel(name, true, shown(c)))
                    .collect(),
            },
            Layer {
                name: "photons".into(),
                channels: vec![
                    channel("global", false, numbers(0)),
                    channel("caustic", false, numbers(1)),
                ],
            },
        ];
        if !self.levels.is_empty() {
            let mean = |(sum, n): &(u32, u32)| *sum as f32 / (*n).max(1) as f32;
            layers.push(Layer {
                name: "cells".into(),
                channels: vec![channel(
                    "level",
                    false,
                    self.levels.iter().map(mean).collect(),
                )],
            });
        }
        Image {
            width: self.width,
            height: self.height,
            layers,
        }
    }
}
