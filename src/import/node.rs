//! Nodes: where things stand.

use std::collections::HashMap;

use super::accessor::Source;
use super::hierarchy::Hierarchy;
use super::json::Cursor;
use super::mesh::Part;
use super::skin::Skin;
use super::{Notes, Problem, camera, light, mesh, morph, tangents, variants};
use crate::color::units::LightUnits;
use crate::geometry::{MaterialId, ShapeId, SphereSet, TriangleMesh};
use crate::math::DAffine3;
use crate::scene::{MeshPlacement, SceneBuilder};

/// Walks the node tree and fills the scene.
pub(super) struct Walker<'a, 'b> {
    pub(super) source: &'b Source<'a>,
    /// The units of the file's lights, resolved.
    pub(super) light_units: LightUnits,
    /// Which variant of the materials is shown, if any.
    pub(super) variant: Option<usize>,
    pub(super) hierarchy: Hierarchy<'a, 'b>,
    pub(super) materials: &'b [MaterialId],
    pub(super) default_material: MaterialId,
    pub(super) builder: &'b mut SceneBuilder,
    pub(super) notes: &'b mut Notes,
    /// Shapes of a mesh that was met before, with their materials, by mesh and the weights of
    /// its morph targets.
    pub(super) meshes: HashMap<(usize, Vec<u64>), Parts>,
}

/// The shapes of a mesh with their materials.
type Parts = Vec<(ShapeId, MaterialId)>;

/// What a node hands down.
#[derive(Clone, Copy)]
struct Inherited {
    world: DAffine3,
    visible: bool,
}

impl<'a> Walker<'a, '_> {
    /// Visits a node and everything below it. A tree can be deep, so this does not recurse; a
    /// node that is met twice is a cycle or a shared child, which glTF forbids.
    pub(super) fn walk(&mut self, roots: &[Cursor<'a>]) -> Result<(), Problem> {
        let mut seen = HashMap::new();
        let top = Inherited {
            world: DAffine3::IDENTITY,
            visible: true,
        };
        let mut stack: Vec<(Cursor<'a>, Inherited)> =
            roots.iter().rev().map(|r| (r.clone(), top)).collect();
        while let Some((at, parent)) = stack.pop() {
            let index = at.index()?;
            if let Some(before) = seen.insert(index, at.path().to_owned()) {
                return Err(at.problem(format!("node {index} is a child already (of {before})")));
            }
            let node = self.source.root.element("nodes", index, &at)?;
            let own = Inherited {
                world: parent.world * self.hierarchy.local(index, &node)?,
                visible: parent.visible && is_visible(&node)?,
            };
            self.visit(index, &node, own)?;
            for child in node.items("children")?.into_iter().rev() {
                stack.push((child, own));
            }
        }
        Ok(())
    }

    fn visit(&mut self, index: usize, node: &Cursor<'a>, own: Inherited) -> Result<(), Problem> {
        let (name, world) = (node.name(), own.world);
        // Who cannot be seen can still see.
        if let Some(at) = node.get("camera") {
            let camera = self.source.root.element("cameras", at.index()?, &at)?;
            let desc = camera::read(&camera, name.clone(), world)?;
            self.builder.add_camera(desc);
        }
        if !own.visible {
            return Ok(());
        }
        if let Some(at) = node
            .extension("KHR_lights_punctual")
            .and_then(|e| e.get("light"))
        {
            let desc = light::read(self, &at, name.clone(), world)?;
            self.builder.add_light(desc);
        }
        let Some(at) = node.get("mesh") else {
            return Ok(());
        };
        let mesh = self.source.root.element("meshes", at.index()?, &at)?;
        let posed = self.hierarchy.pose(index).and_then(|p| p.weights.as_ref());
        let weights = morph::weights(posed, node, &mesh)?;
        if let Some(at) = node.get("skin") {
            let hierarchy = &mut self.hierarchy;
            let skin = Skin::read(&at, self.source, |joint| hierarchy.world(joint))?;
            let shaping = mesh::Shaping {
                weights: &weights,
                skin: Some(&skin),
            };
            // The node's own transform does not count (glTF 2.0, 3.7.3.3).
            let world = DAffine3::from_translation(skin.center);
            for (shape, material) in self.read(&mesh, shaping)? {
                self.place(shape, material, world, name.clone());
            }
            return Ok(());
        }
        let parts = self.mesh(at.index()?, &mesh, &weights)?;
        if let Some(radius) = node.get("extras").and_then(|e| e.get("sphere_radius")) {
            let r = radius.f64()?;
            if !(r > 0.0) {
                return Err(radius.problem(format!("{r} is not a positive radius")));
            }
            let material = parts.first().map_or(self.default_material, |p| p.1);
            let set = SphereSet {
                spheres: vec![[0.0, 0.0, 0.0, r as f32]],
            };
            let shape = self.builder.add_spheres(set, &name);
            self.place(shape, material, world, name);
            return Ok(());
        }
        for (shape, material) in parts {
            self.place(shape, material, world, name.clone());
        }
        Ok(())
    }

    fn place(&mut self, shape: ShapeId, material: MaterialId, world: DAffine3, name: String) {
        self.builder.place(MeshPlacement {
            shape,
            material,
            world_from_object: world,
            name,
        });
    }

    /// The shapes of a mesh, read once for the same weights of its morph targets.
    fn mesh(&mut self, index: usize, mesh: &Cursor<'a>, weights: &[f64]) -> Result<Parts, Problem> {
        let key = (index, weights.iter().map(|w| w.to_bits()).collect());
        if let Some(known) = self.meshes.get(&key) {
            return Ok(known.clone());
        }
        let shaping = mesh::Shaping {
            weights,
            skin: None,
        };
        let parts = self.read(mesh, shaping)?;
        self.meshes.insert(key, parts.clone());
        Ok(parts)
    }

    fn read(&mut self, mesh: &Cursor<'a>, shaping: mesh::Shaping<'_>) -> Result<Parts, Problem> {
        let mut parts = Vec::new();
        for p in mesh.items("primitives")? {
            let at = variants::material(&p, self.variant)?;
            let material = match &at {
                None => self.default_material,
                Some(m) => *self
                    .materials
                    .get(m.index()?)
                    .ok_or_else(|| m.problem("names a material that does not exist"))?,
            };
            let shape = match mesh::read(&p, self.source, shaping, self.notes)? {
                Some(Part::Mesh(mut triangles)) => {
                    self.complete(&mut triangles, at.as_ref())?;
                    self.builder.add_mesh(triangles, &mesh.name())
                }
                Some(Part::Spheres(set)) => self.builder.add_spheres(set, &mesh.name()),
                None => continue,
            };
            parts.push((shape, material));
        }
        Ok(parts)
    }

    /// Adds the tangents that a material needs, given by where its index stands.
    fn complete(
        &mut self,
        triangles: &mut TriangleMesh,
        material: Option<&Cursor<'a>>,
    ) -> Result<(), Problem> {
        if let Some(m) = material {
            let material = self.source.root.element("materials", m.index()?, m)?;
            let set = tangents::wanted(&material)?;
            if set.is_some_and(|set| !tangents::complete(triangles, set)) {
                self.notes.add(tangents::CROWDED, 1);
            }
        }
        Ok(())
    }
}

/// Whether a node lets itself and what is below be seen (`KHR_node_visibility`).
fn is_visible(node: &Cursor<'_>) -> Result<bool, Problem> {
    match node
        .extension("KHR_node_visibility")
        .and_then(|e| e.get("visible"))
    {
        None => Ok(true),
        Some(c) => c
            .value()
            .as_bool()
            .ok_or_else(|| c.problem("is not true or false")),
    }
}
