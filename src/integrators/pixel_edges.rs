//! Pixels in which what is seen first changes: the paper's check points, on the image.
//!
//! Rays through the middle and the corners of a pixel meet different patches, or the middle's hit
//! forecasts an edge that matters on the way to a corner, or the outline of a sphere crosses the
//! pixel, or something may lie between the rays. Of what mirrors and glass show, only small lights
//! are asked for, by [`pixel_glints`](super::pixel_glints).

use rayon::prelude::*;

use super::Region;
use crate::accel::Accelerator;
use crate::cameras::Camera;
use crate::geometry::forecast::{Moves, Order};
use crate::geometry::{Hit, PatchId, Ray, ScenePatches, Walk};
use crate::math::DVec3;
use crate::photons::{Beam, Caster, Sight, casters};
use crate::scene::Scene;

/// Edge of a block of pixels that share a list of what they may see.
const BLOCK: u32 = 16;

/// An object that no ray has met is expected where the pixel is wider than this, in its radii.
const SEARCH: f64 = 0.25;

/// What is looked at, and through what.
pub(super) struct Finder<'a> {
    scene: &'a Scene,
    accel: &'a dyn Accelerator,
    camera: &'a dyn Camera,
    image: [f64; 2],
    patches: &'a ScenePatches,
    casters: Vec<Caster>,
}

/// A ray that was traced.
#[derive(Clone, Copy)]
struct Probe {
    ray: Ray,
    hit: Option<Hit>,
    id: Option<PatchId>,
}

impl Probe {
    fn distance(&self) -> f64 {
        self.hit.map_or(f64::INFINITY, |h| {
            f64::from(h.t) * self.ray.direction().length()
        })
    }
}

impl<'a> Finder<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        accel: &'a dyn Accelerator,
        camera: &'a dyn Camera,
        [width, height]: [u32; 2],
    ) -> Self {
        Self {
            scene,
            accel,
            camera,
            image: [f64::from(width), f64::from(height)],
            patches: scene.patches(),
            casters: casters(scene, false),
        }
    }

    /// Whether each pixel of the region has an edge, row by row, and the rays traced.
    pub(super) fn find(&self, region: Region) -> (Vec<bool>, u64) {
        let width = (region.x1 - region.x0) as usize;
        let mut out = vec![false; width * (region.y1 - region.y0) as usize];
        let blocks: Vec<[u32; 4]> = (region.y0..region.y1)
            .step_by(BLOCK as usize)
            .flat_map(|y| {
                let xs = (region.x0..region.x1).step_by(BLOCK as usize);
                xs.map(move |x| [x, y, (x + BLOCK).min(region.x1), (y + BLOCK).min(region.y1)])
            })
            .collect();
        let found: Vec<(Vec<[u32; 2]>, u64)> = blocks.par_iter().map(|b| self.block(*b)).collect();
        let mut rays = 0;
        for (edges, traced) in found {
            rays += traced;
            for [x, y] in edges {
                out[(y - region.y0) as usize * width + (x - region.x0) as usize] = true;
            }
        }
        (out, rays)
    }

    /// Pixels with edges of a block from its upper left to before its lower right.
    fn block(&self, [x0, y0, x1, y1]: [u32; 4]) -> (Vec<[u32; 2]>, u64) {
        let at = |x: u32, y: u32| [f64::from(x), f64::from(y)];
        let held = self.held(at(x0, y0), at(x1, y1));
        let columns = (x1 - x0 + 1) as usize;
        let corners: Vec<Probe> = (y0..=y1)
            .flat_map(|y| (x0..=x1).map(move |x| at(x, y)))
            .map(|p| self.probe(p))
            .collect();
        let mut rays = corners.len() as u64;
        let mut out = Vec::new();
        for y in y0..y1 {
            for x in x0..x1 {
                let i = (y - y0) as usize * columns + (x - x0) as usize;
                let around = [0, 1, columns, columns + 1].map(|k| corners[i + k]);
                let [cx, cy] = at(x, y);
                let middle = self.probe([cx + 0.5, cy + 0.5]);
                rays += 1;
                if self.changes(&middle, &around, &held) {
                    out.push([x, y]);
                }
            }
        }
        (out, rays)
    }

    fn ray(&self, [x, y]: [f64; 2]) -> Ray {
        let [w, h] = self.image;
        let (o, d) = self.camera.ray(x / w, y / h, [0.5; 2]);
        Ray::new(o, d)
    }

    fn probe(&self, at: [f64; 2]) -> Probe {
        let ray = self.ray(at);
        let hit = self.accel.intersect(&ray);
        let g = &self.scene.geometry;
        let id = hit.map(|h| self.patches.id(g, ray.origin(), ray.direction(), &h));
        Probe { ray, hit, id }
    }

    /// What the rays between two corners of a rectangle may meet.
    fn held(&self, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2]) -> Vec<&Caster> {
        let middle = self.ray([0.5 * (x0 + x1), 0.5 * (y0 + y1)]);
        let corners = [[x0, y0], [x1, y0], [x0, y1], [x1, y1]].map(|p| self.ray(p));
        let beam = beam(&middle, &corners);
        let seen = |c: &&Caster| beam.sight(&c.sphere, Order::Quadratic) != Sight::Outside;
        self.casters.iter().filter(seen).collect()
    }

    /// Whether what is met changes between the middle and the corners of a pixel.
    fn changes(&self, middle: &Probe, corners: &[Probe; 4], held: &[&Caster]) -> bool {
        corners.iter().any(|p| p.id != middle.id)
            || self.walks_off(middle, corners)
            || self.crossed(middle, corners, held)
    }

    /// Whether the surface that the middle meets has an edge that matters on the way to a corner.
    fn walks_off(&self, middle: &Probe, corners: &[Probe; 4]) -> bool {
        let Some(hit) = &middle.hit else {
            return false;
        };
        let Some(mesh) = self.patches.mesh(&self.scene.geometry, hit) else {
            return false;
        };
        corners.iter().any(|p| {
            let (moves, h) = offset(&middle.ray, &p.ray);
            let along = [middle.ray.origin(), middle.ray.direction(), h];
            matches!(mesh.walk(hit.prim, along, moves), Walk::Stopped(..))
        })
    }

    /// Whether an outline crosses the pixel, or something that no ray met may lie in it.
    fn crossed(&self, middle: &Probe, corners: &[Probe; 4], held: &[&Caster]) -> bool {
        let rays = corners.map(|p| p.ray);
        let beam = beam(&middle.ray, &rays);
        let all = || corners.iter().chain([middle]);
        let far = all().fold(0.0f64, |m, p| m.max(p.distance()));
        held.iter().any(|c| {
            let sight = beam.sight(&c.sphere, Order::Quadratic);
            if sight == Sight::Outside {
                return false;
            }
            let dist = (c.sphere.center - beam.o).length();
            let seen = all().any(|p| p.hit.is_some_and(|h| h.object.0 == c.object));
            if !seen && far < dist - c.sphere.radius {
                return false;
            }
            match sight {
                Sight::Straddles(_) if c.exact => true,
                _ => !seen && beam.width(dist) > SEARCH * c.sphere.radius,
            }
        })
    }
}

/// How ray `b` differs from ray `a`, and by what.
fn offset(a: &Ray, b: &Ray) -> (Moves, DVec3) {
    let turn = b.direction() - a.direction();
    let shift = b.origin() - a.origin();
    if shift.length_squared() > 0.0 {
        (Moves::Ray, shift)
    } else {
        (Moves::Target, turn)
    }
}

/// All rays between these corners.
fn beam(middle: &Ray, corners: &[Ray; 4]) -> Beam {
    let offsets = corners.map(|c| offset(middle, &c));
    let reach = offsets.iter().fold(0.0f64, |m, o| m.max(o.1.length()));
    Beam::new(middle, reach, 0.0, offsets[0].0)
}
