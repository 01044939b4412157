//! What light sees of a scene, as numbers that tell it from others: names and cameras are left out.

use std::fmt::{self, Write};
use std::sync::Arc;

use bytemuck::{NoUninit, cast_slice};
use rayon::prelude::*;
use twox_hash::xxhash3_128::Hasher;

use super::Scene;
use crate::geometry::Shape;
use crate::lights::{LightDesc, SkyImage};
use crate::materials::MaterialDesc;

/// Numbers that depend on every bit of what they stand for (XXH3, 128 bits). They are those of one
/// kind of machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprints {
    /// Shapes and where they stand, with the materials and lights that they have.
    pub geometry: u128,
    /// Parameters of materials.
    pub materials: u128,
    /// Texels of all textures.
    pub textures: u128,
    /// Lights that are no surfaces, with the texels of skies.
    pub lights: u128,
}

/// What the builder remembers of descriptions that the finished scene no longer has.
#[derive(Default)]
pub(super) struct Recipe {
    materials: Digest,
    lights: Digest,
    skies: Vec<Arc<SkyImage>>,
}

impl Recipe {
    pub(super) fn add_material(&mut self, kind: &str, desc: &MaterialDesc) {
        let nameless = MaterialDesc {
            name: String::new(),
            ..desc.clone()
        };
        self.materials.describe(&(kind, nameless));
    }

    pub(super) fn add_light(&mut self, desc: &LightDesc) {
        self.skies.extend(desc.sky.clone());
        let nameless = LightDesc {
            name: String::new(),
            seen_by_camera: true,
            sky: None,
            ..desc.clone()
        };
        self.lights.describe(&nameless);
    }
}

/// A fingerprint in the making.
#[derive(Default)]
struct Digest(Hasher);

impl Digest {
    /// Adds numbers, and how many.
    fn numbers<T: NoUninit>(&mut self, numbers: &[T]) {
        self.0.write(&(numbers.len() as u64).to_le_bytes());
        self.0.write(cast_slice(numbers));
    }

    /// Adds what the debugger would be told: all fields, and numbers with all their digits.
    fn describe(&mut self, value: &impl fmt::Debug) {
        // Writing to a hasher does not fail.
        let _ = write!(self, "{value:?};");
    }
}

impl Write for Digest {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}

fn shape(shape: &Shape) -> u128 {
    let mut digest = Digest::default();
    match shape {
        Shape::Mesh(m) => {
            digest.numbers(&m.positions);
            digest.numbers(&m.indices);
            digest.numbers(&m.normals);
            digest.numbers(&m.colors);
            digest.numbers(&m.tangents);
            for uvs in &m.uv_sets {
                digest.numbers(uvs);
            }
        }
        Shape::Spheres(s) => digest.numbers(&s.spheres),
    }
    digest.0.finish_128()
}

impl Scene {
    /// The fingerprints of what light sees.
    pub fn fingerprints(&self) -> Fingerprints {
        let mut geometry = Digest::default();
        let shapes: Vec<u128> = self.geometry.shapes.par_iter().map(shape).collect();
        geometry.numbers(&shapes);
        geometry.describe(&self.center);
        for o in &self.geometry.objects {
            geometry.describe(&(o.shape, o.placement, o.material, o.light));
        }
        let mut textures = Digest::default();
        let mut seen: Vec<*const crate::textures::Image> = Vec::new();
        for t in &self.textures {
            let image = Arc::as_ptr(&t.image);
            let number = seen.iter().position(|s| *s == image);
            textures.describe(&number.unwrap_or(seen.len()));
            if number.is_none() {
                seen.push(image);
                textures.numbers(t.image.texels().as_bytes());
            }
        }
        let mut lights = Digest(self.recipe.lights.0.clone());
        for sky in &self.recipe.skies {
            lights.describe(&(sky.width(), sky.height()));
            lights.numbers(sky.texels());
        }
        Fingerprints {
            geometry: geometry.0.finish_128(),
            materials: self.recipe.materials.0.finish_128(),
            textures: textures.0.finish_128(),
            lights: lights.0.finish_128(),
        }
    }
}
