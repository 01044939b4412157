//! The catalogue of hard cases, row by row: every row runs on the paths it concerns against an
//! exact or closed-form reference and reports its worst case.
//!
//! `cargo test --test hardcases` checks the bounds; with `DUALIGHT_HARDCASES=full` it tries as many
//! cases as the catalogue asks for;
//! `cargo test --test hardcases -- --ignored write_the_table` writes `docs/hardcases.md`.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]
#![allow(unreachable_pub, reason = "shared by the files of this test alone")]

mod bounces;
mod boxes;
#[path = "../common/mod.rs"]
mod common;
mod deposits;
mod dual;
mod duals;
mod exact;
mod flushed;
mod fuzz;
mod kernels;
mod mirrored;
mod photons;
mod refraction;
mod report;
mod scenes;
mod slabs;
mod spawn;
mod spheres;
mod touching;
mod triangles;
mod watertight;

use report::rows;

rows! { "hardcases";
    s1: "head-on unit sphere" in spheres;
    s2: "start at the centre and inside" in spheres;
    s3: "start on the surface, outward" in spawn;
    s4: "start on the surface, inward" in spawn;
    s5: "exact tangent" in spheres;
    s6: "tangent and some last places off" in spheres;
    s7: "far sphere" in spheres;
    s8: "small and far" in spheres;
    s9: "beyond all limits" in spheres;
    s10: "huge ground sphere" in spheres;
    s11: "sphere at 1e6" in spheres;
    s12: "bad radii" in spheres;
    s13: "ellipsoid instance" in spheres;
    s14: "thin shell" in spheres;
    s15: "coincident spheres" in spheres;
    s16: "touching glass spheres" in touching;
    s17: "odd directions" in spheres;
    t1: "unit triangle" in triangles;
    t2: "watertight, random rays" in watertight;
    t3: "watertight, rays at vertices and edges" in watertight;
    t4: "fan of 200 triangles" in watertight;
    t5: "pbrt's bad case" in triangles;
    t6: "no area, bad vertices" in triangles;
    t7: "slivers" in triangles;
    t8: "tiny" in triangles;
    t9: "vanishing" in triangles;
    t10: "huge" in triangles;
    t11: "grazing" in triangles;
    t12: "ray in the plane" in triangles;
    t13: "spawned off a triangle" in spawn;
    t14: "neighbour hit" in spawn;
    t15: "coincident triangles" in triangles;
    t16: "thin slab" in slabs;
    t17: "node that mirrors" in mirrored;
    t20: "T-junction" in watertight;
    r1: "critical angle" in refraction;
    r2: "grazing Fresnel" in refraction;
    r3: "normal incidence, n = 1" in refraction;
    r4: "reciprocity" in refraction;
    r5: "long chain of total reflection" in refraction;
    r6: "edge of a glass cube" in refraction;
    d1: "gradients" in duals;
    d2: "the trap of b² − ac" in duals;
    d3: "tangency" in duals;
    d4: "ray through the centre" in duals;
    d5: "scaling" in duals;
    d6: "switch of the root" in duals;
    d9: "two refractions" in duals;
    d10: "denormal" in duals;
    b1: "axis-parallel, in a box's face" in boxes;
    b2: "flat and coincident boxes" in boxes;
    b3: "bad rays" in boxes;
    b4: "ends of the interval" in boxes;
    b5: "backends against each other" in boxes;
    b6: "instruction sets" in boxes;
    p1: "bookkeeping of flux" in photons;
    p3: "extremes of gathering" in photons;
    p4: "thin wall" in kernels;
    f1: "any triangle, any ray" in fuzz;
    f2: "any sphere, any ray" in fuzz;
}

/// An overflow would otherwise be a wrong count that looks right.
#[test]
fn numbers_that_overflow_stop_a_test() {
    let most = std::hint::black_box(u64::MAX);
    let sum = std::panic::catch_unwind(|| std::hint::black_box(most + std::hint::black_box(1)));
    assert!(sum.is_err(), "overflow checks are off");
}
