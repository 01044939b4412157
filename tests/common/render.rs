//! Rendering tiny images in tests.

use std::sync::Arc;

use dualight::accel::{ACCELERATORS, Accelerator};
use dualight::control::Control;
use dualight::film::Image;
use dualight::geometry::Geometry;
use dualight::integrators::IntegratorSettings;
use dualight::pipeline::{self, PhotonFile, PixelSampling, RenderSettings, Rendering, Session};
use dualight::plugins::Registry;
use dualight::scene::Scene;

/// A way to compute a picture.
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    pub name: &'static str,
    pub integrator: &'static str,
    pub gather_rays: u32,
}

pub const PATH: Mode = Mode {
    name: "path",
    integrator: "path",
    gather_rays: 0,
};
pub const GATHER: Mode = Mode {
    name: "photon with final gather",
    integrator: "photon",
    gather_rays: 4,
};
pub const DIRECT_MAP: Mode = Mode {
    name: "photon without gather",
    integrator: "photon",
    gather_rays: 0,
};
pub const HYBRID: Mode = Mode {
    name: "hybrid",
    integrator: "hybrid",
    gather_rays: 0,
};
pub const MODES: [Mode; 3] = [PATH, GATHER, DIRECT_MAP];

/// Names of the ray tracing backends.
pub fn backends() -> Vec<&'static str> {
    ACCELERATORS.iter().map(|a| a.name).collect()
}

/// Our own hierarchy of a scene's shapes.
pub fn bvh(geometry: &Arc<Geometry>) -> Box<dyn Accelerator> {
    let bvh = ACCELERATORS.iter().find(|e| e.name == "bvh").unwrap();
    (bvh.build)(geometry, 1).unwrap()
}

/// Settings of a square image of so many pixels and samples, by one thread and without indirect
/// light and caustics: its noise is that of the pixels.
pub fn plain_pixels(
    [side, spp]: [u32; 2],
    pixel_sampling: PixelSampling,
    seed: u64,
) -> RenderSettings {
    let mut out = RenderSettings {
        effects: "-indirect,-caustics".into(),
        width: side,
        height: side,
        spp,
        pixel_sampling,
        accelerator: Some("bvh".into()),
        threads: Some(1),
        ..RenderSettings::default()
    };
    out.integrator_settings.seed = seed;
    out
}

/// How large a test's renderings are.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    pub pixels: u32,
    pub spp: u32,
    pub photons: u64,
}

/// Settings of a square image; seeds take turns on the backends.
pub fn settings(mode: Mode, size: Size, seed: u64) -> RenderSettings {
    let backends = backends();
    RenderSettings {
        integrator: Some(mode.integrator.into()),
        accelerator: Some(backends[seed as usize % backends.len()].into()),
        width: size.pixels,
        height: size.pixels,
        spp: size.spp,
        integrator_settings: IntegratorSettings {
            seed,
            photons: size.photons,
            caustic_photons: size.photons,
            gather_rays: mode.gather_rays,
            ..Default::default()
        },
        ..Default::default()
    }
}

/// Renders, and insists that no pixel was refused.
#[track_caller]
pub fn rendering(scene: &Scene, settings: &RenderSettings) -> Rendering {
    let result = pipeline::render(scene, settings, &Registry::builtin(), &Control::default());
    let rendering = result.expect("a scene made in code renders");
    assert_eq!(rendering.statistics.rejected_pixels, 0, "NaN or infinity");
    rendering
}

/// Renders with photons that a file keeps or is to keep; the error is its text.
pub fn with_photons(
    scene: &Scene,
    settings: &RenderSettings,
    photons: Option<PhotonFile>,
) -> Result<Rendering, String> {
    let session = Session {
        film: None,
        seconds: 0.0,
        watch: &mut |_, _| {},
        photons,
        prepared: None,
    };
    let (registry, control) = (Registry::builtin(), Control::default());
    pipeline::render_session(scene, settings, &registry, &control, session)
        .map_err(|e| e.to_string())
}

/// As [`rendering`], developed.
#[track_caller]
pub fn render(scene: &Scene, mode: Mode, size: Size, seed: u64) -> Image {
    rendering(scene, &settings(mode, size, seed)).film.develop()
}

/// Mean of all pixels and channels of a layer.
pub fn mean(image: &Image, layer: &str) -> f64 {
    let pixels = image.rgb(layer).expect("the layer exists");
    let sum: f64 = pixels.iter().flatten().map(|&x| f64::from(x)).sum();
    sum / (3 * pixels.len()) as f64
}
