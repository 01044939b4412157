//! A guard against leaks. A backend in single precision may lose a ray that passes a vertex
//! within its rounding, so that it leaves a room without a hole; such a ray is asked again.
//!
//! Only a ray without end that hit nothing is doubtful, and only where hardly any ray leaves the
//! scene is the second question cheap: whoever puts the guard on has found out before. Where
//! light may leave anyway, a lost ray in millions is not seen.

use std::ops::Deref;

use super::{Accelerator, BuildStats};
use crate::geometry::{Hit, Ray};
use crate::math::robust::UNIT_ROUNDOFF;

/// How far aside of the ray the next questions look, in units of roundoff of its direction. What
/// is lost is lost within few of them.
const ASIDE: [f64; 2] = [4.0, -16.0];

/// A backend that asks again, its own or a borrowed one.
pub struct Guarded<A> {
    inner: A,
}

impl<A: Deref<Target: Accelerator>> Guarded<A> {
    /// Guards a backend. Not for scenes with surfaces that are not whole, where a ray that asks
    /// again would have a second chance.
    pub fn new(inner: A) -> Self {
        Self { inner }
    }

    #[cold]
    fn again(&self, ray: &Ray) -> Option<Hit> {
        if ray.tmax < f32::INFINITY || !ray.is_valid() {
            return None;
        }
        let d = ray.direction();
        let (x, y) = d.normalize().any_orthonormal_pair();
        // Along neither axis, where edges of made meshes often lie.
        let aside = (x + 0.6 * y) * d.length() * UNIT_ROUNDOFF;
        ASIDE.iter().find_map(|k| {
            self.inner.intersect(&Ray {
                d: (d + aside * *k).as_vec3(),
                ..*ray
            })
        })
    }
}

impl<A: Deref<Target: Accelerator> + Send + Sync> Accelerator for Guarded<A> {
    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.inner.intersect(ray).or_else(|| self.again(ray))
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.inner.occluded(ray) || self.again(ray).is_some()
    }

    fn watertight(&self) -> bool {
        true
    }

    fn stats(&self) -> BuildStats {
        let inner = self.inner.stats();
        BuildStats {
            backend: format!("{}, guarded against leaks", inner.backend),
            ..inner
        }
    }
}
