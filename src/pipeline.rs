//! From a scene to an image: one call per stage.

use crate::integrators::IntegratorSettings;

/// What to render, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderSettings {
    /// Name of the integrator.
    pub integrator: String,
    /// Name of the ray tracing backend; `None` for the first of the table.
    pub accelerator: Option<String>,
    /// Name of the photon emission.
    pub emission: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Camera samples per pixel.
    pub spp: u32,
    /// Part of the image to render: left, top, right, bottom in pixels; the rest stays black.
    pub crop: Option<[u32; 4]>,
    /// Name of the camera; `None` for the first.
    pub camera: Option<String>,
    /// Threads; `None` for one per processor.
    pub threads: Option<usize>,
    /// What the integrator is told.
    pub integrator_settings: IntegratorSettings,
}
