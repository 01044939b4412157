//! The stack of lobes at one surface point.
//!
//! Each lobe is its own sampling technique: a sample's weight is `f·|cos|/pdf` of the lobe that
//! was picked, and light sampling weighs each lobe against that lobe's own density. So every
//! contribution belongs to exactly one lobe class (diffuse, glossy or delta) and the integrators
//! can partition path space by class.

mod build;
mod channels;
mod entry;
mod matte;
mod scattering;

pub use channels::ChannelSamples;
use entry::Entry;
pub use matte::Matte;
pub use scattering::Scattering;

use std::ops::Mul;

use arrayvec::ArrayVec;

use super::cover::Cover;
use super::lobes::{Lambert, Lobe, LobeClass, LobeModel, LobeSample};
use crate::color::Rgb;
use crate::math::{DVec3, Frame};

/// What is transported along a path: radiance (from the camera) or importance (photons). The
/// factors η² and of shading normals depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransportMode {
    /// The path started at the camera.
    Radiance,
    /// The path started at a light.
    Importance,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Unit direction, world space, away from the surface.
    pub wi: DVec3,
    /// `f·|cos θi| / pdf`, with the probability of the lobe included.
    pub weight: Rgb,
    /// Density in solid angle with the probability of the lobe included; 0 for a delta lobe.
    pub pdf: f64,
    /// Class of the lobe that was picked.
    pub class: LobeClass,
    /// Whether the direction goes to the other side of the surface.
    pub transmitted: bool,
}

impl BsdfSample {
    /// Nothing.
    const NONE: Self = Self {
        wi: DVec3::ZERO,
        weight: Rgb::ZERO,
        pdf: 0.0,
        class: LobeClass::Delta,
        transmitted: false,
    };
}

/// `f·|cos θi|`, by lobe class, each lobe weighted by its own share against light sampling.
#[derive(Clone, Copy, Debug, Default)]
pub struct BsdfValue {
    /// Of diffuse lobes.
    pub diffuse: Rgb,
    /// Of glossy lobes.
    pub glossy: Rgb,
}

impl Mul<Rgb> for BsdfValue {
    type Output = Self;
    #[inline]
    fn mul(self, c: Rgb) -> Self {
        Self {
            diffuse: self.diffuse * c,
            glossy: self.glossy * c,
        }
    }
}

/// Most lobes a material stacks.
const MAX_LOBES: usize = 8;

/// Least cosine between `wo` and a normal that a normal map gave.
const LEAST_COSINE: f64 = 1e-2;

/// One of the frames in which the lobes at a point lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameId(u8);

impl FrameId {
    /// That of the shading normal.
    pub const MAIN: Self = Self(0);
}

/// A frame with `wo` in it.
#[derive(Clone, Copy, Debug)]
struct View {
    frame: Frame,
    wo: DVec3,
}

/// The scattering function at one point, seen from one direction.
#[derive(Clone, Debug)]
pub struct Bsdf {
    main: View,
    /// A second frame, for a coat with a normal of its own.
    second: Option<View>,
    /// Geometric normal on the side of `wo`.
    ng: DVec3,
    wo_world: DVec3,
    front: bool,
    mode: TransportMode,
    lobes: ArrayVec<Entry, MAX_LOBES>,
    covers: ArrayVec<(Cover, FrameId), 2>,
    total: f64,
    /// What is shown instead of reflected light.
    shown: Option<Rgb>,
}

impl Bsdf {
    #[inline(always)]
    fn view(&self, id: FrameId) -> &View {
        match &self.second {
            Some(second) if id != FrameId::MAIN => second,
            _ => &self.main,
        }
    }

    /// Cosine between `wo` and the shading normal on its side.
    #[inline]
    pub fn cos_o(&self) -> f64 {
        self.main.wo.z
    }

    /// What the layers above a lobe leave of the light that comes along `wi`.
    #[inline]
    fn uncovered(&self, under: u8, wi: DVec3) -> f64 {
        let mut left = 1.0;
        for (cover, frame) in self.covers.iter().skip(usize::from(under)) {
            let view = self.view(*frame);
            let cos_i = view.frame.z.dot(wi);
            left *= cover.passes(view.wo.z).min(cover.passes(cos_i));
        }
        left
    }

    /// What the layers above a lobe leave of its albedo.
    fn uncovered_albedo(&self, e: &Entry) -> Rgb {
        let mut albedo = e.lobe.albedo(self.view(e.frame).wo);
        for (cover, frame) in self.covers.iter().skip(usize::from(e.under)) {
            albedo *= cover.passes(self.view(*frame).wo.z);
        }
        albedo
    }

    /// Whether some lobe is diffuse: only there photons are stored.
    #[inline]
    pub fn has_diffuse(&self) -> bool {
        self.lobes
            .iter()
            .any(|e| e.lobe.class() == LobeClass::Diffuse)
    }

    /// Whether some lobe is neither diffuse nor black.
    #[inline]
    pub fn has_specular(&self) -> bool {
        self.lobes
            .iter()
            .any(|e| e.lobe.class() != LobeClass::Diffuse)
    }

    /// Whether light sampling can contribute: some lobe is not a delta.
    #[inline]
    pub fn has_finite(&self) -> bool {
        self.lobes
            .iter()
            .any(|e| e.lobe.class() != LobeClass::Delta)
    }

    /// The one lobe of the commonest surface, which needs neither loop nor dispatch.
    #[inline(always)]
    fn lone_lambert(&self) -> Option<&Lambert> {
        match self.lobes.as_slice() {
            [
                Entry {
                    lobe: Lobe::Lambert(lobe),
                    ..
                },
            ] if self.covers.is_empty() => Some(lobe),
            _ => None,
        }
    }

    /// The albedo if the surface is one Lambert lobe and nothing else.
    #[inline]
    pub fn as_lambert(&self) -> Option<Rgb> {
        match self.lobes.as_slice() {
            [
                Entry {
                    lobe: Lobe::Lambert(l),
                    under,
                    ..
                },
            ] if usize::from(*under) == self.covers.len() => Some(l.albedo),
            _ => None,
        }
    }

    /// Sum of the lobes' albedos.
    pub fn albedo(&self) -> Rgb {
        self.lobes.iter().map(|e| self.uncovered_albedo(e)).sum()
    }

    /// Sum of the albedos of the lobes that reflect (glossy ones that transmit too count here).
    pub fn reflected_albedo(&self) -> Rgb {
        self.albedo() - self.transmitted_albedo()
    }

    /// Sum of the albedos of the lobes that transmit diffusely.
    pub fn transmitted_albedo(&self) -> Rgb {
        let through = |e: &&Entry| matches!(e.lobe, Lobe::DiffuseTransmission(_));
        let lobes = self.lobes.iter().filter(through);
        lobes.map(|e| self.uncovered_albedo(e)).sum()
    }

    /// Probability that [`sample`](Self::sample) picks a diffuse lobe.
    #[inline]
    pub fn diffuse_probability(&self) -> f64 {
        let diffuse = self
            .lobes
            .iter()
            .filter(|e| e.lobe.class() == LobeClass::Diffuse);
        diffuse.map(|e| e.pick).sum::<f64>() / self.total
    }

    /// Drops all lobes that are not diffuse.
    #[inline]
    pub fn keep_diffuse(&mut self) {
        self.keep(|c| c == LobeClass::Diffuse);
    }

    /// Drops the diffuse lobes.
    #[inline]
    pub fn keep_specular(&mut self) {
        self.keep(|c| c != LobeClass::Diffuse);
    }

    fn keep(&mut self, keep: impl Fn(LobeClass) -> bool) {
        self.lobes.retain(|e| keep(e.lobe.class()));
        self.total = self.lobes.iter().map(|e| e.pick).sum();
    }

    /// The factor that makes `f` adjoint: η² for refracted radiance, and the correction for
    /// shading normals when importance is transported (Veach 1997, 5.2 and 5.3.2).
    #[inline(always)]
    fn transport_factor(&self, wo: DVec3, wi: DVec3, wi_local: DVec3, eta: f64) -> f64 {
        match self.mode {
            TransportMode::Radiance => {
                if wi_local.z < 0.0 {
                    1.0 / (eta * eta)
                } else {
                    1.0
                }
            }
            TransportMode::Importance => {
                let num = wo.z * wi.dot(self.ng);
                let den = self.wo_world.dot(self.ng) * wi_local.z;
                if den == 0.0 { 0.0 } else { (num / den).abs() }
            }
        }
    }

    /// Whether `wi` lies on the side of the surface that its local coordinates claim; otherwise
    /// light would leak through the geometry by the interpolated normal.
    #[inline]
    fn sides_agree(&self, wi: DVec3, wi_local: DVec3) -> bool {
        wi.dot(self.ng) * wi_local.z > 0.0
    }

    /// `f·|cos θi|` toward the unit direction `wi`, each lobe multiplied by
    /// `weight(pdf of that lobe)`; the pdf includes the probability of picking the lobe.
    #[inline(always)]
    pub fn eval(&self, wi: DVec3, weight: impl Fn(f64) -> f64) -> BsdfValue {
        let Some(lobe) = self.lone_lambert() else {
            return self.eval_stack(wi, weight);
        };
        let mut out = BsdfValue::default();
        let main = self.main.frame.to_local(wi);
        if self.sides_agree(wi, main) {
            let (f, pdf) = lobe.eval(self.main.wo, main);
            let factor = self.transport_factor(self.main.wo, wi, main, 1.0);
            out.diffuse = f * (main.z * factor * weight(pdf));
        }
        out
    }

    #[inline(never)]
    fn eval_stack(&self, wi: DVec3, weight: impl Fn(f64) -> f64) -> BsdfValue {
        let mut out = BsdfValue::default();
        let main = self.main.frame.to_local(wi);
        for e in &self.lobes {
            let class = e.lobe.class();
            if class == LobeClass::Delta {
                continue;
            }
            let (wo, local) = match &self.second {
                Some(view) if e.frame != FrameId::MAIN => (view.wo, view.frame.to_local(wi)),
                _ => (self.main.wo, main),
            };
            if !self.sides_agree(wi, local) {
                continue;
            }
            let _scope = e.tell();
            let (f, pdf) = e.lobe.eval(wo, local);
            if f.is_black() {
                continue;
            }
            let factor =
                self.transport_factor(wo, wi, local, e.lobe.eta()) * self.uncovered(e.under, wi);
            let pdf = if self.lobes.len() == 1 {
                pdf
            } else {
                pdf * e.pick / self.total
            };
            let value = f * (local.z.abs() * factor * weight(pdf));
            match class {
                LobeClass::Diffuse => out.diffuse += value,
                _ => out.glossy += value,
            }
        }
        out
    }

    /// Diffuse `f` (without cosine) toward `wi`, as density estimates need it.
    #[inline]
    pub fn diffuse_f(&self, wi: DVec3) -> Rgb {
        if let Some(lobe) = self.lone_lambert() {
            // Both cosines positive: on the side of wo, and not below the shading horizon.
            let seen = wi.dot(self.ng) > 0.0 && wi.dot(self.main.frame.z) > 0.0;
            return if seen { lobe.f() } else { Rgb::ZERO };
        }
        self.diffuse_f_stack(wi)
    }

    #[inline(never)]
    fn diffuse_f_stack(&self, wi: DVec3) -> Rgb {
        let mut sum = Rgb::ZERO;
        for e in &self.lobes {
            if e.lobe.class() == LobeClass::Diffuse {
                let view = self.view(e.frame);
                let local = view.frame.to_local(wi);
                if self.sides_agree(wi, local) {
                    let _scope = e.tell();
                    sum += e.lobe.eval(view.wo, local).0 * self.uncovered(e.under, wi);
                }
            }
        }
        sum
    }

    /// Whether some diffuse lobe lets light through: photons on the other side count too.
    #[inline]
    pub fn has_diffuse_transmission(&self) -> bool {
        let through = |e: &Entry| matches!(e.lobe, Lobe::DiffuseTransmission(_));
        self.lobes.iter().any(through)
    }

    /// Every direction that the delta lobes send light to, if all lobes are deltas and there are
    /// few; the weights are `f·|cos θi|`, without probabilities.
    pub fn branches(&self) -> Option<ArrayVec<BsdfSample, 4>> {
        let mut out = ArrayVec::new();
        for e in &self.lobes {
            if e.lobe.class() != LobeClass::Delta {
                return None;
            }
            let view = self.view(e.frame);
            let _scope = e.tell();
            for s in e.lobe.branches(view.wo) {
                let wi = view.frame.to_world(s.wi);
                if !self.sides_agree(wi, s.wi) || s.weight.is_black() {
                    continue;
                }
                let factor = self.transport_factor(view.wo, wi, s.wi, e.lobe.eta())
                    * self.uncovered(e.under, wi);
                let weight = s.weight * factor;
                // Lobes of glass that disperses, one for each channel, reflect alike.
                if let Some(same) = out.iter_mut().find(|b: &&mut BsdfSample| b.wi == wi) {
                    same.weight += weight;
                    continue;
                }
                out.try_push(BsdfSample {
                    wi,
                    weight,
                    pdf: 0.0,
                    class: LobeClass::Delta,
                    transmitted: s.wi.z < 0.0,
                })
                .ok()?;
            }
        }
        Some(out)
    }

    /// Picks a lobe by `u_lobe` and a direction from it by `u`. `None` where nothing scatters.
    #[inline(always)]
    pub fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        match self.lone_lambert() {
            Some(lobe) => {
                let s = lobe.sample(self.main.wo, u_lobe, u)?;
                self.scattered(&self.main, &s, LobeClass::Diffuse, 1.0, 1.0)
            }
            None => {
                // By reference, so that a Lambert sample need not go through memory to where
                // this function would put its answer.
                let mut out = BsdfSample::NONE;
                self.sample_stack(u_lobe, u, &mut out).then_some(out)
            }
        }
    }

    #[inline(never)]
    fn sample_stack(&self, u_lobe: f64, u: [f64; 2], out: &mut BsdfSample) -> bool {
        let Some((last, firsts)) = self.lobes.split_last() else {
            return false;
        };
        let (mut chosen, mut p_lobe, mut u_in) = (last, 1.0, u_lobe);
        if !firsts.is_empty() {
            let mut rest = u_lobe * self.total;
            for entry in firsts {
                if rest < entry.pick {
                    chosen = entry;
                    break;
                }
                rest -= entry.pick;
            }
            p_lobe = chosen.pick / self.total;
            // Within the lobe, what is left of u_lobe is uniform again.
            u_in = (rest / chosen.pick).clamp(0.0, 1.0 - f64::EPSILON);
        }
        let _scope = chosen.tell();
        let lobe = &chosen.lobe;
        let view = self.view(chosen.frame);
        let scattered = lobe
            .sample(view.wo, u_in, u)
            .and_then(|s| self.scattered(view, &s, lobe.class(), lobe.eta(), p_lobe));
        if let Some(s) = scattered {
            *out = s;
            out.weight *= self.uncovered(chosen.under, out.wi);
        }
        scattered.is_some()
    }

    /// The sample `s` of a lobe that was picked with probability `p_lobe`, in the world.
    #[inline(always)]
    fn scattered(
        &self,
        view: &View,
        s: &LobeSample,
        class: LobeClass,
        eta: f64,
        p_lobe: f64,
    ) -> Option<BsdfSample> {
        let wi = view.frame.to_world(s.wi);
        if !self.sides_agree(wi, s.wi) {
            return None;
        }
        let factor = self.transport_factor(view.wo, wi, s.wi, eta);
        Some(BsdfSample {
            wi,
            weight: if p_lobe == 1.0 {
                s.weight * factor
            } else {
                s.weight * (factor / p_lobe)
            },
            pdf: s.pdf * p_lobe,
            class,
            transmitted: s.wi.z < 0.0,
        })
    }
}
