//! Two backends on many rays: how often they agree, and the rays on which they do worst.

use rayon::prelude::*;
use serde::Serialize;

use super::rays::{RayKind, RayMaker, Step, WALK};
use crate::accel::{Class, CrossCheck, Finding};
use crate::control::Control;
use crate::geometry::{Hit, Ray};

/// Walks compared by one task.
const BATCH: u64 = 1024;

/// Counts over the rays of one kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Rays compared.
    pub rays: u64,
    /// Of these, rays on which the subject hit something.
    pub hits: u64,
    /// Differences that are ties.
    pub ties: u64,
    /// Differences where the ray passes an edge or a silhouette.
    pub edges: u64,
    /// Of both, rays on which one backend hit nothing.
    pub lost: u64,
    /// Differences without an explanation.
    pub unexplained: u64,
    /// Of the differences with an explanation, the one that takes most of its bound.
    pub worst_explained: f64,
    /// Largest error of the subject's own distances, in units of their bound.
    pub worst_distance: f64,
}

impl Tally {
    fn count(&mut self, f: &Finding) {
        self.rays += 1;
        self.hits += u64::from(f.hit);
        match f.class {
            Class::Same => {}
            Class::Tie => self.ties += 1,
            Class::Edge => self.edges += 1,
            Class::Unexplained => self.unexplained += 1,
        }
        let one_sided = f.subject.is_none() != f.reference.is_none();
        self.lost += u64::from(one_sided && f.class != Class::Same);
        self.worst_distance = self.worst_distance.max(f.distance);
        if f.class != Class::Unexplained {
            self.worst_explained = self.worst_explained.max(f.ratio);
        }
    }

    /// Adds the counts of other rays.
    pub fn add(&mut self, o: &Self) {
        self.rays += o.rays;
        self.hits += o.hits;
        self.ties += o.ties;
        self.edges += o.edges;
        self.lost += o.lost;
        self.unexplained += o.unexplained;
        self.worst_distance = self.worst_distance.max(o.worst_distance);
        self.worst_explained = self.worst_explained.max(o.worst_explained);
    }
}

/// A ray on which backends differ.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// What it was traced for.
    pub kind: RayKind,
    /// The ray.
    pub ray: Ray,
    /// What the backends said.
    pub finding: Finding,
}

/// What comparing brought.
#[derive(Clone, Debug, Default)]
pub struct Agreement {
    /// Counts by kind, in the order of [`RayKind::ALL`].
    pub kinds: Vec<(RayKind, Tally)>,
    /// The worst rays, worst first.
    pub worst: Vec<Case>,
}

impl Agreement {
    /// Counts over all kinds.
    pub fn total(&self) -> Tally {
        let mut sum = Tally::default();
        for (_, t) in &self.kinds {
            sum.add(t);
        }
        sum
    }

    fn keep_worst(&mut self, most: usize) {
        self.worst.sort_by(|a, b| {
            let key = |c: &Case| (c.finding.class, c.finding.ratio);
            let ((ca, ra), (cb, rb)) = (key(a), key(b));
            cb.cmp(&ca).then(rb.total_cmp(&ra))
        });
        self.worst.truncate(most);
    }
}

/// Asks both backends about one ray.
pub fn ask(check: &CrossCheck<'_>, kind: RayKind, step: &Step) -> Finding {
    match (kind, step.hit) {
        (RayKind::Shadow, _) => check.occluded(&step.ray),
        (_, None) => check.intersect(&step.ray),
        (_, Some(hit)) => check.judge(&step.ray, hit),
    }
}

/// Compares `rays` rays in all, shared evenly by the kinds, and keeps the `keep` worst. What a kind
/// has no rays for, as photons where there is no light, is left to random ones.
pub fn compare(
    check: &CrossCheck<'_>,
    maker: &RayMaker<'_>,
    rays: u64,
    keep: usize,
    control: &Control,
) -> Agreement {
    let stage = control.stage("compare", "rays", rays);
    let mut out = Agreement::default();
    // So many rays, from a number of walks on.
    let mut compare = |kind: RayKind, start: u64, rays: u64| {
        let walks = rays.div_ceil(WALK as u64);
        let parts: Vec<(Tally, Vec<Case>)> = (0..walks.div_ceil(BATCH))
            .into_par_iter()
            .map(|b| {
                let mut part = Agreement::default();
                let mut tally = Tally::default();
                for i in b * BATCH..((b + 1) * BATCH).min(walks) {
                    if control.stopped().is_some() {
                        break;
                    }
                    // The last walk may be more than is wanted.
                    let wanted = (rays - i * WALK as u64).min(WALK as u64);
                    for step in maker.walk(kind, start + i).iter().take(wanted as usize) {
                        let (ray, finding) = (step.ray, ask(check, kind, step));
                        tally.count(&finding);
                        if finding.class != Class::Same {
                            part.worst.push(Case { kind, ray, finding });
                        }
                    }
                }
                part.keep_worst(keep);
                stage.advance(tally.rays);
                (tally, part.worst)
            })
            .collect();
        let mut sum = Tally::default();
        for (tally, worst) in parts {
            sum.add(&tally);
            out.worst.extend(worst);
            out.keep_worst(keep);
        }
        sum
    };
    let n = RayKind::ALL.len() as u64;
    let share = |k: u64| rays * k / n;
    let mut kinds: Vec<(RayKind, Tally)> = RayKind::ALL
        .into_iter()
        .zip(0..)
        .map(|(kind, k)| (kind, compare(kind, 0, share(k + 1) - share(k))))
        .collect();
    let left = rays - kinds.iter().map(|(_, t)| t.rays).sum::<u64>();
    // From a walk on that no share above came to.
    kinds.push((RayKind::Random, compare(RayKind::Random, rays, left)));
    for kind in RayKind::ALL {
        let mut sum = Tally::default();
        for (_, t) in kinds.iter().filter(|(k, _)| *k == kind) {
            sum.add(t);
        }
        out.kinds.push((kind, sum));
    }
    out
}

/// A ray and what it was traced for.
pub type Question = (RayKind, Ray);

/// Asks again about rays of an earlier comparison; all of them are kept.
pub fn replay(check: &CrossCheck<'_>, cases: &[Question]) -> Agreement {
    let mut out = Agreement::default();
    for kind in RayKind::ALL {
        let mut tally = Tally::default();
        for (_, ray) in cases.iter().filter(|(k, _)| *k == kind) {
            let (ray, step) = (*ray, Step::from(*ray));
            let finding = ask(check, kind, &step);
            tally.count(&finding);
            out.worst.push(Case { kind, ray, finding });
        }
        out.kinds.push((kind, tally));
    }
    out.keep_worst(cases.len());
    out
}

/// A number for JSON, which knows no infinity.
fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

/// A case as JSON, from which [`parse_case`] makes the same ray again, to the bit.
pub fn case_to_json(case: &Case) -> serde_json::Value {
    let hit = |h: &Option<Hit>| {
        h.map(|h| {
            serde_json::json!({
                "t": h.t, "u": h.u, "v": h.v, "prim": h.prim, "object": h.object.0,
            })
        })
    };
    let r = &case.ray;
    serde_json::json!({
        "kind": case.kind.name(),
        "o": r.o.to_array(),
        "d": r.d.to_array(),
        "tmin": r.tmin,
        "tmax": finite(f64::from(r.tmax)),
        "class": case.finding.class.name(),
        "reason": case.finding.reason,
        "ratio": finite(case.finding.ratio),
        "subject": hit(&case.finding.subject),
        "reference": hit(&case.finding.reference),
    })
}

/// Kind and ray of a case in JSON; the error says what is wrong with it.
///
/// # Errors
/// The first field that is missing or no number.
pub fn parse_case(value: &serde_json::Value) -> Result<Question, String> {
    let name = value["kind"].as_str().ok_or("'kind' is no text")?;
    let kind = RayKind::ALL
        .into_iter()
        .find(|k| k.name() == name)
        .ok_or_else(|| format!("'kind' is '{name}', which is none"))?;
    let number = |v: &serde_json::Value, what: &str| {
        v.as_f64()
            .map(|x| x as f32)
            .ok_or_else(|| format!("'{what}' is no number"))
    };
    let vector = |what: &str| -> Result<_, String> {
        let v = &value[what];
        Ok([
            number(&v[0], what)?,
            number(&v[1], what)?,
            number(&v[2], what)?,
        ])
    };
    let tmax = match &value["tmax"] {
        serde_json::Value::Null => f32::INFINITY,
        v => number(v, "tmax")?,
    };
    let ray = Ray {
        o: vector("o")?.into(),
        d: vector("d")?.into(),
        tmin: number(&value["tmin"], "tmin")?,
        tmax,
    };
    Ok((kind, ray))
}
