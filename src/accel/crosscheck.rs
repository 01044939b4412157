//! Two backends asked the same question: every difference is explained, or it is a bug.
//!
//! A backend in single precision answers exactly, but for a ray and a primitive that it moved by
//! its rounding: by at most `δ = 16·u·s`, `u = 2⁻²⁴`, with `s` the largest number it computed
//! with (origin, corners, way travelled; for an instance also the terms of its map). To first
//! order the distance then moves by `∂t/∂o·δ = δ / (n·d)`, `n` the unit normal at the hit: that
//! bounds what may be called a tie. Where the ray passes an outline nearer than `δ`, it may be
//! seen on either side of it. Nothing else may differ.

use super::Accelerator;
use crate::ad::V3;
use crate::geometry::{CoverageQuery, Geometry, Hit, Placement, Ray, Shape, ray_key, sphere};
use crate::math::robust::UNIT_ROUNDOFF;
use crate::math::{DMat3, DVec3, max_abs};

/// Units of roundoff that a backend may lose in one intersection: the factor of
/// [`spawn_offset`](crate::math::robust::spawn_offset), for the same reasons.
const FACTOR: f64 = 16.0;

/// Most hits that one backend may have passed over on the way to the other's answer.
const MOST_SKIPPED: usize = 256;

/// How a difference is explained, mildest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// There is none.
    Same,
    /// Two hits, a hit and an end of the segment, or chance and opacity, too close to be told
    /// apart.
    Tie,
    /// The ray passes an edge or a silhouette too closely to say on which side.
    Edge,
    /// A bug.
    Unexplained,
}

impl Class {
    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Tie => "tie",
            Self::Edge => "edge",
            Self::Unexplained => "unexplained",
        }
    }
}

/// What two backends said about one ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding {
    /// How they differ.
    pub class: Class,
    /// Whether the subject hit anything.
    pub hit: bool,
    /// What happened, for people.
    pub reason: &'static str,
    /// How far apart they are in units of the bound; above 1 nothing is explained.
    pub ratio: f64,
    /// Error of the subject's own distance, in units of its bound.
    pub distance: f64,
    /// The subject's hit.
    pub subject: Option<Hit>,
    /// The reference's hit.
    pub reference: Option<Hit>,
}

/// A geometry with two backends built over it. The reference is taken to be exact.
pub struct CrossCheck<'a> {
    /// What both were built over.
    pub geometry: &'a Geometry,
    /// The backend that is judged.
    pub subject: &'a dyn Accelerator,
    /// The backend it is judged by.
    pub reference: &'a dyn Accelerator,
}

/// One explanation: class, reason, and the share of the bound that it takes.
type Explanation = (Class, &'static str, f64);

impl CrossCheck<'_> {
    /// Asks both for the nearest hit.
    pub fn intersect(&self, ray: &Ray) -> Finding {
        self.judge(ray, self.reference.intersect(ray))
    }

    /// Asks the subject for the nearest hit, where the reference's is known.
    pub fn judge(&self, ray: &Ray, b: Option<Hit>) -> Finding {
        let a = self.subject.intersect(ray);
        let passage = a.map(|a| Passage::new(self.geometry, ray, &a));
        let (class, reason, ratio) = self.explain(ray, a.zip(passage), b);
        let distance = a.zip(passage).map_or(0.0, |(a, p)| p.error(&a));
        Finding {
            class,
            hit: a.is_some(),
            reason,
            ratio,
            distance,
            subject: a,
            reference: b,
        }
    }

    /// Asks both whether anything is in the way.
    pub fn occluded(&self, ray: &Ray) -> Finding {
        let (a, b) = (self.subject.occluded(ray), self.reference.occluded(ray));
        let mut finding = Finding {
            class: Class::Same,
            hit: a,
            reason: "",
            ratio: 0.0,
            distance: 0.0,
            subject: None,
            reference: None,
        };
        if a != b {
            // The hit that made the difference is that of the nearest-hit query.
            if a {
                finding.subject = self.subject.intersect(ray);
            } else {
                finding.reference = self.reference.intersect(ray);
            }
            (finding.class, finding.reason, finding.ratio) =
                if finding.subject.is_none() && finding.reference.is_none() {
                    let reason = "one backend's two queries contradict each other";
                    (Class::Unexplained, reason, f64::INFINITY)
                } else {
                    let passage = |a| (a, Passage::new(self.geometry, ray, &a));
                    self.explain(ray, finding.subject.map(passage), finding.reference)
                };
        }
        finding
    }

    /// Explains two answers to the same ray.
    fn explain(
        &self,
        ray: &Ray,
        subject: Option<(Hit, Passage)>,
        reference: Option<Hit>,
    ) -> Explanation {
        let Some((a, pa)) = subject else {
            return match reference {
                None => (Class::Same, "", 0.0),
                Some(b) => self.skipped(ray, b, None),
            };
        };
        let error = pa.error(&a);
        if !(error <= 1.0) {
            return (Class::Unexplained, "a distance that is wrong", error);
        }
        let passage = |h: &Hit| Passage::new(self.geometry, ray, h);
        if let Some(b) = &reference
            && (a.object, a.prim) == (b.object, b.prim)
            && (self.is_flat(&a) || pa.root == passage(b).root)
        {
            return (Class::Same, "", 0.0);
        }
        // Whatever the other says, this hit must be one.
        if let Some(wrong) = self.not_a_hit(ray, &a, &pa) {
            return wrong;
        }
        match reference {
            None => self.marginal(ray, &a, &pa),
            Some(b) => {
                let pb = passage(&b);
                if let Some(tie) = tie(&pa, &pb) {
                    return tie;
                }
                if pb.t < pa.t {
                    self.skipped(ray, b, Some(pa))
                } else {
                    self.marginal(ray, &a, &pa)
                }
            }
        }
    }

    /// Whether a line meets the primitive once at most.
    fn is_flat(&self, hit: &Hit) -> bool {
        let shape = self.geometry.object(hit.object).shape;
        matches!(self.geometry.shape(shape), Shape::Mesh(_))
    }

    /// Whether the subject may pass over what the reference hits from `b` up to the subject's
    /// own hit.
    fn skipped(&self, ray: &Ray, b: Hit, until: Option<Passage>) -> Explanation {
        let mut worst: Explanation = (Class::Same, "", 0.0);
        let mut next = b;
        for _ in 0..MOST_SKIPPED {
            let passage = Passage::new(self.geometry, ray, &next);
            if let Some(until) = &until {
                if let Some(tie) = tie(&passage, until) {
                    return worse(worst, tie);
                }
                if passage.t >= until.t {
                    return worst;
                }
            }
            worst = worse(worst, self.marginal(ray, &next, &passage));
            if worst.0 == Class::Unexplained {
                return worst;
            }
            let rest = Ray {
                tmin: next.t.next_up(),
                ..*ray
            };
            match self.reference.intersect(&rest) {
                Some(h) => next = h,
                None if until.is_none() => return worst,
                None => break,
            }
        }
        // The subject's hit lies off its primitive within the bound, where nothing exact is.
        match until {
            Some(_) => worse(
                worst,
                (Class::Edge, "a hit within the bound of an outline", 0.0),
            ),
            None => (
                Class::Unexplained,
                "too many hits passed over",
                f64::INFINITY,
            ),
        }
    }

    /// Why a backend may miss this hit.
    fn marginal(&self, ray: &Ray, hit: &Hit, passage: &Passage) -> Explanation {
        let (mut class, mut reason) = (Class::Edge, passage.outline);
        let mut ratio = passage.depth.abs() / passage.slack;
        for end in [ray.tmin, ray.tmax].into_iter().filter(|e| e.is_finite()) {
            let r = (f64::from(end) - passage.t).abs() / passage.dt;
            if r < ratio {
                (class, reason, ratio) = (Class::Tie, "an end of the segment", r);
            }
        }
        if ratio > 1.0 && self.coverage(ray, hit, passage) == [true; 2] {
            (class, reason, ratio) = (Class::Tie, "opacity at its threshold", 0.0);
        }
        if ratio <= 1.0 {
            (class, reason, ratio)
        } else {
            (Class::Unexplained, "a hit was missed", ratio)
        }
    }

    /// What is wrong with a reported hit, if anything.
    fn not_a_hit(&self, ray: &Ray, hit: &Hit, passage: &Passage) -> Option<Explanation> {
        let outside = -passage.depth / passage.slack;
        let before = (f64::from(ray.tmin) - passage.t) / passage.dt;
        let after = (passage.t - f64::from(ray.tmax).min(f64::MAX)) / passage.dt;
        let ratio = outside.max(before).max(after);
        let bad = |reason, ratio| Some((Class::Unexplained, reason, ratio));
        if !(ratio <= 1.0) {
            return bad("a hit that is none", ratio);
        }
        if !self.coverage(ray, hit, passage)[1] {
            return bad("a hit where there is no surface", f64::INFINITY);
        }
        None
    }

    /// Whether the hit may be let through, and whether it may be stopped, by the coverage of the
    /// object anywhere within the bound around it.
    fn coverage(&self, ray: &Ray, hit: &Hit, passage: &Passage) -> [bool; 2] {
        let object = self.geometry.object(hit.object);
        let Some(coverage) = &object.coverage else {
            return [false, true];
        };
        let shape = self.geometry.shape(object.shape);
        let mut seen = [false; 2];
        let mut ask = |barycentrics| {
            let query = CoverageQuery {
                key: ray_key(ray),
                object: hit.object.0,
                prim: hit.prim,
                barycentrics,
                outward: passage.root == 1,
            };
            seen[usize::from(query.stops(&**coverage, shape))] = true;
        };
        ask([f64::from(hit.u), f64::from(hit.v)]);
        let ([b1, b2], [r1, r2]) = (passage.barycentrics, passage.spread);
        for i in -2i8..=2 {
            for j in -2i8..=2 {
                let step = |k: i8| 0.5 * f64::from(k);
                ask([b1 + r1 * step(i), b2 + r2 * step(j)]);
            }
        }
        seen
    }
}

/// Two hits whose distances differ by no more than their bounds.
fn tie(a: &Passage, b: &Passage) -> Option<Explanation> {
    if a.dt + b.dt == f64::INFINITY {
        return Some((Class::Edge, "a triangle edge-on within the bound", 0.0));
    }
    let ratio = (a.t - b.t).abs() / (a.dt + b.dt);
    (ratio <= 1.0).then_some((Class::Tie, "two hits at one distance", ratio))
}

/// The one that needs the stronger explanation.
fn worse(a: Explanation, b: Explanation) -> Explanation {
    if b.0 > a.0 || (b.0 == a.0 && b.2 > a.2) {
        b
    } else {
        a
    }
}

/// How a ray passes a primitive, in the space of its shape.
#[derive(Clone, Copy, Debug)]
struct Passage {
    /// Distance in units of `|d|`, in double precision.
    t: f64,
    /// Which of a sphere's intersections: 0 where the ray enters; 0 for a triangle.
    root: u8,
    /// Depth inside the outline as seen along the ray, in metres; negative outside. Of a
    /// triangle, inside the lines through its edges: that is what backends compute. Outside of an
    /// edge's ends in units of how far its line moves there if they move by a metre.
    depth: f64,
    /// Bound `δ` on the rounding of positions, in metres.
    slack: f64,
    /// Bound on the rounding of `t`; there is none for a triangle that rounding may turn edge-on.
    dt: f64,
    /// Barycentric weights, and their bound.
    barycentrics: [f64; 2],
    spread: [f64; 2],
    /// What the outline is.
    outline: &'static str,
}

impl Passage {
    fn new(geometry: &Geometry, ray: &Ray, hit: &Hit) -> Self {
        let object = geometry.object(hit.object);
        let (mut o, mut d, mut terms) = (ray.origin(), ray.direction(), 0.0);
        if let Some(place) = &object.placement {
            terms = map_terms(place, ray, f64::from(hit.t));
            o = place.object_from_world.transform_point3(o);
            d = place.object_from_world.transform_vector3(d);
        }
        let passage = match geometry.shape(object.shape) {
            Shape::Mesh(mesh) => triangle(o, d, mesh.corners(hit.prim), f64::from(hit.t), terms),
            Shape::Spheres(set) => {
                let (c, r) = set.get(hit.prim);
                ball(o, d, c, r, f64::from(hit.t), terms)
            }
        };
        Self {
            // The distance itself is rounded to single precision.
            dt: passage.dt + UNIT_ROUNDOFF * passage.t.abs() + f64::from(f32::MIN_POSITIVE),
            ..passage
        }
    }

    /// How far off the distance of `hit` is, in units of the bound.
    fn error(&self, hit: &Hit) -> f64 {
        (f64::from(hit.t) - self.t).abs() / self.dt
    }
}

/// The largest term in a ray's way into the frame of an instance. The map itself is inverted in
/// single precision, which costs its condition number.
fn map_terms(place: &Placement, ray: &Ray, t: f64) -> f64 {
    let absolute = |m: DMat3| DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
    let there = absolute(place.object_from_world.matrix3);
    let condition = max_abs(there * absolute(place.world_from_object.matrix3) * DVec3::ONE);
    let reach = ray.origin().abs()
        + place.world_from_object.translation.abs()
        + ray.direction().abs() * t.abs();
    max_abs(there * reach) * condition
}

/// `δ` for computations with numbers up to `size` in space, and `terms` in a map.
fn slack(size: f64, terms: f64) -> f64 {
    FACTOR * UNIT_ROUNDOFF * (size + terms) + f64::from(f32::MIN_POSITIVE)
}

fn triangle(o: DVec3, d: DVec3, v: [DVec3; 3], t_backend: f64, terms: f64) -> Passage {
    let length = d.length();
    let unit = d / length;
    let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
    let n = e1.cross(e2);
    let area = n.length();
    let det = d.dot(n);
    let s = v[0] - o;
    // Beyond its corners there is nothing of the triangle, however far off its plane is met.
    let corners = v.map(|c| (c - o).dot(unit) / length);
    let nearest = corners.iter().copied().fold(f64::INFINITY, f64::min);
    let farthest = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let t = if det == 0.0 {
        t_backend
    } else {
        s.dot(n) / det
    };
    let t = t.max(nearest).min(farthest);
    let far = v.iter().fold(max_abs(o), |m, c| m.max(max_abs(*c)));
    let extent = e1.length().max(e2.length()).max((e2 - e1).length());
    let slack = slack(far + (s.length() + extent), terms);
    // Seen along the ray, about its origin: how far to the left of each edge's line.
    let seen = v.map(|c| (c - o) - unit * (c - o).dot(unit));
    let sides = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| {
        let (p, along) = (seen[i], seen[j] - seen[i]);
        let width = along.length();
        // An edge seen end-on is a point, which either side may be of.
        if width > 0.0 {
            // Ends that move turn the line of a short edge: beyond them it moves by so much more.
            let at = -p.dot(along) / width;
            let beyond = (-at).max(at - width).max(0.0);
            p.cross(along).dot(unit) / (width * (1.0 + 2.0 * beyond / width))
        } else {
            0.0
        }
    });
    let least = |sign: f64| sides.iter().fold(f64::INFINITY, |m, s| m.min(sign * s));
    let cos = det.abs() / (area * length);
    // Corners moved by `δ` turn the normal by `δ` over the height: the derivative of the distance
    // is that at the worst of these angles.
    let height = area / extent;
    let steep = cos - slack / height;
    let in_plane = if steep > 0.0 {
        slack / steep
    } else {
        f64::INFINITY
    };
    let m = s.cross(d) / det;
    Passage {
        t,
        root: 0,
        // Whichever way round it is seen; edge-on that is for rounding to say.
        depth: least(1.0).max(least(-1.0)),
        slack,
        dt: in_plane / length,
        barycentrics: [e2.dot(m), -e1.dot(m)],
        spread: [e2.length(), e1.length()].map(|e| (in_plane * e / area).min(1.0)),
        outline: "an edge",
    }
}

fn ball(o: DVec3, d: DVec3, c: DVec3, r: f64, t_backend: f64, terms: f64) -> Passage {
    let length = d.length();
    let line = sphere::line_sphere(V3::<f64>::constant(o), V3::constant(d), c, r);
    let b = (o - c + d * line.t_closest).length();
    let far = max_abs(o).max(max_abs(c) + r);
    let slack = slack(far + (o - c).length() + r, terms);
    let (root, t) = match line.roots() {
        Some([t0, t1]) if (t_backend - t1).abs() < (t_backend - t0).abs() => (1, t1),
        Some([t0, _]) => (0, t0),
        None => (0, line.t_closest),
    };
    let cos = (o + d * t - c).dot(d).abs() / (r * length);
    // At grazing the distance moves with the root of the rounding.
    let along = slack / cos.max((slack / r).min(1.0).sqrt());
    Passage {
        t,
        root,
        depth: r - b,
        slack,
        dt: along / length,
        barycentrics: [0.0; 2],
        spread: [0.0; 2],
        outline: "a silhouette",
    }
}
