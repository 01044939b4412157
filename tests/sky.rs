//! Light from infinity: environments and suns, against closed forms, in every way to compute it.
//!
//! Statistical statements hold at 4 standard deviations over their seeds, or name their bias.

mod common;

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use common::render::{MODES, Size, mean, render, rendering, settings};
use common::stats::Samples;
use common::{add_quad, add_sphere, camera, glass, lambert, look_at};
use dualight::color::Rgb;
use dualight::geometry::{MaterialId, ObjectId, SurfacePoint};
use dualight::lights::{LIGHTS, Light, LightDesc, SkyImage, SpotCurve};
use dualight::math::{BoundingSphere, DQuat, DVec3};
use dualight::sampling::{Rng, warp};
use dualight::scene::{Scene, SceneBuilder};

fn build(desc: &LightDesc) -> Box<dyn Light> {
    let entry = LIGHTS.iter().find(|l| l.name == desc.kind).unwrap();
    (entry.build)(desc).unwrap()
}

fn environment(sky: Option<SkyImage>, strength: f64) -> LightDesc {
    LightDesc {
        kind: "environment",
        name: "sky".into(),
        strength: Rgb::splat(strength),
        sky: sky.map(Arc::new),
        scene: BoundingSphere {
            center: DVec3::ZERO,
            radius: 2.0,
        },
        ..Default::default()
    }
}

/// A dim sky with a gradient and one bright texel.
fn sky(width: u32, height: u32) -> SkyImage {
    let mut texels: Vec<[f32; 3]> = (0..width * height)
        .map(|i| {
            let (x, y) = ((i % width) as f32, (i / width) as f32);
            [0.1 + y / height as f32, 0.2, 0.1 + 0.5 * x / width as f32]
        })
        .collect();
    texels[(width * (height / 3) + width / 5) as usize] = [500.0, 400.0, 300.0];
    SkyImage::new(width, height, texels).unwrap()
}

/// A ball in the middle of a sky of radiance 1.
fn ball(albedo: f64) -> Scene {
    let mut b = SceneBuilder::default();
    let m = b
        .add_material(&lambert("ball", Rgb::splat(albedo)))
        .unwrap();
    add_sphere(&mut b, "ball", m, DVec3::ZERO, 1.0);
    b.add_light(environment(None, 1.0));
    b.add_camera(camera(DVec3::Z * 4.0, 12.0));
    b.finish().unwrap()
}

const SIZE: Size = Size {
    pixels: 16,
    spp: 32,
    photons: 100_000,
};

#[test]
fn a_convex_body_under_an_even_sky_shows_its_albedo() {
    // Radiance ρ everywhere: the irradiance is π wherever one looks.
    for albedo in [0.5, 1.0] {
        let scene = ball(albedo);
        for mode in MODES {
            let got = Samples::over_seeds(4, |s| mean(&render(&scene, mode, SIZE, s), ""));
            got.assert_mean(mode.name, albedo, 0.01);
        }
    }
}

#[test]
fn the_sky_is_seen_unless_it_is_hidden() {
    let mut b = SceneBuilder::default();
    let m = b.add_material(&lambert("far", Rgb::ZERO)).unwrap();
    add_sphere(&mut b, "far", m, DVec3::Z * 50.0, 1.0);
    b.add_light(environment(None, 0.75));
    b.add_camera(camera(DVec3::ZERO, 40.0));
    let scene = b.finish().unwrap();
    for mode in MODES {
        let mut s = settings(mode, SIZE, 0);
        let seen = rendering(&scene, &s).film.develop();
        assert!((mean(&seen, "") - 0.75).abs() < 1e-6, "{}", mode.name);
        s.integrator_settings.background = false;
        let hidden = rendering(&scene, &s).film.develop();
        assert_eq!(mean(&hidden, ""), 0.0, "{}", mode.name);
    }
}

#[test]
fn a_furnace_of_glass_and_stone_is_invisible() {
    // White bodies that absorb nothing, under an even sky: radiance 1 in every pixel, whatever
    // stands there; caustics and glow included.
    let mut b = SceneBuilder::default();
    let clear = b.add_material(&glass(1.5)).unwrap();
    let stone = b.add_material(&lambert("stone", Rgb::ONE)).unwrap();
    add_sphere(&mut b, "glass", clear, DVec3::X * -0.8, 0.7);
    add_sphere(&mut b, "stone", stone, DVec3::X * 0.8, 0.7);
    b.add_light(environment(None, 1.0));
    b.add_camera(camera(DVec3::Z * 5.0, 40.0));
    let scene = b.finish().unwrap();
    for mode in MODES {
        let got = Samples::over_seeds(4, |s| mean(&render(&scene, mode, SIZE, s), ""));
        // Density estimates are a few per mille off where a kernel leaves the curved surface.
        let bias = if mode.integrator == "path" { 0.0 } else { 0.01 };
        got.assert_mean_with_bias(mode.name, 1.0, 0.01, bias);
    }
}

#[test]
fn directions_to_the_sky_follow_their_density() {
    for (w, h) in [(1, 1), (8, 4), (64, 32), (1030, 515)] {
        let light = build(&LightDesc {
            rotation: DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7),
            ..environment(Some(sky(w, h.max(2))), 1.0)
        });
        // Sampled densities are those that `pdf_escaped` tells, which integrate to one.
        let mut rng = Rng::new(3);
        let n = 200_000;
        let (mut sum, mut fluence) = (0.0, Rgb::ZERO);
        for _ in 0..n {
            let d = warp::sphere(rng.next_2d());
            sum += light.pdf_escaped(d) * 4.0 * PI / f64::from(n);
            let li = light.sample_li(DVec3::ZERO, rng.next_2d()).unwrap();
            let told = light.pdf_escaped(li.wi);
            assert!((told / li.pdf - 1.0).abs() < 1e-6, "{w}: {told} {}", li.pdf);
            fluence += li.radiance / (li.pdf * f64::from(n));
        }
        // The bright texel is a small part of the sphere: uniform directions rarely find it.
        let granted = if w > 64 { 0.2 } else { 0.05 };
        assert!((sum - 1.0).abs() < granted, "{w} x {h}: {sum}");
        let want = light.power().luminance() / (PI * 4.0);
        let got = fluence.luminance();
        // Power is told by texels; blends between a few large ones shift it.
        let granted = if w <= 8 { 0.04 } else { 0.01 };
        assert!(
            (got / want - 1.0).abs() < granted,
            "{w} x {h}: {got} {want}"
        );
    }
}

#[test]
fn photons_from_the_sky_carry_its_flux() {
    for desc in [
        environment(None, 2.0),
        environment(Some(sky(64, 32)), 1.0),
        LightDesc {
            kind: "directional",
            angular_radius: 0.3,
            ..environment(None, 3.0)
        },
    ] {
        let light = build(&desc);
        let mut rng = Rng::new(1);
        let n = 100_000;
        let mut sum = Rgb::ZERO;
        for _ in 0..n {
            let d = light.sample_distant(rng.next_2d()).unwrap();
            sum += d.irradiance * (PI * 4.0 / f64::from(n));
        }
        let (got, want) = (sum.luminance(), light.power().luminance());
        assert!(
            (got / want - 1.0).abs() < 0.02,
            "{}: {got} W of {want}",
            desc.kind
        );
    }
}

/// A floor under a sun of some width, at an angle.
fn sunlit(angular_radius: f64) -> Scene {
    let mut b = SceneBuilder::default();
    let m = b.add_material(&lambert("floor", Rgb::splat(0.5))).unwrap();
    let p = DVec3::new(-5.0, 0.0, -5.0);
    add_quad(&mut b, "floor", m, p, DVec3::Z * 10.0, DVec3::X * 10.0);
    b.add_light(LightDesc {
        kind: "directional",
        name: "sun".into(),
        direction: DVec3::new(0.6, -0.8, 0.0),
        strength: Rgb::splat(3.0),
        angular_radius,
        ..Default::default()
    });
    b.add_camera(look_at(
        "perspective",
        DVec3::new(0.0, 6.0, 1.0),
        DVec3::ZERO,
        0.4,
    ));
    b.finish().unwrap()
}

#[test]
fn a_sun_sheds_the_same_light_whatever_its_size() {
    // E = 3·0.8, L = ρ E / π; exact for a disc above the horizon by symmetry about its axis.
    for radius in [0.0, 1e-6, 0.005, 0.2] {
        let scene = sunlit(radius);
        for mode in MODES {
            let got = mean(&render(&scene, mode, SIZE, 1), "direct");
            let want = 0.5 * 2.4 / PI;
            assert!(
                (got / want - 1.0).abs() < 0.01,
                "{radius} {}: {got}",
                mode.name
            );
        }
    }
}

fn at(p: DVec3) -> SurfacePoint {
    SurfacePoint {
        p,
        ng: DVec3::Z,
        n: DVec3::Z,
        wo: DVec3::Z,
        front: true,
        distance: 1.0,
        barycentrics: [0.0; 2],
        offset: 0.0,
        prim: 0,
        object: ObjectId(0),
        material: MaterialId(0),
        light: None,
    }
}

#[test]
fn a_spot_from_blender_falls_as_cycles_has_it() {
    // Measured in Cycles: a cone of 60° with a blend of a half.
    let outer = 30f64.to_radians();
    let spot = build(&LightDesc {
        kind: "spot",
        direction: DVec3::NEG_Z,
        outer_cone: outer,
        inner_cone: 0.5 * outer,
        spot_curve: SpotCurve::Cycles,
        ..Default::default()
    });
    for (angle, want) in [
        (0.0f64, 1.0),
        (20.0, 1.0),
        (25.0, 0.650),
        (28.0, 0.160),
        (29.5, 0.013),
    ] {
        let (s, c) = angle.to_radians().sin_cos();
        let li = spot
            .sample_li(at(DVec3::new(s, 0.0, -c)).p, [0.5; 2])
            .unwrap();
        assert!(
            (li.radiance.r - want).abs() < 2e-3,
            "{angle}: {}",
            li.radiance.r
        );
    }
    // Its power is the integral of its intensity.
    let n = 100_000;
    let power: f64 = (0..n)
        .map(|i| {
            let theta = outer * (f64::from(i) + 0.5) / f64::from(n);
            let dir = DVec3::new(theta.sin(), 0.0, -theta.cos());
            let li = spot.sample_li(dir, [0.5; 2]);
            li.map_or(0.0, |l| l.radiance.r) * TAU * theta.sin() * outer / f64::from(n)
        })
        .sum();
    assert!((spot.power().r / power - 1.0).abs() < 1e-4, "{power}");
}

#[test]
fn a_light_with_a_range_ends_there_for_photons_too() {
    let scene = |range: f64| {
        let mut b = SceneBuilder::default();
        let m = b.add_material(&lambert("ball", Rgb::splat(0.6))).unwrap();
        add_sphere(&mut b, "room", m, DVec3::ZERO, 1.0);
        b.add_light(LightDesc {
            range,
            ..common::light("point", DVec3::ZERO, DVec3::NEG_Z, 1.0)
        });
        b.add_camera(camera(DVec3::Z * 0.5, 60.0));
        b.finish().unwrap()
    };
    let whole = scene(f64::INFINITY);
    for mode in MODES {
        let full = mean(&render(&whole, mode, SIZE, 2), "");
        for (range, left) in [(2.0, 1.0 - 1.0 / 16.0), (1.25, 1.0 - 0.4096), (0.9, 0.0)] {
            let got = mean(&render(&scene(range), mode, SIZE, 2), "");
            assert!(
                (got / full - left).abs() < 5e-3,
                "{} {range}: {got}",
                mode.name
            );
        }
    }
}
