//! Layers: what coats and sheen leave of what lies below them, in a white furnace and by χ².
//!
//! In a white furnace, under radiance 1 from everywhere, a surface shows its directional albedo.
//! Expected albedos are integrals of the layers' own functions by quadrature, or closed forms.

mod common;

use std::cell::Cell;
use std::f64::consts::{FRAC_1_PI, PI, TAU};
use std::sync::Arc;

use common::chi2::chi2;
use common::points::{Specimen, direction, point};
use common::stats::Samples;
use dualight::color::Rgb;
use dualight::geometry::Surface;
use dualight::materials::fresnel::{self, Schlick};
use dualight::materials::lobes::{GgxReflection, Sheen};
use dualight::materials::{
    Bsdf, LobeModel, MATERIALS, Material, MaterialDesc, TextureSlots, TransportMode,
};
use dualight::math::{DAffine3, DVec3};
use dualight::sampling::Rng;
use dualight::scene::{MeshPlacement, Scene, SceneBuilder};
use dualight::textures::{Content, Image, Texture};

const COSINES: [f64; 5] = [1.0, 0.8, 0.5, 0.25, 0.1];

/// The tables by which layers are scaled are good to about this.
const TABLES: f64 = 4e-3;

fn pbr(desc: &MaterialDesc) -> Box<dyn Material> {
    let entry = MATERIALS.iter().find(|m| m.name == "pbr").expect("known");
    (entry.build)(desc).expect("valid")
}

fn specimen(desc: MaterialDesc) -> Specimen {
    Specimen {
        name: "stack".into(),
        material: pbr(&desc),
        desc,
        both_sides: true,
    }
}

/// A white diffuse base.
fn white() -> MaterialDesc {
    MaterialDesc {
        metallic: 0.0,
        specular: 0.0,
        base_color: Rgb::ONE,
        ..Default::default()
    }
}

/// Directional albedo in green from 16 seeds.
fn albedo(bsdf: &Bsdf, n: u32) -> Samples {
    channel(bsdf, n, |c| c.g)
}

fn channel(bsdf: &Bsdf, n: u32, of: impl Fn(Rgb) -> f64) -> Samples {
    Samples::over_seeds(16, |seed| {
        let mut rng = Rng::new(500 + seed);
        let draw = |_| bsdf.sample(rng.next_1d(), rng.next_2d());
        let sum: Rgb = (0..n).filter_map(draw).map(|x| x.weight).sum();
        of(sum) / f64::from(n)
    })
}

/// `∫ g(wi) cos θi dωi` over the upper hemisphere by the midpoint rule; `g` is even in y.
fn integral(n: u32, g: impl Fn(DVec3) -> f64) -> f64 {
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
    let mut sum = 0.0;
    for i in 0..n {
        // Denser toward the horizon and the pole: z = s² (3 − 2 s), dz = 6 s (1 − s) ds.
        let s = at(i);
        let z = s * s * (3.0 - 2.0 * s);
        for j in 0..n {
            sum += g(direction(z, PI * at(j))) * z * 6.0 * s * (1.0 - s);
        }
    }
    sum * TAU / f64::from(n * n)
}

/// The albedo of a lobe that does not transmit, for `wo` at each of the nodes that `integral` asks
/// for: by cosine, linear between 129 values over its root.
struct Table(Vec<f64>);

impl Table {
    fn new(lobe: &impl LobeModel) -> Self {
        let value = |k: u32| {
            let wo = direction((f64::from(k.max(1)) / 128.0).powi(2), 0.0);
            integral(160, |wi| lobe.eval(wo, wi).0.max_channel())
        };
        Self((0..=128).map(value).collect())
    }

    fn at(&self, cos: f64) -> f64 {
        let x = cos.sqrt() * 128.0;
        let k = (x as usize).min(127);
        self.0[k] + (self.0[k + 1] - self.0[k]) * (x - k as f64)
    }
}

/// The clear coat by itself: its albedo.
enum Coat {
    None,
    Smooth(f64),
    Rough(Table),
}

impl Coat {
    fn new(strength: f64, roughness: f64) -> Self {
        let schlick = Schlick {
            f0: Rgb::splat(0.04 * strength),
            f90: strength,
        };
        match (strength > 0.0, roughness > 0.0) {
            (false, _) => Self::None,
            (true, false) => Self::Smooth(strength),
            (true, true) => {
                Self::Rough(Table::new(&GgxReflection::new(roughness.powi(2), schlick)))
            }
        }
    }

    fn albedo(&self, cos: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Smooth(strength) => strength * (0.04 + 0.96 * (1.0 - cos).powi(5)),
            Self::Rough(table) => table.at(cos),
        }
    }
}

/// Directional albedo by quadrature of what `eval` says on both sides; `wo` lies at y = 0.
fn integrated(bsdf: &Bsdf) -> f64 {
    let side = |sign: f64| {
        integral(400, |wi| {
            let v = bsdf.eval(DVec3::new(wi.x, wi.y, sign * wi.z), |_| 1.0);
            (v.diffuse + v.glossy).g / wi.z
        })
    };
    side(1.0) + side(-1.0)
}

#[test]
fn each_white_lobe_shows_its_albedo_in_the_furnace() {
    let metal = |roughness| MaterialDesc {
        roughness,
        ..Default::default()
    };
    let glass = |roughness, volume| MaterialDesc {
        roughness,
        transmission: 1.0,
        volume,
        specular: 1.0,
        ..white()
    };
    // Lossless by themselves.
    let leaf = MaterialDesc {
        diffuse_transmission: 1.0,
        ..white()
    };
    let whole = [
        ("diffuse", white()),
        ("leaf", leaf),
        ("mirror", metal(0.0)),
        ("glass", glass(0.0, true)),
        ("pane", glass(0.0, false)),
    ];
    for (name, desc) in whole {
        let s = specimen(desc);
        for cos in COSINES {
            let bsdf = s.bsdf(direction(cos, 0.0), TransportMode::Importance);
            albedo(&bsdf, 2000).assert_mean_with_bias(&format!("{name}, {cos}"), 1.0, 0.01, 1e-9);
        }
    }
    // What single scattering loses, and cloth does not reflect, the quadrature tells.
    let cloth = MaterialDesc {
        base_color: Rgb::ZERO,
        sheen_color: Rgb::ONE,
        sheen_roughness: 0.7,
        ..white()
    };
    let brushed = MaterialDesc {
        anisotropy: 0.8,
        ..metal(0.6)
    };
    let film = MaterialDesc {
        iridescence: 1.0,
        ..glass(0.6, true)
    };
    let lossy = [
        ("cloth", cloth),
        ("brushed metal", brushed),
        ("metal", metal(0.6)),
        ("rough metal", metal(1.0)),
        ("rough glass", glass(0.6, true)),
        ("rough pane", glass(0.6, false)),
        ("rough glass with a film", film),
    ];
    for (name, desc) in lossy {
        let s = specimen(desc);
        for cos in COSINES.into_iter().chain(COSINES.map(|c| -c)) {
            let bsdf = s.bsdf(direction(cos, 0.0), TransportMode::Importance);
            let want = integrated(&bsdf);
            let what = format!("{name}, {cos}");
            albedo(&bsdf, 20_000).assert_mean_with_bias(&what, want, 0.02, 2e-3);
            assert!(want < 1.0 + 1e-3, "{what}: {want}");
        }
    }
    // Width 1, seen from above: ∫ G₁ over the microfacets' normals is 1 − ln 2.
    let above = specimen(metal(1.0)).bsdf(DVec3::Z, TransportMode::Importance);
    assert!((integrated(&above) - (1.0 - 2f64.ln())).abs() < 1e-3);
}

#[test]
fn white_bases_under_sheen_and_coats_show_what_the_layers_leave() {
    for sheen in [0.0, 0.7] {
        for (coat, coat_roughness) in [(0.0, 0.0), (1.0, 0.0), (0.6, 0.0), (1.0, 0.5)] {
            let s = specimen(MaterialDesc {
                sheen_color: Rgb::splat(sheen),
                sheen_roughness: 0.6,
                clearcoat: coat,
                clearcoat_roughness: coat_roughness,
                ..white()
            });
            let fibres = Sheen::new(Rgb::splat(sheen), 0.6);
            let fuzz = Table::new(&fibres);
            let layer = Coat::new(coat, coat_roughness);
            for cos in COSINES {
                let wo = direction(cos, 0.0);
                let under = |e: f64, f: f64| (1.0 - e).min(1.0 - f);
                let below = |wi: DVec3| {
                    let base = under(fuzz.at(cos), fuzz.at(wi.z)) * FRAC_1_PI;
                    let cloth = fibres.eval(wo, wi).0.r + base;
                    cloth * under(layer.albedo(cos), layer.albedo(wi.z))
                };
                let want = layer.albedo(cos) + integral(160, below);
                let bsdf = s.bsdf(wo, TransportMode::Radiance);
                let what = format!("sheen {sheen}, coat {coat} of {coat_roughness}, at {cos}");
                albedo(&bsdf, 20_000).assert_mean_with_bias(&what, want, 0.01, TABLES);
                assert!(want <= 1.0 + TABLES, "{what}: {want}");
            }
        }
    }
}

#[test]
fn coated_glass_parts_its_light_between_coat_and_interface() {
    // Solid and smooth: F + (1 − F) R back, and through what the coat leaves along both ways.
    let coat = |cos: f64| 0.04 + 0.96 * (1.0 - cos).powi(5);
    for cos in COSINES.into_iter().chain(COSINES.map(|c| -c)) {
        let s = specimen(MaterialDesc {
            roughness: 0.0,
            transmission: 1.0,
            volume: true,
            specular: 1.0,
            clearcoat: 1.0,
            ..white()
        });
        let eta = if cos > 0.0 { 1.5 } else { 1.0 / 1.5 };
        let (near, f) = (cos.abs(), fresnel::dielectric(cos.abs(), eta));
        let kept = (1.0 - coat(near)).min(1.0 - coat(f.cos_t));
        let want = coat(near) + (1.0 - coat(near)) * f.reflectance + kept * f.transmittance;
        let bsdf = s.bsdf(direction(cos, 0.3), TransportMode::Importance);
        albedo(&bsdf, 20_000).assert_mean_with_bias(&format!("{cos}"), want, 0.01, TABLES);
        // From outside all of it is there.
        assert!(want <= 1.0 + 1e-12 && (cos < 0.0 || want > 1.0 - 1e-12));
    }
}

#[test]
fn half_transmitting_white_returns_and_passes_all_light() {
    for diffuse_transmission in [0.0, 0.5] {
        for volume in [true, false] {
            let s = specimen(MaterialDesc {
                roughness: 0.0,
                transmission: 0.5,
                diffuse_transmission,
                volume,
                specular: 1.0,
                ..white()
            });
            for cos in COSINES {
                let bsdf = s.bsdf(direction(cos, 0.3), TransportMode::Importance);
                let what = format!("{diffuse_transmission}, {volume}, {cos}");
                albedo(&bsdf, 20_000).assert_mean_with_bias(&what, 1.0, 0.01, TABLES);
            }
        }
    }
}

#[test]
fn no_stack_of_white_layers_shines_in_the_furnace() {
    let mut worst = (0.0, String::new());
    let mut rng = Rng::new(21);
    for round in 0..150 {
        let mut one = |odds: f64| {
            let there = rng.next_1d() < odds;
            f64::from(u8::from(there)) * [1.0, rng.next_1d()][usize::from(rng.next_1d() < 0.5)]
        };
        let desc = MaterialDesc {
            base_color: Rgb::ONE,
            metallic: one(0.4),
            roughness: one(0.8),
            specular: 1.0 - one(0.3),
            transmission: one(0.4),
            diffuse_transmission: one(0.3),
            clearcoat: one(0.6),
            clearcoat_roughness: one(0.6),
            sheen_color: Rgb::splat(one(0.5)),
            sheen_roughness: one(0.9),
            anisotropy: one(0.4),
            iridescence: one(0.4),
            dispersion: one(0.2),
            ior: 1.0 + one(0.9),
            volume: one(0.5) > 0.0,
            ..Default::default()
        };
        let text = format!("round {round}: {desc:?}");
        let s = specimen(desc);
        for cos in [1.0, 0.7, 0.3, 0.1, 0.01, -0.01, -0.1, -0.3, -0.7, -1.0] {
            let bsdf = s.bsdf(direction(cos, 0.5), TransportMode::Importance);
            for of in [|c: Rgb| c.r, |c: Rgb| c.g, |c: Rgb| c.b] {
                let a = channel(&bsdf, 400, of);
                // So many that four standard deviations of 16 seeds would be passed by chance.
                let least = a.mean() - 6.0 * a.sigma();
                if least > worst.0 {
                    worst = (least, format!("{cos}, {text}"));
                }
            }
        }
    }
    println!("largest albedo less six sigma: {worst:?}");
    assert!(worst.0 <= 1.0 + TABLES, "{worst:?}");
}

/// A square in the plane z = 0 with texture coordinates along x and y.
fn sheet(desc: &MaterialDesc) -> Scene {
    let mut b = SceneBuilder::default();
    let material = b.add_material(desc).expect("valid");
    let shape = b.add_mesh(common::square(), "sheet");
    b.place(MeshPlacement {
        shape,
        material,
        world_from_object: DAffine3::IDENTITY,
        name: "sheet".into(),
    });
    b.finish().expect("a scene")
}

/// A normal map that is the same everywhere, leaning along x by an angle of sine `x`.
fn leaning(x: f64) -> Option<Texture> {
    let n = [x, 0.0, (1.0 - x * x).sqrt()].map(|c| (0.5 + 0.5 * c) as f32);
    let image = Image::new(1, 1, vec![[n[0], n[1], n[2], 1.0]]).expect("a texel");
    Some(Texture::new(Arc::new(image), Content::Normal))
}

/// Coats whose normal is not that of what lies below.
fn leaning_coats() -> Vec<(&'static str, Scene)> {
    let desc = |base: Option<Texture>, coat: Option<Texture>| MaterialDesc {
        metallic: 0.0,
        roughness: 0.5,
        base_color: Rgb::ONE,
        clearcoat: 1.0,
        clearcoat_roughness: 0.4,
        textures: Some(Arc::new(TextureSlots {
            normal: base,
            normal_scale: 1.0,
            clearcoat_normal: coat,
            clearcoat_normal_scale: 1.0,
            ..Default::default()
        })),
        ..Default::default()
    };
    vec![
        ("leaning coat", sheet(&desc(None, leaning(0.6)))),
        (
            "level coat on a leaning base",
            sheet(&desc(leaning(0.6), None)),
        ),
        (
            "coat and base lean apart",
            sheet(&desc(leaning(-0.4), leaning(0.5))),
        ),
    ]
}

fn seen(scene: &Scene, wo: DVec3) -> Bsdf {
    let sp = point(wo);
    let surface = Surface::new(&scene.geometry, &sp, None);
    scene
        .material(sp.material)
        .bsdf(&surface, TransportMode::Radiance)
}

#[test]
fn coats_with_their_own_normal_are_sampled_by_their_density() {
    for (name, scene) in leaning_coats() {
        // The coat has a frame of its own, or the test says nothing of it.
        let level = {
            let sp = point(DVec3::Z);
            let bare = Surface::bare(&sp);
            scene
                .material(sp.material)
                .bsdf(&bare, TransportMode::Radiance)
        };
        let wi = direction(0.7, 0.0);
        let value = |b: &Bsdf| b.eval(wi, |_| 1.0).glossy.r;
        assert!((value(&seen(&scene, DVec3::Z)) / value(&level) - 1.0).abs() > 0.05);
        for wo in [
            direction(1.0, 0.0),
            direction(0.7, 0.9),
            direction(0.35, 4.0),
        ] {
            let bsdf = seen(&scene, wo);
            let density = |wi: DVec3| {
                let sum = Cell::new(0.0);
                bsdf.eval(wi, |p| {
                    sum.set(sum.get() + p);
                    1.0
                });
                sum.get()
            };
            let draw = |rng: &mut Rng| bsdf.sample(rng.next_1d(), rng.next_2d()).map(|s| s.wi);
            chi2(&format!("{name}, from {wo}"), draw, density);
        }
    }
}

#[test]
fn coats_with_their_own_normal_give_nothing_away() {
    for (name, scene) in leaning_coats() {
        for cos in [1.0, 0.7, 0.3, 0.1, -0.5] {
            for phi in [0.0, 1.5, 3.0] {
                let a = albedo(&seen(&scene, direction(cos, phi)), 4000);
                let least = a.mean() - 4.0 * a.sigma();
                assert!(least <= 1.0 + TABLES, "{name}, {cos}, {phi}: {}", a.mean());
            }
        }
    }
}
