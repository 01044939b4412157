//! Effects: which parts of light transport a scene calls for, and why. A survey decides before
//! anything is traced; a pass that is not called for does not run. An effect is one file and
//! one line in [`EFFECTS`].
//!
//! The survey is conservative: it may keep an effect needlessly, but never drop a needed one.

mod caustics;
mod direct;
mod indirect;
mod refraction;
mod specular;

use bitflags::bitflags;
use serde::Serialize;

use crate::error::{Error, Result};
use crate::geometry::SurfacePoint;
use crate::materials::LobeClass;
use crate::registry::Table;
use crate::scene::{Census, Scene};

bitflags! {
    /// A set of effects.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct EffectSet: u32 {
        /// Light that arrives straight from a light, and lights seen directly.
        const DIRECT = 1;
        /// Mirror-like and glossy reflection, and unbent transmission.
        const SPECULAR = 2;
        /// Bent transmission.
        const REFRACTION = 4;
        /// Light focused onto diffuse surfaces by others.
        const CAUSTICS = 8;
        /// Light that comes by way of other diffuse surfaces.
        const INDIRECT = 16;
    }
}

impl EffectSet {
    /// Whether light is followed through a scattering at a point: bent transmission is
    /// [`REFRACTION`](Self::REFRACTION), what is neither that nor diffuse
    /// [`SPECULAR`](Self::SPECULAR).
    #[inline]
    pub fn follow(
        self,
        scene: &Scene,
        sp: &SurfacePoint,
        class: LobeClass,
        transmitted: bool,
    ) -> bool {
        let both = Self::SPECULAR | Self::REFRACTION;
        if class == LobeClass::Diffuse || self.contains(both) {
            return true;
        }
        let bent = transmitted && scene.material(sp.material).traits().refracts;
        self.contains(if bent {
            Self::REFRACTION
        } else {
            Self::SPECULAR
        })
    }
}

/// Whether an effect is called for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// Whether it is simulated.
    pub on: bool,
    /// Why, or why not.
    pub reason: String,
}

impl Verdict {
    fn on(reason: impl Into<String>) -> Self {
        Self {
            on: true,
            reason: reason.into(),
        }
    }

    fn off(reason: impl Into<String>) -> Self {
        Self {
            on: false,
            reason: reason.into(),
        }
    }
}

/// A decision of the survey, or of the user.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Decision {
    /// Name of the effect.
    pub name: &'static str,
    /// Whether it is simulated.
    pub on: bool,
    /// Why, or why not.
    pub reason: String,
}

/// An effect that can be surveyed.
#[derive(Clone, Copy, Debug)]
pub struct EffectEntry {
    /// Name, for `--effects`.
    pub name: &'static str,
    /// One sentence.
    pub doc: &'static str,
    /// Its bit.
    pub bit: EffectSet,
    /// Decides from what the scene holds.
    pub verdict: fn(&Census) -> Verdict,
}

crate::registry::impl_entry!(EffectEntry, "effect");

/// The effects, in the order of the report.
pub static EFFECTS: &[EffectEntry] = &[
    direct::ENTRY,
    specular::ENTRY,
    refraction::ENTRY,
    caustics::ENTRY,
    indirect::ENTRY,
];

/// What the survey found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Effects {
    /// The effects that are simulated.
    pub set: EffectSet,
    /// Every effect with its reason.
    pub decisions: Vec<Decision>,
}

/// Surveys a scene. `wish` is what the user asked for: `auto`, `all`, or a comma-separated list
/// of `+name` and `-name` that override the survey.
///
/// # Errors
/// A wish that names no effect.
pub fn survey(scene: &Scene, wish: &str, table: &Table<EffectEntry>) -> Result<Effects> {
    let census = Census::new(scene);
    let mut forced = EffectSet::empty();
    let mut banned = EffectSet::empty();
    for word in wish
        .split(',')
        .map(str::trim)
        .filter(|w| !w.is_empty() && *w != "auto")
    {
        if word == "all" {
            forced = EffectSet::all();
            continue;
        }
        let (target, name) = match word.split_at_checked(1) {
            Some(("+", name)) => (&mut forced, name),
            Some(("-", name)) => (&mut banned, name),
            _ => {
                return Err(Error::Usage(format!(
                    "--effects '{word}' is neither auto, all, +NAME nor -NAME"
                )));
            }
        };
        let entry = table.find(name)?;
        target.insert(entry.bit);
    }
    let mut set = EffectSet::empty();
    let decisions = table
        .entries()
        .iter()
        .map(|e| {
            let found = (e.verdict)(&census);
            let verdict = if banned.contains(e.bit) {
                Verdict::off("switched off by --effects")
            } else if forced.contains(e.bit) && !found.on {
                Verdict::on(format!("forced by --effects, although {}", found.reason))
            } else {
                found
            };
            set.set(e.bit, verdict.on);
            Decision {
                name: e.name,
                on: verdict.on,
                reason: verdict.reason,
            }
        })
        .collect();
    Ok(Effects { set, decisions })
}

/// Whether anything emits; nearly every verdict begins with it.
fn lights(census: &Census) -> usize {
    census.lights.iter().map(|(_, n)| n).sum()
}
