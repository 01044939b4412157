//! Scattering functions are physical: reciprocal, adjoint, energy conserving, consistent with
//! their samplers and finite, for every kind of the table of materials.
//!
//! Sources: Veach 1997, 5.2 (η² and adjoint BSDFs); Walter et al. 2007 (rough refraction); Heitz
//! 2014 (a smooth microfacet surface loses nothing to single scattering).

mod common;

use std::cell::Cell;
use std::f64::consts::TAU;

use common::points::{Specimen, direction, point, point_with_normal, specimens};
use common::stats::Samples;
use dualight::color::Rgb;
use dualight::geometry::Surface;
use dualight::materials::{LobeClass, MaterialDesc, TransportMode, fresnel};
use dualight::math::DVec3;
use dualight::sampling::{Rng, warp};

const ROUGHNESSES: [f64; 5] = [1e-3, 0.05, 0.2, 0.5, 1.0];

/// Cosines of `wo`, from the normal to grazing; `true` for those worth a look from the back too.
const COSINES: [f64; 9] = [1.0, 0.9, 0.5, 0.1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-9];

/// Pairs of a specimen and a cosine, backs included where they differ.
fn views(roughnesses: &[f64]) -> Vec<(Specimen, Vec<f64>)> {
    specimens(roughnesses)
        .into_iter()
        .map(|s| {
            let mut cosines = COSINES.to_vec();
            if s.both_sides {
                cosines.extend(COSINES.map(|c| -c));
            }
            (s, cosines)
        })
        .collect()
}

/// `f` without its cosine, all finite lobes together.
fn f(s: &Specimen, wo: DVec3, wi: DVec3, mode: TransportMode) -> Rgb {
    let v = s.bsdf(wo, mode).eval(wi, |_| 1.0);
    (v.diffuse + v.glossy) / wi.z.abs()
}

/// Largest channel-wise difference, relative to the larger value.
fn difference(a: Rgb, b: Rgb) -> f64 {
    let scale = a.max_channel().max(b.max_channel());
    if scale == 0.0 {
        return 0.0;
    }
    (a - b).map(f64::abs).max_channel() / scale
}

/// Index of refraction behind `wi` over that behind `wo`.
fn eta(s: &Specimen, wo: DVec3, wi: DVec3) -> f64 {
    match (wo.z > 0.0, wi.z > 0.0) {
        _ if !s.desc.volume => 1.0,
        (true, false) => s.desc.ior,
        (false, true) => 1.0 / s.desc.ior,
        _ => 1.0,
    }
}

#[test]
fn scattering_is_reciprocal_and_adjoint() {
    // f*(wo → wi) η⁻² = f*(wi → wo), and f(wo, wi) = f*(wi, wo) with roles exchanged, where f* is
    // the function of importance: for a photon that arrives from `wo` and leaves along `wi`.
    let (mut pairs, mut worst) = (0u64, (0.0, String::new()));
    for s in specimens(&ROUGHNESSES[1..]) {
        let mut rng = Rng::new(1);
        for _ in 0..4000 {
            let (wo, wi) = (warp::sphere(rng.next_2d()), warp::sphere(rng.next_2d()));
            let eta = eta(&s, wo, wi);
            let there = f(&s, wo, wi, TransportMode::Importance);
            let back = f(&s, wi, wo, TransportMode::Importance);
            let radiance = f(&s, wi, wo, TransportMode::Radiance);
            pairs += u64::from(!there.is_black());
            for (what, a, b) in [
                ("reciprocity", there / (eta * eta), back),
                ("adjoint", there, radiance),
            ] {
                let off = difference(a, b);
                if off > worst.0 {
                    worst = (off, format!("{what} of {} from {wo} to {wi}", s.name));
                }
            }
        }
    }
    println!("worst of {pairs} pairs that scatter: {worst:?}");
    assert!(pairs > 30_000);
    assert!(worst.0 < 1e-7, "{worst:?}");
}

#[test]
fn shading_normals_keep_the_two_transports_adjoint() {
    // Veach 1997, 5.3: f*(wo → wi) |wi·n| = f(wi, wo) |wo·n| |wi·ng| / |wo·ng| in terms of the
    // products with cosines that `eval` returns.
    let n = DVec3::new(0.4, 0.1, 0.9).normalize();
    let mut compared = 0;
    for s in specimens(&[0.4]) {
        let mut rng = Rng::new(2);
        for _ in 0..4000 {
            let (wo, wi) = (warp::sphere(rng.next_2d()), warp::sphere(rng.next_2d()));
            // Where the normal is replaced because it faces away the two differ by intention.
            let faces = |w: DVec3| w.dot(n) * w.z > 0.0;
            if !faces(wo) || !faces(wi) {
                continue;
            }
            let value = |from: DVec3, to, mode| {
                let sp = point_with_normal(from, n);
                let v = s.material.bsdf(&Surface::bare(&sp), mode).eval(to, |_| 1.0);
                v.diffuse + v.glossy
            };
            let photon = value(wo, wi, TransportMode::Importance) / wi.z.abs();
            let camera = value(wi, wo, TransportMode::Radiance) / wo.z.abs();
            // `eval` carries |wi·n| (or |wo·n|); the photon's correction is |wo·n||wi·ng| over
            // |wo·ng||wi·n|, so both are f·|wo·n|/|wo·ng|.
            let off = difference(photon, camera);
            assert!(off < 1e-7, "{}: {wo} {wi}: {photon:?} {camera:?}", s.name);
            compared += usize::from(!photon.is_black());
        }
    }
    assert!(compared > 5000, "{compared}");
}

#[test]
fn weights_are_value_over_density() {
    // Each lobe is its own technique, so a sample's weight is f |cos| / pdf of the lobe picked;
    // `eval` tells each lobe's density, by which the picked one is recognised.
    let (mut compared, mut worst) = (0u64, (0.0, String::new()));
    for (s, cosines) in views(&ROUGHNESSES) {
        for cos in cosines {
            for mode in [TransportMode::Radiance, TransportMode::Importance] {
                let bsdf = s.bsdf(direction(cos, 1.0), mode);
                let mut rng = Rng::new(3);
                for _ in 0..200 {
                    let Some(x) = bsdf.sample(rng.next_1d(), rng.next_2d()) else {
                        continue;
                    };
                    assert!(
                        x.weight.is_finite() && x.pdf.is_finite() && x.pdf >= 0.0,
                        "{} at {cos}: {x:?}",
                        s.name
                    );
                    assert!((x.wi.length() - 1.0).abs() < 1e-9);
                    assert_eq!(
                        x.pdf == 0.0,
                        x.class == LobeClass::Delta,
                        "{} {x:?}",
                        s.name
                    );
                    if x.class == LobeClass::Delta {
                        continue;
                    }
                    // A half vector computed again is off by rounding over the shorter cosine, to
                    // be compared with the width of the highlight: all that can be asked for.
                    let alpha = s.desc.roughness.powi(2);
                    let least = x.wi.z.abs().min(cos.abs());
                    let granted = 1e-7 + 1e-13 / (alpha * least);
                    if granted > 0.1 {
                        continue;
                    }
                    let same = Cell::new(0);
                    let value = bsdf.eval(x.wi, |pdf| {
                        let is = (pdf / x.pdf - 1.0).abs() < granted;
                        same.set(same.get() + i32::from(is));
                        f64::from(is)
                    });
                    if same.get() > 1 {
                        continue; // Two lobes of the same density cannot be told apart.
                    }
                    let off =
                        difference((value.diffuse + value.glossy) / x.pdf, x.weight) / granted;
                    compared += 1;
                    if off > worst.0 {
                        worst = (off, format!("{} at {cos}: {x:?}", s.name));
                    }
                }
            }
        }
    }
    println!("worst of {compared}, over what rounding grants: {worst:?}");
    assert!(compared > 30_000 && worst.0 < 1.0, "{worst:?}");
}

/// Directional albedo from `n` samples per seed, 16 seeds.
fn albedo(s: &Specimen, wo: DVec3, mode: TransportMode, n: u32) -> [Samples; 3] {
    let means: Vec<Rgb> = (0..16)
        .map(|seed| {
            let bsdf = s.bsdf(wo, mode);
            let mut rng = Rng::new(1000 + seed);
            let draw = |_| bsdf.sample(rng.next_1d(), rng.next_2d());
            let sum: Rgb = (0..n).filter_map(draw).map(|x| x.weight).sum();
            sum / f64::from(n)
        })
        .collect();
    [|c: &Rgb| c.r, |c: &Rgb| c.g, |c: &Rgb| c.b].map(|f| Samples(means.iter().map(f).collect()))
}

#[test]
fn no_surface_returns_more_than_it_gets() {
    let mut all = views(&ROUGHNESSES);
    for roughness in ROUGHNESSES {
        let entry = dualight::materials::MATERIALS.last().expect("pbr");
        for transmission in [0.0, 0.6, 1.0] {
            let desc = MaterialDesc {
                roughness,
                transmission,
                volume: true,
                metallic: 0.2,
                base_color: Rgb::ZERO,
                ..Default::default()
            };
            let coat = Specimen {
                name: format!("coat alone, transmission {transmission}, roughness {roughness}"),
                material: (entry.build)(&desc).expect("valid"),
                desc,
                both_sides: true,
            };
            all.push((
                coat,
                COSINES.into_iter().chain(COSINES.map(|c| -c)).collect(),
            ));
        }
    }
    let mut worst = (0.0, String::new());
    for (s, cosines) in all {
        for cos in cosines {
            for c in albedo(&s, direction(cos, 1.0), TransportMode::Importance, 500) {
                let least = c.mean() - 4.0 * c.sigma();
                if least > worst.0 {
                    worst = (least, format!("{} at {cos}: {}", s.name, c.mean()));
                }
            }
        }
    }
    println!("largest albedo less four sigma: {worst:?}");
    // Layers are scaled by tabulated albedos, good to about 2e-3.
    assert!(worst.0 <= 1.0 + 4e-3, "{worst:?}");
}

#[test]
fn white_plastic_returns_all_light() {
    // What the layer does not reflect the white base does, at every angle: E + (1 − E).
    let entry = dualight::materials::MATERIALS.last().expect("pbr");
    for roughness in [0.0, 0.05, 0.3, 0.6, 1.0] {
        for diffuse_transmission in [0.0, 0.5] {
            let desc = MaterialDesc {
                metallic: 0.0,
                roughness,
                diffuse_transmission,
                ..Default::default()
            };
            let s = Specimen {
                name: "white plastic".into(),
                material: (entry.build)(&desc).expect("valid"),
                desc,
                both_sides: false,
            };
            for cos in [1.0, 0.8, 0.5, 0.2, 0.05, 0.01] {
                let [a, ..] = albedo(&s, direction(cos, 0.4), TransportMode::Importance, 4000);
                let what = format!("white plastic of roughness {roughness} at {cos}");
                // The table of albedos is good to about this.
                a.assert_mean_with_bias(&what, 1.0, 0.01, 4e-3);
            }
        }
    }
}

#[test]
fn smooth_glass_divides_its_light_exactly() {
    for s in specimens(&[]).iter().filter(|s| s.both_sides) {
        for cos in COSINES.into_iter().chain(COSINES.map(|c| -c)) {
            let wo = direction(cos, 0.3);
            let bsdf = s.bsdf(wo, TransportMode::Importance);
            // The two outcomes, by u_lobe near its ends, have the same weight: their sum.
            for u in [0.0, 0.3, 0.7, 1.0 - 1e-16] {
                let x = bsdf.sample(u, [0.5; 2]).expect("a delta lobe");
                assert!((x.weight.r - 1.0).abs() < 1e-14, "{} {cos} {x:?}", s.name);
            }
            assert!((bsdf.albedo().r - 1.0).abs() < 1e-14);
            // As radiance, what is refracted is diluted by η².
            let camera = s.bsdf(wo, TransportMode::Radiance);
            for k in 0..100 {
                let x = camera
                    .sample(f64::from(k) / 100.0, [0.5; 2])
                    .expect("delta");
                let thin = s.name.contains("thin");
                let eta = if thin { 1.0 } else { eta(s, wo, x.wi) };
                assert!(
                    (x.weight.r * eta * eta - 1.0).abs() < 1e-12,
                    "{} {x:?}",
                    s.name
                );
            }
        }
    }
    // How often it reflects is what Fresnel says.
    let glass = specimens(&[]);
    let glass = glass.iter().find(|s| s.name == "dielectric smooth");
    let glass = glass.expect("in the list");
    for cos in [1.0, 0.5, 0.1] {
        let bsdf = glass.bsdf(direction(cos, 0.0), TransportMode::Importance);
        let r = fresnel::dielectric(cos, 1.5).reflectance;
        let reflected = Samples::over_seeds(16, |seed| {
            let mut rng = Rng::new(seed);
            let n = 40_000;
            let hits = (0..n).filter(|_| {
                let x = bsdf.sample(rng.next_1d(), rng.next_2d());
                x.is_some_and(|x| !x.transmitted)
            });
            hits.count() as f64 / f64::from(n)
        });
        reflected.assert_mean(&format!("reflected at cosine {cos}"), r, 0.01);
    }
}

#[test]
fn a_white_microfacet_surface_that_is_nearly_smooth_loses_nothing() {
    for roughness in [1e-3, 0.02, 0.05, 0.1] {
        let white = MaterialDesc {
            roughness,
            base_color: Rgb::ONE,
            ..Default::default()
        };
        let glass = MaterialDesc {
            metallic: 0.0,
            transmission: 1.0,
            volume: true,
            ..white.clone()
        };
        for (kind, desc, sides) in [("conductor", white, 1), ("dielectric", glass, 2)] {
            let entry = dualight::materials::MATERIALS
                .iter()
                .find(|m| m.name == kind);
            let s = Specimen {
                name: kind.into(),
                material: (entry.expect("known").build)(&desc).expect("valid"),
                desc,
                both_sides: false,
            };
            for cos in [1.0, 0.7, 0.3, -1.0, -0.9, -0.3] {
                if cos < 0.0 && sides == 1 {
                    continue;
                }
                let [a, ..] = albedo(&s, direction(cos, 0.0), TransportMode::Importance, 2000);
                // Shadowing and masking at this roughness cost about α² tan²θ / 2 on each way.
                let loss: f64 = roughness.powi(4) * (1.0 / (cos * cos) - 1.0) + 1e-3 * roughness;
                let what = format!("{kind} of roughness {roughness} at {cos}");
                a.assert_mean_with_bias(&what, 1.0, 0.01, 2.0 * loss + 1e-9);
            }
        }
    }
}

#[test]
fn values_are_finite_wherever_one_looks() {
    let mut rng = Rng::new(7);
    for (s, cosines) in views(&ROUGHNESSES) {
        for cos in cosines {
            let wo = direction(cos, 0.7);
            for mode in [TransportMode::Radiance, TransportMode::Importance] {
                let bsdf = s.bsdf(wo, mode);
                assert!(bsdf.albedo().is_finite(), "{} at {cos}", s.name);
                let mirror = DVec3::new(-wo.x, -wo.y, wo.z);
                let mut directions = vec![mirror, wo, -wo, -mirror, DVec3::Z, -DVec3::Z];
                directions.extend([1e-3, 1e-6, 1e-9, 0.0].map(|c| direction(c, 4.0)));
                directions.extend([-1e-3, -1e-6, -1e-9].map(|c| direction(c, 3.84)));
                directions.extend((0..50).map(|_| warp::sphere(rng.next_2d())));
                for wi in directions {
                    let worst = Cell::new(0.0f64);
                    let v = bsdf.eval(wi, |pdf| {
                        worst.set(worst.get() + if pdf >= 0.0 { pdf } else { f64::NAN });
                        1.0
                    });
                    let sum = v.diffuse + v.glossy;
                    let fine = sum.is_finite() && worst.get().is_finite();
                    let least = sum.r.min(sum.g).min(sum.b);
                    assert!(fine && least >= 0.0, "{} {wo} {wi} {v:?} {worst:?}", s.name);
                }
            }
        }
    }
    // Extremes of the random numbers.
    for (s, cosines) in views(&ROUGHNESSES) {
        for cos in cosines {
            let bsdf = s.material.bsdf(
                &Surface::bare(&point(direction(cos, TAU / 3.0))),
                TransportMode::Radiance,
            );
            for a in [0.0, 0.5, 1.0 - f64::EPSILON] {
                for b in [0.0, 0.5, 1.0 - f64::EPSILON] {
                    for c in [0.0, 0.5, 1.0 - f64::EPSILON] {
                        if let Some(x) = bsdf.sample(a, [b, c]) {
                            let fine = x.weight.is_finite() && x.pdf.is_finite();
                            assert!(fine && x.wi.is_finite(), "{} {cos} {x:?}", s.name);
                        }
                    }
                }
            }
        }
    }
}
