//! Next-event estimation: a sample of direct light at a surface point.

use super::RenderContext;
use crate::color::Rgb;
use crate::effects::specular_part;
use crate::geometry::{LightId, Ray, SurfacePoint};
use crate::materials::{BsdfValue, LobeClass, Scattering};
use crate::math::DVec3;
use crate::stats::tally::Part;

/// The power heuristic with exponent 2 (Veach 1997, 9.2.4) for `na` samples of density `a`
/// against `nb` of density `b`.
#[inline]
pub(super) fn power_heuristic(na: f64, a: f64, nb: f64, b: f64) -> f64 {
    let (x, y) = (na * a, nb * b);
    // Scaled by the larger one: squares of densities would overflow near delta lobes.
    if x >= y {
        let r = y / x;
        1.0 / (1.0 + r * r)
    } else {
        let r = x / y;
        r * r / (1.0 + r * r)
    }
}

/// What a ray may see of lights that are no surfaces of the scene.
#[derive(Clone, Copy)]
pub(super) struct View {
    /// Whether it is a camera ray.
    pub(super) camera: bool,
    /// Density and origin of the sample of the BSDF that chose the ray; none if no light sampling
    /// could have found the light.
    pub(super) last: Option<(f64, DVec3)>,
    /// Such samples of the BSDF, taken against…
    pub(super) n_bsdf: f64,
    /// …those of lights.
    pub(super) n_light: f64,
}

impl View {
    /// Of a ray of a path; `depth` counts its bounces so far.
    #[inline]
    pub(super) fn of_path(depth: u32, last: Option<(f64, DVec3)>) -> Self {
        Self {
            camera: depth == 0,
            last,
            n_bsdf: 1.0,
            n_light: 1.0,
        }
    }

    /// Share of the radiance that this ray counts of a light that light sampling finds with
    /// density `pdf`.
    fn weight(&self, cx: &RenderContext<'_>, id: LightId, pdf: f64) -> f64 {
        self.last.map_or(1.0, |(pdf_bsdf, from)| {
            let pdf_light = pdf * cx.light_probability(from, id);
            power_heuristic(self.n_bsdf, pdf_bsdf, self.n_light, pdf_light)
        })
    }

    /// Radiance of the lights that `ray` passes through within `reach` metres.
    #[inline]
    pub(super) fn crossed(&self, cx: &RenderContext<'_>, ray: &Ray, reach: f64) -> Rgb {
        if cx.scene.bodiless().is_empty() {
            return Rgb::ZERO;
        }
        let dir = ray.direction().normalize_or_zero();
        let mut sum = Rgb::ZERO;
        for &id in cx.scene.bodiless() {
            let light = cx.scene.light(id);
            if self.camera && !light.seen_by_camera() {
                continue;
            }
            if let Some(c) = light.crossed(ray.origin(), dir, reach) {
                sum += c.radiance * self.weight(cx, id, c.pdf);
            }
        }
        sum
    }

    /// Radiance that a ray which leaves the scene sees, near and at infinity.
    pub(super) fn escaped(&self, cx: &RenderContext<'_>, ray: &Ray) -> Rgb {
        let mut sum = self.crossed(cx, ray, f64::INFINITY);
        if cfg!(dualight_without = "environment") || cx.scene.infinite().is_empty() {
            return sum;
        }
        let dir = ray.direction().normalize_or_zero();
        for &id in cx.scene.infinite() {
            let light = cx.scene.light(id);
            if self.camera && !(cx.settings.background && light.seen_by_camera()) {
                continue;
            }
            let radiance = light.escaped(dir);
            if !radiance.is_black() {
                sum += radiance * self.weight(cx, id, light.pdf_escaped(dir));
            }
        }
        sum
    }
}

/// A light's contribution at a point, and the ray that must reach it.
pub(super) struct DirectSample {
    /// `f·|cos|·L / pdf`, weighed against BSDF sampling, by lobe class.
    pub(super) value: BsdfValue,
    /// The shadow ray.
    pub(super) ray: Ray,
}

impl DirectSample {
    /// Whether what glossy lobes make of it is followed.
    #[inline]
    pub(super) fn follows_glossy(&self, cx: &RenderContext<'_>, sp: &SurfacePoint) -> bool {
        let class = LobeClass::Glossy;
        cx.effects.allows(cx.scene, sp, class, self.passes(sp))
    }

    /// What that is part of.
    #[inline]
    pub(super) fn glossy_part(&self, cx: &RenderContext<'_>, sp: &SurfacePoint) -> Part {
        specular_part(cx.scene, sp, self.passes(sp))
    }

    /// Whether it comes through the surface.
    #[inline]
    fn passes(&self, sp: &SurfacePoint) -> bool {
        (self.ray.direction().dot(sp.ng) > 0.0) != sp.front
    }
}

/// Picks a light by flux and a point on it. `n_light` of these are taken against `n_bsdf`
/// samples of the BSDF, whose hits on the light weigh against these; 0 if there are none.
#[inline(always)]
pub(super) fn sample_direct<S: Scattering>(
    cx: &RenderContext<'_>,
    sp: &SurfacePoint,
    bsdf: &S,
    u: [f64; 2],
    n_light: f64,
    n_bsdf: f64,
) -> Option<DirectSample> {
    let (id, p_pick, rest) = cx.pick_light(sp.p, u[0])?;
    let li = cx.scene.sample_li(id, sp.p, [rest, u[1]])?;
    let pdf = li.pdf * p_pick;
    let x = pdf * n_light;
    let alone = li.delta || n_bsdf == 0.0;
    let mut value = bsdf.eval(li.wi, |pdf_lobe| {
        // The power heuristic x²/(x² + y²) over x, in one division.
        let y = if alone { 0.0 } else { pdf_lobe * n_bsdf };
        x / (x * x + y * y)
    });
    if value.diffuse.is_black() && (!S::GLOSSY || value.glossy.is_black()) {
        return None;
    }
    value.diffuse *= li.radiance;
    if S::GLOSSY {
        value.glossy *= li.radiance;
    }
    Some(DirectSample {
        value,
        ray: sp.spawn_toward(li.wi, li.target),
    })
}
