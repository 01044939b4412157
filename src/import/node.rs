//! Nodes: where things stand.

use std::collections::HashMap;

use super::accessor::Source;
use super::json::Cursor;
use super::mesh::Part;
use super::{Notes, Problem, camera, light, mesh, tangents};
use crate::color::units::LightUnits;
use crate::geometry::{MaterialId, ShapeId, SphereSet, TriangleMesh};
use crate::math::{DAffine3, DMat4, DQuat, DVec3};
use crate::scene::{MeshPlacement, SceneBuilder};

/// Walks the node tree and fills the scene.
pub(super) struct Walker<'a, 'b> {
    pub(super) source: &'b Source<'a>,
    /// The units of the file's lights, resolved.
    pub(super) light_units: LightUnits,
    pub(super) materials: &'b [MaterialId],
    pub(super) default_material: MaterialId,
    pub(super) builder: &'b mut SceneBuilder,
    pub(super) notes: &'b mut Notes,
    /// Shapes of a mesh that was met before, with their materials.
    pub(super) meshes: HashMap<usize, Vec<(ShapeId, MaterialId)>>,
}

impl<'a> Walker<'a, '_> {
    /// Visits a node and everything below it. A tree can be deep, so this does not recurse; a
    /// node that is met twice is a cycle or a shared child, which glTF forbids.
    pub(super) fn walk(&mut self, roots: &[Cursor<'a>]) -> Result<(), Problem> {
        let mut seen = HashMap::new();
        let mut stack: Vec<(Cursor<'a>, DAffine3)> = roots
            .iter()
            .rev()
            .map(|r| (r.clone(), DAffine3::IDENTITY))
            .collect();
        while let Some((at, parent)) = stack.pop() {
            let index = at.index()?;
            if let Some(before) = seen.insert(index, at.path().to_owned()) {
                return Err(at.problem(format!("node {index} is a child already (of {before})")));
            }
            let node = self.source.root.element("nodes", index, &at)?;
            let world = parent * transform(&node)?;
            self.visit(&node, world)?;
            for child in node.items("children")?.into_iter().rev() {
                stack.push((child, world));
            }
        }
        Ok(())
    }

    fn visit(&mut self, node: &Cursor<'a>, world: DAffine3) -> Result<(), Problem> {
        let name = node.name();
        if node.get("skin").is_some() {
            self.notes
                .add("skins are not supported yet: the bind pose is used", 1);
        }
        if let Some(at) = node.get("camera") {
            let camera = self.source.root.element("cameras", at.index()?, &at)?;
            let desc = camera::read(&camera, name.clone(), world)?;
            self.builder.add_camera(desc);
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
        let parts = self.mesh(&at)?;
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

    /// The shapes of a mesh, read once.
    fn mesh(&mut self, at: &Cursor<'a>) -> Result<Vec<(ShapeId, MaterialId)>, Problem> {
        let index = at.index()?;
        if let Some(known) = self.meshes.get(&index) {
            return Ok(known.clone());
        }
        let mesh = self.source.root.element("meshes", index, at)?;
        let mut parts = Vec::new();
        for p in mesh.items("primitives")? {
            let material = match p.get("material") {
                None => self.default_material,
                Some(m) => *self
                    .materials
                    .get(m.index()?)
                    .ok_or_else(|| m.problem("names a material that does not exist"))?,
            };
            let shape = match mesh::read(&p, self.source, self.notes)? {
                Some(Part::Mesh(mut triangles)) => {
                    self.complete(&mut triangles, &p)?;
                    self.builder.add_mesh(triangles, &mesh.name())
                }
                Some(Part::Spheres(set)) => self.builder.add_spheres(set, &mesh.name()),
                None => continue,
            };
            parts.push((shape, material));
        }
        self.meshes.insert(index, parts.clone());
        Ok(parts)
    }

    /// Adds the tangents that the material of a primitive needs.
    fn complete(&mut self, triangles: &mut TriangleMesh, p: &Cursor<'a>) -> Result<(), Problem> {
        if let Some(m) = p.get("material") {
            let material = self.source.root.element("materials", m.index()?, &m)?;
            let set = tangents::wanted(&material)?;
            if set.is_some_and(|set| !tangents::complete(triangles, set)) {
                self.notes.add(tangents::CROWDED, 1);
            }
        }
        Ok(())
    }
}

/// The node's own transform.
fn transform(node: &Cursor<'_>) -> Result<DAffine3, Problem> {
    if node.get("matrix").is_some() {
        let m: [f64; 16] = node.numbers_or("matrix", DMat4::IDENTITY.to_cols_array())?;
        return Ok(DAffine3::from_mat4(DMat4::from_cols_array(&m)));
    }
    let t = node.numbers_or("translation", [0.0; 3])?;
    let r: [f64; 4] = node.numbers_or("rotation", [0.0, 0.0, 0.0, 1.0])?;
    let s = node.numbers_or("scale", [1.0; 3])?;
    let q = DQuat::from_array(r);
    let q = if q.length_squared() > 0.0 {
        q.normalize()
    } else {
        DQuat::IDENTITY
    };
    Ok(DAffine3::from_scale_rotation_translation(
        DVec3::from_array(s),
        q,
        DVec3::from_array(t),
    ))
}
