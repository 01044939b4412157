use super::*;
use crate::color::Rgb;
use crate::film::{Component, PixelSample};
use crate::math::DVec3;
use crate::sampling::Rng;

const SIDE: u32 = 48;

/// Values of the indirect layer after interpolation, over an albedo that changes from pixel to
/// pixel. `light` gives the irradiance, to which noise of this deviation is added.
fn after(light: impl Fn(f64, f64) -> f64, noise: f64, edges: &[bool]) -> Vec<f64> {
    let mut film = Film::new(SIDE, SIDE);
    let mut rng = Rng::new(5);
    let albedo = |x: u32, y: u32| 0.3 + 0.1 * f64::from((x * 7 + y * 3) % 5);
    for y in 0..SIDE {
        for x in 0..SIDE {
            let halves = [0; 2].map(|_| {
                let mut s = PixelSample {
                    albedo: Rgb::splat(albedo(x, y)),
                    normal: DVec3::Z,
                    ..Default::default()
                };
                // Uniform noise of unit variance.
                let u = (rng.next_1d() - 0.5) * 12f64.sqrt();
                let e = light(f64::from(x), f64::from(y)) + noise * u;
                s.add(Component::Indirect, Rgb::splat(e * albedo(x, y)));
                s.add(Component::Direct, Rgb::splat(u));
                (s, 1)
            });
            film.add_halves([x, y], halves);
        }
    }
    let own = film.develop();
    film.interpolate(edges);
    let image = film.develop();
    let (all, indirect) = (image.rgb("").unwrap(), image.rgb("indirect").unwrap());
    // What is not indirect stays, and so does all of pixels with an edge and of those that no
    // window reached from.
    let direct = image.rgb("direct").unwrap();
    assert_eq!(own.rgb("direct").unwrap(), direct);
    let before = own.rgb("indirect").unwrap();
    for i in 0..all.len() {
        assert!((all[i][0] - direct[i][0] - indirect[i][0]).abs() < 1e-5);
        if edges[i] || film.reach().unwrap()[i] == 0.0 {
            assert_eq!(before[i], indirect[i]);
        }
    }
    // No surface gains or loses light.
    let surfaces = surfaces(SIDE as usize, edges);
    for surface in 1..=surfaces.iter().copied().max().unwrap() {
        let flux = |v: &[[f32; 3]]| -> f64 {
            let own = v.iter().zip(&surfaces).filter(|(_, s)| **s == surface);
            own.map(|(v, _)| f64::from(v[0])).sum()
        };
        let [a, b] = [&before, &indirect].map(|v| flux(v));
        assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
    }
    let value =
        |(i, v): (usize, [f32; 3])| f64::from(v[0]) / albedo(i as u32 % SIDE, i as u32 / SIDE);
    let pixels = indirect.into_iter();
    pixels.enumerate().map(value).collect()
}

/// Root mean square of the error.
fn error(got: &[f64], light: impl Fn(f64, f64) -> f64) -> f64 {
    let side = SIDE as usize;
    let square = |(i, v): (usize, &f64)| {
        let (x, y) = ((i % side) as f64, (i / side) as f64);
        (v - light(x, y)).powi(2)
    };
    (got.iter().enumerate().map(square).sum::<f64>() / got.len() as f64).sqrt()
}

const NONE: [bool; (SIDE * SIDE) as usize] = [false; (SIDE * SIDE) as usize];

#[test]
fn a_plane_is_kept_and_its_noise_is_not() {
    let plane = |x: f64, y: f64| 2.0 + 0.03 * x - 0.01 * y;
    assert!(error(&after(plane, 0.0, &NONE), plane) < 1e-6);
    // 25² pixels would leave a 25th of the noise, fewer at borders, where slopes cost more.
    let left = error(&after(plane, 0.2, &NONE), plane);
    assert!(left < 0.2 / 8.0, "{left}");
}

#[test]
fn what_bends_is_followed_as_far_as_noise_lets_see() {
    let wave = |x: f64, y: f64| 3.0 + (x * 0.3).sin() + (y * 0.2).cos();
    let of = |noise: f64| error(&after(wave, noise, &NONE), wave) / noise;
    let shares = [0.3, 0.1, 0.03, 0.01, 0.001].map(of);
    println!("errors in units of the pixels' own noise: {shares:?}");
    // Never more than the pixels' own noise, however little of it there is.
    assert!(shares.iter().all(|s| *s < 1.0), "{shares:?}");
    assert!(shares[0] < 0.35, "{shares:?}");
}

#[test]
fn a_step_that_no_edge_tells_of_stays_one() {
    let step = |x: f64, _: f64| if x < 23.5 { 1.0 } else { 3.0 };
    let got = after(step, 0.05, &NONE);
    let side = SIDE as usize;
    for (i, v) in got.iter().enumerate() {
        let want = step((i % side) as f64, 0.0);
        assert!((v - want).abs() < 0.25, "{v} at {}", i % side);
    }
}

#[test]
fn nothing_crosses_an_edge() {
    let mut edges = NONE.to_vec();
    for y in 0..SIDE as usize {
        edges[y * SIDE as usize + 20] = true;
    }
    // Noise in which the step would be lost.
    let step = |x: f64, _: f64| if x < 20.0 { 1.0 } else { 1.1 };
    let got = after(step, 0.3, &edges);
    let mean = |from: usize, to: usize| {
        let columns = |(i, v): (usize, &f64)| {
            let x = i % SIDE as usize;
            (from..to).contains(&x).then_some(*v)
        };
        let all: Vec<f64> = got.iter().enumerate().filter_map(columns).collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    // Each is a mean over 144 values and what lies behind them: 0.02 off is two deviations.
    let rise = mean(21, 24) - mean(17, 20);
    assert!((rise - 0.1).abs() < 0.06, "{rise}");
}

#[test]
fn surfaces_are_what_edges_divide() {
    let edges = [0, 1, 0, 0, 1, 0, 1, 1, 0].map(|e| e == 1);
    assert_eq!(surfaces(3, &edges), [1, 0, 2, 1, 0, 2, 0, 0, 2]);
}
