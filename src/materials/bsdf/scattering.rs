//! What light transport asks of a scattering function, however much of one there is.

use super::{Bsdf, BsdfSample, BsdfValue};
use crate::color::Rgb;
use crate::math::DVec3;

/// A scattering function at one point, seen from one direction. Code that is generic over it is
/// compiled once for the whole stack of lobes, and once for surfaces that need none.
pub trait Scattering {
    /// Whether it may scatter in another way than diffusely.
    const GLOSSY: bool = true;

    /// As [`Bsdf::eval`].
    fn eval(&self, wi: DVec3, weight: impl Fn(f64) -> f64) -> BsdfValue;
    /// As [`Bsdf::sample`].
    fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample>;
    /// As [`Bsdf::sample_carried`]; what does not disperse has no use for what is carried.
    #[inline(always)]
    fn sample_carried(
        &self,
        _carried: Rgb,
        u_lobe: f64,
        u: [f64; 2],
        _choose: impl FnOnce() -> f64,
    ) -> Option<BsdfSample> {
        self.sample(u_lobe, u)
    }
    /// As [`Bsdf::diffuse_f`].
    fn diffuse_f(&self, wi: DVec3) -> Rgb;
    /// As [`Bsdf::has_finite`].
    fn has_finite(&self) -> bool;
    /// As [`Bsdf::as_lambert`].
    fn as_lambert(&self) -> Option<Rgb>;
    /// As [`Bsdf::has_diffuse_transmission`].
    fn has_diffuse_transmission(&self) -> bool;
    /// As [`Bsdf::reflected_albedo`].
    fn reflected_albedo(&self) -> Rgb;
    /// As [`Bsdf::transmitted_albedo`].
    fn transmitted_albedo(&self) -> Rgb;
}

impl Scattering for Bsdf {
    #[inline(always)]
    fn eval(&self, wi: DVec3, weight: impl Fn(f64) -> f64) -> BsdfValue {
        Self::eval(self, wi, weight)
    }

    #[inline(always)]
    fn sample(&self, u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        Self::sample(self, u_lobe, u)
    }

    #[inline(always)]
    fn sample_carried(
        &self,
        carried: Rgb,
        u_lobe: f64,
        u: [f64; 2],
        choose: impl FnOnce() -> f64,
    ) -> Option<BsdfSample> {
        Self::sample_carried(self, carried, u_lobe, u, choose)
    }

    #[inline]
    fn diffuse_f(&self, wi: DVec3) -> Rgb {
        Self::diffuse_f(self, wi)
    }

    #[inline]
    fn has_finite(&self) -> bool {
        Self::has_finite(self)
    }

    #[inline]
    fn as_lambert(&self) -> Option<Rgb> {
        Self::as_lambert(self)
    }

    #[inline]
    fn has_diffuse_transmission(&self) -> bool {
        Self::has_diffuse_transmission(self)
    }

    fn reflected_albedo(&self) -> Rgb {
        Self::reflected_albedo(self)
    }

    fn transmitted_albedo(&self) -> Rgb {
        Self::transmitted_albedo(self)
    }
}
