//! How wide kernels are, and where they end: decided at some sites by the photons of a pilot
//! emission. Since those are not the photons that a kernel counts, neither its radius nor the
//! test that narrows it can prefer one outcome of the count to another, and the mean of an
//! estimate is exact whatever the photons' arrangement. (The distance to the `k`-th neighbour
//! among the counted photons themselves is exact for random ones only; for stratified ones it
//! loses up to `1/k`.)
//!
//! Source: for kernels chosen by photons of other passes, Kaplanyan and Dachsbacher, *Adaptive
//! Progressive Photon Mapping*, ACM TOG 32(2), 2013.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::clearing::{Clearing, Plane, Seen, Surroundings};
use super::ground::Ground;
use super::nearest::Closest;
use super::{KdTree, Limits, Nearest, PackedNormal, PhotonMap, Side, Site};
use crate::control::Control;
use crate::math::Vec3;
use crate::photons::PhotonClass;

/// Pilot photons that tell a density: enough for a radius good to a tenth.
const PILOT_NEAREST: usize = 16;

/// Where light is even by a χ² test, a kernel holds up to so many times the photons.
const EVEN: usize = 4;

/// Sites nearer to each other than this part of their radius are one.
const THINNING: f32 = 1.0 / 64.0;

/// A kernel.
#[derive(Clone, Copy)]
pub struct Kernel<'a> {
    /// Radius in metres.
    pub radius: f32,
    /// The site that has looked around, unless all is flat there.
    from: Option<Site>,
    /// What limits it.
    clearing: Option<&'a Clearing>,
}

impl<'a> Kernel<'a> {
    /// A disc, of which nothing more is known.
    pub(super) fn disc(radius: f32) -> Self {
        Self {
            radius,
            from: None,
            clearing: None,
        }
    }

    /// A disc near `site`, on the ground that was seen from there.
    pub(super) fn seen(site: &Site, radius: f32, seen: &'a Seen) -> Self {
        match seen {
            Seen::Flat => Self::disc(radius),
            Seen::Bent => Self::on_ground(site, radius, None),
            Seen::Limited(clearing) => Self::on_ground(site, radius, Some(clearing)),
        }
    }

    fn on_ground(site: &Site, radius: f32, clearing: Option<&'a Clearing>) -> Self {
        Self {
            radius,
            from: Some(*site),
            clearing,
        }
    }

    #[inline]
    pub(super) fn plane(&self) -> Option<Plane<'a>> {
        let from = self.from?;
        self.clearing.map(|c| Plane::new(c, from.p, from.ng))
    }

    /// The surface whose tangent plane the area of this kernel at a place is measured in, if that
    /// may be another than the one of the place itself.
    #[inline]
    pub(super) fn ground(&self, at: Vec3) -> Option<Ground> {
        let ground = Ground::new(&self.from?, self.radius);
        // A place above the ground lies on something else, which nobody has looked at.
        (self.clearing.is_some() || ground.supports(at)).then_some(ground)
    }
}

/// What was decided at a site.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Decision {
    ng: PackedNormal,
    /// Radius of a kernel that knows nothing more.
    radius: f32,
    /// How far around the site light is even: kernels within are as wide as they can be there.
    even: f32,
    /// Index of its clearing; [`OPEN`] or [`BENT`] if there is none.
    clearing: u32,
}

/// Nothing ends or blocks the surface, which is flat.
const OPEN: u32 = u32::MAX;

/// Nothing ends or blocks the surface, but it bends.
const BENT: u32 = u32::MAX - 1;

/// How far from its site a kernel with a clearing may serve, in radii: its corners lie within
/// twice the radius, and no point is as high above as it is far.
const FARTHEST: f32 = 2.0 * std::f32::consts::SQRT_2;

impl Decision {
    #[inline]
    fn is_limited(&self) -> bool {
        self.clearing < BENT
    }

    /// Squared distance from the site up to which the kernel may serve.
    #[inline]
    fn limit(&self) -> f32 {
        let reach = if !self.is_limited() {
            self.radius
        } else {
            FARTHEST * self.radius
        };
        reach * reach
    }
}

/// The kernels of a map.
#[derive(Debug, Default)]
pub struct Kernels {
    /// Where kernels were decided: the tree has the positions.
    pub(super) tree: KdTree,
    /// How far they may serve.
    limits: Limits,
    pub(super) decisions: Vec<Decision>,
    pub(super) clearings: Vec<Clearing>,
    /// The radius where no pilot photon came.
    pub(super) widest: f32,
}

/// What kernels are decided by.
pub struct Pilot<'a> {
    /// Where the surfaces stand.
    pub around: Surroundings<'a>,
    /// Photons that a kernel is to hold.
    pub nearest: usize,
    /// Photons of the map for each of the pilot's.
    pub ratio: f64,
}

impl Pilot<'_> {
    /// Decides kernels at the photons of the pilot emission that `keep` accepts. `area` is that
    /// of all surfaces in m².
    pub fn kernels(
        &self,
        photons: Vec<crate::photons::Photon>,
        area: f64,
        keep: impl Fn(PhotonClass) -> bool,
        control: &Control,
    ) -> Kernels {
        let photons: Vec<_> = photons.into_iter().filter(|p| keep(p.class)).collect();
        let stage = control.stage("kernels", "sites", photons.len() as u64);
        // Of as many pilot photons the kernel would hold `nearest` of the map's.
        let even = super::even_radius(self.nearest, area, photons.len() as f64 * self.ratio);
        let map = PhotonMap::build(photons, PILOT_NEAREST, area);
        let scale = (self.nearest as f64 / (PILOT_NEAREST as f64 * self.ratio)).sqrt();
        let widest = (super::REACH * even) as f32;
        let decided: Vec<(Vec3, Decision, Seen)> = map
            .photons()
            .par_chunks(1024)
            .flat_map_iter(|chunk| {
                let (mut found, mut last2) = (Nearest::new(), f32::INFINITY);
                let mut part: Vec<(Vec3, Decision, Seen)> = Vec::new();
                for photon in chunk {
                    let site = Site {
                        p: Vec3::from(photon.p),
                        ng: photon.ng(),
                    };
                    let [near, far] = map.spread(&site, photon, EVEN, &mut found, &mut last2);
                    let [radius, even] = [near, far].map(|near| {
                        let radius = (f64::from(near) * scale) as f32;
                        radius.clamp(super::LEAST * widest, widest)
                    });
                    // Photons in one place need to be counted once only.
                    let apart = THINNING * radius;
                    if part.last().is_some_and(|(p, last, _)| {
                        p.distance_squared(site.p) < apart * apart && last.ng == photon.packed_ng()
                    }) {
                        continue;
                    }
                    let wide = (even > radius).then(|| self.around.look(&site, even));
                    let (even, seen) = match wide {
                        Some(seen @ Seen::Flat) => (even, seen),
                        _ => (radius, self.around.look(&site, radius)),
                    };
                    let decision = Decision {
                        ng: photon.packed_ng(),
                        radius,
                        even,
                        clearing: OPEN,
                    };
                    part.push((site.p, decision, seen));
                }
                stage.advance(chunk.len() as u64);
                part
            })
            .collect();
        let mut clearings = Vec::new();
        let mut sites: Vec<(Vec3, Decision)> = decided
            .into_iter()
            .map(|(p, mut decision, seen)| {
                match seen {
                    Seen::Flat => {}
                    Seen::Bent => decision.clearing = BENT,
                    Seen::Limited(c) => {
                        decision.clearing = clearings.len() as u32;
                        clearings.push(c);
                    }
                }
                (p, decision)
            })
            .collect();
        let tree = KdTree::build(&mut sites, |s| s.0.into());
        let decisions = sites.into_iter().map(|s| s.1).collect();
        Kernels::new(tree, decisions, clearings, widest)
    }
}

impl Kernels {
    /// Those of the sites in a tree.
    pub(super) fn new(
        tree: KdTree,
        decisions: Vec<Decision>,
        clearings: Vec<Clearing>,
        widest: f32,
    ) -> Self {
        Self {
            limits: tree.limits(|i| decisions[i].limit(), decisions.len()),
            tree,
            decisions,
            clearings,
            widest,
        }
    }

    /// Number of sites.
    pub fn len(&self) -> usize {
        self.decisions.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.decisions.is_empty()
    }

    /// The sites themselves.
    pub fn sites(&self) -> impl IndexedParallelIterator<Item = Site> + '_ {
        (0..self.len()).into_par_iter().map(|i| self.site(i))
    }

    fn site(&self, i: usize) -> Site {
        Site {
            p: self.tree.position(i),
            ng: self.decisions[i].ng.unpack(),
        }
    }

    /// The kernel decided at a site of a number.
    pub fn at(&self, i: usize) -> Kernel<'_> {
        let decision = &self.decisions[i];
        if decision.clearing == OPEN {
            return Kernel::disc(decision.even);
        }
        let clearing = self.clearings.get(decision.clearing as usize);
        Kernel::on_ground(&self.site(i), decision.radius, clearing)
    }

    /// The same for a point that it serves: no wider than lies in what was found even.
    pub(super) fn beside(&self, i: usize, p: Vec3) -> Kernel<'_> {
        let (kernel, decision) = (self.at(i), &self.decisions[i]);
        Kernel {
            radius: decision
                .radius
                .max(kernel.radius - self.tree.position(i).distance(p)),
            ..kernel
        }
    }

    /// The nearest site on the same side of the same surface that has looked at what lies around
    /// `site`.
    #[inline]
    pub fn nearest(&self, site: &Site) -> Option<usize> {
        let side = Side::new(site);
        // Nearly always something lies close by; the wide search is for dark regions.
        [0.25, 1.0].into_iter().find_map(|reach| {
            let r = self.widest * reach;
            let mut found = Closest::new(r * r);
            // Where sites lie close beside what is large, thousands of them are near that do not
            // serve here.
            let wanted = |i: usize, p: Vec3, _: f32| {
                let d = &self.decisions[i];
                // Twice the radius is open, so that all of a kernel here is, too.
                site.p.distance_squared(p) <= d.limit()
                    && side.accepts(p, d.ng, r * r)
                    && (!d.is_limited()
                        || self
                            .at(i)
                            .plane()
                            .is_some_and(|plane| plane.contains(site.p)))
            };
            self.tree
                .visit_wanted(site.p, &self.limits, &mut found, wanted);
            found.item.map(|i| i as usize)
        })
    }

    /// The radius at a site that none has looked at: that of the nearest, and the widest where
    /// none is near.
    pub(super) fn radius(&self, site: &Site) -> f32 {
        let mut found = Closest::new(self.widest * self.widest);
        let side = Side::new(site);
        self.tree.visit_near(site.p, &mut found, |i, p, r2| {
            side.accepts(p, self.decisions[i].ng, r2)
        });
        match found.item {
            Some(i) => self.decisions[i as usize].radius.max(found.d2.sqrt()),
            None => self.widest,
        }
    }
}
