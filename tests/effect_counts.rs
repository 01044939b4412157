//! What is counted for an effect is exactly 0 where it is off, and above 0 where it is on and has
//! something to do; counts do not depend on threads.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::collections::BTreeMap;

use common::render::{DIRECT_MAP, GATHER, HYBRID, PATH, Size, rendering, settings};
use common::show::{Show, scene};
use dualight::effects::{Acts, EFFECTS, omissions};
use dualight::pipeline::Rendering;
use dualight::plugins::Registry;
use dualight::scene::Omit;

const SIZE: Size = Size {
    pixels: 24,
    spp: 4,
    photons: 2000,
};

/// All counts by effect.
fn counts(done: &Rendering) -> BTreeMap<&'static str, (bool, BTreeMap<&'static str, u64>)> {
    let of = |d: &dualight::effects::Decision| {
        let cost = d.cost.clone().expect("a finished rendering has counted");
        (d.name, (d.on, cost.counts))
    };
    done.effects.iter().map(of).collect()
}

fn insist_on_nothing(done: &Rendering, what: &str) {
    for (name, (on, counts)) in counts(done) {
        let sum: u64 = counts.values().sum();
        assert!(on || sum == 0, "{what}: {name} is off, but {counts:?}");
    }
}

/// Scenes each of which has one thing more than a plain room.
#[test]
fn what_is_skipped_counts_nothing_and_what_is_there_counts() {
    for show in Show::ALL {
        for mode in [PATH, GATHER, DIRECT_MAP, HYBRID] {
            let what = format!("{show:?} by {}", mode.name);
            let done = rendering(
                &scene(*show, 1.0, Omit::default()),
                &settings(mode, SIZE, 1),
            );
            insist_on_nothing(&done, &what);
            let counts = counts(&done);
            for name in show.calls_for() {
                let (on, own) = &counts[name];
                assert!(*on, "{what}: {name} is skipped");
                assert!(own.values().any(|n| *n > 0), "{what}: {name} {own:?}");
            }
        }
    }
}

/// What the user switches off counts nothing either.
#[test]
fn what_is_switched_off_counts_nothing() {
    let table = Registry::builtin().effects;
    let of = |wish: &str, mode| {
        let omit = omissions(wish, &table).unwrap();
        let mut s = settings(mode, SIZE, 1);
        s.effects = wish.into();
        rendering(&scene(Show::Everything, 1.0, omit), &s)
    };
    for e in EFFECTS {
        if matches!(e.acts, Acts::Always) {
            continue;
        }
        for mode in [PATH, GATHER, DIRECT_MAP, HYBRID] {
            let wish = format!("-{}", e.name);
            let done = of(&wish, mode);
            let (on, counts) = &counts(&done)[e.name];
            assert!(
                !on && counts.values().all(|n| *n == 0),
                "{wish}: {counts:?}"
            );
            insist_on_nothing(&done, &wish);
        }
    }
}

#[test]
fn counts_are_the_same_on_any_number_of_threads() {
    for mode in [PATH, GATHER] {
        let [one, three] = [1, 3].map(|threads| {
            let mut s = settings(mode, SIZE, 1);
            s.threads = Some(threads);
            counts(&rendering(
                &scene(Show::Everything, 1.0, Omit::default()),
                &s,
            ))
        });
        assert_eq!(one, three, "{}", mode.name);
    }
}

/// The rays of all parts are those that were counted by kind, save what is no effect.
#[test]
fn the_rays_of_effects_are_all_rays_but_those_of_the_camera() {
    for mode in [PATH, GATHER, DIRECT_MAP, HYBRID] {
        let done = rendering(
            &scene(Show::Everything, 1.0, Omit::default()),
            &settings(mode, SIZE, 1),
        );
        let by_effect: u64 = counts(&done).values().map(|(_, c)| c["rays"]).sum();
        let r = done.statistics.rays;
        assert_eq!(
            by_effect,
            r.shadow + r.bounce + r.gather + r.photon,
            "{}",
            mode.name
        );
    }
}
