//! The stack of lobes at one surface point.
//!
//! Each lobe is its own sampling technique: a sample's weight is `f·|cos|/pdf` of the lobe that
//! was picked, and light sampling weighs each lobe against that lobe's own density. So every
//! contribution belongs to exactly one lobe class (diffuse, glossy or delta) and the integrators
//! can partition path space by class.

use arrayvec::ArrayVec;

use super::lobes::{Lobe, LobeClass, LobeModel};
use crate::color::Rgb;
use crate::geometry::SurfacePoint;
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

/// `f·|cos θi|`, by lobe class, each lobe weighted by its own share against light sampling.
#[derive(Clone, Copy, Debug, Default)]
pub struct BsdfValue {
    /// Of diffuse lobes.
    pub diffuse: Rgb,
    /// Of glossy lobes.
    pub glossy: Rgb,
}

/// Most lobes a material stacks.
const MAX_LOBES: usize = 6;

/// The scattering function at one point, seen from one direction.
#[derive(Clone, Debug)]
pub struct Bsdf {
    frame: Frame,
    /// Geometric normal on the side of `wo`.
    ng: DVec3,
    wo: DVec3,
    wo_world: DVec3,
    mode: TransportMode,
    lobes: ArrayVec<(Lobe, f64), MAX_LOBES>,
    total: f64,
}

impl Bsdf {
    /// A surface that absorbs everything, until lobes are pushed.
    #[inline]
    pub fn new(sp: &SurfacePoint, mode: TransportMode) -> Self {
        let (ng, mut n) = if sp.front {
            (sp.ng, sp.n)
        } else {
            (-sp.ng, -sp.n)
        };
        if sp.wo.dot(n) <= 0.0 {
            // The interpolated normal faces away from a visible point.
            n = ng;
        }
        let frame = Frame::from_normal(n);
        Self {
            wo: frame.to_local(sp.wo),
            wo_world: sp.wo,
            frame,
            ng,
            mode,
            lobes: ArrayVec::new(),
            total: 0.0,
        }
    }

    /// Cosine between `wo` and the shading normal on its side.
    #[inline]
    pub fn cos_o(&self) -> f64 {
        self.wo.z
    }

    /// Adds a lobe; it is picked in proportion to its albedo. A black lobe is left out.
    #[inline]
    pub fn push(&mut self, lobe: impl Into<Lobe>) {
        let lobe = lobe.into();
        let pick = lobe.albedo(self.wo).max_channel();
        if pick > 0.0 && self.lobes.try_push((lobe, pick)).is_ok() {
            self.total += pick;
        }
    }

    /// Whether some lobe is diffuse: only there photons are stored.
    #[inline]
    pub fn has_diffuse(&self) -> bool {
        self.lobes
            .iter()
            .any(|(l, _)| l.class() == LobeClass::Diffuse)
    }

    /// Whether some lobe is neither diffuse nor black.
    #[inline]
    pub fn has_specular(&self) -> bool {
        self.lobes
            .iter()
            .any(|(l, _)| l.class() != LobeClass::Diffuse)
    }

    /// Whether light sampling can contribute: some lobe is not a delta.
    #[inline]
    pub fn has_finite(&self) -> bool {
        self.lobes
            .iter()
            .any(|(l, _)| l.class() != LobeClass::Delta)
    }

    /// The albedo if the surface is one Lambert lobe and nothing else.
    #[inline]
    pub fn as_lambert(&self) -> Option<Rgb> {
        match self.lobes.as_slice() {
            [(Lobe::Lambert(l), _)] => Some(l.albedo),
            _ => None,
        }
    }

    /// Sum of the lobes' albedos.
    pub fn albedo(&self) -> Rgb {
        self.lobes.iter().map(|(l, _)| l.albedo(self.wo)).sum()
    }

    /// Probability that [`sample`](Self::sample) picks a diffuse lobe.
    #[inline]
    pub fn diffuse_probability(&self) -> f64 {
        let diffuse = self
            .lobes
            .iter()
            .filter(|(l, _)| l.class() == LobeClass::Diffuse);
        diffuse.map(|(_, p)| p).sum::<f64>() / self.total
    }

    /// The same point with only its diffuse lobes.
    #[inline]
    pub fn diffuse_only(&self) -> Self {
        self.filtered(|c| c == LobeClass::Diffuse)
    }

    /// The same point without its diffuse lobes.
    #[inline]
    pub fn specular_only(&self) -> Self {
        self.filtered(|c| c != LobeClass::Diffuse)
    }

    fn filtered(&self, keep: impl Fn(LobeClass) -> bool) -> Self {
        let mut out = self.clone();
        out.lobes.retain(|(l, _)| keep(l.class()));
        out.total = out.lobes.iter().map(|(_, p)| p).sum();
        out
    }

    /// The factor that makes `f` adjoint: η² for refracted radiance, and the correction for
    /// shading normals when importance is transported (Veach 1997, 5.2 and 5.3.2).
    #[inline(always)]
    fn transport_factor(&self, wi: DVec3, wi_local: DVec3, eta: f64) -> f64 {
        match self.mode {
            TransportMode::Radiance => {
                if wi_local.z < 0.0 {
                    1.0 / (eta * eta)
                } else {
                    1.0
                }
            }
            TransportMode::Importance => {
                let num = self.wo.z * wi.dot(self.ng);
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
        let mut out = BsdfValue::default();
        let local = self.frame.to_local(wi);
        if !self.sides_agree(wi, local) {
            return out;
        }
        // By far the commonest surface needs neither loop nor dispatch.
        if let [(Lobe::Lambert(lobe), _)] = self.lobes.as_slice() {
            let (f, pdf) = lobe.eval(self.wo, local);
            let factor = self.transport_factor(wi, local, 1.0);
            out.diffuse = f * (local.z * factor * weight(pdf));
            return out;
        }
        for (lobe, pick) in &self.lobes {
            let class = lobe.class();
            if class == LobeClass::Delta {
                continue;
            }
            let (f, pdf) = lobe.eval(self.wo, local);
            if f.is_black() {
                continue;
            }
            let factor = self.transport_factor(wi, local, lobe.eta());
            let pdf = if self.lobes.len() == 1 {
                pdf
            } else {
                pdf * pick / self.total
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
        let local = self.frame.to_local(wi);
        if !self.sides_agree(wi, local) {
            return Rgb::ZERO;
        }
        self.lobes
            .iter()
            .filter(|(l, _)| l.class() == LobeClass::Diffuse)
            .map(|(l, _)| l.eval(self.wo, local).0)
            .sum()
    }

    /// Every direction that the delta lobes send light to, if all lobes are deltas and there are
    /// few; the weights are `f·|cos θi|`, without probabilities.
    pub fn branches(&self) -> Option<ArrayVec<BsdfSample, 4>> {
        let mut out = ArrayVec::new();
        for (lobe, _) in &self.lobes {
            if lobe.class() != LobeClass::Delta {
                return None;
            }
            for s in lobe.branches(self.wo) {
                let wi = self.frame.to_world(s.wi);
                if !self.sides_agree(wi, s.wi) || s.weight.is_black() {
                    continue;
                }
                let factor = self.transport_factor(wi, s.wi, lobe.eta());
                out.try_push(BsdfSample {
                    wi,
                    weight: s.weight * factor,
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
    #[inline]
    pub fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        let (last, firsts) = self.lobes.split_last()?;
        let (mut lobe, mut p_lobe, mut u_in) = (&last.0, 1.0, u_lobe);
        if !firsts.is_empty() {
            let mut rest = u_lobe * self.total;
            let mut chosen = last;
            for entry in firsts {
                if rest < entry.1 {
                    chosen = entry;
                    break;
                }
                rest -= entry.1;
            }
            lobe = &chosen.0;
            p_lobe = chosen.1 / self.total;
            // Within the lobe, what is left of u_lobe is uniform again.
            u_in = (rest / chosen.1).clamp(0.0, 1.0 - f64::EPSILON);
        }
        let s = lobe.sample(self.wo, u_in, u)?;
        let wi = self.frame.to_world(s.wi);
        if !self.sides_agree(wi, s.wi) {
            return None;
        }
        let factor = self.transport_factor(wi, s.wi, lobe.eta());
        Some(BsdfSample {
            wi,
            weight: if p_lobe == 1.0 {
                s.weight * factor
            } else {
                s.weight * (factor / p_lobe)
            },
            pdf: s.pdf * p_lobe,
            class: lobe.class(),
            transmitted: s.wi.z < 0.0,
        })
    }
}
