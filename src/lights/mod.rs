//! Lights: what they emit, how to sample them from a point, how photons leave them. They answer
//! questions, trace no rays and never see the scene. A light kind is one file and one line in
//! [`LIGHTS`].
//!
//! Units: flux W, intensity W/sr, irradiance W/m², radiance W/(m²·sr), each per RGB channel.

mod area;
mod ball;
mod cube;
mod desc;
mod directional;
mod ellipsoid;
mod environment;
mod facets;
mod panel;
mod parallelogram;
mod point;
mod sky;
mod sphere;
mod spot;

pub use cube::CubeMap;
pub use desc::{EmissionMap, LightDesc, SpotCurve};
pub use parallelogram::Parallelogram;
pub use sky::SkyImage;

use crate::color::Rgb;
use crate::geometry::{Ray, Surface, SurfacePoint};
use crate::math::{BoundingSphere, DVec3};

/// A sample of the light that arrives at a point.
#[derive(Clone, Copy, Debug)]
pub struct LiSample {
    /// Unit direction from the point to the light.
    pub wi: DVec3,
    /// Where on the light, moved off its surface; `None` for light from infinity.
    pub target: Option<DVec3>,
    /// Radiance; for a delta light the incident irradiance at normal incidence.
    pub radiance: Rgb,
    /// Density in solid angle at the point; 1 for a delta light.
    pub pdf: f64,
    /// Whether no other technique can find this light.
    pub delta: bool,
}

/// Where a photon leaves a light.
#[derive(Clone, Copy, Debug)]
pub struct EmissionOrigin {
    /// Position on the light.
    pub p: DVec3,
    /// Unit normal of a surface that emits; `None` for a point.
    pub ng: Option<DVec3>,
    /// Start of rays off the surface, in metres along `ng`.
    pub offset: f64,
    /// Density in area (1/m²); 1 for a point.
    pub pdf_area: f64,
    /// Radiance of a surface there, W/(m²·sr); not used by a point.
    pub radiance: Rgb,
}

impl EmissionOrigin {
    /// The ray that leaves along `dir`.
    #[inline]
    pub fn ray(&self, dir: DVec3) -> Ray {
        let shift = self
            .ng
            .map_or(DVec3::ZERO, |n| n * self.offset.copysign(n.dot(dir)));
        Ray::new(self.p + shift, dir)
    }
}

/// Parallel light.
#[derive(Clone, Copy, Debug)]
pub struct Distant {
    /// Unit direction in which the light travels.
    pub direction: DVec3,
    /// Irradiance on a surface at normal incidence, W/m².
    pub irradiance: Rgb,
}

/// What a ray sees of a light that it passes through.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Radiance.
    pub radiance: Rgb,
    /// Density in solid angle with which [`Light::sample_li`] finds this direction.
    pub pdf: f64,
}

/// A light source.
pub trait Light: Send + Sync {
    /// Emitted flux in W; for parallel light that through the scene's disc.
    fn power(&self) -> Rgb;

    /// A guess of the luminance that would arrive at `p` if nothing stood between, W/m² or in
    /// proportion to it: lights are chosen by it. Zero only where the light cannot contribute.
    fn importance(&self, p: DVec3) -> f64;

    /// Samples the light that arrives at `p`; `None` where none can.
    fn sample_li(&self, p: DVec3, u: [f64; 2]) -> Option<LiSample>;

    /// The light itself, if it is a parallelogram of even radiance: whoever samples it often
    /// then need not ask this trait.
    fn parallelogram(&self) -> Option<Parallelogram> {
        None
    }

    /// Density in solid angle, seen from `p`, with which [`sample_li`](Self::sample_li) finds
    /// the point `on` of this light; 0 for delta lights.
    fn pdf_li(&self, p: DVec3, on: &SurfacePoint) -> f64;

    /// Distance in metres at which the light ends; photons are dimmed on their first segment as
    /// [`sample_li`](Self::sample_li) is.
    fn range(&self) -> f64 {
        f64::INFINITY
    }

    /// Radiance emitted at a point of this light toward `on.sp.wo`.
    fn radiance(&self, on: &Surface<'_>) -> Rgb;

    /// Light from infinity, if that is what it is: a beam of parallel light in a direction chosen
    /// by `u`, its irradiance divided by the direction's density. Photons then leave a disc
    /// beside the scene.
    fn sample_distant(&self, _u: [f64; 2]) -> Option<Distant> {
        None
    }

    /// Whether it has no extent, so that no ray ever meets it by chance.
    fn is_delta(&self) -> bool {
        false
    }

    /// Whether it is seen by rays that leave the scene.
    fn is_infinite(&self) -> bool {
        false
    }

    /// Radiance seen along the unit direction `dir` by a ray that leaves the scene.
    fn escaped(&self, _dir: DVec3) -> Rgb {
        Rgb::ZERO
    }

    /// Density in solid angle with which [`sample_li`](Self::sample_li) finds the direction
    /// `dir` to a light at infinity.
    fn pdf_escaped(&self, _dir: DVec3) -> f64 {
        0.0
    }

    /// Whether it is neither a surface of the scene nor at infinity, and yet has extent: rays see
    /// it and pass through.
    fn is_bodiless(&self) -> bool {
        false
    }

    /// What a ray sees of a bodiless light that starts at `from` and runs along the unit direction
    /// `dir` for less than `reach` metres.
    fn crossed(&self, _from: DVec3, _dir: DVec3, _reach: f64) -> Option<Crossing> {
        None
    }

    /// Whether camera rays see it, if it is bodiless or at infinity.
    fn seen_by_camera(&self) -> bool {
        true
    }

    /// A point where photons leave.
    fn sample_origin(&self, u: [f64; 2]) -> Option<EmissionOrigin>;

    /// A direction in which photons leave `from`, and its density in solid angle.
    fn sample_direction(&self, from: &EmissionOrigin, u: [f64; 2]) -> (DVec3, f64);

    /// What leaves `from` along the unit direction `dir`: radiance times cosine in W/(m²·sr) for
    /// a surface, intensity in W/sr for a point.
    fn emitted(&self, from: &EmissionOrigin, dir: DVec3) -> Rgb;
}

/// The [`Light::importance`] of a surface of a given flux within a sphere: that of its middle,
/// and no more than at its rim.
fn surface_importance(flux: f64, around: &BoundingSphere, p: DVec3) -> f64 {
    let d2 = (p - around.center).length_squared();
    let r2 = around.radius * around.radius;
    flux / (std::f64::consts::PI * d2.max(r2).max(f64::MIN_POSITIVE))
}

/// What the range of a light leaves at a distance (`KHR_lights_punctual`, the recommended
/// window).
#[inline]
pub fn range_window(distance: f64, range: f64) -> f64 {
    (1.0 - (distance / range).powi(4)).clamp(0.0, 1.0)
}

/// A light kind that can be chosen.
#[derive(Clone, Copy, Debug)]
pub struct LightEntry {
    /// Name, as [`LightDesc::kind`] gives it.
    pub name: &'static str,
    /// One sentence.
    pub doc: &'static str,
    /// Makes the light; the error says what is wrong.
    pub build: fn(&LightDesc) -> Result<Box<dyn Light>, String>,
}

crate::registry::impl_entry!(LightEntry, "light");

/// The light kinds.
pub static LIGHTS: &[LightEntry] = &[
    area::ENTRY,
    panel::ENTRY,
    sphere::ENTRY,
    ellipsoid::ENTRY,
    point::ENTRY,
    spot::ENTRY,
    directional::ENTRY,
    environment::ENTRY,
];
