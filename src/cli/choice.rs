//! Which integrator renders a scene: the one that was named, or the one that suits the scene.

use super::plan::Plan;
use crate::control::Control;
use crate::effects;
use crate::error::Result;
use crate::integrators::{Outlook, suited, with_photons};
use crate::pipeline::{Prepared, prepare};
use crate::plugins::Registry;
use crate::scene::Scene;

/// An integrator, and why it was chosen.
pub(super) struct Choice {
    pub(super) integrator: &'static str,
    pub(super) reason: String,
    /// What was built for the trial that decided, if there was one.
    pub(super) prepared: Option<Prepared>,
}

/// Chooses the integrator for a scene.
///
/// # Errors
/// A name that no integrator has, a wish for effects that names none, what keeps a trial from
/// being made.
pub(super) fn choose(
    plan: &Plan,
    scene: &Scene,
    registry: &Registry,
    control: &Control,
) -> Result<Choice> {
    let table = &registry.integrators;
    let settled = |integrator, reason: &str| Choice {
        integrator,
        reason: reason.into(),
        prepared: None,
    };
    if let Some(name) = plan.named_integrator() {
        return Ok(settled(table.find(name)?.name, "as was asked for"));
    }
    if plan.asks_for_photons()
        && let Some(entry) = with_photons(table)
    {
        return Ok(settled(entry.name, "photons were asked for"));
    }
    let effects = effects::survey(scene, plan.effects(), &registry.effects)?;
    let mut outlook = Outlook::new(scene, effects.set);
    let mut prepared = None;
    if outlook.is_open() && control.stopped().is_none() {
        // What photons would gain depends on how their pixels would be sampled.
        let photons = with_photons(table).unwrap_or(table.choose(None)?);
        let settings = plan.settings_for(scene, photons.name, registry)?;
        let mut built = prepare(scene, &settings, registry, control)?;
        outlook.trial = Some(built.try_out(scene, &settings, registry, control)?);
        prepared = Some(built);
    }
    let (entry, reason) = suited(table, &outlook)?;
    Ok(Choice {
        integrator: entry.name,
        reason,
        prepared,
    })
}
