//! `path`: unbiased path tracing with next-event estimation and multiple importance sampling;
//! the reference for everything else. With photons it is `hybrid`, which see.
//!
//! Source: Kajiya, *The Rendering Equation*, 1986; Veach 1997, chapters 8 to 10.

use arrayvec::ArrayVec;

use super::footprint::Trail;
use super::light_sampling::{View, power_heuristic, sample_direct};
use super::stored_light::{Stored, sites};
use super::{
    BATCH, Integrator, IntegratorEntry, PhotonNeeds, RenderContext, Sample, Scratch, keeps,
};
use crate::color::Rgb;
use crate::effects::EffectSet;
use crate::film::{Component, PixelSample};
use crate::geometry::{Differential, Ray, SurfacePoint};
use crate::materials::{Bsdf, BsdfValue, LobeClass, Scattering, TransportMode};
use crate::math::DVec3;
use crate::sampling::Sampler;
use crate::scene::{Inside, Scene};
use crate::stats::tally::{self, Event, Part};

/// Scattering events after which roulette begins.
const ROULETTE_DEPTH: u32 = 3;

/// Throughput below which roulette sets in, and which survivors are raised to. Ending paths
/// that still carry much makes the rest of them bright: in the box, roulette by the throughput
/// itself triples the error at equal samples.
const ROULETTE_WEIGHT: f64 = 0.1;

/// How often the glow map is asked at diffuse surfaces after the first.
const LATER_GLOW: f64 = 0.25;

/// Longest path when neither roulette nor the user ends it.
const DEPTH_GUARD: u32 = 4096;

/// What a path from the camera has been through so far; decides the component that light found
/// next belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Walk {
    /// Nothing: `E`.
    Camera,
    /// A specular surface first: `E S …`.
    Specular,
    /// One diffuse surface: `E D`.
    Diffuse,
    /// One diffuse surface, then specular ones: `E D S⁺`.
    DiffuseSpecular,
    /// Two diffuse surfaces at least: `E D S* D …`.
    Indirect,
}

/// All of them, in the order of their numbers.
const WALKS: [Walk; 5] = [
    Walk::Camera,
    Walk::Specular,
    Walk::Diffuse,
    Walk::DiffuseSpecular,
    Walk::Indirect,
];

impl Walk {
    /// After one more scattering event.
    #[inline]
    fn after(self, class: LobeClass) -> Self {
        match (self, class == LobeClass::Diffuse) {
            (Self::Camera, true) => Self::Diffuse,
            (Self::Camera, false) => Self::Specular,
            (Self::Diffuse | Self::DiffuseSpecular, true) => Self::Indirect,
            (Self::Diffuse | Self::DiffuseSpecular, false) => Self::DiffuseSpecular,
            (other, _) => other,
        }
    }

    /// Whether what lies beyond this surface can be part of an effect that is simulated.
    #[inline]
    fn goes_on(self, effects: EffectSet) -> bool {
        match self {
            Self::Camera | Self::Specular => true,
            Self::Diffuse | Self::DiffuseSpecular => {
                effects.intersects(EffectSet::CAUSTICS | EffectSet::INDIRECT)
            }
            Self::Indirect => effects.contains(EffectSet::INDIRECT),
        }
    }

    /// Where light belongs that is found now.
    #[inline]
    fn component(self) -> Component {
        match self {
            Self::Camera | Self::Diffuse => Component::Direct,
            Self::Specular => Component::Specular,
            Self::DiffuseSpecular => Component::Caustics,
            Self::Indirect => Component::Indirect,
        }
    }
}

/// `PHOTONS`: whether `D S⁺ L` comes from photon maps.
pub(super) struct Path<'a, const PHOTONS: bool> {
    cx: RenderContext<'a>,
    /// What segments are traced for after a diffuse surface, by the [`Walk`] so far.
    beyond: [Part; 5],
    /// Whether anything can be found beyond a surface, by the [`Walk`] so far with it.
    onward: [bool; 5],
}

impl<'a, const PHOTONS: bool> Path<'a, PHOTONS> {
    pub(super) fn new(cx: RenderContext<'a>) -> Self {
        let on = |effect, part| cx.effects.contains(effect).then_some(part);
        let indirect = on(EffectSet::INDIRECT, Part::Indirect);
        let caustics = on(EffectSet::CAUSTICS, Part::Caustics);
        let mut beyond = [Part::Rest; 5];
        for (walk, part) in [
            (Walk::Diffuse, indirect.or(caustics).unwrap_or(Part::Direct)),
            (
                Walk::DiffuseSpecular,
                caustics.or(indirect).unwrap_or(Part::Rest),
            ),
            (Walk::Indirect, indirect.unwrap_or(Part::Rest)),
        ] {
            beyond[walk as usize] = part;
        }
        // Without light to pass on, only a lamp that can be met is worth one more segment.
        let lamps = cx.scene.lights.iter().any(|l| !l.is_delta());
        let onward = WALKS
            .map(|walk| walk.goes_on(cx.effects) || lamps && keeps(cx.effects, walk.component()));
        Self { cx, beyond, onward }
    }
}

/// A path on its way.
struct Walker {
    ray: Ray,
    differential: Option<Differential>,
    inside: Inside,
    sampler: Sampler,
    beta: Rgb,
    walk: Walk,
    /// Diffuse surfaces that it has left.
    left_diffuse: u32,
    /// Whether a specular surface came after the last of them: light found now ends `D S⁺ L`.
    focused: bool,
    /// Density and origin of the last BSDF sample; none for a delta lobe or the camera.
    last: Option<(f64, DVec3)>,
    /// What its segment is traced for.
    part: Part,
    /// Index of the sum that it adds to.
    pixel: usize,
}

impl Walker {
    fn new(scene: &Scene, sample: &Sample) -> Self {
        Self {
            ray: sample.camera.ray,
            differential: sample.camera.differential,
            inside: scene.enclosing(sample.camera.ray.origin()),
            sampler: sample.sampler.clone(),
            beta: Rgb::ONE,
            walk: Walk::Camera,
            left_diffuse: 0,
            focused: false,
            last: None,
            part: Part::Rest,
            pixel: sample.pixel,
        }
    }
}

/// Light that arrives if nothing stands in its way.
struct Direct {
    ray: Ray,
    value: BsdfValue,
    walk: Walk,
    part: Part,
    pixel: usize,
}

impl<const PHOTONS: bool> Integrator for Path<'_, PHOTONS> {
    fn sample(&self, batch: &mut [Sample], sums: &mut [PixelSample], scratch: &mut Scratch) {
        for batch in batch.chunks(BATCH) {
            self.walk(batch, sums, scratch);
        }
    }
}

impl<const PHOTONS: bool> Path<'_, PHOTONS> {
    /// Walks several paths, each step of all of them together: shading is a long chain of
    /// dependent operations, and the processor works on those of several paths at a time if no
    /// search lies between them.
    fn walk(&self, batch: &[Sample], sums: &mut [PixelSample], scratch: &mut Scratch) {
        let (accel, scene) = (self.cx.accel, self.cx.scene);
        let mut walkers: ArrayVec<Walker, BATCH> = ArrayVec::new();
        walkers.extend(batch.iter().map(|s| Walker::new(scene, s)));
        let mut alive: ArrayVec<usize, BATCH> = (0..walkers.len()).collect();
        let mut points: ArrayVec<SurfacePoint, BATCH> = ArrayVec::new();
        let mut lights: ArrayVec<Direct, BATCH> = ArrayVec::new();
        scratch.rays.camera += alive.len() as u64;
        let mut scope = tally::enter(Part::Rest);
        for depth in 0.. {
            alive.retain(|&mut i| {
                let w = &walkers[i];
                scope.switch(w.part);
                let hit = accel.intersect(&w.ray);
                match &hit {
                    Some(hit) => points.push(scene.surface_point(&w.ray, hit)),
                    None => self.escape(depth, w, &mut sums[w.pixel]),
                }
                hit.is_some()
            });
            let mut met = points.iter();
            alive.retain(|&mut i| {
                let w = &mut walkers[i];
                scope.switch(w.part);
                let sum = &mut sums[w.pixel];
                match met.next() {
                    Some(sp) => self.scatter(depth, w, sp, sum, &mut lights, scratch),
                    None => false,
                }
            });
            scratch.rays.shadow += lights.len() as u64;
            scratch.rays.bounce += alive.len() as u64;
            for light in &lights {
                scope.switch(light.part);
                if !accel.occluded(&light.ray) {
                    let sum = &mut sums[light.pixel];
                    let diffuse = light.walk.after(LobeClass::Diffuse).component();
                    sum.add(diffuse, light.value.diffuse);
                    if !light.value.glossy.is_black() {
                        let glossy = light.walk.after(LobeClass::Glossy).component();
                        sum.add(glossy, light.value.glossy);
                    }
                }
            }
            points.clear();
            lights.clear();
            if alive.is_empty() {
                break;
            }
        }
    }

    /// Takes the light from beyond the scene that a path has met.
    fn escape(&self, depth: u32, w: &Walker, out: &mut PixelSample) {
        if PHOTONS && w.focused {
            return;
        }
        let radiance = View::of_path(depth, w.last).escaped(&self.cx, &w.ray);
        out.add(w.walk.component(), w.beta * radiance);
    }

    /// What happens where a path has met a surface: takes the light that is found there to the
    /// pixel's sum, asks for light from elsewhere, and turns the path into a new direction.
    /// Whether it goes on.
    #[inline(always)]
    fn scatter(
        &self,
        depth: u32,
        w: &mut Walker,
        sp: &SurfacePoint,
        out: &mut PixelSample,
        lights: &mut ArrayVec<Direct, BATCH>,
        scratch: &mut Scratch,
    ) -> bool {
        let cx = &self.cx;
        let counts = !(PHOTONS && w.focused);
        if counts && !cx.scene.bodiless().is_empty() {
            let seen = View::of_path(depth, w.last).crossed(cx, &w.ray, sp.distance);
            out.add(w.walk.component(), w.beta * seen);
        }
        let trail = Trail::land(&w.differential, w.inside, cx.scene, &w.ray, sp);
        if let Some(t) = cx.scene.transmittance(sp, trail.crossing()) {
            w.beta *= t;
        }
        if depth == 0 {
            out.alpha += 1.0;
            out.normal += sp.n;
            out.position += sp.p + cx.scene.center;
            out.depth += sp.distance;
        }
        if counts && sp.light.is_some() {
            let le = cx.scene.emitted(sp, trail.footprint());
            if !le.is_black() {
                let weight = w.last.map_or(1.0, |(pdf, from)| {
                    power_heuristic(1.0, pdf, 1.0, cx.pdf_light(from, sp))
                });
                out.add(w.walk.component(), w.beta * le * weight);
            }
        }
        if let Some(matte) = cx.scene.matte(sp) {
            if depth == 0 {
                out.albedo += matte.reflected_albedo();
            }
            if PHOTONS {
                self.stored(w, sp, &matte, out, scratch);
            }
            return self.turn(depth, w, sp, &trail, &matte, lights);
        }
        let mut bsdf = Bsdf::new(sp, TransportMode::Radiance);
        cx.scene.scatter(sp, trail.footprint(), &mut bsdf);
        trail.crossing().apply(&mut bsdf);
        if depth == 0 {
            out.albedo += bsdf.albedo();
        }
        if let Some(color) = bsdf.shown() {
            if matches!(w.walk, Walk::Camera | Walk::Specular) {
                out.add(w.walk.component(), w.beta * color);
            }
            return false;
        }
        if PHOTONS && bsdf.has_diffuse() {
            self.stored(w, sp, &bsdf, out, scratch);
        }
        self.turn(depth, w, sp, &trail, &bsdf, lights)
    }

    /// Takes what the photon maps hold for the diffuse lobes at a point.
    fn stored(
        &self,
        w: &mut Walker,
        sp: &SurfacePoint,
        bsdf: &impl Scattering,
        out: &mut PixelSample,
        scratch: &mut Scratch,
    ) {
        let stored = Stored::new(&self.cx);
        let sites = sites(sp, bsdf);
        let (near, far) = match w.walk {
            Walk::Specular => (Component::Specular, Component::Specular),
            _ => (Component::Caustics, Component::Indirect),
        };
        let mut beta = w.beta;
        if w.left_diffuse == 0 {
            if let Some(map) = &self.cx.maps.caustic {
                let _scope = tally::enter(Part::Caustics);
                let lookup = Event::CausticLookups;
                let e = stored.density(map, &sites, bsdf, |_| true, lookup, scratch);
                out.add(near, beta * e.value);
                out.photons[1] += e.density;
            }
        } else {
            // What is stored here is the glow of the surface before. And the glow of this one is
            // faint and smooth, but takes as long to find.
            if w.sampler.next_1d() >= LATER_GLOW {
                return;
            }
            beta = beta / LATER_GLOW;
        }
        out.add(far, beta * stored.glow(&sites, bsdf));
    }

    /// Asks for light from elsewhere, and turns the path into a new direction. Whether it goes
    /// on.
    #[inline(always)]
    fn turn<S: Scattering>(
        &self,
        depth: u32,
        w: &mut Walker,
        sp: &SurfacePoint,
        trail: &Trail,
        bsdf: &S,
        lights: &mut ArrayVec<Direct, BATCH>,
    ) -> bool {
        let cx = &self.cx;
        if depth >= cx.settings.max_depth.unwrap_or(DEPTH_GUARD) || !w.walk.goes_on(cx.effects) {
            return false;
        }
        if bsdf.has_finite() {
            let u = w.sampler.next_2d();
            self.ask(w, sp, bsdf, u, lights);
        }
        let u = w.sampler.next_2d();
        let u_lobe = w.sampler.next_1d();
        let sampler = &mut w.sampler;
        let Some(s) = bsdf.sample_carried(w.beta, u_lobe, u, || sampler.next_1d()) else {
            return false;
        };
        let Some(follows) = cx.effects.follow(cx.scene, sp, s.class, s.transmitted) else {
            return false;
        };
        w.beta *= s.weight;
        let walk = w.walk.after(s.class);
        if !self.onward[walk as usize] {
            return false;
        }
        w.part = match walk {
            // Once it has been seen in a mirror, everything belongs to that.
            Walk::Camera | Walk::Specular if s.class == LobeClass::Diffuse => w.part,
            Walk::Camera | Walk::Specular => follows,
            Walk::Diffuse | Walk::DiffuseSpecular | Walk::Indirect => self.beyond[walk as usize],
        };
        w.walk = walk;
        if PHOTONS {
            let diffuse = s.class == LobeClass::Diffuse;
            w.left_diffuse += u32::from(diffuse);
            w.focused = !diffuse && w.left_diffuse > 0;
        }
        w.last = (s.class != LobeClass::Delta).then_some((s.pdf, sp.p));
        if cx.settings.roulette && depth + 1 >= ROULETTE_DEPTH {
            let survive = (w.beta.max_channel() / ROULETTE_WEIGHT).min(1.0);
            if w.sampler.next_1d() >= survive {
                return false;
            }
            w.beta = w.beta / survive;
        }
        if w.beta.is_black() {
            return false;
        }
        w.ray = sp.spawn(s.wi);
        w.inside = trail.beyond(&s);
        // Without textures there is none, and nothing is copied.
        match trail.leave(sp, &s) {
            None => w.differential = None,
            left => w.differential = left,
        }
        tally::ray(w.part);
        true
    }

    /// Asks for light from elsewhere, of what is simulated.
    #[inline(always)]
    fn ask<S: Scattering>(
        &self,
        w: &Walker,
        sp: &SurfacePoint,
        bsdf: &S,
        u: [f64; 2],
        lights: &mut ArrayVec<Direct, BATCH>,
    ) {
        let cx = &self.cx;
        let mut part = match w.walk {
            Walk::Camera => Part::Direct,
            Walk::Specular => w.part,
            Walk::Diffuse | Walk::DiffuseSpecular | Walk::Indirect => Part::Indirect,
        };
        let mut scope = tally::enter(w.part);
        let kept = keeps(cx.effects, w.walk.after(LobeClass::Diffuse).component());
        if kept {
            scope.switch(part);
        }
        let Some(mut direct) = sample_direct(cx, sp, bsdf, u, 1.0, 1.0) else {
            return;
        };
        if !kept {
            direct.value.diffuse = Rgb::ZERO;
        }
        direct.value.diffuse *= w.beta;
        if S::GLOSSY {
            let glossy = w.walk.after(LobeClass::Glossy).component();
            let dropped = PHOTONS && w.left_diffuse > 0 || !keeps(cx.effects, glossy);
            if dropped || !direct.follows_glossy(cx, sp) {
                direct.value.glossy = Rgb::ZERO;
            }
            direct.value.glossy *= w.beta;
            if direct.value.diffuse.is_black() {
                part = match glossy {
                    Component::Caustics => Part::Caustics,
                    Component::Indirect => Part::Indirect,
                    _ => direct.glossy_part(cx, sp),
                };
            }
        }
        if direct.value.diffuse.is_black() && (!S::GLOSSY || direct.value.glossy.is_black()) {
            return;
        }
        tally::ray(part);
        lights.push(Direct {
            ray: direct.ray,
            value: direct.value,
            walk: w.walk,
            part,
            pixel: w.pixel,
        });
    }
}

/// The table's line.
pub(super) const ENTRY: IntegratorEntry = IntegratorEntry {
    name: "path",
    doc: "unbiased path tracing with next-event estimation and MIS: the reference",
    photons: PhotonNeeds::None,
    suits: |outlook| Some(outlook.wants_paths()),
    build: |cx| Box::new(Path::<false>::new(cx)),
};
