//! Scenes of atoms and of galaxies. Robust intersection multiplies three lengths in single
//! precision, which ends at 1e-38 and 3e38: a scene of 1e-13 m or 1e13 m would lose triangles
//! without a word. Such scenes are traced as others of common size: everything, the origins of
//! rays too, times a power of two. Directions get a power of their own that brings them to about
//! 1, since Embree takes their components below 1e-18 for 1e-18, and shadow rays come as long as
//! the scene is large. None of this rounds anything.

use std::borrow::Cow;

use super::Embree;
use crate::accel::{Accelerator, BuildStats};
use crate::geometry::{Hit, Ray, ray_key};
use crate::math::{Aabb, DAffine3, DMat3, Vec3, max_abs};

/// Exponents of two between which the largest coordinate is left as it is: cubes of lengths down
/// to a millionth of it are far from the ends of single precision.
const COMMON: std::ops::RangeInclusive<i32> = -20..=30;

/// What to multiply a geometry with these bounds by: 1 unless it is of uncommon size.
pub(super) fn wanted(bounds: Aabb) -> f32 {
    let size = max_abs(bounds.min).max(max_abs(bounds.max));
    if !(size.is_finite() && size > 0.0) {
        return 1.0;
    }
    let exponent = size.log2().round() as i32;
    if COMMON.contains(&exponent) {
        return 1.0;
    }
    to_one(exponent)
}

/// The power of two that brings numbers of about `2^exponent` to about 1, or as near as single
/// precision goes.
fn to_one(exponent: i32) -> f32 {
    2f32.powi(exponent.saturating_neg().clamp(-126, 127))
}

/// What to multiply a direction by, so that its largest component is about 1.
fn unit(d: Vec3) -> f32 {
    to_one(d.abs().max_element().log2().round() as i32)
}

/// All numbers times `scale`.
pub(super) fn scaled<const N: usize>(values: &[[f32; N]], scale: f32) -> Cow<'_, [[f32; N]]> {
    match scale {
        1.0 => Cow::Borrowed(values),
        _ => values.iter().map(|v| v.map(|x| x * scale)).collect(),
    }
}

/// The map from a shape that is `own` times as large to a world that is `scale` times as large.
pub(super) fn map(world_from_object: &DAffine3, scale: f32, own: f32) -> DAffine3 {
    let (scale, own) = (f64::from(scale), f64::from(own));
    DAffine3 {
        matrix3: DMat3 {
            x_axis: world_from_object.matrix3.x_axis * (scale / own),
            y_axis: world_from_object.matrix3.y_axis * (scale / own),
            z_axis: world_from_object.matrix3.z_axis * (scale / own),
        },
        translation: world_from_object.translation * scale,
    }
}

/// Embree over a scene that is `scale` times as large.
pub(super) struct Scaled {
    pub(super) embree: Embree,
    pub(super) scale: f32,
}

impl Scaled {
    /// The ray as Embree traces it, and how much farther distances are along it.
    fn ray(&self, ray: &Ray) -> (Ray, f64) {
        let unit = unit(ray.d);
        let farther = f64::from(self.scale) / f64::from(unit);
        let along = |t: f32| (f64::from(t) * farther) as f32;
        let ray = Ray {
            o: ray.o * self.scale,
            d: ray.d * unit,
            tmin: along(ray.tmin),
            tmax: along(ray.tmax),
        };
        (ray, farther)
    }
}

impl Accelerator for Scaled {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let (traced, farther) = self.ray(ray);
        let hit = self.embree.nearest(&traced, || ray_key(ray))?;
        Some(Hit {
            t: (f64::from(hit.t) / farther) as f32,
            ..hit
        })
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.embree.any(&self.ray(ray).0, || ray_key(ray))
    }

    fn stats(&self) -> BuildStats {
        self.embree.stats()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;

    #[test]
    fn common_sizes_are_left_alone_and_others_come_to_one() {
        let of = |size: f64| {
            wanted(Aabb {
                min: DVec3::ZERO,
                max: DVec3::new(0.0, size, 0.0),
            })
        };
        for size in [1e-6, 1e-3, 1.0, 1e3, 1e9] {
            assert_eq!(of(size), 1.0, "{size}");
        }
        for size in [1e-30, 1e-13, 1e-7, 3e9, 1e13, 1e18] {
            let s = f64::from(of(size));
            assert!((0.7..1.5).contains(&(s * size)), "{size}");
            assert_eq!(s.log2().fract(), 0.0);
        }
        assert_eq!(wanted(Aabb::EMPTY), 1.0);
    }

    #[test]
    fn directions_of_any_length_come_to_one() {
        for length in [1e-37, 1e-18, 0.7, 1.0, 3.0, 1e18, 1e38] {
            let s = unit(Vec3::new(0.3 * length, -length, 0.0));
            assert!((0.7..1.5).contains(&(s * length)), "{length}");
            assert_eq!(s.log2().fract(), 0.0);
        }
        // What is no direction stays none.
        assert_eq!(Vec3::ZERO * unit(Vec3::ZERO), Vec3::ZERO);
        let no_number = Vec3::new(f32::NAN, 1.0, f32::INFINITY);
        assert!(!(no_number * unit(no_number)).is_finite());
    }
}
