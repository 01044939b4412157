//! What photons are worth where they land.

use std::sync::Arc;

use rayon::prelude::*;

use crate::color::Rgb;
use crate::geometry::SurfacePoint;
use crate::photons::map::{Nearest, PhotonMap, Site, surface_area};
use crate::photons::{Photon, PhotonClass, Purpose};
use crate::scene::Scene;

/// Points that tell how densely a place is seen.
const NEAREST: usize = 8;

/// What emission is guided by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum GuideBy {
    /// Nothing: photons are shared by the flux of the lights.
    Off,
    /// Where light goes, whoever looks: photons do not depend on the camera.
    #[default]
    Light,
    /// Where light goes that the camera sees.
    View,
}

impl GuideBy {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Light => "light",
            Self::View => "view",
        }
    }
}

/// What emission is guided by, at hand.
#[derive(Clone, Debug, Default)]
pub enum Guidance {
    /// Nothing.
    Off,
    /// All photons that are stored count alike.
    #[default]
    Light,
    /// Photons count where somebody looks.
    View(Arc<Sights>),
}

/// Points of diffuse surfaces that paths from the camera have met.
#[derive(Debug)]
pub struct Sights {
    seen: PhotonMap,
    gathered: PhotonMap,
}

impl Sights {
    /// `seen` has points that the camera sees, in mirrors and through glass as well, `gathered` those
    /// that are seen from there.
    pub fn new(scene: &Scene, seen: &[SurfacePoint], gathered: &[SurfacePoint]) -> Self {
        let area = surface_area(scene);
        let map = |points: &[SurfacePoint]| {
            let share = Rgb::splat(1.0 / points.len().max(1) as f64);
            let point = |sp: &SurfacePoint| {
                let ng = if sp.front { sp.ng } else { -sp.ng };
                Photon::new(sp.p, ng, ng, share, PhotonClass::Direct)
            };
            PhotonMap::build(points.iter().map(point).collect(), NEAREST, area)
        };
        Self {
            seen: map(seen),
            gathered: map(gathered),
        }
    }

    /// Light that photons bring to where the camera looks, in W times the share of the sights in a square
    /// metre.
    pub fn light(&self, photons: &[Photon]) -> f64 {
        let parts: Vec<f64> = photons
            .par_chunks(256)
            .map(|part| {
                let mut found = Nearest::new();
                let light = |p: &Photon| p.power().luminance() * self.around(p, false, &mut found);
                part.iter().map(light).sum()
            })
            .collect();
        parts.iter().sum()
    }

    /// Share of the sights per square metre, around a photon of a map for which purpose.
    fn around(&self, photon: &Photon, gathers: bool, found: &mut Nearest) -> f64 {
        let map = if gathers { &self.gathered } else { &self.seen };
        let site = Site {
            p: photon.p.into(),
            ng: photon.ng(),
        };
        let e = map.estimate_nearest(&site, found, |_| true, |_| Rgb::ONE);
        e.value.r
    }
}

impl Guidance {
    /// What it goes by.
    pub fn by(&self) -> GuideBy {
        match self {
            Self::Off => GuideBy::Off,
            Self::Light => GuideBy::Light,
            Self::View(_) => GuideBy::View,
        }
    }

    /// Worth of the photons that one left: the sum of their squared powers, each by where it is.
    /// Global photons are seen by what `gathers` light, if it does, all others by the camera.
    pub(super) fn worth<'p>(
        &self,
        photons: impl Iterator<Item = &'p Photon>,
        (purpose, gathers): (Purpose, bool),
        found: &mut Nearest,
    ) -> f64 {
        let gathers = gathers && purpose == Purpose::Global;
        photons
            // Others than those of the caustic map are asked of caustics.
            .filter(|p| !gathers || p.class != PhotonClass::Caustic)
            .map(|photon| {
                let worth = match self {
                    Self::View(sights) => sights.around(photon, gathers, found),
                    Self::Off | Self::Light => 1.0,
                };
                photon.power().luminance().powi(2) * worth
            })
            .sum()
    }
}
