//! A thin film on what transmits: it reflects as on an opaque dielectric, what is left passes,
//! and without thickness it is not there.

mod common;

use common::points::{Specimen, direction};
use common::stats::Samples;
use dualight::color::Rgb;
use dualight::materials::{BsdfSample, MATERIALS, MaterialDesc, TransportMode};
use dualight::math::DVec3;
use dualight::sampling::Rng;

const COSINES: [f64; 6] = [1.0, 0.9, 0.6, 0.3, 0.1, 0.01];
const ROUGHNESSES: [f64; 3] = [0.1, 0.4, 1.0];

fn specimen(desc: MaterialDesc) -> Specimen {
    let pbr = MATERIALS.iter().find(|m| m.name == "pbr").expect("known");
    Specimen {
        name: "film".into(),
        material: (pbr.build)(&desc).expect("valid"),
        desc,
        both_sides: true,
    }
}

/// Clear glass of index 1.5 with a film of 400 nm, which is far from white.
fn filmed(roughness: f64) -> MaterialDesc {
    MaterialDesc {
        metallic: 0.0,
        roughness,
        transmission: 1.0,
        volume: true,
        iridescence: 1.0,
        base_color: Rgb::ONE,
        ..Default::default()
    }
}

/// The same film on a black body that lets nothing through.
fn opaque(glass: MaterialDesc) -> MaterialDesc {
    MaterialDesc {
        transmission: 0.0,
        volume: false,
        base_color: Rgb::ZERO,
        ..glass
    }
}

/// What a smooth surface does with light along `wo`: reflected, transmitted.
fn branches(s: &Specimen, wo: DVec3) -> [Vec<BsdfSample>; 2] {
    let mut bsdf = s.bsdf(wo, TransportMode::Importance);
    bsdf.keep_specular();
    let all = bsdf.branches().expect("deltas only");
    let (through, back) = all.into_iter().partition(|b| b.transmitted);
    [back, through]
}

fn sum(branches: &[BsdfSample]) -> Rgb {
    branches.iter().map(|b| b.weight).sum()
}

fn close(a: Rgb, b: Rgb, within: f64) -> bool {
    (a - b).map(f64::abs).max_channel() <= within
}

#[test]
fn smooth_glass_reflects_as_the_film_on_an_opaque_body_and_passes_the_rest() {
    for (specular, color) in [(1.0, Rgb::ONE), (0.6, Rgb::new(1.0, 0.7, 0.4))] {
        let glass = MaterialDesc {
            specular,
            specular_color: color,
            ..filmed(0.0)
        };
        let body = specimen(opaque(glass.clone()));
        let pane = specimen(MaterialDesc {
            volume: false,
            ..glass.clone()
        });
        let glass = specimen(glass);
        for cos in COSINES {
            let wo = direction(cos, 0.4);
            let want = sum(&branches(&body, wo)[0]);
            let [back, through] = branches(&glass, wo).map(|b| sum(&b));
            // The film is kept in single precision.
            assert!(close(back, want, 1e-5), "{cos}: {back:?} {want:?}");
            assert!(close(back + through, Rgb::ONE, 1e-12), "{cos}");
            // Two faces with all reflections between them: 2R/(1 + R).
            let [back, through] = branches(&pane, wo).map(|b| sum(&b));
            let want = want.map(|r| 2.0 * r / (1.0 + r));
            assert!(close(back, want, 1e-5), "pane, {cos}: {back:?} {want:?}");
            assert!(close(back + through, Rgb::ONE, 1e-12), "pane, {cos}");
        }
    }
    // The film has a colour, or none of this says anything.
    let [back, _] = branches(&specimen(filmed(0.0)), DVec3::Z);
    assert!(!close(back[0].weight, Rgb::splat(back[0].weight.g), 0.01));
}

#[test]
fn light_takes_the_same_share_through_the_film_both_ways() {
    let glass = specimen(filmed(0.0));
    for cos in COSINES {
        let [back, through] = branches(&glass, direction(cos, 0.4));
        let [inside, out] = branches(&glass, through[0].wi);
        assert!(close(through[0].weight, out[0].weight, 1e-9), "{cos}");
        assert!(close(back[0].weight, inside[0].weight, 1e-9), "{cos}");
    }
    // Beyond the critical angle nothing passes, film or not.
    let [inside, out] = branches(&glass, direction(-0.5, 0.0));
    assert_eq!(sum(&inside), Rgb::ONE);
    assert!(out.is_empty());
}

#[test]
fn rough_glass_reflects_as_the_film_on_an_opaque_body() {
    let mut rng = Rng::new(4);
    for roughness in ROUGHNESSES {
        let glass = specimen(filmed(roughness));
        let body = specimen(opaque(filmed(roughness)));
        for _ in 0..500 {
            let [a, b, c, d] = std::array::from_fn(|_| rng.next_1d());
            let (wo, wi) = (direction(a, 6.0 * b), direction(c, 6.0 * d));
            let [got, want] = [&glass, &body].map(|s| {
                s.bsdf(wo, TransportMode::Importance)
                    .eval(wi, |_| 1.0)
                    .glossy
            });
            assert!(close(got, want, 1e-5 * (1.0 + want.max_channel())));
        }
    }
}

#[test]
fn rough_filmed_glass_loses_nothing_but_what_masking_takes() {
    // Seen from above, white glass of small roughness passes or reflects everything.
    for volume in [true, false] {
        let s = specimen(MaterialDesc {
            volume,
            ..filmed(0.05)
        });
        for cos in [1.0, 0.7, -1.0, -0.9] {
            let bsdf = s.bsdf(direction(cos, 0.0), TransportMode::Importance);
            for channel in [|c: Rgb| c.r, |c: Rgb| c.g, |c: Rgb| c.b] {
                let whole = Samples::over_seeds(16, |seed| {
                    let mut rng = Rng::new(seed);
                    let draw = |_| bsdf.sample(rng.next_1d(), rng.next_2d());
                    let sum: f64 = (0..2000).filter_map(draw).map(|x| channel(x.weight)).sum();
                    sum / 2000.0
                });
                whole.assert_mean_with_bias(&format!("{cos}, {volume}"), 1.0, 0.01, 1e-4);
            }
        }
    }
}

#[test]
fn a_film_without_thickness_is_plain_glass() {
    let mut rng = Rng::new(5);
    for roughness in [0.0, 0.1, 0.4] {
        for volume in [true, false] {
            let none = MaterialDesc {
                volume,
                iridescence_thickness: [0.0; 2],
                ..filmed(roughness)
            };
            let plain = MaterialDesc {
                iridescence: 0.0,
                ..none.clone()
            };
            let [none, plain] = [none, plain].map(specimen);
            for _ in 0..200 {
                let [a, b, c, d] = std::array::from_fn(|_| rng.next_1d());
                let (wo, wi) = (direction(2.0 * a - 1.0, 6.0 * b), direction(c, 6.0 * d));
                let [x, y] = [&none, &plain].map(|s| {
                    let bsdf = s.bsdf(wo, TransportMode::Radiance);
                    let v = bsdf.eval(wi, |_| 1.0).glossy;
                    (v, bsdf.sample(a, [b, c]).map(|x| (x.wi, x.weight)))
                });
                assert_eq!(x, y);
            }
        }
    }
}
