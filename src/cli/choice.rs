//! Which integrator renders a scene: the one that was named, or the one that suits the scene.

use super::plan::Plan;
use crate::control::Control;
use crate::effects;
use crate::error::Result;
use crate::integrators::{Outlook, suited, with_photons};
use crate::output::Checkpoint;
use crate::pipeline::{Prepared, RenderSettings, prepare};
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
/// A name that no integrator has, a film to go on from that is none, a wish for effects that names
/// none, what keeps a trial from being made.
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
    // A trial goes by the samples of the picture too: with more of them it may decide otherwise.
    // What no integrator of ours has rendered is refused when it is read.
    if let Some(path) = &plan.resume
        && let Some(name) = Checkpoint::integrator_of(path)?
        && let Ok(entry) = table.find(&name)
    {
        return Ok(settled(entry.name, "the film was begun with it"));
    }
    if plan.asks_for_photons()
        && let Some(entry) = with_photons(table)
    {
        return Ok(settled(entry.name, "photons were asked for"));
    }
    // What photons would gain depends on how their pixels would be sampled.
    let photons = with_photons(table).unwrap_or(table.choose(None)?);
    let settings = plan.settings_for(scene, photons.name, registry)?;
    let mut prepared = None;
    let (integrator, reason) = suited_to(scene, &settings, registry, &mut prepared, control)?;
    Ok(Choice {
        integrator,
        reason,
        prepared,
    })
}

/// The integrator that suits a scene, and why; `settings` are those by which photons would render it.
/// What was built for the trial that decided, if there was one, serves the next as well.
pub(super) fn suited_to(
    scene: &Scene,
    settings: &RenderSettings,
    registry: &Registry,
    prepared: &mut Option<Prepared>,
    control: &Control,
) -> Result<(&'static str, String)> {
    let effects = effects::survey(scene, &settings.effects, &registry.effects)?;
    let mut outlook = Outlook::new(scene, effects.set);
    if outlook.is_open() && control.stopped().is_none() {
        let mut built = match prepared.take() {
            Some(built) => built,
            None => prepare(scene, settings, registry, control)?,
        };
        outlook.trial = Some(built.try_out(scene, settings, registry, control)?);
        *prepared = Some(built);
    }
    let (entry, reason) = suited(&registry.integrators, &outlook)?;
    Ok((entry.name, reason))
}
