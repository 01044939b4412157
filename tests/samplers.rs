//! Samplers against their densities (χ²), reciprocity, energy, and closed forms of direct light.
//!
//! Each χ² test rejects at a level of 0.01 over the whole file (Šidák), with fixed seeds.

mod common;

use std::cell::Cell;
use std::f64::consts::PI;

use common::chi2::{COS_CELLS, chi2};
use common::{glass, lambert, mirror};
use dualight::color::Rgb;
use dualight::geometry::{MaterialId, ObjectId, Surface, SurfacePoint};
use dualight::lights::{LIGHTS, Light, LightDesc};
use dualight::materials::{Bsdf, MATERIALS, Material, MaterialDesc, TransportMode};
use dualight::math::{BoundingSphere, DVec3};
use dualight::sampling::{Rng, warp};

fn point(wo: DVec3, front: bool) -> SurfacePoint {
    let ng = if front { DVec3::Z } else { -DVec3::Z };
    SurfacePoint {
        p: DVec3::ZERO,
        ng,
        n: ng,
        wo,
        front,
        distance: 1.0,
        barycentrics: [0.0; 2],
        offset: 0.0,
        prim: 0,
        object: ObjectId(0),
        material: MaterialId(0),
        light: None,
    }
}

fn build(desc: &MaterialDesc) -> Box<dyn Material> {
    let entry = MATERIALS.iter().find(|e| (e.claims)(desc)).unwrap();
    (entry.build)(desc).unwrap()
}

fn bsdf(m: &dyn Material, wo: DVec3, front: bool, mode: TransportMode) -> Bsdf {
    m.bsdf(&Surface::bare(&point(wo, front)), mode)
}

fn descs() -> Vec<(String, MaterialDesc)> {
    let mut out = vec![("lambert".to_string(), lambert("grey", Rgb::splat(0.7)))];
    for r in [0.4, 0.7, 1.0] {
        let rough = |d: MaterialDesc| MaterialDesc { roughness: r, ..d };
        out.push((format!("conductor {r}"), rough(mirror())));
        out.push((format!("rough glass {r}"), rough(glass(1.5))));
        let plastic = MaterialDesc {
            metallic: 0.0,
            base_color: Rgb::splat(0.6),
            ..mirror()
        };
        out.push((format!("plastic {r}"), rough(plastic.clone())));
        out.push((
            format!("half metal {r}"),
            rough(MaterialDesc {
                metallic: 0.5,
                ..plastic.clone()
            }),
        ));
        if r == 1.0 {
            continue;
        }
        let layered = [
            MaterialDesc {
                name: "coated".into(),
                clearcoat: 0.9,
                clearcoat_roughness: 0.4,
                ..plastic.clone()
            },
            MaterialDesc {
                name: "velvet".into(),
                sheen_color: Rgb::splat(0.8),
                sheen_roughness: r,
                ..plastic.clone()
            },
            MaterialDesc {
                name: "brushed".into(),
                anisotropy: 0.7,
                ..mirror()
            },
            MaterialDesc {
                name: "soap".into(),
                iridescence: 1.0,
                ..plastic.clone()
            },
            MaterialDesc {
                name: "leaf, of both sides like glass".into(),
                diffuse_transmission: 0.5,
                ..plastic.clone()
            },
            MaterialDesc {
                name: "frosted glass pane".into(),
                transmission: 1.0,
                specular: 0.8,
                ..plastic.clone()
            },
            MaterialDesc {
                name: "filmed glass".into(),
                transmission: 1.0,
                volume: true,
                iridescence: 1.0,
                ..plastic
            },
        ];
        for d in layered {
            out.push((format!("{} {r}", d.name), rough(d)));
        }
    }
    out
}

fn directions() -> [DVec3; 3] {
    [0.1f64, 0.7, 1.2].map(|a| DVec3::new(a.sin() * 0.8, a.sin() * 0.6, a.cos()))
}

#[test]
fn bsdf_samples_follow_their_densities_on_both_sides() {
    for (name, desc) in descs() {
        let m = build(&desc);
        for wo in directions() {
            for front in [true, false] {
                if !front && !name.contains("glass") {
                    continue;
                }
                let b = bsdf(&*m, wo, front, TransportMode::Radiance);
                chi2(
                    &format!("{name}, cos {:.2}, front {front}", wo.z),
                    |rng| b.sample(rng.next_1d(), rng.next_2d()).map(|s| s.wi),
                    |wi| {
                        let sum = Cell::new(0.0);
                        b.eval(wi, |p| {
                            sum.set(sum.get() + p);
                            1.0
                        });
                        sum.get()
                    },
                );
            }
        }
    }
}

#[test]
fn opaque_bsdfs_are_reciprocal_and_none_gains_energy() {
    let mut rng = Rng::new(5);
    for (name, desc) in descs() {
        let m = build(&desc);
        for _ in 0..2000 {
            let (a, b) = (
                warp::cosine_hemisphere(rng.next_2d()),
                warp::cosine_hemisphere(rng.next_2d()),
            );
            if a.z < 1e-3 || b.z < 1e-3 {
                continue;
            }
            let f = |wo: DVec3, wi: DVec3| {
                let v = bsdf(&*m, wo, true, TransportMode::Radiance).eval(wi, |_| 1.0);
                (v.diffuse + v.glossy) / wi.z
            };
            let (x, y) = (f(a, b), f(b, a));
            assert!(
                (x - y).map(f64::abs).max_channel() <= 1e-9 * x.max_channel().max(1e-6),
                "{name}"
            );
        }
        for wo in directions()
            .into_iter()
            .chain([DVec3::Z, DVec3::new(0.0, 1.0, 1e-6).normalize()])
        {
            let b = bsdf(&*m, wo, true, TransportMode::Importance);
            let n = 20_000;
            let mut sum = 0.0;
            for _ in 0..n {
                if let Some(s) = b.sample(rng.next_1d(), rng.next_2d()) {
                    assert!(
                        s.weight.is_finite() && (s.wi.length() - 1.0).abs() < 1e-9,
                        "{name}"
                    );
                    sum += s.weight.max_channel() / f64::from(n);
                }
            }
            assert!(sum < 1.02, "{name} at cos {:.2}: albedo {sum}", wo.z);
        }
    }
}

#[test]
fn smooth_glass_keeps_every_photon_and_scales_radiance() {
    let m = build(&glass(1.5));
    for wo in directions() {
        for front in [true, false] {
            let b = bsdf(&*m, wo, front, TransportMode::Importance);
            let sum: f64 = b.branches().unwrap().iter().map(|s| s.weight.r).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{sum}");
            let r = bsdf(&*m, wo, front, TransportMode::Radiance);
            let eta: f64 = if front { 1.5 } else { 1.0 / 1.5 };
            for (x, y) in b.branches().unwrap().iter().zip(&r.branches().unwrap()) {
                let scale = if x.transmitted {
                    1.0 / (eta * eta)
                } else {
                    1.0
                };
                assert!((x.weight.r * scale - y.weight.r).abs() < 1e-12);
            }
        }
    }
}

fn light(desc: &LightDesc) -> Box<dyn Light> {
    let entry = LIGHTS.iter().find(|e| e.name == desc.kind).unwrap();
    (entry.build)(desc).unwrap()
}

fn square(height: f64, side: f64) -> LightDesc {
    let h = 0.5 * side;
    let v = |x: f64, z: f64| DVec3::new(x, height, z);
    let (a, b, c, d) = (v(-h, -h), v(h, -h), v(h, h), v(-h, h));
    LightDesc {
        kind: "area",
        triangles: vec![[a, b, c], [a, c, d]],
        ..Default::default()
    }
}

fn ball(center: DVec3, radius: f64) -> LightDesc {
    let spheres = vec![BoundingSphere { center, radius }];
    LightDesc {
        kind: "sphere",
        spheres,
        ..Default::default()
    }
}

/// Irradiance at the origin facing `+y`, by sampling the light.
fn irradiance(desc: &LightDesc) -> f64 {
    let (l, mut rng, n) = (light(desc), Rng::new(9), 200_000);
    let mut sum = 0.0;
    for _ in 0..n {
        if let Some(s) = l.sample_li(DVec3::ZERO, rng.next_2d()) {
            sum += s.radiance.r * s.wi.y.max(0.0) / s.pdf / f64::from(n);
        }
    }
    sum
}

#[test]
fn direct_light_has_the_irradiance_of_its_form_factor() {
    // A 1×1 square 2 m above: F = 0.0734776, E = πLF.
    let e = irradiance(&square(2.0, 1.0));
    assert!((e / (PI * 0.073_477_6) - 1.0).abs() < 2e-3, "{e}");
    // A sphere of radius a at distance d straight above: E = πL a²/d².
    for (d, a) in [(2.0, 0.5), (1.0, 0.9), (100.0, 0.01)] {
        let e = irradiance(&ball(DVec3::new(0.0, d, 0.0), a));
        let expected = PI * (a / d) * (a / d);
        assert!((e / expected - 1.0).abs() < 5e-3, "{e} {expected}");
    }
    let e = irradiance(&LightDesc {
        position: DVec3::new(0.0, 2.0, 0.0),
        ..Default::default()
    });
    assert!((e - 0.25).abs() < 1e-12);
}

#[test]
fn photons_carry_the_power_of_every_light_kind() {
    let scene = BoundingSphere {
        center: DVec3::ZERO,
        radius: 2.0,
    };
    let base = LightDesc {
        scene,
        ..Default::default()
    };
    let kinds = [
        square(1.0, 2.0),
        LightDesc {
            double_sided: true,
            ..square(1.0, 2.0)
        },
        ball(DVec3::ONE, 0.3),
        LightDesc {
            kind: "point",
            ..base.clone()
        },
        LightDesc {
            kind: "spot",
            inner_cone: 0.3,
            outer_cone: 0.8,
            ..base.clone()
        },
        LightDesc {
            kind: "spot",
            inner_cone: 0.8,
            outer_cone: 0.8,
            ..base.clone()
        },
        LightDesc {
            kind: "directional",
            ..base
        },
    ];
    for desc in &kinds {
        let (l, mut rng, n) = (light(desc), Rng::new(3), 100_000);
        let (mut sum, mut sum2) = (0.0, 0.0);
        for _ in 0..n {
            let from = l.sample_origin(rng.next_2d()).unwrap();
            let (dir, pdf) = l.sample_direction(&from, rng.next_2d());
            let w = l.emitted(&from, dir).r / (from.pdf_area * pdf);
            if let (Some(ng), false) = (from.ng, desc.double_sided) {
                assert!(ng.dot(dir) >= 0.0, "{}: out of the back", desc.kind);
            }
            sum += w;
            sum2 += w * w;
        }
        let m = sum / f64::from(n);
        let sigma = ((sum2 / f64::from(n) - m * m).max(0.0) / f64::from(n)).sqrt();
        let power = l.power().r;
        assert!(
            (m - power).abs() < 4.0 * sigma + 1e-9 * power,
            "{}: {m} {power}",
            desc.kind
        );
        if desc.kind != "directional" {
            let from = l.sample_origin([0.3, 0.6]).unwrap();
            // The density of the direction alone, against samples of it.
            let pdf = |d: DVec3| {
                let e = l.emitted(&from, d).r;
                match (desc.kind, from.ng) {
                    (_, Some(_)) => e / PI / if desc.double_sided { 2.0 } else { 1.0 },
                    ("point", None) => 1.0 / (4.0 * PI),
                    _ if d.dot(desc.direction) >= desc.outer_cone.cos() => {
                        warp::cone_pdf(1.0 - desc.outer_cone.cos())
                    }
                    _ => 0.0,
                }
            };
            // The rim of a cone cuts cells that the midpoint rule integrates poorly.
            if desc.kind != "spot" {
                chi2(
                    desc.kind,
                    |rng| Some(l.sample_direction(&from, rng.next_2d()).0),
                    pdf,
                );
            }
        }
    }
}

#[test]
fn warps_follow_their_densities() {
    chi2(
        "sphere",
        |r| Some(warp::sphere(r.next_2d())),
        |_| 1.0 / (4.0 * PI),
    );
    chi2(
        "cosine hemisphere",
        |r| Some(warp::cosine_hemisphere(r.next_2d())),
        |d| warp::cosine_hemisphere_pdf(d.z),
    );
    // A cone whose rim is a boundary of cells.
    let cos = 1.0 - 2.0 * 3.0 / COS_CELLS as f64;
    chi2(
        "cone",
        |r| Some(warp::cone(r.next_2d(), cos)),
        |d| {
            if d.z >= cos {
                warp::cone_pdf(1.0 - cos)
            } else {
                0.0
            }
        },
    );
    // Uniform on a triangle: each quarter gets its share, binomial at 4σ.
    let (mut rng, n) = (Rng::new(8), 100_000);
    let mut quarter = 0;
    for _ in 0..n {
        let [b1, b2] = warp::triangle(rng.next_2d());
        assert!(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0);
        quarter += i32::from(b1 + b2 < 0.5);
    }
    let p = f64::from(quarter) / f64::from(n);
    assert!(
        (p - 0.25).abs() < 4.0 * (0.25 * 0.75 / f64::from(n)).sqrt(),
        "{p}"
    );
}
