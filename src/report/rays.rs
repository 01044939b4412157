//! Rays like those that rendering traces, by kind, for comparing backends.
//!
//! Walk `i` of a kind is a pure function of (seed, kind, `i`) and of the reference backend, which
//! is what paths are followed with. All of a walk's segments serve: following a path for the sake
//! of its last one would take most of the time.

use arrayvec::ArrayVec;

use crate::accel::Accelerator;
use crate::cameras::Camera;
use crate::geometry::{Hit, ObjectId, Ray, Shape, SurfacePoint};
use crate::materials::TransportMode;
use crate::math::{BoundingSphere, DVec3};
use crate::photons::PhotonSource;
use crate::sampling::{Rng, hash2, stream, warp};
use crate::scene::Scene;

/// What a ray is traced for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayKind {
    /// From the camera.
    Camera,
    /// From a surface toward a light; only whether it is blocked is asked.
    Shadow,
    /// A photon's segment, from the light or between surfaces.
    Photon,
    /// A continuation of a camera path.
    Bounced,
    /// From anywhere to anywhere, half of them with an end.
    Random,
    /// At a vertex, an edge or the rim of a sphere, where backends differ most.
    Aimed,
}

impl RayKind {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Camera,
        Self::Shadow,
        Self::Photon,
        Self::Bounced,
        Self::Random,
        Self::Aimed,
    ];

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Shadow => "shadow",
            Self::Photon => "photon",
            Self::Bounced => "bounced",
            Self::Random => "random",
            Self::Aimed => "aimed",
        }
    }
}

/// Most rays of a walk.
pub const WALK: usize = 5;

/// Paths that are tried before a walk is left short, for instance where most of the light leaves
/// the scene at once.
const TRIES: u64 = 8;

/// A ray, and what the reference says to it if a path went on along it.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// The ray.
    pub ray: Ray,
    /// Its nearest hit, where that is known.
    pub hit: Option<Option<Hit>>,
}

impl From<Ray> for Step {
    fn from(ray: Ray) -> Self {
        Self { ray, hit: None }
    }
}

/// Rays that are made together.
pub type Walk = ArrayVec<Step, WALK>;

/// Makes rays.
pub struct RayMaker<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Where camera paths begin.
    pub camera: &'a dyn Camera,
    /// Photons as rendering emits them.
    pub photons: Vec<Box<dyn PhotonSource + 'a>>,
    /// What paths are followed with.
    pub accel: &'a dyn Accelerator,
    /// The seed.
    pub seed: u64,
}

impl RayMaker<'_> {
    /// Walk `i` of a kind: [`WALK`] rays, fewer where the scene hardly has such, none for instance
    /// without a light.
    pub fn walk(&self, kind: RayKind, i: u64) -> Walk {
        let key = hash2(hash2(self.seed, stream::TOOL), kind as u64);
        let mut walk = Walk::new();
        for try_ in 0..TRIES {
            let mut rng = Rng::new(hash2(key, hash2(i, try_)));
            // `None` where the path ended or the walk is full.
            let _: Option<()> = self.extend(&mut walk, kind, i, &mut rng);
            if walk.is_full() {
                break;
            }
        }
        walk
    }

    fn extend(&self, walk: &mut Walk, kind: RayKind, i: u64, rng: &mut Rng) -> Option<()> {
        use TransportMode::{Importance, Radiance};
        match kind {
            RayKind::Camera => loop {
                push(walk, self.camera_ray(rng))?;
            },
            RayKind::Bounced => {
                let ray = self.camera_ray(rng);
                let mut sp = self.at(&ray, self.accel.intersect(&ray))?;
                loop {
                    push(walk, self.bounce(&sp, Radiance, rng))?;
                    sp = self.end(walk)?;
                }
            }
            RayKind::Photon => {
                push(walk, self.photon(i, rng)?)?;
                loop {
                    let sp = self.end(walk)?;
                    push(walk, self.bounce(&sp, Importance, rng))?;
                }
            }
            RayKind::Shadow => {
                let mut ray = self.camera_ray(rng);
                loop {
                    let sp = self.at(&ray, self.accel.intersect(&ray))?;
                    push(walk, self.to_light(&sp, rng)?)?;
                    ray = self.bounce(&sp, Radiance, rng);
                }
            }
            RayKind::Random => loop {
                push(walk, self.random(rng))?;
            },
            RayKind::Aimed => loop {
                let o = somewhere(&self.around(), 1.5, rng);
                let target = self.delicate(o, rng)?;
                // From where the ray really begins, once that is rounded.
                let o = Ray::new(o, DVec3::X).origin();
                push(walk, Ray::new(o, target - o))?;
            },
        }
    }

    fn around(&self) -> BoundingSphere {
        self.scene.bounds.bounding_sphere()
    }

    fn camera_ray(&self, rng: &mut Rng) -> Ray {
        let [x, y] = rng.next_2d();
        let (o, d) = self.camera.ray(x, y, [0.5; 2]);
        Ray::new(o, d)
    }

    fn photon(&self, i: u64, rng: &mut Rng) -> Option<Ray> {
        let sources: Vec<_> = self.photons.iter().filter(|s| !s.is_empty()).collect();
        let source = sources.get(i as usize % sources.len().max(1))?;
        Some(source.emit(rng.next_u64() % source.len())?.ray)
    }

    /// A segment, or a whole line.
    fn random(&self, rng: &mut Rng) -> Ray {
        let around = self.around();
        let o = somewhere(&around, 2.0, rng);
        let mut ray = Ray::new(o, somewhere(&around, 1.0, rng) - o);
        if rng.next_1d() < 0.5 {
            let (a, b) = (rng.next_1d() as f32, rng.next_1d() as f32);
            (ray.tmin, ray.tmax) = (a.min(b), a.max(b));
        }
        ray
    }

    fn to_light(&self, sp: &SurfacePoint, rng: &mut Rng) -> Option<Ray> {
        let (id, _, rest) = self.scene.pick_light(sp.p, None, rng.next_1d())?;
        let light = self.scene.light(id);
        let li = light.sample_li(sp.p, [rest, rng.next_1d()])?;
        Some(match li.target {
            Some(target) => sp.spawn_to(target),
            None => sp.spawn(li.wi),
        })
    }

    fn at(&self, ray: &Ray, hit: Option<Hit>) -> Option<SurfacePoint> {
        Some(self.scene.surface_point(ray, &hit?))
    }

    /// Where the last ray of a walk ends.
    fn end(&self, walk: &mut Walk) -> Option<SurfacePoint> {
        let last = walk.last_mut()?;
        let hit = self.accel.intersect(&last.ray);
        last.hit = Some(hit);
        self.at(&last.ray, hit)
    }

    fn bounce(&self, sp: &SurfacePoint, mode: TransportMode, rng: &mut Rng) -> Ray {
        let bsdf = self.scene.bsdf(sp, None, mode);
        // What scatters nothing is left in any direction: a ray is all that is wanted.
        let wi = bsdf
            .sample(rng.next_1d(), rng.next_2d())
            .map_or_else(|| warp::sphere(rng.next_2d()), |s| s.wi);
        sp.spawn(wi)
    }

    /// A vertex, a point of an edge, or one of the rim of a sphere seen from `o`.
    fn delicate(&self, o: DVec3, rng: &mut Rng) -> Option<DVec3> {
        let geometry = &self.scene.geometry;
        let n = geometry.objects.len() as u64;
        let id = ObjectId(rng.next_u64().checked_rem(n)? as u32);
        let object = geometry.object(id);
        let shape = geometry.shape(object.shape);
        let prim = rng.next_u64().checked_rem(shape.len() as u64)? as u32;
        let (to_world, to_object) = match &object.placement {
            None => Default::default(),
            Some(p) => (p.world_from_object, p.object_from_world),
        };
        let local = match shape {
            Shape::Mesh(mesh) => {
                let v = mesh.corners(prim);
                let k = (rng.next_u64() % 3) as usize;
                if rng.next_u64().is_multiple_of(2) {
                    v[k]
                } else {
                    v[k] + (v[(k + 1) % 3] - v[k]) * rng.next_1d()
                }
            }
            Shape::Spheres(set) => {
                let (c, r) = set.get(prim);
                let o = to_object.transform_point3(o);
                let to = c - o;
                let (axis, distance) = (to.normalize_or(DVec3::Z), to.length());
                if distance <= r {
                    c + warp::sphere(rng.next_2d()) * r
                } else {
                    // Where tangents from `o` touch.
                    let side = warp::sphere(rng.next_2d());
                    let side =
                        (side - axis * side.dot(axis)).normalize_or(axis.any_orthogonal_vector());
                    let sin = r / distance;
                    c - axis * (r * sin) + side * (r * (1.0 - sin * sin).sqrt())
                }
            }
        };
        Some(to_world.transform_point3(local))
    }
}

/// Adds a ray to a walk; `None` if it is none, or the walk's last.
fn push(walk: &mut Walk, ray: Ray) -> Option<()> {
    if ray.is_valid() {
        walk.push(ray.into());
    }
    (ray.is_valid() && !walk.is_full()).then_some(())
}

/// A point in a ball of so many times the radius.
fn somewhere(around: &BoundingSphere, scale: f64, rng: &mut Rng) -> DVec3 {
    let r = around.radius * scale * rng.next_1d().cbrt();
    around.center + warp::sphere(rng.next_2d()) * r
}
