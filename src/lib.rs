//! Dualight: a photon-mapping renderer for glTF scenes.
//!
//! # The way of the data
//! ```text
//! asset.glb ──import──▶ Scene ──survey──▶ Effects (what this scene calls for, with reasons)
//!                         │
//!                         ├──▶ Accelerator: embree | bvh            rays in, hits out
//!                         ▼
//!    Emission ──▶ photon tracing ──▶ PhotonMaps {global, caustic, glow}
//!                                                            │
//!    Camera ──▶ integrator: photon | path ◀── radiance / irradiance estimates
//!                         ▼
//!                       Film: one layer per component, AOVs ──▶ EXR, PNG, statistics
//! ```
//! A later stage reads an earlier one's result and never changes it.
//!
//! # Conventions
//! - **Directions** `wo` and `wi` are unit vectors that point away from the surface: `wo` to
//!   where the path came from, `wi` to where it goes. A stored photon keeps `wi`.
//! - **Normals**: `ng` geometric, out of the front; `n` shading, in the hemisphere of `ng`.
//! - **Spaces**: world space unless a name says otherwise (`world_from_object`); local frames
//!   have the shading normal as `z`. A scene far from the
//!   origin is moved to it ([`scene::Scene::center`]).
//! - **Units**: metres, watts, W/sr, W/m², W/(m²·sr), per linear Rec.709 channel; radians.
//! - **Densities**: `pdf` is in solid angle unless its name says `pdf_area`.
//! - **Random numbers** are a pure function of (seed, stream, key, index).
#![deny(unsafe_code)]
#![warn(clippy::unwrap_used)]
#![cfg_attr(
    test,
    allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")
)]

pub mod accel;
pub mod ad;
pub mod cameras;
pub mod cli;
pub mod color;
pub mod control;
pub mod effects;
pub mod error;
#[cfg(feature = "embree")]
#[path = "../ffi/mod.rs"]
#[allow(
    unsafe_code,
    reason = "the one place that calls C; its rules are in ffi/README.md"
)]
pub mod ffi;
pub mod film;
pub mod geometry;
pub mod import;
pub mod integrators;
pub mod lights;
pub mod materials;
pub mod math;
pub mod output;
pub mod photons;
pub mod pipeline;
pub mod plugins;
pub mod registry;
pub mod report;
pub mod sampling;
pub mod scene;
pub mod stats;
pub mod textures;
