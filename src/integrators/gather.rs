//! The light that diffuse surfaces send back: by shadow rays, from the caustic map, and by
//! final-gather rays that look at the global map.

use std::f64::consts::FRAC_1_PI;

use super::Scratch;
use super::footprint::{Start, Trail};
use super::light_sampling::{View, power_heuristic, sample_direct};
use super::photon::{CHAIN_GUARD, PhotonMapping, ROULETTE_DEPTH};
use super::stored_light::{Stored, sites};
use crate::color::Rgb;
use crate::effects::EffectSet;
use crate::geometry::{Footprint, Ray, SurfacePoint};
use crate::materials::{Bsdf, Scattering, TransportMode};
use crate::photons::PhotonClass;
use crate::sampling::Sampler;
use crate::stats::tally::{self, Event, Part};

/// A gather ray shorter than this many kernel radii sees the kernel itself, as splotches in
/// corners: there the path is followed one surface further instead.
const NEAR: f64 = 2.0;

/// How often a gather path may go one surface further.
const NEAR_STEPS: u32 = 3;

/// What a gather ray meets before any surface that scatters.
enum Seen<'a> {
    /// A light.
    Light(&'a SurfacePoint, Option<Footprint>),
    /// Perhaps lights that it passes through, within some metres.
    Between(&'a Ray, f64),
    /// Nothing: the ray leaves the scene.
    Sky(&'a Ray),
}

/// Light reflected by the diffuse lobes of a surface, by the way it came.
#[derive(Default)]
pub(super) struct DiffuseLight {
    pub(super) direct: Rgb,
    pub(super) caustics: Rgb,
    pub(super) indirect: Rgb,
}

impl PhotonMapping<'_> {
    /// Everything that the diffuse lobes at a point send back. `shares` are those of the shadow rays
    /// and of the gather rays: a faint branch gets fewer. `densities` takes the densities of global and
    /// caustic photons, if they are wanted.
    #[expect(
        clippy::too_many_arguments,
        reason = "what a surface point is, and what it may use"
    )]
    pub(super) fn diffuse(
        &self,
        sp: &SurfacePoint,
        trail: &Trail,
        full: &Bsdf,
        shares: [f64; 2],
        sampler: &mut Sampler,
        mut densities: Option<&mut [f64; 2]>,
        scratch: &mut Scratch,
    ) -> DiffuseLight {
        let cx = &self.cx;
        let mut filtered;
        let bsdf = if full.has_specular() {
            filtered = full.clone();
            filtered.keep_diffuse();
            &filtered
        } else {
            full
        };
        let mut light = DiffuseLight::default();
        let indirect = cx.effects.contains(EffectSet::INDIRECT);
        let rays = |n: u32, share: f64| (f64::from(n) * share).ceil() as u32;
        let gather_rays = if indirect {
            rays(cx.settings.gather_rays, shares[1])
        } else {
            0
        };
        let n_gather = f64::from(gather_rays);

        // Shadow rays.
        let n_shadow = if cx.effects.contains(EffectSet::DIRECT) {
            rays(cx.settings.shadow_rays, shares[0])
        } else {
            0
        };
        let mut scope = tally::enter(Part::Direct);
        for _ in 0..n_shadow {
            let u = sampler.next_2d();
            let sampled = sample_direct(cx, sp, bsdf, u, f64::from(n_shadow), n_gather);
            if let Some(direct) = sampled {
                scratch.rays.shadow += 1;
                tally::ray(Part::Direct);
                if !cx.accel.occluded(&direct.ray) {
                    light.direct += direct.value.diffuse;
                }
            }
        }

        // The caustic map.
        let stored = Stored::new(cx);
        let sites = sites(sp, bsdf);
        if let Some(map) = &cx.maps.caustic {
            scope.switch(Part::Caustics);
            let lookup = Event::CausticLookups;
            let e = stored.density(map, &sites, bsdf, |_| true, lookup, scratch);
            light.caustics += e.value;
            if let Some(d) = &mut densities {
                d[1] += e.density;
            }
        }

        // The global map: seen by gather rays, or directly.
        scope.switch(Part::Indirect);
        if let Some(d) = &mut densities
            && let Some(s) = stored.irradiance(&sites[0])
        {
            d[0] += f64::from(s.density);
        }
        if gather_rays == 0 {
            if let Some(map) = &cx.maps.global {
                let keep = |class| class == PhotonClass::Indirect;
                let lookup = Event::GlobalLookups;
                let e = stored.density(map, &sites, bsdf, keep, lookup, scratch);
                light.indirect += e.value;
                if let Some(d) = &mut densities {
                    d[0] += e.density;
                }
            }
            return light;
        }
        light.indirect += stored.glow(&sites, bsdf);
        let share = 1.0 / n_gather;
        for _ in 0..gather_rays {
            let u = sampler.next_2d();
            let Some(s) = bsdf.sample(sampler.next_1d(), u) else {
                continue;
            };
            let start = trail.start(sp, &s);
            scratch.rays.gather += 1;
            tally::ray(Part::Indirect);
            let shadow = f64::from(n_shadow);
            let mut seen = Rgb::ZERO;
            let view = View {
                camera: false,
                last: Some((s.pdf, sp.p)),
                n_bsdf: n_gather,
                n_light: shadow,
            };
            let reflected = self.gather(start, s.weight, sampler, scratch, 0, |on, beta| {
                seen += beta
                    * match on {
                        Seen::Light(on, footprint) => {
                            let pdf_light = cx.pdf_light(sp.p, on);
                            cx.scene.emitted(on, footprint)
                                * power_heuristic(n_gather, s.pdf, shadow, pdf_light)
                        }
                        Seen::Sky(ray) => view.escaped(cx, ray),
                        Seen::Between(ray, reach) => view.crossed(cx, ray, reach),
                    };
            });
            light.direct += seen * share;
            light.indirect += reflected * share;
        }
        light
    }

    /// Follows a ray along specular surfaces to the next diffuse one: what that reflects, times
    /// the throughput. `on_light` is called if the ray meets a light before any surface. `steps`
    /// are the diffuse surfaces that the path has gone on from.
    fn gather(
        &self,
        start: Start,
        mut beta: Rgb,
        sampler: &mut Sampler,
        scratch: &mut Scratch,
        steps: u32,
        mut on_light: impl FnMut(Seen<'_>, Rgb),
    ) -> Rgb {
        let cx = &self.cx;
        let Start {
            mut ray,
            mut differential,
            mut inside,
        } = start;
        for depth in 0..CHAIN_GUARD {
            let Some(hit) = cx.accel.intersect(&ray) else {
                if depth == 0 {
                    on_light(Seen::Sky(&ray), beta);
                }
                return Rgb::ZERO;
            };
            let sp = cx.scene.surface_point(&ray, &hit);
            if depth == 0 && !cx.scene.bodiless().is_empty() {
                on_light(Seen::Between(&ray, sp.distance), beta);
            }
            let trail = Trail::land(&differential, inside, cx.scene, &ray, &sp);
            if let Some(t) = cx.scene.transmittance(&sp, trail.crossing()) {
                beta *= t;
            }
            if depth == 0 && sp.light.is_some() {
                on_light(Seen::Light(&sp, trail.footprint()), beta);
            }
            if let Some(matte) = cx.scene.matte(&sp) {
                return beta * self.reflected(&sp, &trail, &matte, sampler, scratch, steps);
            }
            let mut bsdf = Bsdf::new(&sp, TransportMode::Radiance);
            cx.scene.scatter(&sp, trail.footprint(), &mut bsdf);
            trail.crossing().apply(&mut bsdf);
            let diffuse = bsdf.has_diffuse();
            if diffuse && !bsdf.has_specular() {
                return beta * self.reflected(&sp, &trail, &bsdf, sampler, scratch, steps);
            }
            // A surface of both kinds: one of them is followed, by its share.
            if diffuse {
                let p = bsdf.diffuse_probability();
                if sampler.next_1d() < p {
                    bsdf.keep_diffuse();
                    let reflected = self.reflected(&sp, &trail, &bsdf, sampler, scratch, steps);
                    return beta / p * reflected;
                }
                beta = beta / (1.0 - p);
                bsdf.keep_specular();
            }
            let (u_lobe, u) = (sampler.next_1d(), sampler.next_2d());
            let Some(s) = bsdf.sample_carried(beta, u_lobe, u, || sampler.next_1d()) else {
                return Rgb::ZERO;
            };
            let follows = cx.effects.follow(cx.scene, &sp, s.class, s.transmitted);
            if follows.is_none() {
                return Rgb::ZERO;
            }
            beta *= s.weight;
            let survive = beta.max_channel().min(1.0);
            if depth >= ROULETTE_DEPTH {
                if sampler.next_1d() >= survive {
                    return Rgb::ZERO;
                }
                beta = beta / survive;
            }
            if beta.is_black() {
                return Rgb::ZERO;
            }
            ray = sp.spawn(s.wi);
            differential = trail.leave(&sp, &s);
            inside = trail.beyond(&s);
            scratch.rays.gather += 1;
            tally::ray(Part::Indirect);
        }
        Rgb::ZERO
    }

    /// Radiance that a gather ray sees reflected at a diffuse surface.
    fn reflected(
        &self,
        sp: &SurfacePoint,
        trail: &Trail,
        bsdf: &impl Scattering,
        sampler: &mut Sampler,
        scratch: &mut Scratch,
        steps: u32,
    ) -> Rgb {
        let cx = &self.cx;
        let stored = Stored::new(cx);
        let sites = sites(sp, bsdf);
        let near = stored.irradiance(&sites[0]);
        let radius = near.map_or(0.0, |s| f64::from(s.radius));
        if sp.distance >= NEAR * radius || steps >= NEAR_STEPS {
            return match (bsdf.as_lambert(), near) {
                (Some(albedo), Some(s)) => albedo * s.irradiance() * FRAC_1_PI,
                _ => stored.reflected(&sites, bsdf, scratch),
            };
        }
        // Too near: direct light and glow here, the rest from one surface further. (Caustics here
        // are the glow of the surface that the gather ray left.)
        let mut sum = stored.glow(&sites, bsdf);
        if let Some(direct) = sample_direct(cx, sp, bsdf, sampler.next_2d(), 1.0, 0.0) {
            scratch.rays.shadow += 1;
            tally::ray(Part::Indirect);
            if !cx.accel.occluded(&direct.ray) {
                sum += direct.value.diffuse;
            }
        }
        let u = sampler.next_2d();
        if let Some(s) = bsdf.sample(sampler.next_1d(), u) {
            let start = trail.start(sp, &s);
            scratch.rays.gather += 1;
            tally::ray(Part::Indirect);
            sum += self.gather(start, s.weight, sampler, scratch, steps + 1, |_, _| ());
        }
        sum
    }
}
