//! Lights that are seen and hit by nothing: panels, and points and spots with a radius; and lenses.
//!
//! What one samples, what a ray sees that passes through, and what photons carry must be the same
//! light. Statistical statements hold at 4 standard deviations over their seeds, or name a bias.

mod common;

use std::f64::consts::PI;

use common::render::{GATHER, MODES, Size, mean, render, rendering, settings};
use common::stats::Samples;
use common::{add_quad, camera, lambert, look_at, mirror, round_lens};
use dualight::color::Rgb;
use dualight::lights::{LIGHTS, Light, LightDesc, SpotCurve};
use dualight::math::DVec3;
use dualight::sampling::{Rng, warp};
use dualight::scene::{Scene, SceneBuilder};

fn build(desc: &LightDesc) -> Box<dyn Light> {
    let entry = LIGHTS.iter().find(|l| l.name == desc.kind).unwrap();
    (entry.build)(desc).unwrap()
}

fn panel(round: bool) -> LightDesc {
    LightDesc {
        kind: "panel",
        name: "panel".into(),
        position: DVec3::Y * 2.0,
        direction: DVec3::NEG_Y,
        strength: Rgb::splat(5.0),
        edges: [DVec3::X * 1.2, DVec3::Z * 0.7],
        round,
        ..Default::default()
    }
}

fn ball(kind: &'static str, radius: f64) -> LightDesc {
    LightDesc {
        kind,
        name: "ball".into(),
        position: DVec3::Y * 2.0,
        direction: DVec3::NEG_Y,
        strength: Rgb::splat(2.0),
        radius,
        inner_cone: 0.3,
        outer_cone: 0.6,
        spot_curve: SpotCurve::Cycles,
        ..Default::default()
    }
}

fn zoo() -> Vec<(&'static str, LightDesc)> {
    vec![
        ("rectangle", panel(false)),
        ("ellipse", panel(true)),
        (
            "parallelogram",
            LightDesc {
                edges: [DVec3::X, DVec3::new(0.6, 0.2, 0.8)],
                ..panel(false)
            },
        ),
        ("ball", ball("point", 0.4)),
        ("spot", ball("spot", 0.4)),
        (
            "short ball",
            LightDesc {
                range: 2.5,
                ..ball("point", 0.3)
            },
        ),
    ]
}

#[test]
fn what_is_sampled_is_what_a_ray_sees() {
    for (name, desc) in zoo() {
        let light = build(&desc);
        assert!(light.is_bodiless());
        let mut rng = Rng::new(7);
        for p in [
            DVec3::new(0.1, 0.0, 0.2),
            DVec3::new(0.9, 1.0, -0.5),
            DVec3::new(-0.4, 1.4, 0.1),
        ] {
            let n = 200_000;
            let (mut sampled, mut seen, mut found) = (0.0, 0.0, 0);
            for _ in 0..n {
                let u = rng.next_2d();
                if let Some(li) = light.sample_li(p, u) {
                    found += 1;
                    sampled += li.radiance.g / li.pdf / f64::from(n);
                    let target = li.target.unwrap();
                    assert!((target - p).normalize().dot(li.wi) > 1.0 - 1e-9);
                    // At its very rim rounding may decide otherwise.
                    if let Some(c) = light.crossed(p, li.wi, 1e9) {
                        assert!((c.pdf / li.pdf - 1.0).abs() < 1e-6, "{name}");
                        assert!((c.radiance.g - li.radiance.g).abs() < 1e-6 * li.radiance.g);
                        let near = (target - p).length();
                        assert!(light.crossed(p, li.wi, near * 0.999).is_none(), "{name}");
                        assert!(light.crossed(target + li.wi * 1e-3, li.wi, 1e9).is_none());
                    }
                }
                let d = warp::sphere(rng.next_2d());
                if let Some(c) = light.crossed(p, d, 1e9) {
                    seen += c.radiance.g * 4.0 * PI / f64::from(n);
                }
            }
            // Uniform directions meet it now and then only.
            let granted = 4.0 / (f64::from(n) * 0.01).sqrt();
            assert!(
                found == 0 || (seen / sampled - 1.0).abs() < granted,
                "{name} at {p}: {seen} {sampled}"
            );
        }
    }
}

#[test]
fn a_panel_is_dark_from_behind_and_a_ball_from_within() {
    let mut rng = Rng::new(1);
    for _ in 0..1000 {
        let (u, d) = (rng.next_2d(), warp::sphere(rng.next_2d()));
        let behind = DVec3::new(0.1, 2.5, 0.1);
        assert!(build(&panel(true)).sample_li(behind, u).is_none());
        assert!(build(&panel(true)).crossed(behind, d, 1e9).is_none());
        let within = DVec3::new(0.1, 2.1, 0.1);
        assert!(build(&ball("point", 0.5)).sample_li(within, u).is_none());
        assert!(build(&ball("point", 0.5)).crossed(within, d, 1e9).is_none());
    }
}

const SIZE: Size = Size {
    pixels: 12,
    spp: 64,
    photons: 50_000,
};

/// The middle of a wide floor, seen from above through the back of the light.
fn floor(light: LightDesc) -> Scene {
    let mut b = SceneBuilder::default();
    let m = b.add_material(&lambert("floor", Rgb::splat(0.5))).unwrap();
    let p = DVec3::new(-20.0, 0.0, -20.0);
    add_quad(&mut b, "floor", m, p, DVec3::Z * 40.0, DVec3::X * 40.0);
    b.add_light(LightDesc {
        seen_by_camera: false,
        ..light
    });
    let eye = DVec3::new(0.0, 9.0, 1e-3);
    b.add_camera(look_at("perspective", eye, DVec3::ZERO, 0.002));
    b.finish().unwrap()
}

#[test]
fn the_floor_below_is_as_bright_as_the_closed_forms_say() {
    let rectangle = {
        // Centre of a rectangle from below: four corners of half its size (Howell, B-3).
        let (a, b) = (0.6f64 / 2.0, 0.35f64 / 2.0);
        let (sa, sb) = (a.hypot(1.0), b.hypot(1.0));
        4.0 / (2.0 * PI) * (a / sa * (b / sa).atan() + b / sb * (a / sb).atan())
    };
    let r: f64 = 0.4;
    for (name, light, irradiance) in [
        ("rectangle", panel(false), 5.0 * PI * rectangle),
        // A ball is as bright as a point of its power where all of it is above the horizon.
        ("ball", ball("point", r), 2.0 / 4.0),
        (
            "disc",
            LightDesc {
                edges: [DVec3::X, DVec3::Z],
                ..panel(true)
            },
            5.0 * PI * 0.25 / 4.25,
        ),
    ] {
        let scene = floor(light);
        for mode in MODES {
            let size = Size {
                photons: 1000,
                ..SIZE
            };
            let got = Samples::over_seeds(4, |s| mean(&render(&scene, mode, size, s), "direct"));
            // The image is 2 cm wide, over which the light falls off by some 1e-5.
            let what = format!("{name}, {}", mode.name);
            got.assert_mean_with_bias(&what, 0.5 * irradiance / PI, 0.01, 1e-4);
        }
    }
}

#[test]
fn the_camera_sees_a_light_as_told_and_mirrors_always_do() {
    let scene = |seen: bool, through_mirror: bool| {
        let mut b = SceneBuilder::default();
        let m = b.add_material(&mirror()).unwrap();
        let p = DVec3::new(-20.0, 0.0, -20.0);
        add_quad(&mut b, "mirror", m, p, DVec3::Z * 40.0, DVec3::X * 40.0);
        b.add_light(LightDesc {
            edges: [DVec3::X * 9.0, DVec3::Z * 9.0],
            seen_by_camera: seen,
            ..panel(false)
        });
        let target = if through_mirror {
            DVec3::ZERO
        } else {
            DVec3::Y * 3.0
        };
        b.add_camera(look_at(
            "perspective",
            DVec3::new(0.3, 1.0, 0.2),
            target,
            0.2,
        ));
        b.finish().unwrap()
    };
    for mode in MODES {
        for (seen, reflected, want) in [
            (true, false, 5.0),
            (false, false, 0.0),
            (true, true, 5.0),
            (false, true, 5.0),
        ] {
            let got = mean(&render(&scene(seen, reflected), mode, SIZE, 1), "");
            assert!(
                (got - want).abs() < 1e-3 * want.max(1.0),
                "{} seen {seen} reflected {reflected}: {got}",
                mode.name
            );
        }
    }
}

#[test]
fn light_of_panels_and_balls_goes_round_a_room_alike_in_both_integrators() {
    for (name, light) in [
        ("panel", panel(false)),
        ("ball", ball("point", 0.4)),
        ("spot", ball("spot", 0.2)),
    ] {
        let mut b = SceneBuilder::default();
        let m = b.add_material(&lambert("wall", Rgb::splat(0.6))).unwrap();
        common::add_room(&mut b, m, 1.5);
        b.add_light(LightDesc {
            position: DVec3::Y * 0.7,
            ..light
        });
        b.add_camera(camera(DVec3::Z * 1.2, 80.0));
        let scene = b.finish().unwrap();
        let reference = Samples::over_seeds(4, |s| {
            let mut s = settings(common::render::PATH, Size { spp: 256, ..SIZE }, s);
            s.integrator_settings.roulette = true;
            mean(&rendering(&scene, &s).film.develop(), "")
        });
        let got = Samples::over_seeds(4, |s| mean(&render(&scene, GATHER, SIZE, s), ""));
        // Density estimates lose some light at the room's edges.
        got.assert_mean_with_bias(name, reference.mean(), 0.02, 0.02);
    }
}

#[test]
fn a_lens_blurs_what_is_out_of_focus_and_nothing_else() {
    // A white card edge-on to a black void, in and out of focus.
    let scene = |focus: f64| {
        let mut b = SceneBuilder::default();
        let m = b.add_material(&common::lamp(Rgb::ONE)).unwrap();
        let p = DVec3::new(0.0, -5.0, 0.0);
        add_quad(&mut b, "card", m, p, DVec3::X * 5.0, DVec3::Y * 10.0);
        let mut c = camera(DVec3::Z * 4.0, 20.0);
        c.lens = Some(round_lens(0.2, focus));
        b.add_camera(c);
        b.finish().unwrap()
    };
    let grey = |focus: f64| {
        let image = render(&scene(focus), MODES[0], Size { pixels: 32, ..SIZE }, 1);
        let pixels = image.rgb("").unwrap();
        let grey = |p: &&[f32; 3]| p[0] > 0.02 && p[0] < 0.98;
        (pixels.iter().filter(grey).count(), mean(&image, ""))
    };
    let (sharp, bright) = grey(4.0);
    let (soft, also) = grey(2.0);
    assert!(sharp <= 32 && soft > 8 * sharp.max(16), "{sharp} {soft}");
    // Blur moves light about, and by symmetry none is lost here.
    assert!((bright - 0.5).abs() < 0.01 && (also - 0.5).abs() < 0.01);
}

#[test]
fn lights_and_lenses_that_are_none_are_refused_in_words() {
    let kind = |name: &str| LIGHTS.iter().find(|l| l.name == name).unwrap();
    for desc in [
        LightDesc {
            edges: [DVec3::X, DVec3::X],
            ..panel(false)
        },
        LightDesc {
            edges: [DVec3::ZERO; 2],
            ..panel(true)
        },
        LightDesc {
            edges: [DVec3::X * 1e-300, DVec3::Y * 1e-300],
            ..panel(true)
        },
        ball("point", 1e-200),
        ball("point", f64::INFINITY),
    ] {
        let text = (kind(desc.kind).build)(&desc).err().unwrap();
        assert!(!text.is_empty());
    }
}
