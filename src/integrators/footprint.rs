//! Differentials along a path, if anybody wants them.

use super::CameraRay;
use crate::cameras::Camera;
use crate::geometry::{Differential, Footprint, Landing, Ray, SurfacePoint};
use crate::materials::BsdfSample;
use crate::math::DVec3;
use crate::scene::{Crossing, Inside, Scene};
use crate::stats::tally::{self, Event, Part};

/// Least distance between samples that is told apart, in pixels: what is finer is beyond what
/// a filter of textures resolves.
const FINEST: f64 = 0.125;

/// The part of an image that a sample stands for.
#[derive(Clone, Copy, Debug)]
pub struct Spacing {
    /// Size of the image in pixels.
    pub image: [f64; 2],
    /// Distance between samples in pixels.
    pub pixels: f64,
}

impl Spacing {
    /// Of `spp` samples per pixel.
    pub fn new(width: u32, height: u32, spp: u32) -> Self {
        Self {
            image: [f64::from(width), f64::from(height)],
            pixels: (1.0 / f64::from(spp).sqrt()).max(FINEST),
        }
    }

    /// The camera's ray through the image point `(x, y)` in pixels, with its differential. It is
    /// the difference of the rays half a pixel to either side, so that any camera will do; a
    /// camera maps pixels so smoothly that nothing is lost.
    #[inline]
    pub fn camera_ray(
        &self,
        camera: &dyn Camera,
        x: f64,
        y: f64,
        lens: [f64; 2],
        differential: bool,
    ) -> CameraRay {
        let [w, h] = self.image;
        let at = |x: f64, y: f64| camera.ray(x / w, y / h, lens);
        let (o, d) = at(x, y);
        let difference = |dx: f64, dy: f64| {
            let (a, b) = (at(x - dx, y - dy), at(x + dx, y + dy));
            let scale = |v: DVec3| v * self.pixels;
            (scale(b.0 - a.0), scale(b.1 - a.1))
        };
        CameraRay {
            ray: Ray::new(o, d),
            differential: (!cfg!(dualight_without = "textures") && differential).then(|| {
                let (x, y) = (difference(0.5, 0.0), difference(0.0, 0.5));
                Differential {
                    origin: [x.0, y.0],
                    direction: [x.1, y.1],
                }
            }),
        }
    }
}

/// A path at the start of a segment.
#[derive(Clone, Copy)]
pub(super) struct Start {
    pub(super) ray: Ray,
    pub(super) differential: Option<Differential>,
    /// The bodies that it starts in.
    pub(super) inside: Inside,
}

/// Where a ray landed: with or without derivatives, and between which media.
#[derive(Clone, Copy)]
pub(super) struct Trail {
    landing: Option<Landing>,
    crossing: Crossing,
}

impl Trail {
    /// Carries the differential of `ray` to `sp`, if there is one, for textures; it came through
    /// `inside`.
    #[inline(always)]
    pub(super) fn land(
        differential: &Option<Differential>,
        inside: Inside,
        scene: &Scene,
        ray: &Ray,
        sp: &SurfacePoint,
    ) -> Self {
        let mut trail = Self {
            landing: None,
            crossing: scene.crossing(inside, sp),
        };
        // In place: it is large, and to move nothing of it costs as much as to move it.
        if !cfg!(dualight_without = "textures")
            && let Some(d) = differential
        {
            let _scope = tally::enter(Part::Textures);
            tally::count(Event::Derivatives);
            trail.landing = d.land(&scene.geometry, ray, sp);
        }
        trail
    }

    /// As [`land`](Self::land), but not for textures.
    pub(super) fn land_to_plan(
        differential: &Differential,
        inside: Inside,
        scene: &Scene,
        ray: &Ray,
        sp: &SurfacePoint,
    ) -> Self {
        Self {
            landing: differential.land(&scene.geometry, ray, sp),
            crossing: scene.crossing(inside, sp),
        }
    }

    /// The media that the surface parts.
    #[inline]
    pub(super) fn crossing(&self) -> &Crossing {
        &self.crossing
    }

    /// The path that goes on by a sample of the scattering function.
    #[inline]
    pub(super) fn start(&self, sp: &SurfacePoint, s: &BsdfSample) -> Start {
        Start {
            ray: sp.spawn(s.wi),
            differential: self.leave(sp, s),
            inside: self.beyond(s),
        }
    }

    /// Where a ray starts that leaves by a sample of the scattering function.
    #[inline]
    pub(super) fn beyond(&self, s: &BsdfSample) -> Inside {
        self.crossing.beyond(s.transmitted)
    }

    /// What textures average over.
    #[inline]
    pub(super) fn footprint(&self) -> Option<Footprint> {
        if cfg!(dualight_without = "textures") {
            return None;
        }
        self.landing.map(|l| l.footprint())
    }

    /// The differential of the ray that leaves by a sample of the scattering function.
    #[inline(always)]
    pub(super) fn leave(&self, sp: &SurfacePoint, s: &BsdfSample) -> Option<Differential> {
        if cfg!(dualight_without = "textures") {
            return None;
        }
        self.landing.map(|landing| {
            if s.pdf > 0.0 {
                landing.spread(sp, s.wi, s.pdf)
            } else {
                landing.follow(sp, s.wi)
            }
        })
    }
}
