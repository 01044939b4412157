//! A material of one's own, from outside the crate.
//!
//! Velvet has upright fibres: seen face-on it is dull, at its rim it glows. We describe that with
//! one function (a *lobe*), make a material of it, and give it a name that scenes can ask for.
//! Nothing in Dualight changes. `cargo run --release --example custom_material` writes velvet.png.
use std::f64::consts::FRAC_1_PI;
use std::sync::Arc;

use dualight::cameras::CameraDesc;
use dualight::color::{Rgb, linear_to_srgb};
use dualight::control::Control;
use dualight::geometry::{SphereSet, Surface};
use dualight::lights::LightDesc;
use dualight::materials::lobes::{CustomLobe, Lambert, LobeClass, LobeModel, LobeSample};
use dualight::materials::{Bsdf, Material, MaterialDesc, MaterialEntry, MaterialTraits};
use dualight::math::{DAffine3, DVec3};
use dualight::pipeline::{RenderSettings, render};
use dualight::plugins::Registry;
use dualight::sampling::warp;
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};

/// The glow at the rim: `f = color · 10/π · (1 − cos θo)³ (1 − cos θi)³`.
///
/// Swapping `wo` and `wi` changes nothing, so it is reciprocal. Over all `wi` it reflects
/// `color · (1 − cos θo)³`, because `∫ (1 − cos θ)³ cos θ dω = π/10`: never more than arrives.
pub struct Rim(pub Rgb);

/// Directions are local: `z` is the normal, so `wo.z` is the cosine to it.
impl LobeModel for Rim {
    /// Broad enough to store photons on.
    fn class(&self) -> LobeClass {
        LobeClass::Diffuse
    }

    /// The value `f`, and the density with which `sample` picks `wi`.
    fn eval(&self, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
        if wi.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let fibres = |w: DVec3| (1.0 - w.z).max(0.0).powi(3);
        let f = self.0 * (10.0 * FRAC_1_PI * fibres(wo) * fibres(wi));
        (f, warp::cosine_hemisphere_pdf(wi.z))
    }

    /// A direction, and its weight `f · cos θi / pdf`; here `pdf = cos θi / π`.
    fn sample(&self, wo: DVec3, _u_pick: f64, u: [f64; 2]) -> Option<LobeSample> {
        let wi = warp::cosine_hemisphere(u);
        let (f, pdf) = self.eval(wo, wi);
        let weight = f / FRAC_1_PI;
        Some(LobeSample { wi, weight, pdf })
    }

    /// What is reflected in all directions together.
    fn albedo(&self, wo: DVec3) -> Rgb {
        self.0 * (1.0 - wo.z).max(0.0).powi(3)
    }
}

/// The material: the rim over a diffuse cloth that gets what the rim never takes.
struct Velvet {
    rim: CustomLobe,
    cloth: Lambert,
}

impl Material for Velvet {
    fn scatter(&self, _at: &Surface<'_>, bsdf: &mut Bsdf) {
        bsdf.push(self.rim.clone());
        bsdf.push(self.cloth);
    }

    /// Upper bounds, for the survey of effects: the diffuse albedo is never above one.
    fn traits(&self) -> MaterialTraits {
        MaterialTraits {
            diffuse: 1.0,
            ..Default::default()
        }
    }
}

/// The line of the table. A glTF file asks for it by `"extras": {"dualight_material": "velvet"}`
/// and may say how strong the rim is: `"velvet_rim": 0.8`.
pub const VELVET: MaterialEntry = MaterialEntry {
    name: "velvet",
    doc: "a cloth that glows at its rim",
    claims: |_| false, // only who asks for it gets it
    build: |desc| {
        let rim = desc.extras.get("velvet_rim");
        let Some(rim @ 0.0..=1.0) = rim.map_or(Some(0.8), |v| v.as_f64()) else {
            return Err("velvet_rim is not a number from 0 to 1".into());
        };
        let albedo = desc.base_color * (1.0 - rim);
        Ok(Box::new(Velvet {
            rim: Arc::new(Rim(Rgb::splat(rim))),
            cloth: Lambert { albedo },
        }))
    },
};

/// A velvet ball on a wide white one under a lamp. Lengths are metres, the lamp is in W/sr.
pub fn scene(registry: &Registry) -> dualight::error::Result<Scene> {
    let mut b = SceneBuilder::new(registry.scene.clone());
    let (red, white) = (Rgb::new(0.5, 0.02, 0.03), Rgb::splat(0.7));
    for (name, color, kind, sphere) in [
        ("ball", red, "velvet", [0.0, 1.0, 0.0, 1.0]),
        ("ground", white, "lambert", [0.0, -100.0, 0.0, 100.0]),
    ] {
        let material = b.add_material(&MaterialDesc {
            base_color: color,
            extras: serde_json::json!({ "dualight_material": kind }),
            ..Default::default()
        })?;
        let spheres = vec![sphere.map(|x: f64| x as f32)];
        let shape = b.add_spheres(SphereSet { spheres }, name);
        b.place(MeshPlacement {
            shape,
            material,
            world_from_object: DAffine3::IDENTITY,
            name: name.into(),
        });
    }
    b.add_light(LightDesc {
        kind: "point",
        position: DVec3::new(2.0, 4.0, 1.0),
        strength: Rgb::splat(30.0),
        ..Default::default()
    });
    b.add_camera(CameraDesc {
        name: "camera".into(),
        kind: "perspective",
        world_from_camera: DAffine3::from_translation(DVec3::new(0.0, 1.0, 5.0)),
        vertical: 35f64.to_radians(),
        aspect: None,
        shift: [0.0; 2],
        lens: None,
    });
    b.finish()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut registry = Registry::builtin();
    registry.scene.materials.add(VELVET)?;
    let (settings, control) = (RenderSettings::default(), Control::default());
    let rendering = render(&scene(&registry)?, &settings, &registry, &control)?;
    let colors = rendering.film.develop().rgb("").ok_or("no main layer")?;
    let byte = |c: &f32| (linear_to_srgb(f64::from(*c)) * 255.0).round() as u8;
    let bytes = colors.iter().flatten().map(byte).collect();
    image::RgbImage::from_raw(settings.width, settings.height, bytes)
        .ok_or("the image has another size")?
        .save("velvet.png")?;
    Ok(())
}
