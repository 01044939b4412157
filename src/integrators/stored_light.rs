//! What the photon maps say about the light at a surface.

use std::f64::consts::FRAC_1_PI;

use arrayvec::ArrayVec;

use super::{RenderContext, Scratch};
use crate::color::Rgb;
use crate::geometry::SurfacePoint;
use crate::materials::Scattering;
use crate::photons::map::{Estimate, IrradianceSample, PhotonMap, Site, Surroundings};
use crate::photons::{PhotonClass, PhotonMaps};
use crate::stats::tally::{self, Event, Part};

/// Where photons count at a surface: on the side that is seen, and on the other one too if
/// diffuse light comes through. The first is the side that is seen.
pub(super) fn sites(sp: &SurfacePoint, bsdf: &impl Scattering) -> ArrayVec<Site, 2> {
    let ng = if sp.front { sp.ng } else { -sp.ng };
    let mut out = ArrayVec::new();
    out.push(Site::new(sp.p, ng));
    if bsdf.has_diffuse_transmission() {
        out.push(Site::new(sp.p, -ng));
    }
    out
}

/// The maps of a scene.
pub(super) struct Stored<'a> {
    maps: &'a PhotonMaps,
    around: Surroundings<'a>,
}

impl<'a> Stored<'a> {
    pub(super) fn new(cx: &RenderContext<'a>) -> Self {
        Self {
            maps: cx.maps,
            around: Surroundings {
                scene: cx.scene,
                accel: cx.accel,
            },
        }
    }
}

impl Stored<'_> {
    /// Radiance that diffuse lobes send back of the photons of a map that `keep` accepts; counted
    /// as `lookup`.
    pub(super) fn density(
        &self,
        map: &PhotonMap,
        sites: &[Site],
        bsdf: &impl Scattering,
        keep: impl Fn(PhotonClass) -> bool,
        lookup: Event,
        scratch: &mut Scratch,
    ) -> Estimate {
        let mut sum = Estimate::default();
        for site in sites {
            tally::count(lookup);
            let f = |wi| bsdf.diffuse_f(wi);
            let e = map.estimate(site, self.around, &mut scratch.nearest, &keep, f);
            sum.value += e.value;
            sum.density += e.density;
            sum.radius = sum.radius.max(e.radius);
        }
        sum
    }

    /// The irradiance estimated nearest to a site.
    pub(super) fn irradiance(&self, site: &Site) -> Option<&IrradianceSample> {
        let map = self.maps.irradiance.as_ref()?;
        tally::count(Event::GlobalLookups);
        map.nearest(site)
    }

    /// Radiance that diffuse lobes which are not Lambert's send back, from all photons but
    /// caustic ones.
    pub(super) fn reflected(
        &self,
        sites: &[Site],
        bsdf: &impl Scattering,
        scratch: &mut Scratch,
    ) -> Rgb {
        let Some(map) = &self.maps.global else {
            return Rgb::ZERO;
        };
        let keep = |class| class != PhotonClass::Caustic;
        let lookup = Event::GlobalLookups;
        self.density(map, sites, bsdf, keep, lookup, scratch).value
    }

    /// Radiance sent back of the light that caustics on other surfaces shed here. Diffuse lobes
    /// that are not Lambert's are taken by their albedo: this light comes from all around.
    pub(super) fn glow(&self, sites: &[Site], bsdf: &impl Scattering) -> Rgb {
        let Some(map) = &self.maps.glow else {
            return Rgb::ZERO;
        };
        let _scope = tally::enter(Part::Caustics);
        tally::count(Event::CausticLookups);
        let albedos = [bsdf.reflected_albedo(), bsdf.transmitted_albedo()];
        let mut sum = Rgb::ZERO;
        for (site, albedo) in sites.iter().zip(albedos) {
            if let Some(s) = map.nearest(site) {
                sum += albedo * s.irradiance() * FRAC_1_PI;
            }
        }
        sum
    }
}
