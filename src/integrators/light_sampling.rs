//! Next-event estimation: a sample of direct light at a surface point.

use super::RenderContext;
use crate::color::Rgb;
use crate::geometry::{Ray, SurfacePoint};
use crate::materials::{Bsdf, BsdfValue};
use crate::math::DVec3;

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

/// Radiance that a ray which leaves the scene sees. `last` is density and origin of the sample
/// of the BSDF that chose it, none if no light sampling could have found the light; `n_bsdf` such
/// samples are taken against `n_light` of lights.
pub(super) fn escaped(
    cx: &RenderContext<'_>,
    ray: &Ray,
    last: Option<(f64, DVec3)>,
    n_bsdf: f64,
    n_light: f64,
) -> Rgb {
    if cx.scene.infinite().is_empty() {
        return Rgb::ZERO;
    }
    let dir = ray.direction().normalize_or_zero();
    let mut sum = Rgb::ZERO;
    for &id in cx.scene.infinite() {
        let light = cx.scene.light(id);
        let radiance = light.escaped(dir);
        if radiance.is_black() {
            continue;
        }
        let weight = last.map_or(1.0, |(pdf, from)| {
            let pdf_light = light.pdf_escaped(dir) * cx.scene.light_probability(from, id);
            power_heuristic(n_bsdf, pdf, n_light, pdf_light)
        });
        sum += radiance * weight;
    }
    sum
}

/// A light's contribution at a point, and the ray that must reach it.
pub(super) struct DirectSample {
    /// `f·|cos|·L / pdf`, weighed against BSDF sampling, by lobe class.
    pub(super) value: BsdfValue,
    /// The shadow ray.
    pub(super) ray: Ray,
}

/// Picks a light by flux and a point on it. `n_light` of these are taken against `n_bsdf`
/// samples of the BSDF, whose hits on the light weigh against these; 0 if there are none.
#[inline(always)]
pub(super) fn sample_direct(
    cx: &RenderContext<'_>,
    sp: &SurfacePoint,
    bsdf: &Bsdf,
    u: [f64; 2],
    n_light: f64,
    n_bsdf: f64,
) -> Option<DirectSample> {
    let (id, p_pick, rest) = cx.scene.pick_light(sp.p, u[0])?;
    let light = cx.scene.light(id);
    let li = light.sample_li(sp.p, [rest, u[1]])?;
    let pdf = li.pdf * p_pick;
    let x = pdf * n_light;
    let alone = li.delta || n_bsdf == 0.0;
    let mut value = bsdf.eval(li.wi, |pdf_lobe| {
        // The power heuristic x²/(x² + y²) over x, in one division.
        let y = if alone { 0.0 } else { pdf_lobe * n_bsdf };
        x / (x * x + y * y)
    });
    if value.diffuse.is_black() && value.glossy.is_black() {
        return None;
    }
    value.diffuse *= li.radiance;
    value.glossy *= li.radiance;
    let ray = match li.target {
        Some(target) => sp.spawn_to(target),
        None => sp.spawn(li.wi),
    };
    Some(DirectSample { value, ray })
}
