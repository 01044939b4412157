//! The one way to make a [`Scene`].
//!
//! Shapes come in their own space with placements in `f64`. What is placed once is moved to
//! world space; what is placed more often stays an instance. In a scene far from the origin all
//! positions are taken relative to its centre before they are rounded to single precision, so
//! that it keeps its digits.

use std::borrow::Cow;
use std::sync::Arc;

use super::bake;
use super::emitters::{surface_light, vary};
use super::fingerprint::Recipe;
use super::{LightChoice, Media, Scene};
use crate::cameras::CameraDesc;
use crate::color::Rgb;
use crate::error::{Error, Result};

use crate::geometry::{
    Coverage, Geometry, Invalid, LightId, MaterialId, ObjectId, Shape, ShapeId, SphereSet,
    TriangleMesh,
};
use crate::lights::{LightDesc, LightEntry};
use crate::materials::{Features, Material, MaterialDesc, MaterialEntry, Medium};
use crate::math::{Aabb, DAffine3, DVec3};
use crate::registry::Table;
use crate::textures::Texture;

/// The plugin tables that a scene is built with.
#[derive(Clone, Debug)]
pub struct ScenePlugins {
    /// Kinds of materials.
    pub materials: Table<MaterialEntry>,
    /// Kinds of lights.
    pub lights: Table<LightEntry>,
}

impl Default for ScenePlugins {
    fn default() -> Self {
        Self {
            materials: Table::new(crate::materials::MATERIALS),
            lights: Table::new(crate::lights::LIGHTS),
        }
    }
}

/// What a surface emits.
#[derive(Clone, Debug)]
pub struct Emission {
    /// Radiance in W/(m²·sr).
    pub radiance: Rgb,
    /// The texture that it is multiplied by.
    pub texture: Option<Texture>,
    /// Whether the back emits too.
    pub double_sided: bool,
}

/// A shape to be placed.
#[derive(Clone, Debug)]
pub struct MeshPlacement {
    /// Which shape.
    pub shape: ShapeId,
    /// Its material.
    pub material: MaterialId,
    /// World from the shape's space.
    pub world_from_object: DAffine3,
    /// Name of the node.
    pub name: String,
}

/// What is left out of a scene although it is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Omit {
    /// Features of materials.
    pub features: Features,
    /// Light from all around.
    pub environment: bool,
    /// Apertures of cameras.
    pub lens: bool,
}

/// Collects the parts of a scene.
#[derive(Default)]
pub struct SceneBuilder {
    plugins: ScenePlugins,
    omit: Omit,
    features: Vec<Features>,
    shapes: Vec<Shape>,
    materials: Vec<(
        Box<dyn Material>,
        String,
        Option<Emission>,
        Option<Arc<dyn Coverage>>,
        Option<Medium>,
    )>,
    /// Of each material, those that are averaged over what a sample sees.
    textures: Vec<Vec<Texture>>,
    placements: Vec<MeshPlacement>,
    lights: Vec<LightDesc>,
    cameras: Vec<CameraDesc>,
    recipe: Recipe,
    warnings: Vec<String>,
    notes: Vec<String>,
}

impl SceneBuilder {
    /// An empty scene that will be built with the given plugins.
    pub fn new(plugins: ScenePlugins) -> Self {
        Self {
            plugins,
            ..Self::default()
        }
    }

    /// Leaves something out of all that is added from now on.
    pub fn leave_out(&mut self, omit: Omit) {
        self.omit = omit;
    }

    /// Adds something the user should know.
    pub fn warn(&mut self, message: impl Into<String>) {
        self.warnings.push(message.into());
    }

    /// Adds a decision the user may like to know.
    pub fn inform(&mut self, message: impl Into<String>) {
        self.notes.push(message.into());
    }

    /// Adds triangles in their own space; `name` is for the warning about dropped ones.
    pub fn add_mesh(&mut self, mut mesh: TriangleMesh, name: &str) -> ShapeId {
        let dropped = mesh.drop_invalid();
        self.report(dropped, "triangles", name);
        self.push_shape(Shape::Mesh(mesh))
    }

    /// Adds spheres in their own space.
    pub fn add_spheres(&mut self, mut set: SphereSet, name: &str) -> ShapeId {
        let dropped = set.drop_invalid();
        self.report(dropped, "spheres", name);
        self.push_shape(Shape::Spheres(set))
    }

    fn push_shape(&mut self, shape: Shape) -> ShapeId {
        self.shapes.push(shape);
        ShapeId(self.shapes.len() as u32 - 1)
    }

    fn report(&mut self, d: Invalid, what: &str, name: &str) {
        if d.total() > 0 {
            self.warnings.push(format!(
                "{name}: dropped {} invalid {what} ({} with indices out of range, {} with NaN, \
                 infinite or huge coordinates, {} without extent)",
                d.total(),
                d.index,
                d.coordinate,
                d.degenerate
            ));
        }
    }

    /// Adds a material: of the kind that its extras name (`{"dualight_material": name}`), or else
    /// of the first kind that claims it.
    ///
    /// # Errors
    /// An unknown kind, or a parameter that the kind rejects.
    pub fn add_material(&mut self, desc: &MaterialDesc) -> Result<MaterialId> {
        let cut;
        let desc = match self.omit.features.is_empty() {
            true => desc,
            false => {
                cut = desc.without(self.omit.features);
                &cut
            }
        };
        let named = desc.extras.get("dualight_material");
        // What a kind of one's own makes of a texture is not known.
        let desc = &*match named {
            Some(_) => Cow::Borrowed(desc),
            None => desc.without_idle_textures(),
        };
        let table = &self.plugins.materials;
        let entry = match named {
            Some(kind) => table.find(kind.as_str().unwrap_or_default())?,
            None => table
                .entries()
                .iter()
                .find(|e| (e.claims)(desc))
                .ok_or_else(|| Error::Usage(format!("no material kind fits '{}'", desc.name)))?,
        };
        let material = (entry.build)(desc)
            .map_err(|e| Error::Usage(format!("material '{}': {e}", desc.name)))?;
        let emission = (!desc.emission.is_black()).then_some(Emission {
            radiance: desc.emission,
            texture: desc.textures.as_ref().and_then(|t| t.emissive.clone()),
            double_sided: desc.double_sided,
        });
        let medium = desc
            .medium()
            .map_err(|e| Error::Usage(format!("material '{}': {e}", desc.name)))?
            .filter(|_| material.traits().transmits);
        self.materials.push((
            material,
            desc.name.clone(),
            emission,
            desc.coverage(),
            medium,
        ));
        self.recipe.add_material(entry.name, desc);
        self.features.push(desc.features());
        let slots = desc.textures.as_ref();
        self.textures.push(match slots {
            Some(slots) if named.is_some() || slots.are_filtered(desc.base_color) => {
                slots.iter().map(|(_, t)| t.clone()).collect()
            }
            _ => Vec::new(),
        });
        Ok(MaterialId(self.materials.len() as u32 - 1))
    }

    /// Places a shape in the world.
    pub fn place(&mut self, placement: MeshPlacement) {
        self.placements.push(placement);
    }

    /// Adds a light without surface; its `scene` is filled in later.
    pub fn add_light(&mut self, desc: LightDesc) {
        if !(self.omit.environment && desc.kind == "environment") {
            self.recipe.add_light(&desc);
            self.lights.push(desc);
        }
    }

    /// Adds a camera.
    pub fn add_camera(&mut self, mut desc: CameraDesc) {
        if self.omit.lens {
            desc.lens = None;
        }
        self.cameras.push(desc);
    }

    /// Number of placed shapes so far.
    pub fn placed(&self) -> usize {
        self.placements.len()
    }

    /// Builds the scene.
    ///
    /// # Errors
    /// A light that its kind rejects.
    pub fn finish(mut self) -> Result<Scene> {
        let center = self.world_center();
        let geometry = self.bake(center);
        let bounds = geometry.bounds();
        self.warnings.extend(super::precision::warnings(&geometry));
        let (lights, light_names, geometry) = self.build_lights(geometry, center, bounds)?;
        let mut cameras = self.cameras;
        for c in &mut cameras {
            c.world_from_camera.translation -= center;
        }
        let (media, in_air) = Media::new(&geometry, |id| {
            let m = &self.materials[geometry.object(id).material.index()];
            m.4.map(|medium| (medium, m.0.interior()))
        })?;
        if let Some(first) = in_air.first() {
            self.warnings.push(format!(
                "{} transparent bodies touch others but count as lying in air, '{}' first: the \
                 order of 64 is kept",
                in_air.len(),
                geometry.object(*first).name
            ));
        }
        let (mut materials, mut material_names) = (Vec::<Box<dyn Material>>::new(), Vec::new());
        for (m, name, ..) in self.materials {
            materials.push(m);
            material_names.push(name);
        }
        let mut used = vec![false; materials.len()];
        for o in &geometry.objects {
            used[o.material.index()] = true;
        }
        let textures = self.textures.into_iter().zip(used);
        let textures = textures.filter(|(_, used)| *used);
        let textures = textures.flat_map(|(own, _)| own).collect();
        let matte = materials.iter().map(|m| m.matte()).collect();
        let refracts = materials.iter().map(|m| m.traits().refracts).collect();
        Ok(Scene {
            choose_light: LightChoice::new(&lights),
            geometry: Arc::new(geometry),
            materials,
            refracts,
            matte,
            material_names,
            material_features: self.features,
            textures,
            parallelograms: lights.iter().map(|l| l.parallelogram()).collect(),
            lights,
            light_names,
            media,
            cameras,
            bounds,
            center,
            warnings: self.warnings,
            notes: self.notes,
            recipe: self.recipe,
            found: Default::default(),
        })
    }

    /// What is subtracted from all positions: the centre of the world-space boxes of all
    /// placements, in `f64`, if it is farther from the origin than the scene is large.
    fn world_center(&self) -> DVec3 {
        let mut all = Aabb::EMPTY;
        let mut local: Vec<Option<Aabb>> = vec![None; self.shapes.len()];
        for p in &self.placements {
            let b = *local[p.shape.index()]
                .get_or_insert_with(|| self.shapes[p.shape.index()].bounds());
            b.corners_under(&p.world_from_object)
                .filter(|corner| corner.is_finite())
                .for_each(|corner| all.grow(corner));
        }
        let center = all.center();
        // Around the origin nothing is gained, and the file's coordinates stay as they are.
        let near = center.abs().max_element() <= all.extent().max_element();
        if near { DVec3::ZERO } else { center }
    }

    fn bake(&mut self, center: DVec3) -> Geometry {
        let shapes = std::mem::take(&mut self.shapes);
        let placements = std::mem::take(&mut self.placements);
        let mut geometry = bake::bake(shapes, placements, center, |dropped, name| {
            self.report(dropped, "primitives", name);
        });
        for object in &mut geometry.objects {
            object.coverage = self.materials[object.material.index()].3.clone();
        }
        geometry
    }

    fn build_lights(
        &mut self,
        mut geometry: Geometry,
        center: DVec3,
        bounds: Aabb,
    ) -> Result<(
        Vec<Box<dyn crate::lights::Light>>,
        Vec<(String, &'static str)>,
        Geometry,
    )> {
        let mut descs: Vec<(LightDesc, Option<ObjectId>)> = std::mem::take(&mut self.lights)
            .into_iter()
            .map(|d| {
                (
                    LightDesc {
                        position: d.position - center,
                        ..d
                    },
                    None,
                )
            })
            .collect();
        for (i, object) in geometry.objects.iter().enumerate() {
            let Some(emission) = &self.materials[object.material.index()].2 else {
                continue;
            };
            let id = ObjectId(i as u32);
            let mut desc = LightDesc {
                name: object.name.to_string(),
                strength: emission.radiance,
                double_sided: emission.double_sided,
                ..surface_light(&geometry, id)
            };
            vary(&mut desc, &geometry, object, emission);
            descs.push((desc, Some(id)));
        }
        let (mut lights, mut names): (Vec<Box<dyn crate::lights::Light>>, Vec<_>) =
            (Vec::new(), Vec::new());
        let scene = bounds.bounding_sphere();
        for (mut d, object) in descs {
            if d.strength.is_black() {
                continue;
            }
            d.scene = scene;
            let light = (self.plugins.lights.find(d.kind)?.build)(&d)
                .map_err(|e| Error::Usage(format!("light '{}': {e}", d.name)))?;
            is_measurable(&*light, &d)?;
            if let Some(id) = object {
                geometry.objects[id.index()].light = Some(LightId(lights.len() as u32));
            }
            lights.push(light);
            names.push((d.name, d.kind));
        }
        Ok((lights, names, geometry))
    }
}

/// Most radiance in W/(m²·sr) of what has a surface: films sum that of 2³² samples in single
/// precision.
const MOST_RADIANCE: f64 = 1e28;

/// Most flux of a light in W: photons carry it in single precision.
const MOST_FLUX: f64 = 1e38;

/// Whether pictures can show the light.
fn is_measurable(light: &dyn crate::lights::Light, d: &LightDesc) -> Result<()> {
    let (radiance, flux) = (d.strength.max_channel(), light.power().max_channel());
    let radiates = !matches!(d.kind, "point" | "spot" | "directional");
    let problem = if radiates && !(radiance <= MOST_RADIANCE) {
        format!("a radiance of {radiance:.1e} W/(m²·sr) is more than {MOST_RADIANCE:.0e}")
    } else if !(flux <= MOST_FLUX) {
        format!("a flux of {flux:.1e} W is more than {MOST_FLUX:.0e}")
    } else {
        return Ok(());
    };
    Err(Error::Usage(format!(
        "light '{}': {problem}, which single precision cannot sum; make it less bright",
        d.name
    )))
}
