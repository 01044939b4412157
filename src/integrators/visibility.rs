//! Which lights reach which parts of the scene, learnt from a few trials before rendering: a sun
//! that the roof keeps out would otherwise take nearly all shadow rays of a room.
//!
//! Only probabilities of choosing a light depend on it, none is zero, and light sampling divides
//! by them: trials that are wrong cost noise, never light.

use super::Spacing;
use super::trials::walk;
use crate::accel::Accelerator;
use crate::cameras::Camera;
use crate::geometry::SurfacePoint;
use crate::math::DVec3;
use crate::sampling::Sampler;
use crate::scene::Scene;

/// Cells along each edge of the box around what the trials met.
const CELLS: usize = 24;

/// Share of the trials, at either end of each axis, that lies outside of that box.
const OUTLIERS: f64 = 0.02;

/// Least part of its weight that a light keeps.
const LEAST: f32 = 0.01;

/// The share of each light that points see, by cells of space.
#[derive(Debug, Default)]
pub struct Visibility {
    lights: usize,
    low: DVec3,
    /// Cells per metre along each axis.
    scale: DVec3,
    /// Row of each cell; the first, of the whole scene, where no trial was.
    rows: Vec<u32>,
    seen: Vec<f32>,
}

/// A place that was tried, and the lights that could shine on it and did.
struct Trial {
    p: DVec3,
    lights: Vec<Option<bool>>,
}

impl Visibility {
    /// By trials at what the camera sees and at what diffuse bounces reach from there. Nothing is
    /// tried where there is nothing to choose.
    pub fn learn(
        scene: &Scene,
        accel: &dyn Accelerator,
        camera: &dyn Camera,
        spacing: &Spacing,
        seed: u64,
    ) -> Self {
        if !scene.choose_light.weighs() {
            return Self::default();
        }
        let mut trials = Vec::new();
        walk(scene, accel, camera, spacing, seed, |met, sampler| {
            trials.extend(met.map(|sp| try_lights(scene, accel, sp, sampler)));
        });
        Self::of(&trials, scene.lights.len())
    }

    fn of(trials: &[Trial], lights: usize) -> Self {
        if trials.is_empty() {
            return Self::default();
        }
        // Whoever sees the horizon still wants cells where most things are.
        let cut = (OUTLIERS * trials.len() as f64) as usize;
        let range = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
            let mut x: Vec<f64> = trials.iter().map(|t| t.p.dot(axis)).collect();
            x.sort_by(f64::total_cmp);
            [x[cut], x[x.len() - 1 - cut]]
        });
        let low = DVec3::from_array(range.map(|[lo, _]| lo));
        let extent = DVec3::from_array(range.map(|[lo, hi]| hi - lo));
        let per_metre = |e: f64| if e > 0.0 { CELLS as f64 / e } else { 0.0 };
        let mut out = Self {
            lights,
            low,
            scale: DVec3::new(
                per_metre(extent.x),
                per_metre(extent.y),
                per_metre(extent.z),
            ),
            rows: vec![0; CELLS * CELLS * CELLS],
            seen: Vec::new(),
        };
        // Tries and successes of the whole scene, then of each cell that has any.
        let mut counts = vec![[0u32; 2]; lights];
        for t in trials {
            let cell = out.cell(t.p);
            if out.rows[cell] == 0 {
                out.rows[cell] = (counts.len() / lights) as u32;
                counts.resize(counts.len() + lights, [0; 2]);
            }
            for row in [0, out.rows[cell] as usize] {
                for (count, tried) in counts[row * lights..].iter_mut().zip(&t.lights) {
                    if let Some(seen) = tried {
                        count[0] += 1;
                        count[1] += u32::from(*seen);
                    }
                }
            }
        }
        let share =
            |[tried, seen]: [u32; 2], before: f32| (seen as f32 + before) / (tried as f32 + 1.0);
        let whole: Vec<f32> = counts[..lights].iter().map(|&c| share(c, 1.0)).collect();
        out.seen = counts
            .chunks(lights)
            .flat_map(|row| row.iter().zip(&whole))
            // Few trials say little: the whole scene speaks as one more.
            .map(|(&c, &whole)| LEAST + (1.0 - LEAST) * share(c, whole))
            .collect();
        out
    }

    #[inline]
    fn cell(&self, p: DVec3) -> usize {
        let q = (p - self.low) * self.scale;
        // What lies outside belongs to the cell next to it; a conversion saturates.
        let index = |x: f64| (x as usize).min(CELLS - 1);
        (index(q.z) * CELLS + index(q.y)) * CELLS + index(q.x)
    }

    /// What points around `p` see of each light; `None` if there is nothing to choose.
    #[inline]
    pub(super) fn at(&self, p: DVec3) -> Option<&[f32]> {
        if self.rows.is_empty() {
            return None;
        }
        let row = self.rows[self.cell(p)] as usize * self.lights;
        self.seen.get(row..row + self.lights)
    }
}

/// One shadow ray toward each light that could shine on the side of a surface that was met.
fn try_lights(
    scene: &Scene,
    accel: &dyn Accelerator,
    sp: &SurfacePoint,
    sampler: &mut Sampler,
) -> Trial {
    let lights = scene.lights.iter().map(|light| {
        let li = light.sample_li(sp.p, sampler.next_2d())?;
        if (li.wi.dot(sp.ng) > 0.0) != sp.front {
            return None;
        }
        Some(!accel.occluded(&sp.spawn_toward(li.wi, li.target)))
    });
    Trial {
        p: sp.p,
        lights: lights.collect(),
    }
}
