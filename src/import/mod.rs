//! Import: a glTF 2.0 file becomes a scene.
//!
//! The JSON is read by a cursor that knows its place, accessors by code that checks every bound:
//! a broken file gives one error that names the file, the place in it and the remedy. What is
//! not supported is named in a warning; what a file *requires* and is not supported is an error.

mod accessor;
mod animation;
mod buffer;
mod camera;
mod container;
mod dialect;
#[cfg(feature = "draco")]
mod draco;
mod encoded;
mod environment;
mod extras;
#[cfg(feature = "draco")]
mod gate;
mod hierarchy;
mod ignored;
mod image;
mod image_based;
mod implicit;
mod instancing;
mod inventory;
mod json;
#[cfg(feature = "ktx2")]
mod ktx2;
mod light;
mod material;
mod mesh;
#[cfg(feature = "meshopt")]
mod meshopt;
mod morph;
mod node;
#[cfg(any(feature = "draco", feature = "ktx2"))]
mod quiet;
mod range;
mod scenes;
mod schema;
mod skin;
mod solid;
mod sources;
mod tangents;
mod texture;
#[cfg(feature = "meshopt")]
mod unpacked;
mod uri;
mod used;
mod variants;
mod vertices;
mod views;

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use crate::color::units;
pub use crate::color::units::LightUnits;
use crate::error::{Error, Result};
use crate::lights::LightDesc;
use crate::materials::MaterialDesc;
use crate::scene::{Omit, Scene, SceneBuilder, ScenePlugins};
use accessor::Source;
use dialect::Dialect;
pub use environment::{EnvironmentOption, EnvironmentSource};
use hierarchy::Hierarchy;
use image::Images;
pub use inventory::{
    AnimationInfo, Extensions, ImageInfo, Inventory, MaterialInfo, extensions, inventory,
};
use json::Cursor;
use node::Walker;
pub use solid::SolidGlass;
pub use sources::sources;

/// How a file is to be read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// In which units the intensities of punctual lights are given.
    pub light_units: LightUnits,
    /// Which glass without a volume is taken for solid.
    pub solid_glass: SolidGlass,
    /// Name of the scene; `None` for the file's default.
    pub scene: Option<String>,
    /// The moment at which animations are shown, in seconds; `None` for the rest pose.
    pub time: Option<f64>,
    /// Name of the one animation that is shown; `None` for all.
    pub animation: Option<String>,
    /// Name of the variant of the materials; `None` for the file's default.
    pub variant: Option<String>,
    /// Light from all around, instead of the file's own.
    pub environment: Option<EnvironmentOption>,
    /// What is left out, wherever the file has it.
    pub omit: Omit,
}

/// Extensions that are honoured; a file may require them.
const SUPPORTED: &[&str] = &[
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_implicit_shapes",
    image_based::NAME,
    "EXT_mesh_gpu_instancing",
    #[cfg(feature = "draco")]
    "KHR_draco_mesh_compression",
    #[cfg(feature = "meshopt")]
    "EXT_meshopt_compression",
    #[cfg(feature = "meshopt")]
    "KHR_meshopt_compression",
    "KHR_texture_transform",
    "EXT_texture_webp",
    #[cfg(feature = "ktx2")]
    "KHR_texture_basisu",
];

/// Something is wrong at a place in the file.
#[derive(Clone, Debug)]
struct Problem {
    place: String,
    problem: String,
    remedy: String,
    kind: ProblemKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ProblemKind {
    Invalid,
    Unsupported,
    File,
}

impl Problem {
    fn invalid(place: &str, problem: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            problem: problem.into(),
            remedy: "export the file again, or run it through a glTF validator".into(),
            kind: ProblemKind::Invalid,
        }
    }

    fn unsupported(place: &str, problem: impl Into<String>, remedy: &str) -> Self {
        Self {
            remedy: remedy.into(),
            kind: ProblemKind::Unsupported,
            ..Self::invalid(place, problem)
        }
    }

    fn file(path: &Path, e: &std::io::Error) -> Self {
        let place = path.display().to_string();
        Self {
            remedy: "check the path and its permissions".into(),
            kind: ProblemKind::File,
            ..Self::invalid(&place, format!("cannot be read ({e})"))
        }
    }

    fn into_error(self, path: &Path) -> Error {
        let Self {
            place,
            problem,
            remedy,
            kind,
        } = self;
        let path = path.to_owned();
        match kind {
            ProblemKind::Invalid => Error::Scene {
                path,
                place,
                problem,
                remedy,
            },
            ProblemKind::Unsupported => Error::Unsupported {
                path,
                place,
                problem,
                remedy,
            },
            ProblemKind::File => Error::File {
                path,
                problem,
                remedy,
            },
        }
    }
}

/// What could not be honoured, with counts; each kind is told once.
#[derive(Default)]
struct Notes(BTreeMap<String, usize>);

impl Notes {
    fn add(&mut self, what: impl Into<String>, n: usize) {
        *self.0.entry(what.into()).or_default() += n;
    }

    fn join(&mut self, other: Self) {
        for (what, n) in other.0 {
            self.add(what, n);
        }
    }
}

/// Reads the glTF file at `path`.
///
/// # Errors
/// [`Error::File`] if it cannot be read, [`Error::Scene`] if it is broken or empty,
/// [`Error::Unsupported`] if it requires what Dualight cannot do.
pub fn load(path: &Path, options: &ImportOptions, plugins: ScenePlugins) -> Result<Scene> {
    let mut builder = SceneBuilder::new(plugins);
    builder.leave_out(options.omit);
    let mut notes = Notes::default();
    let mut document = container::open(path, |root| check_extensions(root, &mut notes))
        .map_err(|p| p.into_error(path))?;
    if scenes::complete(&mut document.json).map_err(|p| p.into_error(path))? {
        builder.inform("the file has no scenes: all of its nodes are shown");
    }
    let root = Cursor::root(&document.json);
    let source = Source::new(root.clone(), &document.buffers, document.size);
    let mut images = Images::new(&source, &document.uris);
    fill(
        &root,
        &source,
        &mut images,
        path,
        options,
        &mut builder,
        &mut notes,
    )
    .map_err(|e| match e {
        Failure::Problem(p) => p.into_error(path),
        Failure::Plugin(place, e) => match *e {
            Error::Usage(problem) => Problem::invalid(&place, problem).into_error(path),
            other => other,
        },
    })?;
    for (what, n) in notes.0 {
        builder.warn(if n > 1 {
            format!("{what} ({n} times)")
        } else {
            what
        });
    }
    if builder.placed() == 0 {
        let p = Problem {
            remedy: "export at least one mesh with the scene".into(),
            ..Problem::invalid("the scene", "holds no geometry")
        };
        return Err(p.into_error(path));
    }
    let scene = builder.finish()?;
    if scene.geometry.objects.is_empty() {
        let p = Problem {
            remedy: "export at least one mesh with surface".into(),
            ..Problem::invalid("the scene", "holds no triangle or sphere that could be hit")
        };
        return Err(p.into_error(path));
    }
    Ok(scene)
}

/// Why filling a scene failed.
enum Failure {
    /// The file is at fault.
    Problem(Problem),
    /// A plugin refused what the file says at a place.
    Plugin(String, Box<Error>),
}

impl From<Problem> for Failure {
    fn from(p: Problem) -> Self {
        Self::Problem(p)
    }
}

/// Fills the scene.
fn fill<'a>(
    root: &Cursor<'a>,
    source: &Source<'a>,
    images: &mut Images<'a>,
    path: &Path,
    options: &ImportOptions,
    builder: &mut SceneBuilder,
    notes: &mut Notes,
) -> Result<(), Failure> {
    let animations = root.items("animations")?.len();
    if animations > 0 && options.time.is_none() {
        builder.inform("animations are at rest; --time or --frame shows them at a moment");
    }
    let pose = animation::pose(source, options, notes)?;
    let variant = variants::choose(root, options.variant.as_deref())?;
    let scene = scenes::chosen(root, options, builder)?;
    let roots = scene.items("nodes")?;
    let used = used::materials(root, &roots)?;
    let entries = root.items("materials")?;
    for (_, m) in entries.iter().enumerate().filter(|(i, _)| used.contains(i)) {
        material::read(m, images, &mut Notes::default())?;
    }
    if options.environment.is_none() {
        image_based::want(&scene, root, images)?;
    }
    images.decode()?;
    let mut materials = Vec::new();
    let mut solid = HashMap::new();
    let dialect = Dialect::of(root);
    let takes_solid = match options.solid_glass {
        SolidGlass::Auto => dialect.is_blender(),
        SolidGlass::Always => true,
        SolidGlass::Never => false,
    };
    let light_units = light::resolve(options.light_units, dialect, root, builder)?;
    let radiance = units::radiance_factor(light_units);
    let colored = material::with_vertex_colors(root)?;
    for (i, m) in entries.iter().enumerate() {
        let mut desc = material::read(m, images, notes)?;
        ignored::tell(m, root, notes)?;
        range::of_material(m, notes);
        desc.vertex_colors = colored.contains(&Some(i));
        dialect.apply(&mut desc);
        desc.emission *= radiance;
        let id = builder
            .add_material(&desc)
            .map_err(|e| Failure::Plugin(m.path().to_owned(), Box::new(e)))?;
        materials.push(id);
        if let Some(twin) = solid::twin(m, &desc).filter(|_| takes_solid) {
            let twin = builder
                .add_material(&twin)
                .map_err(|e| Failure::Plugin(m.path().to_owned(), Box::new(e)))?;
            solid.insert(id, twin);
        }
    }
    let default_material = builder
        .add_material(&MaterialDesc {
            vertex_colors: colored.contains(&None),
            ..Default::default()
        })
        .map_err(|e| Failure::Plugin("the default material".into(), Box::new(e)))?;
    let mut walker = Walker {
        source,
        lamps: dialect.of_lamps(options.light_units),
        light_units,
        variant,
        hierarchy: Hierarchy::new(root.clone(), &pose),
        materials: &materials,
        solid: &solid,
        open_too: options.solid_glass == SolidGlass::Always,
        made_solid: 0,
        default_material,
        builder,
        notes,
    };
    walker.walk(&roots)?;
    let made_solid = walker.made_solid;
    if made_solid > 0 {
        builder.inform(format!(
            "{made_solid} object(s) of glass without a volume are taken for solid; \
             --solid-glass never takes them for thin walls"
        ));
    }
    if let Some(light) = surroundings(&scene, root, images, path, options, radiance, notes)? {
        builder.add_light(light);
    }
    Ok(())
}

/// Light from all around: what the user asks for goes before our extras, and these before the
/// extension, whose light is multiplied by `radiance`.
fn surroundings<'a>(
    scene: &Cursor<'a>,
    root: &Cursor<'a>,
    images: &mut Images<'a>,
    path: &Path,
    options: &ImportOptions,
    radiance: f64,
    notes: &mut Notes,
) -> Result<Option<LightDesc>, Failure> {
    let extras = environment::of_scene(scene, path, notes)?;
    if let Some(environment) = options.environment.as_ref().or(extras.as_ref()) {
        let light = environment.light();
        return light
            .map(Some)
            .map_err(|e| Failure::Plugin(scene.path().to_owned(), Box::new(e)));
    }
    let mut light = image_based::of_scene(scene, root, images, notes)?;
    if let Some(light) = &mut light {
        light.strength *= radiance;
    }
    Ok(light)
}

fn check_extensions(root: &Cursor<'_>, notes: &mut Notes) -> Result<(), Problem> {
    for e in root.items("extensionsRequired")? {
        let name = e.str()?;
        if !SUPPORTED.contains(&name) {
            return Err(Problem::unsupported(
                e.path(),
                format!("the file requires {name}, which is not supported"),
                "export it without this extension",
            ));
        }
    }
    for e in root.items("extensionsUsed")? {
        let name = e.str()?;
        if !SUPPORTED.contains(&name) {
            notes.add(format!("{name} is not supported and ignored"), 1);
        }
    }
    Ok(())
}
