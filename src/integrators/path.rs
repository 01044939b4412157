//! `path`: unbiased path tracing with next-event estimation and multiple importance sampling;
//! the reference for everything else.
//!
//! Source: Kajiya, *The Rendering Equation*, 1986; Veach 1997, chapters 8 to 10.

use super::footprint::Trail;
use super::light_sampling::{escaped, power_heuristic, sample_direct};
use super::{CameraRay, Integrator, IntegratorEntry, RenderContext, Scratch};
use crate::color::Rgb;
use crate::film::{Component, PixelSample};
use crate::materials::{LobeClass, TransportMode};
use crate::sampling::Sampler;

/// Scattering events after which roulette begins.
const ROULETTE_DEPTH: u32 = 3;

/// Throughput below which roulette sets in, and which survivors are raised to. Ending paths
/// that still carry much makes the rest of them bright: in the box, roulette by the throughput
/// itself triples the error at equal samples.
const ROULETTE_WEIGHT: f64 = 0.1;

/// Longest path when neither roulette nor the user ends it.
const DEPTH_GUARD: u32 = 4096;

/// What a path from the camera has been through so far; decides the component that light found
/// next belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Walk {
    /// Nothing: `E`.
    Camera,
    /// A specular surface first: `E S …`.
    Specular,
    /// One diffuse surface: `E D`.
    Diffuse,
    /// One diffuse surface, then specular ones: `E D S⁺`.
    DiffuseSpecular,
    /// Two diffuse surfaces at least: `E D S* D …`.
    Indirect,
}

impl Walk {
    /// After one more scattering event.
    #[inline]
    fn after(self, class: LobeClass) -> Self {
        match (self, class == LobeClass::Diffuse) {
            (Self::Camera, true) => Self::Diffuse,
            (Self::Camera, false) => Self::Specular,
            (Self::Diffuse | Self::DiffuseSpecular, true) => Self::Indirect,
            (Self::Diffuse | Self::DiffuseSpecular, false) => Self::DiffuseSpecular,
            (other, _) => other,
        }
    }

    /// Where light belongs that is found now.
    #[inline]
    fn component(self) -> Component {
        match self {
            Self::Camera | Self::Diffuse => Component::Direct,
            Self::Specular => Component::Specular,
            Self::DiffuseSpecular => Component::Caustics,
            Self::Indirect => Component::Indirect,
        }
    }
}

struct Path<'a> {
    cx: RenderContext<'a>,
}

impl Integrator for Path<'_> {
    fn sample(
        &self,
        camera: CameraRay,
        sampler: &mut Sampler,
        out: &mut PixelSample,
        scratch: &mut Scratch,
    ) {
        let cx = &self.cx;
        let max_depth = cx.settings.max_depth.unwrap_or(DEPTH_GUARD);
        let CameraRay {
            mut ray,
            mut differential,
        } = camera;
        let mut beta = Rgb::ONE;
        let mut walk = Walk::Camera;
        // Density and origin of the last BSDF sample; none for a delta lobe or the camera.
        let mut last: Option<(f64, crate::math::DVec3)> = None;
        scratch.rays.camera += 1;
        for depth in 0.. {
            let Some(hit) = cx.accel.intersect(&ray) else {
                if depth > 0 || cx.settings.background {
                    out.add(walk.component(), beta * escaped(cx, &ray, last, 1.0, 1.0));
                }
                break;
            };
            let sp = cx.scene.surface_point(&ray, &hit);
            if let Some(t) = cx.scene.transmittance(&sp) {
                beta *= t;
            }
            if depth == 0 {
                out.alpha += 1.0;
                out.normal += sp.n;
                out.position += sp.p + cx.scene.center;
                out.depth += sp.distance;
            }
            let trail = Trail::land(differential, cx.scene, &ray, &sp);
            if sp.light.is_some() {
                let le = cx.scene.emitted(&sp, trail.footprint());
                if !le.is_black() {
                    let weight = last.map_or(1.0, |(pdf, from)| {
                        power_heuristic(1.0, pdf, 1.0, cx.scene.pdf_light(from, &sp))
                    });
                    out.add(walk.component(), beta * le * weight);
                }
            }
            let bsdf = cx
                .scene
                .bsdf(&sp, trail.footprint(), TransportMode::Radiance);
            if depth == 0 {
                out.albedo += bsdf.albedo();
            }
            if let Some(color) = bsdf.shown() {
                if matches!(walk, Walk::Camera | Walk::Specular) {
                    out.add(walk.component(), beta * color);
                }
                break;
            }
            if depth >= max_depth {
                break;
            }
            if bsdf.has_finite() {
                let u = sampler.next_2d();
                if let Some(direct) = sample_direct(cx, &sp, &bsdf, u, 1.0, 1.0) {
                    scratch.rays.shadow += 1;
                    if !cx.accel.occluded(&direct.ray) {
                        let diffuse = walk.after(LobeClass::Diffuse).component();
                        out.add(diffuse, beta * direct.value.diffuse);
                        let glossy = walk.after(LobeClass::Glossy).component();
                        out.add(glossy, beta * direct.value.glossy);
                    }
                }
            }
            let u = sampler.next_2d();
            let Some(s) = bsdf.sample(sampler.next_1d(), u) else {
                break;
            };
            beta *= s.weight;
            walk = walk.after(s.class);
            last = (s.class != LobeClass::Delta).then_some((s.pdf, sp.p));
            if cx.settings.roulette && depth + 1 >= ROULETTE_DEPTH {
                let survive = (beta.max_channel() / ROULETTE_WEIGHT).min(1.0);
                if sampler.next_1d() >= survive {
                    break;
                }
                beta = beta / survive;
            }
            if beta.is_black() {
                break;
            }
            ray = sp.spawn(s.wi);
            differential = trail.leave(&sp, &s);
            scratch.rays.bounce += 1;
        }
    }
}

/// The table's line.
pub(super) const ENTRY: IntegratorEntry = IntegratorEntry {
    name: "path",
    doc: "unbiased path tracing with next-event estimation and MIS: the reference",
    photons: false,
    build: |cx| Box::new(Path { cx }),
};
