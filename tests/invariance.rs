//! A picture does not depend on the unit, the place, the handedness or the orientation of a
//! scene, nor on how its surfaces are cut into triangles and its places into nodes.
//!
//! Rows T17 to T19 of the hard cases, and more like them. Where numbers scale exactly (powers of two) or recentring
//! takes the shift back, pictures are the same but for rounding; elsewhere sampling differs, and
//! the mean of a layer must agree within four standard errors.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;
#[path = "hardcases/report.rs"]
mod report;

use common::changed::{Change, PLAIN, scene};
use common::render::{GATHER, HYBRID, Mode, PATH, Size, mean, rendering, settings};
use dualight::accel::ACCELERATORS;
use dualight::film::Image;
use dualight::math::{DAffine3, DQuat, DVec3};
use dualight::pipeline::Rendering;
use report::{Meter, Row, rows};

const SIZE: Size = Size {
    pixels: 16,
    spp: 8,
    photons: 8_000,
};

/// A way to compute pictures: integrator, emission of photons and backend.
#[derive(Clone, Copy, Debug)]
struct Way {
    mode: Mode,
    emission: &'static str,
    effects: &'static str,
    backend: &'static str,
}

impl Way {
    fn name(&self) -> String {
        format!("{}, {}", self.backend, self.mode.name)
    }

    fn render(&self, c: &Change, seed: u64) -> Rendering {
        let mut s = settings(self.mode, SIZE, seed);
        s.accelerator = Some(self.backend.into());
        s.emission = Some(self.emission.into());
        s.effects = self.effects.into();
        rendering(&scene(c), &s)
    }
}

/// Photons whose emission follows derivatives.
const ADAPTIVE: Mode = Mode {
    name: "photon with adaptive emission",
    ..GATHER
};

/// Every mode through both backends that render.
fn ways(modes: &[Mode]) -> Vec<Way> {
    let backends = ACCELERATORS.iter().filter(|a| a.name != "linear");
    backends
        .flat_map(|a| {
            modes.iter().map(|mode| Way {
                mode: *mode,
                emission: if mode.name == ADAPTIVE.name {
                    "adaptive"
                } else {
                    "uniform"
                },
                effects: "auto",
                backend: a.name,
            })
        })
        .collect()
}

/// Remembers what has been computed for a change: many are held against the same one.
struct Known<T>(Vec<(Change, T)>);

impl<T: Clone> Known<T> {
    fn get(&mut self, c: &Change, make: impl FnOnce() -> T) -> T {
        if let Some((_, known)) = self.0.iter().find(|(k, _)| k == c) {
            return known.clone();
        }
        let made = make();
        self.0.push((*c, made.clone()));
        made
    }
}

/// Mean relative squared difference of two pictures.
fn distance(a: &Image, b: &Image) -> f64 {
    let (a, b) = (a.rgb("").unwrap(), b.rgb("").unwrap());
    let sum: f64 = a
        .iter()
        .flatten()
        .zip(b.iter().flatten())
        .map(|(x, y)| f64::from(x - y).powi(2) / (f64::from(*y).powi(2) + 0.01))
        .sum();
    sum / (3 * a.len()) as f64
}

/// The same seeds, the same picture: `most` is the relative squared error. And as many photons.
fn same(row: &mut Row, ways: &[Way], changes: &[(Change, Change)], most: f64) {
    for way in ways {
        let [mut picture, mut stored] = [Meter::default(); 2];
        let mut known = Known(Vec::new());
        let mut seen = |c: &Change| {
            known.get(c, || {
                let r = way.render(c, 1);
                let s = &r.statistics;
                let counts = [&s.global_photons, &s.caustic_photons].map(|c| c.stored as f64);
                (r.film.develop(), counts)
            })
        };
        for (a, b) in changes {
            let (a, b) = (seen(a), seen(b));
            picture.see(distance(&a.0, &b.0));
            for (x, y) in a.1.into_iter().zip(b.1) {
                if y > 0.0 {
                    stored.see((x - y).abs() / y);
                }
            }
        }
        row.line(way.name(), "relative squared difference", picture, most);
        if stored.n > 0 {
            let what = "photons stored, relative difference";
            row.line(way.name(), what, stored, 1e-3);
        }
    }
}

/// The same seeds, the same pixels: `most` is the largest difference of any.
fn identical(row: &mut Row, ways: &[Way], changes: &[(Change, Change)], most: f64) {
    for way in ways {
        let mut m = Meter::default();
        for (a, b) in changes {
            let [a, b] = [a, b].map(|c| way.render(c, 1).film.develop());
            let (a, b) = (a.rgb("").unwrap(), b.rgb("").unwrap());
            for (x, y) in a.iter().flatten().zip(b.iter().flatten()) {
                m.see(f64::from(x - y).abs());
            }
        }
        row.line(way.name(), "difference of a pixel", m, most);
    }
}

/// Other samples, the same means: within four standard errors and 0.2 %.
fn alike(row: &mut Row, ways: &[Way], changes: &[(Change, Change)]) {
    for way in ways {
        let mut m = Meter::default();
        let mut known: Known<Vec<f64>> = Known(Vec::new());
        let mut means = |c: &Change| {
            known.get(c, || {
                let picture = |seed| way.render(c, seed).film.develop();
                (1..=6).map(|s| mean(&picture(s), "")).collect()
            })
        };
        for (a, b) in changes {
            let (x, y) = (means(a), means(b));
            let n = x.len() as f64;
            let of = |v: &[f64]| v.iter().sum::<f64>() / n;
            let variance =
                |v: &[f64]| v.iter().map(|m| (m - of(v)).powi(2)).sum::<f64>() / (n - 1.0);
            let error = ((variance(&x) + variance(&y)) / n).sqrt();
            let d = of(&x) - of(&y);
            m.see(d.abs() / (4.0 * error + 0.002 * of(&x)));
        }
        let what = "difference of means, of what is allowed";
        row.line(way.name(), what, m, 1.0);
    }
}

/// The box with analytic spheres, and the same all of triangles.
const SCENES: [Change; 2] = [
    PLAIN,
    Change {
        balls: true,
        ..PLAIN
    },
];

/// Both scenes, each with and without each of the maps.
fn mapped(maps: &[DAffine3]) -> Vec<(Change, Change)> {
    maps.iter()
        .flat_map(|&map| SCENES.map(|c| (c, Change { map, ..c })))
        .collect()
}

fn scale(s: f64) -> DAffine3 {
    DAffine3::from_scale(DVec3::splat(s))
}

mod pictures {
    use super::*;

    /// Every integrator, and photons of an emission that follows derivatives.
    const ALL: [Mode; 4] = [PATH, GATHER, HYBRID, ADAPTIVE];
    /// What is asked again for means where pictures are the same already.
    const TWO: [Mode; 2] = [PATH, GATHER];

    pub(crate) fn t18(row: &mut Row) {
        let exactly = [-13, 13].map(|k| scale(2f64.powi(k)));
        let nearly = [1e-4, 1e4].map(scale);
        row.tried("by 2⁻¹³ and 2¹³, both scenes; seed 1");
        same(row, &ways(&ALL), &mapped(&exactly), 1e-5);
        row.tried("by 1e-4 and 1e4, both scenes; seed 1");
        same(row, &ways(&ALL), &mapped(&nearly), 1e-5);
        row.tried("by 1e-4 and 1e4, both scenes; seeds 1 to 6");
        alike(row, &ways(&TWO), &mapped(&nearly));
    }

    pub(crate) fn t19(row: &mut Row) {
        // What nodes move keeps its digits: recentring takes the shift back, to the bit where it
        // is whole in the places that it rounds.
        let whole = |x: f64| DAffine3::from_translation(DVec3::splat(x));
        row.tried("by (x, x, x), x = 1e3, 1e5, 1e6, both scenes; seed 1");
        same(row, &ways(&ALL), &mapped(&[1e3, 1e5, 1e6].map(whole)), 1e-5);
        let moved = |x: f64| DAffine3::from_translation(DVec3::new(x, -x, 0.5 * x));
        let moved = mapped(&[1e3, 1e5, 1e6].map(moved));
        row.tried("by (x, −x, x/2), x = 1e3, 1e5, 1e6, both scenes; seed 1");
        same(row, &ways(&ALL), &moved, 1e-5);
        row.tried("by (x, −x, x/2), x = 1e3, 1e5, 1e6, both scenes; seeds 1 to 6");
        alike(row, &ways(&TWO), &moved);
        row.note(
            "by nodes; what the coordinates of vertices have lost before import cannot come back",
        );
    }

    pub(crate) fn t17(row: &mut Row) {
        let mirror = |x: f64, y: f64, z: f64| DAffine3::from_scale(DVec3::new(x, y, z));
        // Nodes within nodes, with a turn and a move in between.
        let turn = DAffine3::from_rotation_translation(
            DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7),
            DVec3::new(0.5, -1.0, 2.0),
        );
        let two = mirror(-1.0, 1.0, 1.0) * turn * mirror(1.0, -1.0, 1.0);
        let maps = [
            mirror(-1.0, 1.0, 1.0),
            mirror(-1.0, -1.0, -1.0),
            two,
            mirror(-1.0, -1.0, -1.0) * turn * two,
        ];
        row.tried(
            "(−1, 1, 1), (−1, −1, −1), two and three mirrors in one another with turns between, \
             both scenes; seeds 1 to 6",
        );
        alike(row, &ways(&ALL), &mapped(&maps));
        // What is seen by way of the mirror and the glass, and what the point lights: photon mapping
        // takes no random numbers for it but those that choose between reflection and refraction.
        let flips = [maps[0], maps[1], maps[0] * mirror(1.0, -1.0, 1.0)];
        let lit = |map, c: Change| Change {
            map,
            point: true,
            ..c
        };
        let changes: Vec<_> = flips
            .iter()
            .flat_map(|&map| SCENES.map(|c| (lit(DAffine3::IDENTITY, c), lit(map, c))))
            .collect();
        let sharp = ways(&[GATHER]).into_iter().map(|way| Way {
            effects: "-indirect,-caustics",
            ..way
        });
        row.tried(
            "(−1, 1, 1), (−1, −1, −1), two mirrors in one another; both scenes, lit by a point, \
             without indirect light; seed 1",
        );
        identical(row, &sharp.collect::<Vec<_>>(), &changes, 1e-5);
        row.note(
            "where directions are sampled, as paths do at every surface that scatters, sampling is not \
             mirrored with the scene, so that means are compared, not pixels: frames around a normal are right-handed on both sides of a mirror",
        );
    }

    pub(crate) fn turned(row: &mut Row) {
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        row.tried("both scenes; seeds 1 to 6");
        alike(row, &ways(&ALL), &mapped(&[DAffine3::from_quat(turn)]));
    }

    pub(crate) fn cut(row: &mut Row) {
        let cut = SCENES.map(|c| (c, Change { cuts: 3, ..c }));
        row.tried("both scenes; seeds 1 to 6");
        alike(row, &ways(&ALL), &cut);
    }

    pub(crate) fn baked(row: &mut Row) {
        let map = DAffine3::from_scale_rotation_translation(
            DVec3::splat(2.0),
            DQuat::from_axis_angle(DVec3::Y, 0.3),
            DVec3::new(3.0, 1.0, -2.0),
        );
        let nodes = SCENES.map(|c| Change { map, ..c });
        let baked = nodes.map(|c| (c, Change { baked: true, ..c }));
        row.tried("twice as large, turned by 0.3, moved by (3, 1, −2), both scenes; seed 1");
        same(row, &ways(&ALL), &baked, 1e-3);
    }
}

rows! { "invariance";
    t17: "mirrored, also within mirrors" in pictures;
    t18: "scaled" in pictures;
    t19: "moved" in pictures;
    turned: "turned by 0.7 about (1, 2, 3)" in pictures;
    cut: "each triangle cut into 9" in pictures;
    baked: "nodes' transforms in the vertices" in pictures;
}
