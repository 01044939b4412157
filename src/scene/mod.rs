//! The scene: arenas with typed ids, written by the one builder, frozen after import.

mod bake;
mod builder;
mod census;
mod emitters;
mod fingerprint;
mod light_choice;
mod media;
mod precision;

pub use builder::{Emission, MeshPlacement, Omit, SceneBuilder, ScenePlugins};
pub use census::Census;
pub use fingerprint::Fingerprints;
pub use light_choice::LightChoice;
pub use media::{Crossing, Inside, Media};

use std::sync::{Arc, OnceLock};

use crate::cameras::CameraDesc;
use crate::color::Rgb;
use crate::geometry::{
    Footprint, Geometry, LightId, MaterialId, ObjectId, Ray, ScenePatches, Surface, SurfacePoint,
};
use crate::lights::{LiSample, Light, Parallelogram};
use crate::materials::{Bsdf, Features, Interior, Material, Matte, TransportMode};
use crate::math::{Aabb, BoundingSphere, DVec3};
use crate::stats::tally::{self, Event, Part};
use crate::textures::Texture;

/// Everything that is rendered.
pub struct Scene {
    /// Shapes and their placements.
    pub geometry: Arc<Geometry>,
    /// Materials, named by [`MaterialId`].
    pub materials: Vec<Box<dyn Material>>,
    /// What each of them has beyond a plain surface.
    pub material_features: Vec<Features>,
    /// Whether each of them bends the light that it transmits.
    refracts: Vec<bool>,
    /// Reflectance of those that are [matte](Material::matte).
    pub matte: Vec<Option<Rgb>>,
    /// Names of the materials, for reports.
    pub material_names: Vec<String>,
    /// The textures of all materials that some object uses and that average over what a sample
    /// sees. Without any, nobody needs footprints.
    pub textures: Vec<Texture>,
    /// Lights, named by [`LightId`].
    pub lights: Vec<Box<dyn Light>>,
    /// Those of them that are [parallelograms](Light::parallelogram).
    pub parallelograms: Vec<Option<Parallelogram>>,
    /// Names and kinds of the lights, for reports.
    pub light_names: Vec<(String, &'static str)>,
    /// How lights are chosen for a shading point.
    pub choose_light: LightChoice,
    /// Bodies that touch or lie in one another, if there are any.
    pub media: Option<Media>,
    /// Cameras, in the order of the file.
    pub cameras: Vec<CameraDesc>,
    /// World-space box of the geometry, after recentring.
    pub bounds: Aabb,
    /// The file's coordinates of our origin: what was subtracted from every position.
    pub center: DVec3,
    /// What was dropped or could not be honoured, for the user.
    pub warnings: Vec<String>,
    /// What was decided on the way, for the user.
    pub notes: Vec<String>,
    /// What it was made from, for its fingerprints.
    recipe: fingerprint::Recipe,
    /// What is found out about the geometry when it is first asked for.
    found: Found,
}

/// What is found out once, and only if something asks.
#[derive(Default)]
struct Found {
    patches: OnceLock<ScenePatches>,
    spheres: OnceLock<Vec<BoundingSphere>>,
}

impl Scene {
    /// The material named `id`.
    #[inline]
    pub fn material(&self, id: MaterialId) -> &dyn Material {
        &*self.materials[id.index()]
    }

    /// Whether a material bends the light that it transmits.
    #[inline]
    pub fn bends(&self, id: MaterialId) -> bool {
        self.refracts[id.index()]
    }

    /// The light named `id`.
    #[inline]
    pub fn light(&self, id: LightId) -> &dyn Light {
        &*self.lights[id.index()]
    }

    /// Which triangles of its meshes hold together; found when it is first asked for. (Not by the
    /// cell's own closure: a thread that waits for its share of the work may be given another task
    /// that asks as well.)
    pub fn patches(&self) -> &ScenePatches {
        match self.found.patches.get() {
            Some(patches) => patches,
            None => {
                let patches = ScenePatches::new(&self.geometry);
                self.found.patches.get_or_init(|| patches)
            }
        }
    }

    /// Sphere around an object, in world space; exact for a single sphere.
    pub fn bounding_sphere(&self, id: ObjectId) -> BoundingSphere {
        let spheres = match self.found.spheres.get() {
            Some(spheres) => spheres,
            None => {
                let spheres = self.geometry.bounding_spheres();
                self.found.spheres.get_or_init(|| spheres)
            }
        };
        spheres[id.index()]
    }

    /// Makes the smaller sizes of all textures, on all threads.
    pub fn prepare_textures(&self) {
        for t in &self.textures {
            t.image.prepare(t.content);
        }
    }

    /// Total emitted flux in W.
    pub fn flux(&self) -> Rgb {
        self.lights.iter().map(|l| l.power()).sum()
    }

    /// A surface point with access to its primitive.
    #[inline]
    pub fn surface<'a>(
        &'a self,
        sp: &'a SurfacePoint,
        footprint: Option<Footprint>,
    ) -> Surface<'a> {
        Surface::new(&self.geometry, sp, footprint)
    }

    /// Completes the scattering function at a surface point, `bsdf` being new. (It is large, and
    /// made where it stays: moving it would cost as much as all the rest.)
    #[inline]
    pub fn scatter(&self, sp: &SurfacePoint, footprint: Option<Footprint>, bsdf: &mut Bsdf) {
        self.material(sp.material)
            .scatter(&self.surface(sp, footprint), bsdf);
    }

    /// The scattering function at a surface point, if it is no more than one Lambert lobe.
    #[inline(always)]
    pub fn matte(&self, sp: &SurfacePoint) -> Option<Matte> {
        self.matte[sp.material.index()].map(|albedo| Matte::new(sp, albedo))
    }

    /// The scattering function at a surface point, for those who are not in a hurry.
    pub fn bsdf(
        &self,
        sp: &SurfacePoint,
        footprint: Option<Footprint>,
        mode: TransportMode,
    ) -> Bsdf {
        let mut bsdf = Bsdf::new(sp, mode);
        self.scatter(sp, footprint, &mut bsdf);
        bsdf
    }

    /// Radiance emitted at a surface point toward where the ray came from.
    #[inline]
    pub fn emitted(&self, sp: &SurfacePoint, footprint: Option<Footprint>) -> Rgb {
        sp.light.map_or(Rgb::ZERO, |id| {
            self.light(id).radiance(&self.surface(sp, footprint))
        })
    }

    /// As [`Light::sample_li`], without a call for the commonest light.
    #[inline(always)]
    pub fn sample_li(&self, id: LightId, p: DVec3, u: [f64; 2]) -> Option<LiSample> {
        match &self.parallelograms[id.index()] {
            Some(light) => light.sample_li(p, u),
            None => self.light(id).sample_li(p, u),
        }
    }

    /// The density in solid angle with which light sampling at `from` finds the emitter at `on`.
    #[inline]
    pub fn pdf_light(&self, from: DVec3, on: &SurfacePoint, seen: Option<&[f32]>) -> f64 {
        on.light.map_or(0.0, |id| {
            self.light(id).pdf_li(from, on) * self.light_probability(from, seen, id)
        })
    }

    /// The lights that rays see which leave the scene.
    #[inline]
    pub fn infinite(&self) -> &[LightId] {
        self.choose_light.infinite()
    }

    /// The lights that rays see and pass through.
    #[inline]
    pub fn bodiless(&self) -> &[LightId] {
        self.choose_light.bodiless()
    }

    /// Probability that [`pick_light`](Self::pick_light) chooses `id` at `p`.
    #[inline]
    pub fn light_probability(&self, p: DVec3, seen: Option<&[f32]>, id: LightId) -> f64 {
        let lights = &self.lights;
        self.choose_light.probability(lights, p, seen, id.index())
    }

    /// Chooses a light for a shading point by `u`: which, its probability, and `u` rescaled.
    /// `seen` is the share of each light that points around there see, as far as known.
    #[inline]
    pub fn pick_light(
        &self,
        p: DVec3,
        seen: Option<&[f32]>,
        u: f64,
    ) -> Option<(LightId, f64, f64)> {
        let (i, pdf, rest) = self.choose_light.sample(&self.lights, p, seen, u)?;
        Some((LightId(i as u32), pdf, rest))
    }

    /// The bodies that a point lies in, of those that may share space: where a path begins.
    #[inline]
    pub fn enclosing(&self, p: DVec3) -> Inside {
        match &self.media {
            None => Inside::default(),
            Some(media) => media.enclosing(p),
        }
    }

    /// What a path that came through `inside` crosses if it passes the surface at `sp`.
    #[inline]
    pub fn crossing(&self, inside: Inside, sp: &SurfacePoint) -> Crossing {
        match &self.media {
            None => Crossing::plain(inside),
            Some(media) => media.crossing(inside, sp),
        }
    }

    /// Share of the light that survives the segment of a ray that ended at `sp`, if it ran
    /// inside an absorbing body (Beer–Lambert).
    #[inline(always)]
    pub fn transmittance(&self, sp: &SurfacePoint, crossing: &Crossing) -> Option<Rgb> {
        if cfg!(dualight_without = "absorption") {
            return None;
        }
        if let Some(media) = &self.media
            && (media.knows(sp.object) || crossing.beyond(false) != Inside::default())
        {
            return absorbed(media.interior(crossing)?, sp);
        }
        if sp.front {
            return None;
        }
        self.interior_transmittance(sp)
    }

    /// The rare part of the above, kept out of the loops that it is asked from.
    #[inline(never)]
    fn interior_transmittance(&self, sp: &SurfacePoint) -> Option<Rgb> {
        absorbed(self.material(sp.material).interior()?, sp)
    }

    /// As [`Geometry::surface_point`].
    #[inline(always)]
    pub fn surface_point(&self, ray: &Ray, hit: &crate::geometry::Hit) -> SurfacePoint {
        self.geometry.surface_point(ray, hit)
    }
}

/// What a body leaves of the light on a segment through it.
fn absorbed(interior: Interior, sp: &SurfacePoint) -> Option<Rgb> {
    let _scope = tally::enter(Part::Absorption);
    tally::count(Event::Attenuations);
    Some(interior.transmittance(sp.distance))
}
