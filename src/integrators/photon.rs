//! `photon`: pass 2 of photon mapping (Jensen 1996; Namae and Makino 2002, section 2).
//!
//! From the camera a chain of specular surfaces is followed; at each diffuse surface on it
//! - **direct** light comes by shadow rays,
//! - **caustics** (`D S⁺ L`) from the caustic map,
//! - **indirect** light (`D S* D …`) from the global map, seen by final-gather rays, or directly
//!   with the photons that met another diffuse surface before; with gather rays, the part
//!   `D S* D S⁺ L` comes from the glow map instead, and what the rays see leaves it out.
//!
//! Every light path falls into exactly one of these. A gather ray that meets a light itself
//! belongs to the direct light and is weighed against the shadow rays; one that meets a light
//! by way of specular surfaces is left to the caustic map.

use std::f64::consts::FRAC_1_PI;

use super::footprint::Trail;
use super::light_sampling::{power_heuristic, sample_direct};
use super::stored_light::{Stored, sites};
use super::{CameraRay, Integrator, IntegratorEntry, RenderContext, Scratch};
use arrayvec::ArrayVec;

use crate::color::Rgb;
use crate::effects::EffectSet;
use crate::film::{Component, PixelSample};
use crate::geometry::{Differential, Footprint, Ray, SurfacePoint};
use crate::materials::{Bsdf, LobeClass, TransportMode};
use crate::math::DVec3;
use crate::photons::PhotonClass;
use crate::sampling::Sampler;

/// Longest chain of specular surfaces.
const CHAIN_GUARD: u32 = 256;

/// Scattering events after which roulette may end a specular chain.
const ROULETTE_DEPTH: u32 = 3;

/// Throughput below which roulette sets in, and which survivors are raised to. Ending paths
/// that still carry much makes the rest of them bright: in the box, roulette by the throughput
/// itself triples the error at equal samples.
const ROULETTE_WEIGHT: f64 = 0.1;

/// A gather ray shorter than this many kernel radii sees the kernel itself, as splotches in
/// corners: there the path is followed one surface further instead.
const NEAR: f64 = 2.0;

/// How often a gather path may go one surface further.
const NEAR_STEPS: u32 = 3;

struct PhotonMapping<'a> {
    cx: RenderContext<'a>,
}

/// Scattering events up to which a chain of smooth dielectrics is split rather than sampled.
const SPLIT_DEPTH: u32 = 3;

/// Most chains that wait: at each of the first events one branch goes on and the others wait.
const MAX_CHAINS: usize = 3 * SPLIT_DEPTH as usize + 1;

/// A final-gather path at its next diffuse surface.
struct Gathered {
    sp: SurfacePoint,
    trail: Trail,
    bsdf: Bsdf,
    beta: Rgb,
}

/// A specular chain from the camera, at its next segment.
#[derive(Clone, Copy)]
struct Chain {
    ray: Ray,
    differential: Option<Differential>,
    beta: Rgb,
    /// Scattering events so far.
    depth: u32,
    /// Density and origin of the last direction; none for a delta lobe or the camera.
    last: Option<(f64, DVec3)>,
}

impl Integrator for PhotonMapping<'_> {
    fn sample(
        &self,
        camera: CameraRay,
        sampler: &mut Sampler,
        out: &mut PixelSample,
        scratch: &mut Scratch,
    ) {
        scratch.rays.camera += 1;
        let mut pending = ArrayVec::<Chain, MAX_CHAINS>::new();
        pending.push(Chain {
            ray: camera.ray,
            differential: camera.differential,
            beta: Rgb::ONE,
            depth: 0,
            last: None,
        });
        let mut diffuse_seen = false;
        while let Some(chain) = pending.pop() {
            self.follow(
                chain,
                sampler,
                out,
                scratch,
                &mut pending,
                &mut diffuse_seen,
            );
        }
    }
}

impl PhotonMapping<'_> {
    /// Follows one chain to its end; where it splits, the other branch is left in `pending`.
    fn follow(
        &self,
        chain: Chain,
        sampler: &mut Sampler,
        out: &mut PixelSample,
        scratch: &mut Scratch,
        pending: &mut ArrayVec<Chain, MAX_CHAINS>,
        diffuse_seen: &mut bool,
    ) {
        let cx = &self.cx;
        let guard = cx.settings.max_depth.unwrap_or(CHAIN_GUARD);
        let Chain {
            mut ray,
            mut differential,
            mut beta,
            depth: start,
            mut last,
        } = chain;
        for depth in start.. {
            let Some(hit) = cx.accel.intersect(&ray) else {
                return;
            };
            let sp = cx.scene.surface_point(&ray, &hit);
            if let Some(t) = cx.scene.transmittance(&sp) {
                beta *= t;
            }
            let trail = Trail::land(differential, cx.scene, &ray, &sp);
            let bsdf = cx
                .scene
                .bsdf(&sp, trail.footprint(), TransportMode::Radiance);
            if depth == 0 {
                out.alpha += 1.0;
                out.albedo += bsdf.albedo();
                out.normal += sp.n;
                out.position += sp.p + cx.scene.center;
                out.depth += sp.distance;
            }
            if sp.light.is_some() {
                let weight = last.map_or(1.0, |(pdf, from)| {
                    power_heuristic(1.0, pdf, 1.0, cx.scene.pdf_light(from, &sp))
                });
                let component = if depth == 0 {
                    Component::Direct
                } else {
                    Component::Specular
                };
                out.add(
                    component,
                    beta * cx.scene.emitted(&sp, trail.footprint()) * weight,
                );
            }
            if let Some(color) = bsdf.shown() {
                let component = if depth == 0 {
                    Component::Direct
                } else {
                    Component::Specular
                };
                out.add(component, beta * color);
                return;
            }
            if depth >= guard {
                return;
            }
            if bsdf.has_diffuse() {
                let first = !std::mem::replace(diffuse_seen, true);
                let share = beta.max_channel().min(1.0);
                let densities = first.then_some(&mut out.photons);
                let part = self.diffuse(&sp, &trail, &bsdf, share, sampler, densities, scratch);
                for (component, radiance) in [
                    (Component::Direct, part.direct),
                    (Component::Caustics, part.caustics),
                    (Component::Indirect, part.indirect),
                ] {
                    let to = if depth == 0 {
                        component
                    } else {
                        Component::Specular
                    };
                    out.add(to, beta * radiance);
                }
            }
            let chains = EffectSet::SPECULAR | EffectSet::REFRACTION;
            if !bsdf.has_specular() || !cx.effects.intersects(chains) {
                return;
            }
            let bsdf = bsdf.specular_only();
            if depth < SPLIT_DEPTH {
                // Reflection and refraction are both followed: their shares are known exactly,
                // and a rare bright reflection is the worst noise that glass has.
                if let Some(mut branches) = bsdf.branches() {
                    let Some(main) = branches.pop() else { return };
                    for b in branches {
                        let side = Chain {
                            ray: sp.spawn(b.wi),
                            differential: trail.leave(&sp, &b),
                            beta: beta * b.weight,
                            depth: depth + 1,
                            last: None,
                        };
                        scratch.rays.bounce += 1;
                        if pending.try_push(side).is_err() {
                            debug_assert!(false, "more chains than splits allow");
                        }
                    }
                    beta *= main.weight;
                    last = None;
                    ray = sp.spawn(main.wi);
                    differential = trail.leave(&sp, &main);
                    scratch.rays.bounce += 1;
                    continue;
                }
            }
            if bsdf.has_finite() {
                let u = sampler.next_2d();
                if let Some(direct) = sample_direct(cx, &sp, &bsdf, u, 1.0, 1.0) {
                    scratch.rays.shadow += 1;
                    if !cx.accel.occluded(&direct.ray) {
                        out.add(Component::Specular, beta * direct.value.glossy);
                    }
                }
            }
            let u = sampler.next_2d();
            let Some(s) = bsdf.sample(sampler.next_1d(), u) else {
                return;
            };
            beta *= s.weight;
            last = (s.class != LobeClass::Delta).then_some((s.pdf, sp.p));
            if cx.settings.roulette && depth + 1 >= ROULETTE_DEPTH {
                let survive = (beta.max_channel() / ROULETTE_WEIGHT).min(1.0);
                if sampler.next_1d() >= survive {
                    return;
                }
                beta = beta / survive;
            }
            if beta.is_black() {
                return;
            }
            ray = sp.spawn(s.wi);
            differential = trail.leave(&sp, &s);
            scratch.rays.bounce += 1;
        }
    }
}

/// Light reflected by the diffuse lobes of a surface, by the way it came.
#[derive(Default)]
struct DiffuseLight {
    direct: Rgb,
    caustics: Rgb,
    indirect: Rgb,
}

impl PhotonMapping<'_> {
    /// Everything that the diffuse lobes at a point send back. `share` is how much of it the
    /// pixel sees: a faint branch gets fewer rays. `densities` takes the densities of global and
    /// caustic photons, if they are wanted.
    #[expect(
        clippy::too_many_arguments,
        reason = "what a surface point is, and what it may use"
    )]
    fn diffuse(
        &self,
        sp: &SurfacePoint,
        trail: &Trail,
        full: &Bsdf,
        share: f64,
        sampler: &mut Sampler,
        mut densities: Option<&mut [f64; 2]>,
        scratch: &mut Scratch,
    ) -> DiffuseLight {
        let cx = &self.cx;
        let filtered;
        let bsdf = if full.has_specular() {
            filtered = full.diffuse_only();
            &filtered
        } else {
            full
        };
        let mut light = DiffuseLight::default();
        let indirect = cx.effects.contains(EffectSet::INDIRECT);
        let rays = |n: u32| (f64::from(n) * share).ceil() as u32;
        let gather_rays = if indirect {
            rays(cx.settings.gather_rays)
        } else {
            0
        };
        let n_gather = f64::from(gather_rays);

        // Shadow rays.
        let n_shadow = if cx.effects.contains(EffectSet::DIRECT) {
            rays(cx.settings.shadow_rays)
        } else {
            0
        };
        for _ in 0..n_shadow {
            let u = sampler.next_2d();
            let sampled = sample_direct(cx, sp, bsdf, u, f64::from(n_shadow), n_gather);
            if let Some(direct) = sampled {
                scratch.rays.shadow += 1;
                if !cx.accel.occluded(&direct.ray) {
                    light.direct += direct.value.diffuse;
                }
            }
        }

        // The caustic map.
        let stored = Stored { maps: cx.maps };
        let sites = sites(sp, bsdf);
        if let Some(map) = &cx.maps.caustic {
            let e = stored.density(map, &sites, bsdf, |_| true, scratch);
            light.caustics += e.value;
            if let Some(d) = &mut densities {
                d[1] += e.density;
            }
        }

        // The global map: seen by gather rays, or directly.
        if let Some(d) = &mut densities
            && let Some(s) = stored.irradiance(&sites[0], scratch)
        {
            d[0] += f64::from(s.density);
        }
        if gather_rays == 0 {
            if let Some(map) = &cx.maps.global {
                let keep = |class| class == PhotonClass::Indirect;
                let e = stored.density(map, &sites, bsdf, keep, scratch);
                light.indirect += e.value;
                if let Some(d) = &mut densities {
                    d[0] += e.density;
                }
            }
            return light;
        }
        light.indirect += stored.glow(&sites, bsdf, scratch);
        let share = 1.0 / n_gather;
        for _ in 0..gather_rays {
            let u = sampler.next_2d();
            let Some(s) = bsdf.sample(sampler.next_1d(), u) else {
                continue;
            };
            let start = CameraRay {
                ray: sp.spawn(s.wi),
                differential: trail.leave(sp, &s),
            };
            scratch.rays.gather += 1;
            let shadow = f64::from(n_shadow);
            let mut seen = Rgb::ZERO;
            let next =
                self.next_diffuse(start, s.weight, sampler, scratch, |on, footprint, beta| {
                    let pdf_light = cx.scene.pdf_light(sp.p, on);
                    let weight = power_heuristic(n_gather, s.pdf, shadow, pdf_light);
                    seen = beta * cx.scene.emitted(on, footprint) * weight;
                });
            light.direct += seen * share;
            if let Some(next) = next {
                light.indirect += self.reflected(next, sampler, scratch, 0) * share;
            }
        }
        light
    }

    /// Follows a ray along specular surfaces to the next diffuse one. `on_light` is called if
    /// the ray meets a light before any surface.
    fn next_diffuse(
        &self,
        start: CameraRay,
        mut beta: Rgb,
        sampler: &mut Sampler,
        scratch: &mut Scratch,
        mut on_light: impl FnMut(&SurfacePoint, Option<Footprint>, Rgb),
    ) -> Option<Gathered> {
        let cx = &self.cx;
        let CameraRay {
            mut ray,
            mut differential,
        } = start;
        for depth in 0..CHAIN_GUARD {
            let hit = cx.accel.intersect(&ray)?;
            let sp = cx.scene.surface_point(&ray, &hit);
            if let Some(t) = cx.scene.transmittance(&sp) {
                beta *= t;
            }
            let trail = Trail::land(differential, cx.scene, &ray, &sp);
            if depth == 0 && sp.light.is_some() {
                on_light(&sp, trail.footprint(), beta);
            }
            let bsdf = cx
                .scene
                .bsdf(&sp, trail.footprint(), TransportMode::Radiance);
            let diffuse = bsdf.has_diffuse();
            if diffuse && !bsdf.has_specular() {
                return Some(Gathered {
                    sp,
                    trail,
                    bsdf,
                    beta,
                });
            }
            // A surface of both kinds: one of them is followed, by its share.
            let specular = if diffuse {
                let p = bsdf.diffuse_probability();
                if sampler.next_1d() < p {
                    let bsdf = bsdf.diffuse_only();
                    return Some(Gathered {
                        sp,
                        trail,
                        bsdf,
                        beta: beta / p,
                    });
                }
                beta = beta / (1.0 - p);
                bsdf.specular_only()
            } else {
                bsdf
            };
            let s = specular.sample(sampler.next_1d(), sampler.next_2d())?;
            beta *= s.weight;
            let survive = beta.max_channel().min(1.0);
            if depth >= ROULETTE_DEPTH {
                if sampler.next_1d() >= survive {
                    return None;
                }
                beta = beta / survive;
            }
            if beta.is_black() {
                return None;
            }
            ray = sp.spawn(s.wi);
            differential = trail.leave(&sp, &s);
            scratch.rays.gather += 1;
        }
        None
    }

    /// Radiance that a gather ray sees reflected at a diffuse surface, times its throughput.
    fn reflected(
        &self,
        at: Gathered,
        sampler: &mut Sampler,
        scratch: &mut Scratch,
        steps: u32,
    ) -> Rgb {
        let cx = &self.cx;
        let stored = Stored { maps: cx.maps };
        let sites = sites(&at.sp, &at.bsdf);
        let near = stored.irradiance(&sites[0], scratch);
        let radius = near.map_or(0.0, |s| f64::from(s.radius));
        if at.sp.distance >= NEAR * radius || steps >= NEAR_STEPS {
            return at.beta
                * match (at.bsdf.as_lambert(), near) {
                    (Some(albedo), Some(s)) => albedo * s.irradiance() * FRAC_1_PI,
                    (Some(_), None) => Rgb::ZERO,
                    (None, _) => stored.reflected(&sites, &at.bsdf, scratch),
                };
        }
        // Too near: direct light and glow here, the rest from one surface further. (Caustics here
        // are the glow of the surface that the gather ray left.)
        let mut sum = stored.glow(&sites, &at.bsdf, scratch);
        if let Some(direct) = sample_direct(cx, &at.sp, &at.bsdf, sampler.next_2d(), 1.0, 0.0) {
            scratch.rays.shadow += 1;
            if !cx.accel.occluded(&direct.ray) {
                sum += direct.value.diffuse;
            }
        }
        let u = sampler.next_2d();
        if let Some(s) = at.bsdf.sample(sampler.next_1d(), u) {
            let start = CameraRay {
                ray: at.sp.spawn(s.wi),
                differential: at.trail.leave(&at.sp, &s),
            };
            scratch.rays.gather += 1;
            if let Some(next) = self.next_diffuse(start, s.weight, sampler, scratch, |_, _, _| ()) {
                sum += self.reflected(next, sampler, scratch, steps + 1);
            }
        }
        at.beta * sum
    }
}

/// The table's line.
pub(super) const ENTRY: IntegratorEntry = IntegratorEntry {
    name: "photon",
    doc: "photon mapping: direct light by shadow rays, caustics and indirect light from photons",
    photons: true,
    build: |cx| Box::new(PhotonMapping { cx }),
};
