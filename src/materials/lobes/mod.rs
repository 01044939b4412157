//! Lobes: the elementary scattering functions that materials stack, one per file, one line each
//! in the list below.
//!
//! A lobe works in the local frame: `z` is the shading normal on the side of `wo`, so
//! `wo.z > 0` always; `wi.z < 0` means transmission.

mod coated_lambert;
mod diffuse_transmission;
mod ggx_dielectric;
mod ggx_reflection;
mod lambert;
mod sheen;
mod smooth_dielectric;
mod smooth_reflection;
mod thin_dielectric;
mod thin_ggx;

use std::sync::Arc;

pub use coated_lambert::CoatedLambert;
pub use diffuse_transmission::DiffuseTransmission;
pub use ggx_dielectric::GgxDielectric;
pub use ggx_reflection::GgxReflection;
pub use lambert::Lambert;
pub use sheen::Sheen;
pub use smooth_dielectric::SmoothDielectric;
pub use smooth_reflection::SmoothReflection;
pub use thin_dielectric::ThinDielectric;
pub use thin_ggx::ThinGgx;

use crate::color::Rgb;
use crate::math::DVec3;

/// How a lobe is treated by photon maps and light sampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LobeClass {
    /// Broad reflection; photons are stored here.
    Diffuse,
    /// Finite but directional; followed like a mirror, sampled from lights too.
    Glossy,
    /// A single direction.
    Delta,
}

/// A direction sampled from one lobe, local frame.
#[derive(Clone, Copy, Debug)]
pub struct LobeSample {
    /// Unit direction.
    pub wi: DVec3,
    /// `f·|cos θi| / pdf`.
    pub weight: Rgb,
    /// Density in solid angle; 0 for a delta lobe.
    pub pdf: f64,
}

/// The directions of a delta lobe: reflected and refracted at most.
pub type Branches = arrayvec::ArrayVec<LobeSample, 2>;

/// What every lobe answers.
pub trait LobeModel {
    /// Its class.
    fn class(&self) -> LobeClass;
    /// `f` (without cosine, importance convention) and density of [`sample`](Self::sample);
    /// zero for a delta lobe.
    fn eval(&self, wo: DVec3, wi: DVec3) -> (Rgb, f64);
    /// A direction chosen by `u`; `u_pick` decides between branches (reflect or refract).
    fn sample(&self, wo: DVec3, u_pick: f64, u: [f64; 2]) -> Option<LobeSample>;
    /// Every direction of a delta lobe, with `f·|cos θi|` (no probability in it); empty for others.
    fn branches(&self, _wo: DVec3) -> Branches {
        Branches::new()
    }
    /// Directional albedo, possibly approximate: used to pick lobes and for display.
    fn albedo(&self, wo: DVec3) -> Rgb;
    /// What the lobe is picked by among others: near its albedo's largest channel, and positive
    /// wherever that is.
    fn importance(&self, wo: DVec3) -> f64 {
        self.albedo(wo).max_channel()
    }
    /// Index beyond the surface over index on the side of `wo`, for lobes that refract.
    fn eta(&self) -> f64 {
        1.0
    }
}

/// Relative indices closer to 1 than this bend nothing that roughness could spread.
const NO_BORDER: f64 = 1e-4;

impl Lobe {
    /// Share of the surface that is this lobe's interface, by channel; all for what parts no
    /// media.
    #[inline]
    pub(in crate::materials) fn share(&self) -> Rgb {
        match self {
            Self::SmoothDielectric(facet) => facet.share,
            Self::GgxDielectric(lobe) => lobe.facet.share,
            _ => Rgb::ONE,
        }
    }

    /// Whether it serves one channel only, as those of glass that disperses.
    #[inline]
    pub(in crate::materials) fn is_of_one_channel(&self) -> bool {
        let Rgb { r, g, b } = self.share();
        [r, g, b].iter().filter(|c| **c > 0.0).count() == 1
    }

    /// Multiplies the relative index of a lobe that refracts; by 0, light passes straight.
    pub(in crate::materials) fn immerse(&mut self, correction: f64) {
        let (facet, rough) = match self {
            Self::SmoothDielectric(facet) => (facet, false),
            Self::GgxDielectric(lobe) => (&mut lobe.facet, true),
            _ => return,
        };
        if correction == 0.0 {
            *self = SmoothDielectric {
                eta: 1.0,
                tint: Rgb::ONE,
                reflect: Rgb::ZERO,
                share: facet.share,
                film: None,
            }
            .into();
            return;
        }
        facet.eta *= correction;
        if rough && (facet.eta - 1.0).abs() < NO_BORDER {
            *self = (*facet).into();
        }
    }
}

/// One of several branches, in proportion to its weight.
#[inline]
fn pick(branches: Branches, u: f64) -> Option<LobeSample> {
    let total: f64 = branches.iter().map(|b| b.weight.max_channel()).sum();
    let mut rest = u * total;
    for b in branches {
        let w = b.weight.max_channel();
        if rest < w {
            return Some(LobeSample {
                weight: b.weight * (total / w),
                ..b
            });
        }
        rest -= w;
    }
    None
}

/// A lobe defined outside this crate.
pub type CustomLobe = Arc<dyn LobeModel + Send + Sync>;

impl LobeModel for CustomLobe {
    fn class(&self) -> LobeClass {
        (**self).class()
    }
    fn eval(&self, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
        (**self).eval(wo, wi)
    }
    fn sample(&self, wo: DVec3, u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        (**self).sample(wo, u_pick, u)
    }
    fn branches(&self, wo: DVec3) -> Branches {
        (**self).branches(wo)
    }
    fn albedo(&self, wo: DVec3) -> Rgb {
        (**self).albedo(wo)
    }
    fn importance(&self, wo: DVec3) -> f64 {
        (**self).importance(wo)
    }
    fn eta(&self) -> f64 {
        (**self).eta()
    }
}

macro_rules! lobes {
    ($($name:ident($model:ty)),* $(,)?) => {
        /// Any lobe; a closed set so that the inner loop needs no virtual call, with one open end.
        #[derive(Clone)]
        pub enum Lobe {
            $(
                #[allow(missing_docs, reason = "named after the model")]
                $name($model),
            )*
        }

        $(impl From<$model> for Lobe {
            #[inline]
            fn from(l: $model) -> Self {
                Self::$name(l)
            }
        })*

        impl LobeModel for Lobe {
            #[inline]
            fn class(&self) -> LobeClass {
                match self { $(Self::$name(l) => l.class(),)* }
            }
            #[inline]
            fn eval(&self, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
                match self { $(Self::$name(l) => l.eval(wo, wi),)* }
            }
            #[inline]
            fn sample(&self, wo: DVec3, u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
                match self { $(Self::$name(l) => l.sample(wo, u_pick, u),)* }
            }
            fn branches(&self, wo: DVec3) -> Branches {
                match self { $(Self::$name(l) => l.branches(wo),)* }
            }
            #[inline]
            fn albedo(&self, wo: DVec3) -> Rgb {
                match self { $(Self::$name(l) => l.albedo(wo),)* }
            }
            #[inline]
            fn importance(&self, wo: DVec3) -> f64 {
                match self { $(Self::$name(l) => l.importance(wo),)* }
            }
            #[inline]
            fn eta(&self) -> f64 {
                match self { $(Self::$name(l) => l.eta(),)* }
            }
        }

        impl std::fmt::Debug for Lobe {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(match self { $(Self::$name(_) => stringify!($name),)* })
            }
        }
    };
}

lobes! {
    Lambert(Lambert),
    CoatedLambert(CoatedLambert),
    DiffuseTransmission(DiffuseTransmission),
    Sheen(Sheen),
    SmoothReflection(SmoothReflection),
    SmoothDielectric(SmoothDielectric),
    ThinDielectric(ThinDielectric),
    ThinGgx(ThinGgx),
    GgxReflection(GgxReflection),
    GgxDielectric(GgxDielectric),
    Custom(CustomLobe),
}
