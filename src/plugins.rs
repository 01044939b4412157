//! All plugin tables as one value: what the command line lists and chooses from, and where a
//! program that uses the library adds plugins of its own.

use crate::accel::{ACCELERATORS, AcceleratorEntry};
use crate::cameras::{CAMERAS, CameraEntry};
use crate::effects::{EFFECTS, EffectEntry};
use crate::integrators::{INTEGRATORS, IntegratorEntry};
use crate::output::{OUTPUTS, OutputEntry};
use crate::photons::{EMISSIONS, EmissionEntry};
use crate::registry::{Entry, Table};
use crate::scene::ScenePlugins;

/// The plugins of every family.
#[derive(Clone, Debug)]
pub struct Registry {
    /// Ray tracing backends; the first is the default.
    pub accelerators: Table<AcceleratorEntry>,
    /// Integrators; the first is the default.
    pub integrators: Table<IntegratorEntry>,
    /// Photon emissions; the first is the default.
    pub emissions: Table<EmissionEntry>,
    /// Effects.
    pub effects: Table<EffectEntry>,
    /// Materials and lights, which scenes are built with.
    pub scene: ScenePlugins,
    /// Cameras.
    pub cameras: Table<CameraEntry>,
    /// Output formats.
    pub outputs: Table<OutputEntry>,
}

impl Registry {
    /// What Dualight brings along.
    pub fn builtin() -> Self {
        Self {
            accelerators: Table::new(ACCELERATORS),
            integrators: Table::new(INTEGRATORS),
            emissions: Table::new(EMISSIONS),
            effects: Table::new(EFFECTS),
            scene: ScenePlugins::default(),
            cameras: Table::new(CAMERAS),
            outputs: Table::new(OUTPUTS),
        }
    }

    /// Every family with the names and descriptions of its plugins.
    pub fn families(&self) -> Vec<(&'static str, Vec<(&'static str, &'static str)>)> {
        fn list<E: Entry + Copy>(
            t: &Table<E>,
        ) -> (&'static str, Vec<(&'static str, &'static str)>) {
            (
                E::KIND,
                t.entries().iter().map(|e| (e.name(), e.doc())).collect(),
            )
        }
        vec![
            list(&self.accelerators),
            list(&self.integrators),
            list(&self.emissions),
            list(&self.effects),
            list(&self.scene.materials),
            list(&self.scene.lights),
            list(&self.cameras),
            list(&self.outputs),
        ]
    }
}
