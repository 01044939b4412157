//! What a scene holds: the counts that the survey of effects and `inspect` read.

use super::Scene;
use crate::cameras::CameraDesc;
use crate::geometry::{ObjectId, Shape};
use crate::materials::{Features, MaterialTraits};

/// Counts of what is in a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Census {
    /// Distinct shapes.
    pub shapes: usize,
    /// Placed shapes.
    pub objects: usize,
    /// Placed shapes that are instances.
    pub instances: usize,
    /// Distinct triangles in memory.
    pub triangles: u64,
    /// Triangles as seen, instances counted each.
    pub placed_triangles: u64,
    /// Analytic spheres as seen.
    pub spheres: u64,
    /// Materials that some object uses.
    pub materials: usize,
    /// Lights by kind: name and count.
    pub lights: Vec<(&'static str, usize)>,
    /// Upper bounds over all materials that some object uses.
    pub traits: MaterialTraits,
    /// Objects whose material reflects like a mirror or transmits.
    pub specular_objects: usize,
    /// Those of them that a light may reach, by its range.
    pub lit_specular_objects: usize,
    /// Those of them that do so [sharply](MaterialTraits::is_sharp).
    pub sharp_objects: usize,
    /// Lights without extent.
    pub delta_lights: usize,
    /// Features of each material that some object uses.
    pub material_features: Vec<Features>,
    /// Cameras with an aperture.
    pub lenses: usize,
    /// Whether some body absorbs light on its way.
    pub absorbs: bool,
}

impl Census {
    /// Counts what is in `scene`.
    pub fn new(scene: &Scene) -> Self {
        let g = &scene.geometry;
        let mut c = Self {
            shapes: g.shapes.len(),
            objects: g.objects.len(),
            delta_lights: scene.lights.iter().filter(|l| l.is_delta()).count(),
            ..Self::default()
        };
        c.traits.roughness = f64::INFINITY;
        for shape in &g.shapes {
            if let Shape::Mesh(m) = shape {
                c.triangles += m.indices.len() as u64;
            }
        }
        let mut used = vec![false; scene.materials.len()];
        for (i, o) in g.objects.iter().enumerate() {
            c.instances += usize::from(o.placement.is_some());
            match g.shape(o.shape) {
                Shape::Mesh(m) => c.placed_triangles += m.indices.len() as u64,
                Shape::Spheres(s) => c.spheres += s.spheres.len() as u64,
            }
            used[o.material.index()] = true;
            let material = scene.material(o.material);
            let t = material.traits();
            if t.reflects || t.transmits {
                c.specular_objects += 1;
                c.lit_specular_objects += usize::from(lit(scene, ObjectId(i as u32)));
            }
            c.sharp_objects += usize::from(t.is_sharp());
            c.absorbs |= material.interior().is_some();
            c.traits = MaterialTraits {
                diffuse: c.traits.diffuse.max(t.diffuse),
                reflects: c.traits.reflects || t.reflects,
                transmits: c.traits.transmits || t.transmits,
                refracts: c.traits.refracts || t.refracts,
                roughness: match t.reflects || t.transmits {
                    true => c.traits.roughness.min(t.roughness),
                    false => c.traits.roughness,
                },
            };
        }
        c.materials = used.iter().filter(|u| **u).count();
        let all = scene.material_features.iter().zip(&used);
        c.material_features = all.filter(|(_, used)| **used).map(|(f, _)| *f).collect();
        let wide = |c: &&CameraDesc| c.lens.is_some_and(|lens| lens.radius > 0.0);
        c.lenses = scene.cameras.iter().filter(wide).count();
        for (_, kind) in &scene.light_names {
            match c.lights.iter_mut().find(|(k, _)| k == kind) {
                Some((_, n)) => *n += 1,
                None => c.lights.push((kind, 1)),
            }
        }
        c
    }
}

/// Whether some light may reach an object: none of a limited range does that is farther away.
fn lit(scene: &Scene, id: ObjectId) -> bool {
    scene.lights.iter().any(|light| {
        let at = match light.is_delta() && light.range() < f64::INFINITY {
            true => light.sample_origin([0.5; 2]).map(|from| from.p),
            false => None,
        };
        at.is_none_or(|at| {
            let around = scene.bounding_sphere(id);
            let distance = (at - around.center).length() - around.radius;
            distance < light.range() * (1.0 + 1e-6)
        })
    })
}
