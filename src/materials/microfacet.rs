//! The GGX distribution, round or stretched along the frame's axes, and the sampling of its visible normals.
//!
//! Sources: Walter et al., *Microfacet Models for Refraction through Rough Surfaces*, EGSR 2007;
//! Heitz, *Understanding the Masking-Shadowing Function*, JCGT 3(2), 2014; Dupuy and Benyoub,
//! *Sampling Visible GGX Normals with Spherical Caps*, CGF 42(8), 2023.

use std::f64::consts::PI;

use crate::math::DVec3;

/// GGX with its widths along the frame's first and second axis (the square of glTF's roughness).
#[derive(Clone, Copy, Debug)]
pub(super) struct Ggx {
    pub(super) x: f64,
    pub(super) y: f64,
}

impl Ggx {
    /// The same width in all directions.
    #[inline]
    pub(super) fn round(alpha: f64) -> Self {
        Self { x: alpha, y: alpha }
    }

    /// Density of microfacet normals per projected area.
    #[inline]
    pub(super) fn d(&self, h: DVec3) -> f64 {
        // Multiplied by both widths: no cancellation near the normal, no division by a width.
        let a2 = self.x * self.y;
        let (sx, sy) = (h.x * self.y, h.y * self.x);
        let k = h.z * h.z * a2 + (sx * sx + sy * sy) / a2;
        a2 / (PI * k * k)
    }

    #[inline]
    fn lambda(&self, w: DVec3) -> f64 {
        let cos2 = w.z * w.z;
        if cos2 == 0.0 {
            return f64::INFINITY;
        }
        let (sx, sy) = (w.x * self.x, w.y * self.y);
        0.5 * ((1.0 + (sx * sx + sy * sy) / cos2).sqrt() - 1.0)
    }

    /// Masking of one direction.
    #[inline]
    pub(super) fn g1(&self, w: DVec3) -> f64 {
        1.0 / (1.0 + self.lambda(w))
    }

    /// Height-correlated masking and shadowing.
    #[inline]
    pub(super) fn g2(&self, wo: DVec3, wi: DVec3) -> f64 {
        1.0 / (1.0 + self.lambda(wo) + self.lambda(wi))
    }

    /// A microfacet normal visible from `wo` (`wo.z > 0`); density [`visible_pdf`](Self::visible_pdf).
    #[inline]
    pub(super) fn sample_visible(&self, wo: DVec3, u: [f64; 2]) -> DVec3 {
        let v = DVec3::new(self.x * wo.x, self.y * wo.y, wo.z).normalize();
        let (s, c) = (2.0 * PI * u[0]).sin_cos();
        let z = 1.0 - u[1] * (1.0 + v.z);
        let r = (1.0 - z * z).max(0.0).sqrt();
        let h = DVec3::new(r * c, r * s, z) + v;
        DVec3::new(self.x * h.x, self.y * h.y, h.z.max(1e-12)).normalize()
    }

    /// Density of visible normals in solid angle around `h`.
    #[inline]
    pub(super) fn visible_pdf(&self, wo: DVec3, h: DVec3) -> f64 {
        self.g1(wo) * self.d(h) * wo.dot(h).max(0.0) / wo.z
    }
}
