//! Import of scene files (stand-in until the importer is here).

use std::path::Path;

use crate::error::{Error, Result};
use crate::scene::{Scene, ScenePlugins};

/// What the numbers of a file's lights mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightUnits {
    /// As Blender exports them.
    #[default]
    Blender,
    /// Candela and lux, as the format says.
    Photometric,
    /// W/sr and W/m².
    Radiometric,
}

/// What the importer is told.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions {
    /// What the numbers of lights mean.
    pub light_units: LightUnits,
    /// Name of the scene in the file; `None` for the default one.
    pub scene: Option<String>,
}

/// Loads a scene.
///
/// # Errors
/// A file that is missing, broken or beyond Dualight.
pub fn load(path: &Path, _options: &ImportOptions, _plugins: ScenePlugins) -> Result<Scene> {
    let e = std::fs::File::open(path).map_or_else(
        |e| e.kind().to_string(),
        |_| "this build has no importer".into(),
    );
    Err(Error::file(path, e, "check the name"))
}
