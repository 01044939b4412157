//! Photon maps: photons in a tree, and what is estimated from them.

mod bandwidth;
mod clearing;
mod ground;
mod irradiance;
mod kdtree;
mod kernels;
mod nearest;
mod saved;

use clearing::Seen;
pub use clearing::Surroundings;
pub use irradiance::{IrradianceMap, IrradianceSample};
pub use kdtree::{KdTree, Limits, Search, Within};
pub use kernels::{Kernel, Kernels, Pilot};
pub use nearest::Nearest;
pub(super) use saved::{SavedKernels, SavedMap, SavedSamples};

use std::f64::consts::PI;
use std::sync::Arc;

use super::photon::{PackedNormal, Photon, PhotonClass};
use crate::color::Rgb;
use crate::geometry::Shape;
use crate::math::{DVec3, Vec3};
use crate::scene::Scene;

/// Cosine between normals up to which photons of one surface are taken for those of another.
const NORMAL_AGREEMENT: f32 = 0.8;

/// Height of the kernel over its radius: photons farther from the tangent plane lie on another
/// surface. A surface curved with radius `R` leaves the plane by `r²/2R`, so a kernel smaller
/// than half that radius is not clipped.
const FLATNESS: f32 = 0.25;

/// The search radius in units of the radius that would hold the wanted number of photons if
/// they were spread evenly over the whole scene. Where even this finds too few, light is so
/// weak that a fixed kernel serves.
const REACH: f64 = 4.0;

/// Squared distance that is searched first over the one at the neighbour.
const GUESS: f32 = 2.0;

/// The smallest kernel's radius over the largest. Photons in one place would have no density.
const LEAST: f32 = 1e-4;

/// The smallest part of its disc that a kernel may have left. On something so narrow that less is
/// left, hardly a photon would be counted, but for all the brighter.
const LEAST_SHARE: f64 = 0.08;

/// Where a density is estimated.
#[derive(Clone, Copy, Debug)]
pub struct Site {
    /// Position.
    pub p: Vec3,
    /// Unit geometric normal on the side that is lit.
    pub ng: Vec3,
}

impl Site {
    /// The site at `p` on the side of `ng`.
    #[inline]
    pub fn new(p: DVec3, ng: DVec3) -> Self {
        Self {
            p: p.as_vec3(),
            ng: ng.as_vec3(),
        }
    }
}

/// The side of a surface that a site is on: kernels never reach through a wall.
struct Side {
    p: Vec3,
    ng: Vec3,
    packed: PackedNormal,
}

impl Side {
    #[inline]
    fn new(site: &Site) -> Self {
        Self {
            p: site.p,
            ng: site.ng,
            packed: PackedNormal::new(site.ng.as_dvec3()),
        }
    }

    /// Whether a photon or sample at `q` with normal `n` belongs to the same side of the same
    /// surface, for a kernel of squared radius `r2`.
    #[inline]
    fn accepts(&self, q: Vec3, n: PackedNormal, r2: f32) -> bool {
        let height = (q - self.p).dot(self.ng);
        height * height <= FLATNESS * FLATNESS * r2
            // Where surfaces are flat nothing needs to be unpacked.
            && (n == self.packed || n.unpack().dot(self.ng) >= NORMAL_AGREEMENT)
    }

    /// Whether `q` lies over the disc of squared radius `r2` around `center` in the tangent plane.
    #[inline]
    fn over(&self, center: Vec3, q: Vec3, r2: f32) -> bool {
        let way = q - center;
        let height = way.dot(self.ng);
        way.length_squared() - height * height <= r2
    }

    /// What the area of a surface with normal `n` has of its size in the tangent plane.
    #[inline]
    fn seen(&self, n: PackedNormal) -> f64 {
        if n == self.packed {
            1.0
        } else {
            f64::from(n.unpack().dot(self.ng)).clamp(0.0, 1.0)
        }
    }
}

/// Photons in a tree.
#[derive(Debug)]
pub struct PhotonMap {
    tree: KdTree,
    photons: Vec<Photon>,
    nearest: usize,
    max_radius: f32,
    kernels: Option<Arc<Kernels>>,
}

/// What the photons near a site say.
#[derive(Clone, Copy, Debug, Default)]
pub struct Estimate {
    /// Sum of `f(photon) · power`, over the kernel's area: radiance if `f` is a BSDF value,
    /// irradiance if `f = 1`.
    pub value: Rgb,
    /// Photons per square metre.
    pub density: f64,
    /// Radius of the kernel in metres.
    pub radius: f64,
}

impl PhotonMap {
    /// Builds the map. `nearest` photons make an estimate; `area` is that of all surfaces in m².
    pub fn build(mut photons: Vec<Photon>, nearest: usize, area: f64) -> Self {
        let tree = KdTree::build(&mut photons, |p| p.p);
        let even = even_radius(nearest, area, photons.len() as f64);
        Self {
            tree,
            photons,
            nearest: nearest.max(2),
            max_radius: (REACH * even) as f32,
            kernels: None,
        }
    }

    /// The same map, estimating with kernels that others have decided.
    pub fn with_kernels(self, kernels: Arc<Kernels>) -> Self {
        Self {
            kernels: Some(kernels),
            ..self
        }
    }

    /// The kernels that others have decided.
    pub fn kernels(&self) -> Option<&Arc<Kernels>> {
        self.kernels.as_ref()
    }

    /// Distance to the farthest of the wanted number of photons around a site, or as far as is searched, and
    /// how far around they lie evenly, of up to `times` as many. Those that have no channel in common with `like`
    /// are others. `last2` is from call to call the squared distance that was last searched up to, which
    /// makes searches short where sites follow their neighbours.
    fn spread(
        &self,
        site: &Site,
        like: &Photon,
        times: usize,
        found: &mut Nearest,
        last2: &mut f32,
    ) -> [f32; 2] {
        let side = Side::new(site);
        let search = |found: &mut Nearest, k: usize, max2: f32| {
            found.reset(k, max2);
            self.tree.visit_near(site.p, found, |i, p, r2| {
                let photon = &self.photons[i];
                photon.shares_channel(like) && side.accepts(p, photon.packed_ng(), r2)
            });
        };
        let (max2, most) = (self.max_radius * self.max_radius, times * self.nearest);
        let mut k = (2 * self.nearest).min(most);
        search(found, k, max2.min(GUESS * *last2));
        if !found.kernel().0 {
            search(found, k, max2);
        }
        *last2 = found.kernel().1;
        let Some(near2) = found.nth(self.nearest) else {
            return [self.max_radius; 2];
        };
        let mut widest2 = near2;
        let frame = site.ng.any_orthonormal_pair().into();
        while k > self.nearest {
            let (enough, rim) = found.kernel();
            let even = enough
                && rim <= bandwidth::FARTHEST * widest2
                && bandwidth::is_even(&self.photons, found, rim, site.p, frame);
            if !even {
                break;
            }
            widest2 = rim;
            if 2 * k > most {
                break;
            }
            k *= 2;
            search(found, k, (bandwidth::FARTHEST * widest2).min(max2));
        }
        [near2, widest2].map(f32::sqrt)
    }

    /// Number of photons.
    pub fn len(&self) -> usize {
        self.photons.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.photons.is_empty()
    }

    /// The photons, in the order of the tree.
    pub fn photons(&self) -> &[Photon] {
        &self.photons
    }

    /// Estimates a density at `site` over the photons that `keep` accepts, weighing each by
    /// `f(wi)`; `found` is scratch space. With the kernels that others have decided, or by the
    /// nearest photons if there are none.
    #[inline]
    pub fn estimate(
        &self,
        site: &Site,
        around: Surroundings<'_>,
        found: &mut Nearest,
        keep: impl Fn(PhotonClass) -> bool,
        f: impl Fn(DVec3) -> Rgb,
    ) -> Estimate {
        let Some(kernels) = &self.kernels else {
            return self.estimate_nearest(site, found, keep, f);
        };
        if let Some(i) = kernels.nearest(site) {
            return self.estimate_within(site, kernels.beside(i, site.p), keep, f);
        }
        // In the dark, or in a nook: only if there are photons, their surroundings are looked at.
        let radius = kernels.radius(site);
        let bare = self.estimate_within(site, Kernel::disc(radius), &keep, &f);
        if bare.density == 0.0 {
            return bare;
        }
        match around.look(site, radius) {
            Seen::Flat => bare,
            seen => {
                let kernel = Kernel::seen(site, radius, &seen);
                self.estimate_within(site, kernel, keep, f)
            }
        }
    }

    /// As [`estimate`](Self::estimate), over all photons of a given kernel.
    ///
    /// A kernel's area is that of a disc in a plane, and photons count that lie over it, close to
    /// the plane. On what is tilted against it, where the surface bends, they lie closer together
    /// over the disc than on the surface, and count by so much less. Close to an edge the plane is
    /// perhaps that of the surface beyond, on which photons count as well as on this one. Where a
    /// surface bends, they count on all of it that the site of the kernel saw, as the area does.
    #[inline]
    pub fn estimate_within(
        &self,
        site: &Site,
        kernel: Kernel<'_>,
        keep: impl Fn(PhotonClass) -> bool,
        f: impl Fn(DVec3) -> Rgb,
    ) -> Estimate {
        let plane = kernel.plane();
        let r = f64::from(kernel.radius);
        let disc = PI * r * r;
        let (mut sum, mut counted) = (Rgb::ZERO, 0u32);
        let side = Side::new(site);
        let ground = kernel.ground(site.p);
        let flat = ground.as_ref().map_or(&side, |g| &g.side);
        let r2 = kernel.radius * kernel.radius;
        // What lies over the rim, as high as it may.
        let reach2 = match &ground {
            None => r2 * (1.0 + FLATNESS * FLATNESS),
            Some(ground) => ground.reach(site.p),
        };
        let mut search = Within(reach2, |i: usize| {
            let photon = &self.photons[i];
            sum += f(photon.wi()) * photon.power() * flat.seen(photon.packed_ng());
            counted += 1;
        });
        self.tree.visit_near(site.p, &mut search, |i, p, _| {
            let photon = &self.photons[i];
            let ng = photon.packed_ng();
            keep(photon.class)
                && flat.over(site.p, p, r2)
                && (side.accepts(p, ng, r2) || ground.as_ref().is_some_and(|g| g.accepts(p, ng)))
                && plane.as_ref().is_none_or(|c| c.contains(p))
        });
        if counted == 0 {
            return Estimate {
                radius: r,
                ..Default::default()
            };
        }
        let area = plane.map_or(disc, |c| c.disc(site.p, r).clamp(LEAST_SHARE * disc, disc));
        let inv_area = 1.0 / area.max(f64::MIN_POSITIVE);
        Estimate {
            value: sum * inv_area,
            density: f64::from(counted) * inv_area,
            radius: r,
        }
    }

    /// As [`estimate`](Self::estimate), by the nearest photons.
    ///
    /// With `k` nearest photons the kernel's radius is the distance to the `k`-th, which itself
    /// is not counted: `Σ_{i<k} / (π r_k²)` is unbiased on uniform light, where counting it would
    /// give a factor `k/(k−1)` too much. Where fewer than `k` lie within the search radius, all
    /// of them are taken over the disc of that radius. Of several photons at the `k`-th distance
    /// one is not counted, whichever: each counts by so much less.
    #[inline]
    pub fn estimate_nearest(
        &self,
        site: &Site,
        found: &mut Nearest,
        keep: impl Fn(PhotonClass) -> bool,
        f: impl Fn(DVec3) -> Rgb,
    ) -> Estimate {
        let max2 = self.max_radius * self.max_radius;
        found.reset(self.nearest, max2);
        let side = Side::new(site);
        self.tree.visit_near(site.p, found, |i, p, r2| {
            let photon = &self.photons[i];
            keep(photon.class) && side.accepts(p, photon.packed_ng(), r2)
        });
        let (mut full, mut r2) = found.kernel();
        if found.is_empty() {
            return Estimate {
                radius: f64::from(self.max_radius),
                ..Default::default()
            };
        }
        let least2 = max2 * (LEAST * LEAST);
        if r2 < least2 {
            (full, r2) = (false, least2);
        }
        let (mut sum, mut rim) = (Rgb::ZERO, Rgb::ZERO);
        let (mut counted, mut on_rim) = (0u32, 0u32);
        for (i, d2) in found.iter() {
            let photon = &self.photons[i];
            let share = f(photon.wi()) * photon.power();
            if full && d2 >= r2 {
                rim += share;
                on_rim += 1;
            } else {
                sum += share;
                counted += 1;
            }
        }
        if on_rim > 1 {
            sum += rim * (f64::from(on_rim - 1) / f64::from(on_rim));
            counted += on_rim - 1;
        }
        let inv_area = 1.0 / (PI * f64::from(r2).max(f64::MIN_POSITIVE));
        Estimate {
            value: sum * inv_area,
            density: f64::from(counted) * inv_area,
            radius: f64::from(r2).sqrt(),
        }
    }
}

/// Radius that holds `nearest` of `photons` if they lie evenly on `area` m².
fn even_radius(nearest: usize, area: f64, photons: f64) -> f64 {
    (nearest as f64 * area / (PI * photons.max(1.0))).sqrt()
}

/// Area of all surfaces in m², world space.
pub fn surface_area(scene: &Scene) -> f64 {
    let g = &scene.geometry;
    g.objects
        .iter()
        .map(|o| {
            let world = o.placement.map(|p| p.world_from_object);
            match g.shape(o.shape) {
                Shape::Mesh(m) => (0..m.indices.len() as u32)
                    .map(|i| {
                        let mut v = m.corners(i);
                        if let Some(w) = &world {
                            v = v.map(|p| w.transform_point3(p));
                        }
                        0.5 * (v[1] - v[0]).cross(v[2] - v[0]).length()
                    })
                    .sum::<f64>(),
                Shape::Spheres(s) => {
                    let scale = world.map_or(1.0, |w| w.matrix3.determinant().abs().cbrt());
                    (0..s.spheres.len() as u32)
                        .map(|i| 4.0 * PI * (s.get(i).1 * scale).powi(2))
                        .sum()
                }
            }
        })
        .sum()
}
