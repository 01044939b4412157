//! Scenes that each show one effect, at any strength, beside what every room needs.

use std::sync::Arc;

use dualight::cameras::CameraDesc;
use dualight::color::Rgb;
use dualight::lights::LightDesc;
use dualight::materials::{AlphaMode, MaterialDesc, TextureSlots};
use dualight::math::{DAffine3, DVec3};
use dualight::sampling::Rng;
use dualight::scene::{MeshPlacement, Omit, Scene, SceneBuilder};
use dualight::textures::{Content, Image, Texels, Texture};

use super::{add_quad, add_room, add_sphere, camera, lambert, lamp, round_lens, square};

/// What there is to see.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Show {
    Plain,
    Gloss,
    Glass,
    Absorption,
    Dispersion,
    Translucency,
    Coat,
    Sheen,
    Iridescence,
    Anisotropy,
    Textures,
    Normals,
    Alpha,
    Environment,
    Lens,
    Instances,
    Everything,
}

impl Show {
    pub const ALL: &[Self] = &[
        Self::Plain,
        Self::Gloss,
        Self::Glass,
        Self::Absorption,
        Self::Dispersion,
        Self::Translucency,
        Self::Coat,
        Self::Sheen,
        Self::Iridescence,
        Self::Anisotropy,
        Self::Textures,
        Self::Normals,
        Self::Alpha,
        Self::Environment,
        Self::Lens,
        Self::Instances,
        Self::Everything,
    ];

    /// The effect that it is there for, if that is decided when a scene is built.
    pub fn built(self) -> Option<&'static str> {
        Some(match self {
            Self::Absorption => "absorption",
            Self::Dispersion => "dispersion",
            Self::Translucency => "translucency",
            Self::Coat => "coat",
            Self::Sheen => "sheen",
            Self::Iridescence => "iridescence",
            Self::Anisotropy => "anisotropy",
            Self::Textures => "textures",
            Self::Normals => "normals",
            Self::Alpha => "alpha",
            Self::Environment => "environment",
            Self::Lens => "lens",
            _ => return None,
        })
    }

    /// The effects that it calls for at full strength.
    pub fn calls_for(self) -> Vec<&'static str> {
        let mut out = vec!["direct", "indirect"];
        if self.has_gloss() {
            out.extend(["specular", "caustics"]);
        }
        match self {
            Self::Instances => out.push("instances"),
            Self::Glass | Self::Absorption | Self::Dispersion => out.push("refraction"),
            Self::Everything => {
                out.extend(Self::ALL.iter().filter_map(|s| s.built()));
                out.extend(["refraction", "instances"]);
            }
            _ => {}
        }
        out.extend(self.built());
        out
    }

    fn has_gloss(self) -> bool {
        !matches!(
            self,
            Self::Plain | Self::Alpha | Self::Environment | Self::Lens | Self::Instances
        )
    }
}

/// An image of 8 × 8 texels, each channel by chance between bounds.
pub fn noise(seed: u64, content: Content, [low, high]: [[u8; 4]; 2]) -> Option<Texture> {
    let mut rng = Rng::new(seed);
    let texels = (0..64 * 4)
        .map(|i| {
            let (a, b) = (f64::from(low[i % 4]), f64::from(high[i % 4]));
            (a + (b - a) * rng.next_1d()).round() as u8
        })
        .collect();
    let image = Image::from_texels(8, 8, 4, Texels::U8(texels)).unwrap();
    Some(Texture::new(Arc::new(image), content))
}

/// The material on show, its feature as strong as `x`: at 0 it is named, with all that belongs to
/// it, but nothing of it can be seen. `None` is without it.
fn material(show: Show, strength: Option<f64>) -> MaterialDesc {
    let mut d = match show.has_gloss() {
        false => lambert("shown", Rgb::new(0.7, 0.5, 0.4)),
        true => MaterialDesc {
            name: "shown".into(),
            base_color: Rgb::new(0.7, 0.5, 0.4),
            metallic: 0.0,
            roughness: 0.5,
            ..Default::default()
        },
    };
    if matches!(show, Show::Glass | Show::Absorption | Show::Dispersion) {
        d.transmission = 1.0;
        d.roughness = 0.0;
        d.volume = true;
    }
    if show == Show::Textures {
        // What is dark already cannot be made darker by its image.
        d.specular = strength.unwrap_or(0.0);
    }
    let Some(x) = strength else { return d };
    let any = [[0, 0, 0, 0], [255; 4]];
    let has = |one| show == one || show == Show::Everything;
    let mut t = TextureSlots {
        normal_scale: 1.0,
        clearcoat_normal_scale: 1.0,
        ..Default::default()
    };
    if show == Show::Everything {
        (d.transmission, d.volume) = (0.5, true);
    }
    if has(Show::Absorption) {
        d.attenuation_distance = 0.5;
        d.attenuation_color = Rgb::new(1.0 - 0.8 * x, 1.0 - 0.2 * x, 1.0 - 0.5 * x);
    }
    if has(Show::Dispersion) {
        d.dispersion = 5.0 * x;
    }
    if has(Show::Translucency) {
        d.diffuse_transmission = 0.8 * x;
        d.diffuse_transmission_color = Rgb::new(0.9, 0.8, 0.3);
        t.diffuse_transmission_color = noise(1, Content::Color, any);
    }
    if has(Show::Coat) {
        d.clearcoat = x;
        d.clearcoat_roughness = 0.1;
        t.clearcoat = noise(2, Content::Data, any);
        t.clearcoat_normal = noise(3, Content::Data, [[90, 90, 200, 0], [160, 160, 255, 0]]);
    }
    if has(Show::Sheen) {
        d.sheen_color = Rgb::new(0.8, 0.6, 0.9) * x;
        d.sheen_roughness = 0.4;
        t.sheen_color = noise(4, Content::Color, any);
    }
    if has(Show::Iridescence) {
        d.iridescence = x;
        d.iridescence_ior = 1.8;
        t.iridescence_thickness = noise(5, Content::Data, any);
    }
    if has(Show::Anisotropy) {
        d.anisotropy = 0.9 * x;
        d.anisotropy_rotation = 0.6;
        t.anisotropy = noise(6, Content::Data, [[0, 0, 255, 0], [255, 255, 255, 0]]);
    }
    if has(Show::Textures) {
        t.specular = noise(7, Content::Data, any);
        t.specular_color = noise(8, Content::Color, any);
        t.emissive = noise(9, Content::Color, any);
        if x > 0.0 {
            t.base_color = noise(10, Content::Color, [[0, 0, 0, 255], [255; 4]]);
        }
    }
    if has(Show::Normals) {
        t.normal_scale = x;
        t.normal = noise(11, Content::Data, [[60, 60, 200, 0], [190, 190, 255, 0]]);
    }
    if has(Show::Alpha) {
        d.alpha_mode = AlphaMode::Blend;
        d.base_alpha = 1.0 - 0.5 * x;
    }
    d.textures = t.iter().next().is_some().then(|| Arc::new(t.clone()));
    d
}

/// A room with a small lamp, a panel and a ball of the material on show, its feature at
/// `strength`; leaving out what `omit` says.
pub fn scene(show: Show, strength: impl Into<Option<f64>>, omit: Omit) -> Scene {
    let strength = strength.into();
    let has = |one| show == one || show == Show::Everything;
    let mut b = SceneBuilder::default();
    b.leave_out(omit);
    let grey = b.add_material(&lambert("grey", Rgb::splat(0.6))).unwrap();
    let shown = b.add_material(&material(show, strength)).unwrap();
    let lamp = b.add_material(&lamp(Rgb::splat(20.0))).unwrap();
    if has(Show::Environment) {
        // No more than a floor, so that the sky shines in.
        let at = DVec3::new(-3.0, -1.5, -3.0);
        add_quad(&mut b, "floor", grey, at, DVec3::Z * 6.0, DVec3::X * 6.0);
    } else {
        add_room(&mut b, grey, 3.0);
    }
    let at = DVec3::new(-0.4, 2.0, 0.2);
    add_quad(&mut b, "lamp", lamp, at, DVec3::X * 0.8, DVec3::Z * 0.8);
    add_sphere(&mut b, "ball", shown, DVec3::new(0.9, -0.5, 0.0), 0.6);
    let panel = b.add_mesh(square(), "panel");
    let mut places = vec![DVec3::new(-0.8, 0.0, -0.7)];
    if has(Show::Instances) && strength.is_some_and(|x| x > 0.0) {
        places.push(DVec3::new(-1.2, 0.3, -1.6));
    }
    for at in places {
        b.place(MeshPlacement {
            shape: panel,
            material: shown,
            world_from_object: DAffine3::from_translation(at),
            name: "panel".into(),
        });
    }
    if has(Show::Environment)
        && let Some(x) = strength
    {
        b.add_light(LightDesc {
            kind: "environment",
            strength: Rgb::new(0.4, 0.5, 0.9) * x,
            ..Default::default()
        });
    }
    let lens = strength.filter(|_| has(Show::Lens));
    let lens = lens.map(|x| round_lens(0.15 * x, 2.0));
    b.add_camera(CameraDesc {
        lens,
        ..camera(DVec3::new(0.0, 0.2, 2.8), 55.0)
    });
    b.finish().unwrap()
}
