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

use super::footprint::Trail;
use super::light_sampling::{View, power_heuristic, sample_direct};
use super::{Integrator, IntegratorEntry, PhotonNeeds, RenderContext, Sample, Scratch};
use arrayvec::ArrayVec;

use crate::color::Rgb;
use crate::film::{Component, PixelSample};
use crate::geometry::{Differential, Ray};
use crate::materials::{Bsdf, LobeClass, TransportMode};
use crate::math::DVec3;
use crate::sampling::Sampler;
use crate::scene::Inside;
use crate::stats::tally::{self, Part};

/// Longest chain of specular surfaces.
pub(super) const CHAIN_GUARD: u32 = 256;

/// Scattering events after which roulette may end a specular chain.
pub(super) const ROULETTE_DEPTH: u32 = 3;

/// Throughput below which roulette sets in, and which survivors are raised to. Ending paths
/// that still carry much makes the rest of them bright: in the box, roulette by the throughput
/// itself triples the error at equal samples.
const ROULETTE_WEIGHT: f64 = 0.1;

pub(super) struct PhotonMapping<'a> {
    pub(super) cx: RenderContext<'a>,
}

/// Scattering events up to which a chain of smooth dielectrics is split rather than sampled.
const SPLIT_DEPTH: u32 = 3;

/// Most chains that wait: at each of the first events one branch goes on and the others wait.
const MAX_CHAINS: usize = 3 * SPLIT_DEPTH as usize + 1;

/// A specular chain from the camera, at its next segment.
#[derive(Clone, Copy)]
struct Chain {
    ray: Ray,
    differential: Option<Differential>,
    inside: Inside,
    beta: Rgb,
    /// Share of the gather rays at the next surface.
    gathering: f64,
    /// Scattering events so far.
    depth: u32,
    /// Density and origin of the last direction; none for a delta lobe or the camera.
    last: Option<(f64, DVec3)>,
    /// What it is followed for.
    part: Part,
}

impl Integrator for PhotonMapping<'_> {
    fn sample(&self, batch: &mut [Sample], sums: &mut [PixelSample], scratch: &mut Scratch) {
        scratch.rays.camera += batch.len() as u64;
        for sample in batch {
            let mut pending = ArrayVec::<Chain, MAX_CHAINS>::new();
            pending.push(Chain {
                ray: sample.camera.ray,
                differential: sample.camera.differential,
                inside: self.cx.scene.enclosing(sample.camera.ray.origin()),
                beta: Rgb::ONE,
                gathering: sample.gathering,
                depth: 0,
                last: None,
                part: Part::Rest,
            });
            let mut diffuse_seen = false;
            while let Some(chain) = pending.pop() {
                self.follow(
                    chain,
                    &mut sample.sampler,
                    &mut sums[sample.pixel],
                    scratch,
                    &mut pending,
                    &mut diffuse_seen,
                );
            }
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
            mut inside,
            mut beta,
            mut gathering,
            depth: start,
            mut last,
            mut part,
        } = chain;
        let mut scope = tally::enter(part);
        for depth in start.. {
            scope.switch(part);
            // Of what is seen along this ray.
            let component = if depth == 0 {
                Component::Direct
            } else {
                Component::Specular
            };
            let view = View::of_path(depth, last);
            let Some(hit) = cx.accel.intersect(&ray) else {
                out.add(component, beta * view.escaped(cx, &ray));
                return;
            };
            let sp = cx.scene.surface_point(&ray, &hit);
            out.add(component, beta * view.crossed(cx, &ray, sp.distance));
            let trail = Trail::land(&differential, inside, cx.scene, &ray, &sp);
            if let Some(t) = cx.scene.transmittance(&sp, trail.crossing()) {
                beta *= t;
            }
            let mut bsdf = Bsdf::new(&sp, TransportMode::Radiance);
            cx.scene.scatter(&sp, trail.footprint(), &mut bsdf);
            trail.crossing().apply(&mut bsdf);
            if depth == 0 {
                out.alpha += 1.0;
                out.albedo += bsdf.albedo();
                out.normal += sp.n;
                out.position += sp.p + cx.scene.center;
                out.depth += sp.distance;
            }
            if sp.light.is_some() {
                let weight = last.map_or(1.0, |(pdf, from)| {
                    power_heuristic(1.0, pdf, 1.0, cx.pdf_light(from, &sp))
                });
                out.add(
                    component,
                    beta * cx.scene.emitted(&sp, trail.footprint()) * weight,
                );
            }
            if let Some(color) = bsdf.shown() {
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
                let shares = [share, share * gathering];
                let part = self.diffuse(&sp, &trail, &bsdf, shares, sampler, densities, scratch);
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
            if !bsdf.has_specular() {
                return;
            }
            bsdf.keep_specular();
            gathering = 1.0;
            if depth < SPLIT_DEPTH {
                // Reflection and refraction are both followed: their shares are known exactly,
                // and a rare bright reflection is the worst noise that glass has.
                if let Some(branches) = bsdf.branches() {
                    let mut branches: ArrayVec<_, 4> = branches
                        .into_iter()
                        // A path of one colour has no use for the other branches of a prism.
                        .filter(|b| !(beta * b.weight).is_black())
                        .filter_map(|b| {
                            let (class, through) = (b.class, b.transmitted);
                            Some((b, cx.effects.follow(cx.scene, &sp, class, through)?))
                        })
                        .collect();
                    let Some((main, follows)) = branches.pop() else {
                        return;
                    };
                    for (b, part) in branches {
                        let side = Chain {
                            ray: sp.spawn(b.wi),
                            differential: trail.leave(&sp, &b),
                            inside: trail.beyond(&b),
                            beta: beta * b.weight,
                            gathering,
                            depth: depth + 1,
                            last: None,
                            part,
                        };
                        scratch.rays.bounce += 1;
                        tally::ray(part);
                        if pending.try_push(side).is_err() {
                            debug_assert!(false, "more chains than splits allow");
                        }
                    }
                    beta *= main.weight;
                    last = None;
                    ray = sp.spawn(main.wi);
                    differential = trail.leave(&sp, &main);
                    inside = trail.beyond(&main);
                    part = follows;
                    scratch.rays.bounce += 1;
                    tally::ray(part);
                    continue;
                }
            }
            if bsdf.has_finite() {
                let u = sampler.next_2d();
                let direct = sample_direct(cx, &sp, &bsdf, u, 1.0, 1.0);
                if let Some(direct) = direct.filter(|d| d.follows_glossy(cx, &sp)) {
                    scratch.rays.shadow += 1;
                    tally::ray(direct.glossy_part(cx, &sp));
                    if !cx.accel.occluded(&direct.ray) {
                        out.add(Component::Specular, beta * direct.value.glossy);
                    }
                }
            }
            let u = sampler.next_2d();
            let u_lobe = sampler.next_1d();
            let Some(s) = bsdf.sample_carried(beta, u_lobe, u, || sampler.next_1d()) else {
                return;
            };
            let Some(follows) = cx.effects.follow(cx.scene, &sp, s.class, s.transmitted) else {
                return;
            };
            part = follows;
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
            inside = trail.beyond(&s);
            scratch.rays.bounce += 1;
            tally::ray(part);
        }
    }
}

/// The table's line.
pub(super) const ENTRY: IntegratorEntry = IntegratorEntry {
    name: "photon",
    doc: "photon mapping: direct light by shadow rays, caustics and indirect light from photons",
    photons: PhotonNeeds::All,
    suits: super::Outlook::wants_photons,
    build: |cx| Box::new(PhotonMapping { cx }),
};
