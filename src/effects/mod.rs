//! Effects: which parts of light transport a scene calls for, and why. A survey decides before
//! anything is traced; a pass that is not called for does not run. An effect is one file and
//! one line in [`EFFECTS`].
//!
//! The survey is conservative: it may keep an effect needlessly, but never drop a needed one.

mod absorption;
mod alpha;
mod anisotropy;
mod caustics;
mod coat;
mod direct;
mod dispersion;
mod environment;
mod indirect;
mod instances;
mod iridescence;
mod lens;
mod normals;
mod refraction;
mod sheen;
mod specular;
mod textures;
mod translucency;

use bitflags::bitflags;
use serde::Serialize;

use crate::error::{Error, Result};
use crate::geometry::SurfacePoint;
use crate::materials::{Features, LobeClass};
use crate::registry::Table;
use crate::scene::{Census, Omit, Scene};
use crate::stats::tally::{self, Cost, Event, Part, Tally};

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
        /// Light absorbed by bodies.
        const ABSORPTION = 1 << 5;
        /// Colours that glass takes apart.
        const DISPERSION = 1 << 6;
        /// Values from images.
        const TEXTURES = 1 << 7;
        /// Shading normals from images.
        const NORMALS = 1 << 8;
        /// Surfaces that are not whole.
        const ALPHA = 1 << 9;
        /// Light from all around.
        const ENVIRONMENT = 1 << 10;
        /// Depth of field.
        const LENS = 1 << 11;
        /// Shapes that are kept once and stand in several places.
        const INSTANCES = 1 << 12;
        /// Clear coats.
        const COAT = 1 << 13;
        /// The sheen of cloth.
        const SHEEN = 1 << 14;
        /// Thin films.
        const IRIDESCENCE = 1 << 15;
        /// Brushed surfaces.
        const ANISOTROPY = 1 << 16;
        /// Diffuse light that comes through.
        const TRANSLUCENCY = 1 << 17;
    }
}

impl EffectSet {
    /// Whether light is followed through a scattering at a point: bent transmission is
    /// [`REFRACTION`](Self::REFRACTION), what is neither that nor diffuse
    /// [`SPECULAR`](Self::SPECULAR).
    #[inline]
    pub fn allows(
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
        self.contains(match specular_part(scene, sp, transmitted) {
            Part::Refraction => Self::REFRACTION,
            _ => Self::SPECULAR,
        })
    }

    /// As [`allows`](Self::allows), and counts what is followed unless it is diffuse: the part
    /// that it belongs to, or none.
    #[inline]
    pub fn follow(
        self,
        scene: &Scene,
        sp: &SurfacePoint,
        class: LobeClass,
        transmitted: bool,
    ) -> Option<Part> {
        if class == LobeClass::Diffuse {
            return Some(Part::Indirect);
        }
        let part = specular_part(scene, sp, transmitted);
        let (needs, event) = match part {
            Part::Refraction => (Self::REFRACTION, Event::Refractions),
            _ => (Self::SPECULAR, Event::Reflections),
        };
        self.contains(needs).then(|| {
            tally::count(event);
            part
        })
    }
}

/// What a scattering that is not diffuse is part of.
#[inline]
pub fn specular_part(scene: &Scene, sp: &SurfacePoint, transmitted: bool) -> Part {
    if transmitted && scene.bends(sp.material) {
        Part::Refraction
    } else {
        Part::Specular
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
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Decision {
    /// Name of the effect.
    pub name: &'static str,
    /// Whether it is simulated.
    pub on: bool,
    /// Why, or why not.
    pub reason: String,
    /// What it took, once that is known.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub cost: Option<Cost>,
}

/// When it is decided whether an effect is simulated.
#[derive(Clone, Copy, Debug)]
pub enum Acts {
    /// While light is traced.
    Traced,
    /// When the scene is built: it is part of it or left out, and costs nothing then.
    Built(fn(&mut Omit)),
    /// Never: it is how the scene is kept.
    Always,
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
    /// What its work is counted and timed as.
    pub part: Part,
    /// What switches it.
    pub acts: Acts,
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
    absorption::ENTRY,
    dispersion::ENTRY,
    translucency::ENTRY,
    coat::ENTRY,
    sheen::ENTRY,
    iridescence::ENTRY,
    anisotropy::ENTRY,
    textures::ENTRY,
    normals::ENTRY,
    alpha::ENTRY,
    environment::ENTRY,
    lens::ENTRY,
    instances::ENTRY,
];

/// What the survey found.
#[derive(Clone, Debug, PartialEq)]
pub struct Effects {
    /// The effects that are simulated.
    pub set: EffectSet,
    /// Every effect with its reason.
    pub decisions: Vec<Decision>,
    /// The effects that the user asked for, whatever the survey finds.
    forced: EffectSet,
}

impl Effects {
    /// The effects of these that are simulated because the survey found them, not because the user
    /// asked for them.
    pub fn found(&self, set: EffectSet) -> EffectSet {
        (self.set & set).difference(self.forced)
    }

    /// Leaves effects out after all; `table` is the one that they were surveyed by.
    pub fn leave_out(&mut self, table: &Table<EffectEntry>, set: EffectSet, reason: &str) {
        self.set.remove(set);
        for (decision, entry) in self.decisions.iter_mut().zip(table.entries()) {
            if set.contains(entry.bit) {
                decision.on = false;
                reason.clone_into(&mut decision.reason);
            }
        }
    }

    /// Tells what each took; `table` is the one that they were surveyed by.
    pub fn account(&mut self, table: &Table<EffectEntry>, tally: &Tally) {
        for (decision, entry) in self.decisions.iter_mut().zip(table.entries()) {
            decision.cost = Some(tally.cost(entry.part));
        }
    }
}

/// What the user asked for.
struct Wish {
    forced: EffectSet,
    banned: EffectSet,
}

impl Wish {
    fn parse(wish: &str, table: &Table<EffectEntry>) -> Result<Self> {
        let mut out = Self {
            forced: EffectSet::empty(),
            banned: EffectSet::empty(),
        };
        let words = wish.split(',').map(str::trim);
        for word in words.filter(|w| *w != "auto") {
            if word == "all" {
                out.forced = EffectSet::all();
                continue;
            }
            let (target, name) = match word.split_at_checked(1) {
                Some(("+", name)) => (&mut out.forced, name),
                Some(("-", name)) => (&mut out.banned, name),
                _ => {
                    return Err(Error::Usage(format!(
                        "--effects '{word}' is neither auto, all, +NAME nor -NAME; see dualight \
                         plugins"
                    )));
                }
            };
            target.insert(table.find(name)?.bit);
        }
        Ok(out)
    }
}

/// What a wish wants left out of the scene when it is built.
///
/// # Errors
/// A wish that names no effect.
pub fn omissions(wish: &str, table: &Table<EffectEntry>) -> Result<Omit> {
    let banned = Wish::parse(wish, table)?.banned;
    let mut omit = Omit::default();
    for e in table.entries().iter().filter(|e| banned.contains(e.bit)) {
        if let Acts::Built(leave_out) = e.acts {
            leave_out(&mut omit);
        }
    }
    Ok(omit)
}

/// Surveys a scene. `wish` is what the user asked for: `auto`, `all`, or a comma-separated list
/// of `+name` and `-name` that override the survey.
///
/// # Errors
/// A wish that names no effect, or is against one that is part of the scene: see [`omissions`].
pub fn survey(scene: &Scene, wish: &str, table: &Table<EffectEntry>) -> Result<Effects> {
    let census = Census::new(scene);
    let Wish { forced, banned } = Wish::parse(wish, table)?;
    let mut set = EffectSet::empty();
    let mut decisions = Vec::new();
    for e in table.entries() {
        let found = (e.verdict)(&census);
        let traced = matches!(e.acts, Acts::Traced);
        if banned.contains(e.bit) && found.on && !traced {
            let remedy = match e.acts {
                Acts::Built(_) => "leave it out when the scene is built",
                _ => "it cannot be left out",
            };
            return Err(Error::Usage(format!(
                "--effects -{}: {}; {remedy}",
                e.name, found.reason
            )));
        }
        let verdict = if banned.contains(e.bit) {
            Verdict::off("switched off by --effects")
        } else if forced.contains(e.bit) && !found.on && traced {
            Verdict::on(format!("forced by --effects, although {}", found.reason))
        } else {
            found
        };
        set.set(e.bit, verdict.on);
        decisions.push(Decision {
            name: e.name,
            on: verdict.on,
            reason: verdict.reason,
            cost: None,
        });
    }
    Ok(Effects {
        set,
        decisions,
        forced,
    })
}

/// The verdict on a feature of materials: how many have it, and what it `does`, as in "1 material
/// has a clear coat".
fn with_feature(census: &Census, feature: Features, does: &str) -> Verdict {
    let with = |f: &&Features| f.contains(feature);
    match census.material_features.iter().filter(with).count() {
        0 => Verdict::off(format!("no material {does}")),
        1 => Verdict::on(format!("1 material {does}")),
        n => Verdict::on(format!("{n} materials, each of which {does}")),
    }
}

/// Whether anything emits; nearly every verdict begins with it.
fn lights(census: &Census) -> usize {
    census.lights.iter().map(|(_, n)| n).sum()
}
