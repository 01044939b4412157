//! The numbers of a glTF material at one point, and the lobes they make.

use super::bsdf::FrameId;
use super::cover::Cover;
use super::dielectric::Interface;
use super::fresnel::{Film, Fresnel, Schlick, f0};
use super::layer::LayerAlbedo;
use super::lobes::{
    CoatedLambert, DiffuseTransmission, GgxReflection, Lambert, Lobe, Sheen, SmoothReflection,
};
use super::microfacet::Ggx;
use super::thin_film::ThinFilm;
use super::{Brushing, Bsdf};
use super::{Interior, MaterialDesc, MaterialTraits};
use crate::color::Rgb;
use crate::stats::tally::Event;

/// Index of refraction of the clear coat (`KHR_materials_clearcoat`).
const COAT_IOR: f64 = 1.5;

/// What textures can change, and what goes with it; named as in [`MaterialDesc`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Values {
    pub(super) base_color: Rgb,
    pub(super) metallic: f64,
    pub(super) roughness: f64,
    pub(super) ior: f64,
    pub(super) specular: f64,
    pub(super) specular_color: Rgb,
    pub(super) specular_reflectance: Option<Rgb>,
    pub(super) transmission: f64,
    pub(super) volume: bool,
    pub(super) dispersion: f64,
    pub(super) diffuse_transmission: f64,
    pub(super) diffuse_transmission_color: Rgb,
    pub(super) clearcoat: f64,
    pub(super) clearcoat_roughness: f64,
    pub(super) sheen_color: Rgb,
    pub(super) sheen_roughness: f64,
    pub(super) anisotropy: f64,
    pub(super) anisotropy_rotation: f64,
    pub(super) brushing: Brushing,
    pub(super) iridescence: f64,
    pub(super) iridescence_ior: f64,
    pub(super) iridescence_range: [f64; 2],
    pub(super) iridescence_thickness: f64,
}

impl From<&MaterialDesc> for Values {
    fn from(d: &MaterialDesc) -> Self {
        Self {
            base_color: d.base_color,
            metallic: d.metallic,
            roughness: d.roughness,
            ior: d.ior,
            specular: d.specular,
            specular_color: d.specular_color,
            specular_reflectance: d.specular_reflectance,
            transmission: d.transmission,
            volume: d.volume,
            dispersion: d.dispersion,
            diffuse_transmission: d.diffuse_transmission,
            diffuse_transmission_color: d.diffuse_transmission_color,
            clearcoat: d.clearcoat,
            clearcoat_roughness: d.clearcoat_roughness,
            sheen_color: d.sheen_color,
            sheen_roughness: d.sheen_roughness,
            anisotropy: d.anisotropy,
            anisotropy_rotation: d.anisotropy_rotation,
            brushing: d.brushing,
            iridescence: d.iridescence,
            iridescence_ior: d.iridescence_ior,
            iridescence_range: d.iridescence_thickness,
            iridescence_thickness: d.iridescence_thickness[1],
        }
    }
}

impl Values {
    /// Reflectance at normal and at grazing incidence of the dielectric (glTF 2.0, B.3.5;
    /// `KHR_materials_specular`).
    fn dielectric_layer(&self) -> Schlick {
        if let Some(f0) = self.specular_reflectance {
            return Schlick { f0, f90: 1.0 };
        }
        // KHR_materials_ior: an index of 0 means a reflectance of 1 at all angles.
        let r = if self.ior == 0.0 {
            1.0
        } else {
            f0(self.ior, 1.0)
        };
        Schlick {
            f0: (self.specular_color * r).map(|c| c.min(1.0)) * self.specular,
            f90: self.specular,
        }
    }

    fn interface(&self, share: f64) -> Interface {
        Interface {
            ior: self.ior,
            dispersion: self.dispersion,
            tint: self.base_color,
            reflect: self.specular_color * self.specular,
            share,
            ggx: self.ggx(),
            // Index 1 bends nothing, however rough: a delta that light sampling leaves alone.
            smooth: self.is_smooth() || (self.ior == 1.0 && self.volume),
            thin: !self.volume,
            film: self.film(),
        }
    }

    fn is_smooth(&self) -> bool {
        self.roughness < MaterialDesc::SMOOTH
    }

    /// The thin film, and the share of the surface that it covers. A film too thin to be one
    /// covers nothing: the model of interference would leave the grazing terms of both its faces.
    fn film(&self) -> Option<(ThinFilm, f64)> {
        let film = ThinFilm {
            ior: self.iridescence_ior,
            thickness: self.iridescence_thickness,
        };
        let strength = self.iridescence * film.presence();
        let there = !cfg!(dualight_without = "iridescence") && strength > 0.0;
        there.then_some((film, strength))
    }

    /// The microfacet distribution (`KHR_materials_anisotropy` widens it along the tangent).
    fn ggx(&self) -> Ggx {
        let alpha = self.roughness.max(MaterialDesc::SMOOTH).powi(2);
        let [x, y] = self.brushing.widths(alpha, self.anisotropy);
        Ggx { x, y }
    }

    /// Pushes the lobes, from the base outward, in the main frame of `bsdf`; the clear coat lies
    /// in the frame `coat`.
    #[inline]
    pub(super) fn stack(&self, front: bool, coat: FrameId, bsdf: &mut Bsdf) {
        let dielectric = 1.0 - self.metallic;
        let through = dielectric * self.transmission;
        let opaque = dielectric - through;
        let layer = self.dielectric_layer();
        let film = self.film();
        let mut events = 0;
        if film.is_some() {
            events |= Event::FilmLobes.bit();
        }
        if !cfg!(dualight_without = "anisotropy") && self.anisotropy > 0.0 {
            events |= Event::BrushedLobes.bit();
        }

        if opaque > 0.0 {
            let mut base = self.base_color * opaque;
            if let Some(f0) = self.specular_reflectance {
                base *= 1.0 - f0.max_channel().min(1.0);
            }
            let passing = base * self.diffuse_transmission;
            let staying = base * (1.0 - self.diffuse_transmission);
            if layer.f0.is_black() && layer.f90 == 0.0 && film.is_none() {
                bsdf.push(Lambert { albedo: staying });
            } else {
                let cover = self.layer_albedo(&layer, film.as_ref());
                bsdf.push(CoatedLambert::new(staying, cover));
            }
            if !cfg!(dualight_without = "translucency") && self.diffuse_transmission > 0.0 {
                let lobe = DiffuseTransmission::new(
                    passing * self.diffuse_transmission_color,
                    self.layer_albedo(&layer, film.as_ref()),
                );
                bsdf.push_in(lobe, FrameId::MAIN, Event::TranslucentLobes.bit());
            }
        }
        if through > 0.0 {
            self.interface(through).push(front, events, bsdf);
        }
        // Metal and dielectric reflect alike: Schlick's term is linear in f0 and f90.
        let schlick = Schlick {
            f0: self.base_color * self.metallic + layer.f0 * opaque,
            f90: self.metallic + layer.f90 * opaque,
        };
        let fresnel = match film {
            None => Fresnel::Schlick(schlick),
            Some((film, strength)) => Fresnel::Film(Film {
                film,
                strength,
                metal: self.base_color,
                metallic: self.metallic,
                dielectric: layer,
                opaque,
            }),
        };
        let lobe = reflection(self.is_smooth(), self.ggx(), fresnel);
        bsdf.push_in(lobe, FrameId::MAIN, events);

        if !cfg!(dualight_without = "sheen") && !self.sheen_color.is_black() {
            let sheen = Sheen::new(self.sheen_color, self.sheen_roughness);
            bsdf.cover(Cover::sheen(&sheen), FrameId::MAIN);
            bsdf.push_in(sheen, FrameId::MAIN, Event::SheenLobes.bit());
        }
        if !cfg!(dualight_without = "coat") && self.clearcoat > 0.0 {
            let r = f0(COAT_IOR, 1.0);
            let fresnel = Schlick {
                f0: Rgb::splat(r * self.clearcoat),
                f90: self.clearcoat,
            };
            let albedo = LayerAlbedo::new(self.clearcoat_roughness, r, 1.0, self.clearcoat);
            bsdf.cover(Cover::coat(albedo), coat);
            let alpha = self.clearcoat_roughness.max(MaterialDesc::SMOOTH).powi(2);
            let smooth = self.clearcoat_roughness < MaterialDesc::SMOOTH;
            let lobe = reflection(smooth, Ggx::round(alpha), Fresnel::Schlick(fresnel));
            bsdf.push_in(lobe, coat, Event::CoatLobes.bit());
        }
    }

    /// What the reflecting layer above the diffuse base sends back, largest channel.
    fn layer_albedo(&self, layer: &Schlick, film: Option<&(ThinFilm, f64)>) -> LayerAlbedo {
        let (f0, f90) = match film {
            None => (layer.f0.max_channel(), layer.f90),
            Some((film, strength)) => {
                let mix = |bare: f64, filmed: f64| bare * (1.0 - strength) + filmed * strength;
                // A film reflects everything at grazing angles, however weak the base is.
                let f0 = mix(layer.f0.max_channel(), film.bound(layer.f0));
                (f0, mix(layer.f90, 1.0))
            }
        };
        LayerAlbedo::new(self.roughness, f0.min(1.0), f90.max(f0.min(1.0)), 1.0)
    }

    /// Of a material whose values lie between `low` and `high`: what it may do anywhere.
    pub(super) fn traits([low, high]: &[Self; 2]) -> MaterialTraits {
        let layer = high.dielectric_layer();
        let dielectric = 1.0 - low.metallic;
        let transmits = high.transmission > 0.0 && dielectric > 0.0;
        let coat = match high.clearcoat > 0.0 {
            true => low.clearcoat_roughness,
            false => f64::INFINITY,
        };
        MaterialTraits {
            diffuse: high.base_color.max_channel() * dielectric * (1.0 - low.transmission)
                + high.sheen_color.max_channel(),
            reflects: high.metallic > 0.0
                || layer.f90 > 0.0
                || !layer.f0.is_black()
                || high.clearcoat > 0.0
                || high.iridescence > 0.0
                || transmits,
            transmits,
            refracts: transmits && high.volume && (high.ior != 1.0 || high.dispersion > 0.0),
            roughness: low.roughness.min(coat),
        }
    }
}

fn reflection(smooth: bool, ggx: Ggx, fresnel: Fresnel) -> Lobe {
    if smooth {
        SmoothReflection { fresnel }.into()
    } else {
        GgxReflection { ggx, fresnel }.into()
    }
}

/// The medium that `d` encloses, if its surface can let light in: if it is not all metal, and its
/// metalness is `metallic` at least.
pub(super) fn interior(d: &MaterialDesc, metallic: f64) -> Option<Interior> {
    d.interior().filter(|_| metallic < 1.0)
}
