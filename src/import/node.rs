//! Nodes: lights, cameras and meshes where they stand. Meshes are read in parallel, each once.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
#[cfg(feature = "meshopt")]
use serde_json::Value;

use super::accessor::Source;
use super::dialect::Dialect;
#[cfg(feature = "draco")]
use super::draco;
use super::hierarchy::Hierarchy;
use super::json::Cursor;
use super::mesh::{Part, Shaping};
use super::skin::Skin;
#[cfg(feature = "meshopt")]
use super::unpacked::Users;
use super::{
    Notes, Problem, camera, implicit, instancing, light, mesh, morph, range, solid, tangents,
    variants,
};
use crate::color::units::LightUnits;
use crate::geometry::{MaterialId, ShapeId};
use crate::math::DAffine3;
use crate::scene::{MeshPlacement, SceneBuilder};

/// Walks the node tree and fills the scene.
pub(super) struct Walker<'a, 'b> {
    pub(super) source: &'b Source<'a>,
    /// Whose lamps the file's are.
    pub(super) lamps: Dialect,
    /// The units of the file's lights, resolved.
    pub(super) light_units: LightUnits,
    /// Which variant of the materials is shown, if any.
    pub(super) variant: Option<usize>,
    pub(super) hierarchy: Hierarchy<'a, 'b>,
    pub(super) materials: &'b [MaterialId],
    pub(super) default_material: MaterialId,
    /// Solid twins of glass without a volume.
    pub(super) solid: &'b HashMap<MaterialId, MaterialId>,
    /// Whether they are taken on open meshes, too.
    pub(super) open_too: bool,
    /// Objects that were placed with one.
    pub(super) made_solid: usize,
    pub(super) builder: &'b mut SceneBuilder,
    pub(super) notes: &'b mut Notes,
}

/// What a node hands down.
#[derive(Clone, Copy)]
struct Inherited {
    world: DAffine3,
    visible: bool,
}

/// What tells apart the shapes that one mesh can take: its index, its skin, its weights.
type MeshKey = (usize, Option<usize>, Vec<u64>);

/// A mesh in its pose.
struct Posed<'a> {
    mesh: Cursor<'a>,
    weights: Vec<f64>,
    skin: Option<Skin>,
    /// Indices of its primitives among the jobs, with their materials.
    parts: Vec<(usize, MaterialId)>,
    /// Its primitives enclose a volume together, though not each for itself.
    closed: bool,
}

/// A shape, and whether glass of this shape alone can be solid.
#[derive(Clone, Copy)]
struct Made {
    shape: ShapeId,
    solid: bool,
}

/// A mesh that is to be placed.
struct Use {
    name: String,
    /// Which of the posed meshes.
    posed: usize,
    worlds: Vec<DAffine3>,
    /// The node is a sphere, whatever its mesh is.
    sphere: Option<ShapeId>,
}

/// A primitive to be read.
struct Job<'a> {
    primitive: Cursor<'a>,
    posed: usize,
    /// Along what tangents are wanted.
    tangents: Option<tangents::Wanted>,
    name: String,
}

/// Meshes that were met on the way.
#[derive(Default)]
struct Met<'a> {
    uses: Vec<Use>,
    posed: Vec<Posed<'a>>,
    known: HashMap<MeshKey, usize>,
}

impl<'a> Walker<'a, '_> {
    /// Visits the nodes below `roots`. A tree can be deep, so this does not recurse; a node that
    /// is met twice is a cycle or a shared child, which glTF forbids.
    pub(super) fn walk(&mut self, roots: &[Cursor<'a>]) -> Result<(), Problem> {
        let mut seen = HashMap::new();
        let mut met = Met::default();
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
            // Who cannot be seen can still see.
            self.camera(&node, own.world)?;
            if own.visible {
                self.light(&node, own.world)?;
                self.surface(index, &node, own.world, &mut met)?;
            }
            for child in node.items("children")?.into_iter().rev() {
                stack.push((child, own));
            }
        }
        let jobs = self.jobs(&mut met.posed)?;
        let shapes = self.read(&jobs, &mut met.posed)?;
        for u in &met.uses {
            self.place_all(u, &met.posed[u.posed], &shapes);
        }
        Ok(())
    }

    /// Notes what surface a node carries.
    fn surface(
        &mut self,
        index: usize,
        node: &Cursor<'a>,
        world: DAffine3,
        met: &mut Met<'a>,
    ) -> Result<(), Problem> {
        let sphere = self.sphere(node)?;
        let Some(at) = node.get("mesh") else {
            if let Some(shape) = sphere {
                self.place(shape, self.default_material, world, node.name());
            }
            return Ok(());
        };
        let posed = self.posed(index, node, &at, met)?;
        let worlds = match node.extension("EXT_mesh_gpu_instancing") {
            None => vec![world],
            Some(e) => {
                let own = instancing::read(&e, self.source)?;
                own.into_iter().map(|w| world * w).collect()
            }
        };
        met.uses.push(Use {
            name: node.name(),
            posed,
            worlds,
            sphere,
        });
        Ok(())
    }

    fn camera(&mut self, node: &Cursor<'a>, world: DAffine3) -> Result<(), Problem> {
        if let Some(at) = node.get("camera") {
            let camera = self.source.root.element("cameras", at.index()?, &at)?;
            let desc = camera::read(&camera, node.name(), world, self.notes)?;
            let m = world.matrix3;
            if [m.x_axis, m.y_axis, m.z_axis]
                .iter()
                .any(|a| a.try_normalize().is_none())
            {
                let what = "cameras whose nodes have a scale of zero look nowhere and are left out";
                self.notes.add(what, 1);
                return Ok(());
            }
            self.builder.add_camera(desc);
        }
        Ok(())
    }

    fn light(&mut self, node: &Cursor<'a>, world: DAffine3) -> Result<(), Problem> {
        if let Some(at) = node
            .extension("KHR_lights_punctual")
            .and_then(|e| e.get("light"))
        {
            let desc = light::read(self, &at, node.name(), world)?;
            self.builder.add_light(desc);
        }
        if let Some(desc) = light::area(node, &node.name(), world, self.notes)? {
            self.builder.add_light(desc);
        }
        Ok(())
    }

    /// The sphere that a node is, if it says so.
    fn sphere(&mut self, node: &Cursor<'a>) -> Result<Option<ShapeId>, Problem> {
        let set = match implicit::by_extras(node)? {
            Some(set) => Some(set),
            None => implicit::shape(node, &self.source.root, self.notes)?,
        };
        Ok(set.map(|set| self.builder.add_spheres(set, &node.name())))
    }

    /// Which of the posed meshes a node has.
    fn posed(
        &mut self,
        index: usize,
        node: &Cursor<'a>,
        at: &Cursor<'a>,
        met: &mut Met<'a>,
    ) -> Result<usize, Problem> {
        let which = at.index()?;
        let mesh = self.source.root.element("meshes", which, at)?;
        let animated = self.hierarchy.pose(index).and_then(|p| p.weights.as_ref());
        let weights = morph::weights(animated, node, &mesh)?;
        let skin = node.get("skin");
        let skinned = skin.as_ref().map(Cursor::index).transpose()?;
        let bits = weights.iter().map(|w| w.to_bits()).collect();
        match met.known.entry((which, skinned, bits)) {
            Entry::Occupied(known) => return Ok(*known.get()),
            Entry::Vacant(free) => free.insert(met.posed.len()),
        };
        let hierarchy = &mut self.hierarchy;
        met.posed.push(Posed {
            mesh,
            weights,
            skin: match skin {
                Some(at) => Some(Skin::read(&at, self.source, |j| hierarchy.world(j))?),
                None => None,
            },
            parts: Vec::new(),
            closed: false,
        });
        Ok(met.posed.len() - 1)
    }

    /// Lists the primitives of all posed meshes, equal ones once.
    fn jobs(&mut self, posed: &mut [Posed<'a>]) -> Result<Vec<Job<'a>>, Problem> {
        let mut jobs: Vec<Job<'a>> = Vec::new();
        let mut known: HashMap<String, usize> = HashMap::new();
        for (i, m) in posed.iter_mut().enumerate() {
            for p in m.mesh.items("primitives")? {
                let at = variants::material(&p, self.variant)?;
                let material = match &at {
                    None => self.default_material,
                    Some(m) => *self
                        .materials
                        .get(m.index()?)
                        .ok_or_else(|| m.problem("names a material that does not exist"))?,
                };
                let tangents = match &at {
                    None => None,
                    Some(m) => {
                        let m = self.source.root.element("materials", m.index()?, m)?;
                        range::of_coordinates(&p, &m, self.notes);
                        tangents::wanted(&m)?
                    }
                };
                let pose = (m.skin.is_some() || !m.weights.is_empty()).then_some(i);
                let key = format!("{pose:?} {tangents:?} {}", Content(&p));
                let job = *known.entry(key).or_insert_with(|| {
                    jobs.push(Job {
                        primitive: p.clone(),
                        posed: i,
                        tangents,
                        name: m.mesh.name(),
                    });
                    jobs.len() - 1
                });
                m.parts.push((job, material));
            }
        }
        Ok(jobs)
    }

    /// Reads primitives on all threads. What comes of it, and which error is told, does not
    /// depend on their number.
    fn read(
        &mut self,
        jobs: &[Job<'a>],
        posed: &mut [Posed<'a>],
    ) -> Result<Vec<Option<Made>>, Problem> {
        let source = self.source;
        #[cfg(feature = "meshopt")]
        let users = {
            let accessors = jobs.iter().flat_map(Job::accessors);
            Users::new(&source.root, &source.views.unpacked, accessors)
        };
        let (order, next) = (in_order(jobs, source), AtomicUsize::new(0));
        let mut done: Vec<_> = (0..jobs.len())
            .into_par_iter()
            .map(|_| {
                let at = order[next.fetch_add(1, Ordering::Relaxed)];
                let (job, mut notes) = (&jobs[at], Notes::default());
                let part = job.read(source, &posed[job.posed], &mut notes);
                #[cfg(feature = "meshopt")]
                job.accessors().into_iter().for_each(|a| users.done(a));
                (at, part, notes)
            })
            .collect();
        done.sort_unstable_by_key(|(at, ..)| *at);
        let mut parts = Vec::new();
        for (_, part, notes) in done {
            self.notes.join(notes);
            parts.push(part?);
        }
        let closed = self.closed(&parts, posed);
        let made = parts.into_iter().zip(jobs).enumerate();
        Ok(made
            .map(|(i, (part, job))| {
                Some(match part? {
                    Part::Mesh(m) => Made {
                        solid: self.open_too || closed.contains(&i),
                        shape: self.builder.add_mesh(m, &job.name),
                    },
                    Part::Spheres(s) => Made {
                        solid: true,
                        shape: self.builder.add_spheres(s, &job.name),
                    },
                })
            })
            .collect())
    }

    /// Which of the primitives that glass covers enclose a volume by themselves; notes of the
    /// posed meshes with other glass whether they do as a whole.
    fn closed(&self, parts: &[Option<Part>], posed: &mut [Posed<'a>]) -> HashSet<usize> {
        let mesh = |job: usize| match &parts[job] {
            Some(Part::Mesh(m)) => Some(m),
            _ => None,
        };
        let mut known: HashMap<usize, bool> = HashMap::new();
        if self.open_too {
            return HashSet::new();
        }
        for p in posed {
            let glass = p.parts.iter().filter(|(_, m)| self.solid.contains_key(m));
            let mut open = false;
            for &(job, _) in glass {
                open |= !*known
                    .entry(job)
                    .or_insert_with(|| mesh(job).is_none_or(|m| solid::is_closed(&[m])));
            }
            if open && p.parts.len() > 1 {
                let all: Vec<_> = p.parts.iter().filter_map(|&(job, _)| mesh(job)).collect();
                p.closed = solid::is_closed(&all);
            }
        }
        let closed = known.into_iter().filter(|(_, closed)| *closed);
        closed.map(|(job, _)| job).collect()
    }

    fn place_all(&mut self, u: &Use, posed: &Posed<'a>, shapes: &[Option<Made>]) {
        // The transform of a skinned mesh's node does not count (glTF 2.0, 3.7.3.3).
        let skinned = posed.skin.as_ref();
        let skinned = skinned.map(|s| vec![DAffine3::from_translation(s.center)]);
        let worlds = skinned.as_ref().unwrap_or(&u.worlds);
        if let Some(shape) = u.sphere {
            let material = posed.parts.first().map_or(self.default_material, |p| p.1);
            let material = self.solid_or(material, true);
            for world in &u.worlds {
                self.place(shape, material, *world, u.name.clone());
            }
            return;
        }
        for &(job, material) in &posed.parts {
            if let Some(Made { shape, solid }) = shapes[job] {
                let material = self.solid_or(material, solid || posed.closed);
                for world in worlds {
                    self.place(shape, material, *world, u.name.clone());
                }
            }
        }
    }

    /// The material of a shape, or its solid twin where the shape can be solid.
    fn solid_or(&mut self, material: MaterialId, solid: bool) -> MaterialId {
        match self.solid.get(&material) {
            Some(&twin) if solid => {
                self.made_solid += 1;
                twin
            }
            _ => material,
        }
    }

    fn place(&mut self, shape: ShapeId, material: MaterialId, world: DAffine3, name: String) {
        self.builder.place(MeshPlacement {
            shape,
            material,
            world_from_object: world,
            name,
        });
    }
}

impl<'a> Job<'a> {
    /// The accessors that it reads.
    #[cfg(feature = "meshopt")]
    fn accessors(&self) -> Vec<usize> {
        let p = &self.primitive;
        let targets = p.items("targets").unwrap_or_default();
        let maps = p.get("attributes").into_iter().chain(targets);
        let values = maps.filter_map(|m| m.value().as_object().map(|o| o.values()));
        let mut all: Vec<_> = values.flatten().filter_map(Value::as_u64).collect();
        all.extend(p.get("indices").and_then(|i| i.value().as_u64()));
        all.into_iter().map(|i| i as usize).collect()
    }

    fn read(
        &self,
        source: &Source<'a>,
        posed: &Posed<'a>,
        notes: &mut Notes,
    ) -> Result<Option<Part>, Problem> {
        let shaping = Shaping {
            weights: &posed.weights,
            skin: posed.skin.as_ref(),
        };
        let mut part = mesh::read(&self.primitive, source, shaping, notes)?;
        if let (Some(Part::Mesh(m)), Some(wanted)) = (&mut part, self.tangents)
            && !tangents::complete(m, wanted)
        {
            notes.add(tangents::CROWDED, 1);
        }
        Ok(part)
    }
}

/// In which order the jobs are begun: first what takes the most memory while it is decoded, since the
/// least is there beside it then. Others stay as they come.
#[cfg(feature = "draco")]
fn in_order(jobs: &[Job<'_>], source: &Source<'_>) -> Vec<usize> {
    let sizes = draco::sizes(&source.root, jobs.iter().map(|j| &j.primitive));
    let mut order: Vec<usize> = (0..jobs.len()).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(sizes[i]));
    order
}

#[cfg(not(feature = "draco"))]
fn in_order(jobs: &[Job<'_>], _: &Source<'_>) -> Vec<usize> {
    (0..jobs.len()).collect()
}

/// All of a primitive that says something about its shape, as text.
struct Content<'c, 'a>(&'c Cursor<'a>);

impl std::fmt::Display for Content<'_, '_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for key in ["mode", "attributes", "indices", "targets"] {
            if let Some(part) = self.0.get(key) {
                write!(f, "{key} {} ", part.value())?;
            }
        }
        for name in [implicit::NAME, mesh::DRACO] {
            if let Some(e) = self.0.extension(name) {
                write!(f, "{name} {} ", e.value())?;
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
