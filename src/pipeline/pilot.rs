//! What a few paths tell of effects, before anything is rendered.

use crate::accel::Accelerator;
use crate::cameras::Camera;
use crate::effects::{EffectSet, Effects};
use crate::integrators::{Spacing, none_meets_another};
use crate::plugins::Registry;
use crate::scene::Scene;

/// Leaves out light that surfaces pass to one another, if none is in sight that does and nobody
/// asked for it.
pub(super) fn bound(
    effects: &mut Effects,
    scene: &Scene,
    accel: &dyn Accelerator,
    camera: &dyn Camera,
    spacing: &Spacing,
    seed: u64,
    registry: &Registry,
) {
    let passed_on = effects.found(EffectSet::CAUSTICS | EffectSet::INDIRECT);
    if passed_on.is_empty() {
        return;
    }
    if let Some(n) = none_meets_another(scene, accel, camera, spacing, seed) {
        let reason = format!("no surface in sight faces another: of {n} rays none met one");
        effects.leave_out(&registry.effects, passed_on, &reason);
    }
}
