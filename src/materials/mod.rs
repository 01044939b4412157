//! Materials: what a surface does with light. They answer questions, trace no rays and never
//! see the scene.
//!
//! A [`Material`] turns a surface point into a [`Bsdf`], a stack of lobes; each lobe is one file.
//! A material kind is one file and one line in [`MATERIALS`].
//!
//! Directions `wo` and `wi` point away from the surface. Lobes work in the local frame whose
//! `z` axis is the shading normal on the side of `wo`.

mod alpha;
mod bsdf;
mod cover;
mod desc;
mod filmed;
pub mod fresnel;
mod idle;
mod layer;
pub mod lobes;
mod microfacet;
mod slots;
mod thin_film;
mod values;

mod conductor;
mod dielectric;
mod features;
mod lambert;
mod mirror;
mod pbr;
mod unlit;

pub use bsdf::{
    Bsdf, BsdfSample, BsdfValue, ChannelSamples, FrameId, Matte, Scattering, TransportMode,
};
pub use desc::{AlphaMode, Brushing, Interior, MaterialDesc, MaterialTraits, Medium};
pub use features::Features;
pub use filmed::FacetFilm;
pub use lobes::{CustomLobe, Lobe, LobeClass, LobeModel, LobeSample};
pub use slots::TextureSlots;
pub use thin_film::ThinFilm;

use crate::color::Rgb;
use crate::geometry::Surface;

/// What a surface is made of.
pub trait Material: Send + Sync {
    /// Pushes the lobes at a point, seen from `at.sp.wo`.
    fn scatter(&self, at: &Surface<'_>, bsdf: &mut Bsdf);

    /// The scattering function at a point, seen from `at.sp.wo`.
    fn bsdf(&self, at: &Surface<'_>, mode: TransportMode) -> Bsdf {
        let mut bsdf = Bsdf::new(at.sp, mode);
        self.scatter(at, &mut bsdf);
        bsdf
    }

    /// What it can do at all; the survey of effects relies on it, so it may promise too much
    /// but never too little.
    fn traits(&self) -> MaterialTraits;

    /// The reflectance, if all that it ever pushes is one Lambert lobe, the same everywhere:
    /// its points are then shaded as [`Matte`].
    fn matte(&self) -> Option<Rgb> {
        None
    }

    /// The medium behind its front face, if it encloses one that absorbs.
    fn interior(&self) -> Option<Interior> {
        None
    }
}

/// A material kind that can be chosen.
#[derive(Clone, Copy, Debug)]
pub struct MaterialEntry {
    /// Name, as the material's extras `{"dualight_material": name}` give it.
    pub name: &'static str,
    /// One sentence.
    pub doc: &'static str,
    /// Whether this kind is the right one for a glTF material that names none; the first entry
    /// that claims it wins.
    pub claims: fn(&MaterialDesc) -> bool,
    /// Makes the material; the error says which parameter is wrong.
    pub build: fn(&MaterialDesc) -> Result<Box<dyn Material>, String>,
}

crate::registry::impl_entry!(MaterialEntry, "material");

/// The material kinds; order matters, the first that claims a description gets it.
pub static MATERIALS: &[MaterialEntry] = &[
    lambert::ENTRY,
    mirror::ENTRY,
    conductor::ENTRY,
    dielectric::ENTRY,
    unlit::ENTRY,
    pbr::ENTRY,
];
