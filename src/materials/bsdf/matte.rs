//! The scattering function of the commonest surface, one Lambert lobe and nothing else, without
//! the stack: no frame for `wo`, no list of lobes, no call that is not known beforehand.

use super::{Bsdf, BsdfSample, BsdfValue, Scattering};
use crate::color::Rgb;
use crate::geometry::SurfacePoint;
use crate::materials::lobes::{Lambert, LobeModel};
use crate::math::{DVec3, Frame};
use crate::sampling::warp;

/// One Lambert lobe at a point, for radiance. It answers as the stack of that lobe would.
#[derive(Clone, Copy, Debug)]
pub struct Matte {
    lobe: Lambert,
    /// Shading normal on the side of `wo`.
    n: DVec3,
    /// Geometric normal on the side of `wo`.
    ng: DVec3,
}

impl Matte {
    /// At `sp`, with the given reflectance.
    #[inline(always)]
    pub fn new(sp: &SurfacePoint, albedo: Rgb) -> Self {
        let (n, ng) = Bsdf::normals(sp);
        Self {
            lobe: Lambert { albedo },
            n,
            ng,
        }
    }
}

impl Scattering for Matte {
    const GLOSSY: bool = false;

    #[inline(always)]
    fn eval(&self, wi: DVec3, weight: impl Fn(f64) -> f64) -> BsdfValue {
        let cos = wi.dot(self.n);
        let mut out = BsdfValue::default();
        if cos > 0.0 && wi.dot(self.ng) > 0.0 {
            out.diffuse = self.lobe.f() * (cos * weight(warp::cosine_hemisphere_pdf(cos)));
        }
        out
    }

    #[inline(always)]
    fn sample(&self, _u_lobe: f64, u: [f64; 2]) -> Option<BsdfSample> {
        let local = warp::cosine_hemisphere(u);
        let wi = Frame::from_normal(self.n).to_world(local);
        (wi.dot(self.ng) * local.z > 0.0).then(|| BsdfSample {
            wi,
            weight: self.lobe.albedo,
            pdf: warp::cosine_hemisphere_pdf(local.z),
            class: self.lobe.class(),
            transmitted: false,
        })
    }

    #[inline]
    fn diffuse_f(&self, wi: DVec3) -> Rgb {
        if wi.dot(self.ng) > 0.0 && wi.dot(self.n) > 0.0 {
            self.lobe.f()
        } else {
            Rgb::ZERO
        }
    }

    #[inline]
    fn has_finite(&self) -> bool {
        true
    }

    #[inline]
    fn as_lambert(&self) -> Option<Rgb> {
        Some(self.lobe.albedo)
    }

    #[inline]
    fn has_diffuse_transmission(&self) -> bool {
        false
    }

    #[inline]
    fn reflected_albedo(&self) -> Rgb {
        self.lobe.albedo
    }

    #[inline]
    fn transmitted_albedo(&self) -> Rgb {
        Rgb::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{LightId, MaterialId, ObjectId};
    use crate::materials::{LobeClass, TransportMode};

    #[test]
    fn it_answers_as_the_stack_of_its_one_lobe() {
        let albedo = Rgb::new(0.2, 0.5, 0.8);
        let tilted = DVec3::new(0.3, -0.2, 0.9).normalize();
        for (front, wo) in [
            (true, DVec3::new(0.1, 0.6, 0.4)),
            (false, DVec3::new(0.1, 0.6, -0.4)),
            // Its shading normal faces away from what the eye sees.
            (true, DVec3::new(-0.9, 0.6, 0.05)),
        ] {
            let sp = SurfacePoint {
                p: DVec3::ZERO,
                ng: DVec3::Z,
                n: tilted,
                wo: wo.normalize(),
                front,
                distance: 1.0,
                barycentrics: [0.0; 2],
                offset: 0.0,
                prim: 0,
                object: ObjectId(0),
                material: MaterialId(0),
                light: None::<LightId>,
            };
            let mut stack = Bsdf::new(&sp, TransportMode::Radiance);
            stack.push(Lambert { albedo });
            let matte = Matte::new(&sp, albedo);
            let pair = |x: f64, y: f64| (x - y).abs() < 1e-14;
            for i in 0..64 {
                let u = [(f64::from(i) + 0.5) / 64.0, f64::from(i * 37 % 64) / 64.0];
                let (a, b) = (stack.sample(0.3, u), matte.sample(0.3, u));
                assert_eq!(a.is_some(), b.is_some());
                if let (Some(a), Some(b)) = (a, b) {
                    assert!((a.wi - b.wi).length() < 1e-14 && pair(a.pdf, b.pdf));
                    assert_eq!((a.weight, a.class), (b.weight, LobeClass::Diffuse));
                }
                let wi = warp::sphere(u);
                let weight = |pdf: f64| 1.0 / (1.0 + pdf);
                let (a, b) = (stack.eval(wi, weight), matte.eval(wi, weight));
                assert!(pair(a.diffuse.g, b.diffuse.g) && b.glossy.is_black());
                assert_eq!(stack.diffuse_f(wi), matte.diffuse_f(wi));
            }
        }
    }
}
