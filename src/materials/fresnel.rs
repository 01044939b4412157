//! Fresnel terms.
//!
//! Transmittance is computed directly: `1 − R` in single precision loses 1.6 % at a cosine of
//! 1e-6, and digits at every grazing angle.

use super::thin_film::ThinFilm;
use crate::color::Rgb;

/// Reflectance, transmittance and cosine of refraction of a smooth dielectric interface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// Unpolarised reflectance.
    pub reflectance: f64,
    /// Unpolarised transmittance, `1 − reflectance` to rounding.
    pub transmittance: f64,
    /// Cosine of the angle of refraction; 0 under total internal reflection.
    pub cos_t: f64,
}

/// Fresnel's equations for unpolarised light, `eta` = index on the far side over index on the
/// near side, `cos_i ≥ 0`.
#[inline]
pub fn dielectric(cos_i: f64, eta: f64) -> Dielectric {
    let ci = cos_i.clamp(0.0, 1.0);
    let sin2_t = (1.0 - ci * ci).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return Dielectric {
            reflectance: 1.0,
            transmittance: 0.0,
            cos_t: 0.0,
        };
    }
    let ct = (1.0 - sin2_t).sqrt();
    let (s_sum, p_sum) = (ci + eta * ct, eta * ci + ct);
    // Both reciprocals by one division.
    let inv = 1.0 / (s_sum * p_sum);
    let (s_inv, p_inv) = (p_sum * inv, s_sum * inv);
    let rs = (ci - eta * ct) * s_inv;
    let rp = (eta * ci - ct) * p_inv;
    // T = ½ (4 η ci ct)(1/s² + 1/p²): no difference of nearly equal numbers.
    let t = 2.0 * eta * ci * ct * (s_inv * s_inv + p_inv * p_inv);
    Dielectric {
        reflectance: 0.5 * (rs * rs + rp * rp),
        transmittance: t,
        cos_t: ct,
    }
}

/// Reflectance at normal incidence between two indices of refraction.
#[inline]
pub fn f0(a: f64, b: f64) -> f64 {
    ((a - b) / (a + b)).powi(2)
}

/// Reflected and transmitted colour of an interface that reflects `reflect` of what Fresnel says
/// and colours what it transmits by `tint`. What is not reflected is transmitted, and under total
/// internal reflection nothing is.
#[inline]
pub fn split(f: &Dielectric, reflect: Rgb, tint: Rgb) -> [Rgb; 2] {
    if f.cos_t == 0.0 {
        return [Rgb::ONE, Rgb::ZERO];
    }
    let through = f.transmittance + f.reflectance * (1.0 - reflect.max_channel()).max(0.0);
    [reflect * f.reflectance, tint * through]
}

/// Schlick's approximation between `f0` at normal and `f90` at grazing incidence.
#[inline]
pub fn schlick(f0: Rgb, f90: f64, cos: f64) -> Rgb {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    let m5 = m2 * m2 * m;
    f0 + (Rgb::splat(f90) - f0) * m5
}

/// Fresnel term of a reflecting layer.
#[derive(Clone, Copy, Debug)]
pub struct Schlick {
    /// Reflectance at normal incidence.
    pub f0: Rgb,
    /// Reflectance at grazing incidence.
    pub f90: f64,
}

impl Schlick {
    /// Reflectance at the cosine of the angle to the microfacet.
    #[inline]
    pub fn at(&self, cos: f64) -> Rgb {
        schlick(self.f0, self.f90, cos)
    }
}

/// Fresnel term of a microfacet reflection.
#[derive(Clone, Copy, Debug)]
pub enum Fresnel {
    /// A plain surface.
    Schlick(Schlick),
    /// A thin film on part of it (`KHR_materials_iridescence`).
    Film(Film),
}

/// A thin film on part of a surface that is metal and dielectric side by side. What a film
/// reflects is not linear in what it lies on, so that both are asked.
#[derive(Clone, Copy, Debug)]
pub struct Film {
    /// The film.
    pub film: ThinFilm,
    /// Share of the surface that it covers.
    pub strength: f64,
    /// Reflectance of the metal at normal incidence.
    pub metal: Rgb,
    /// Share of the metal.
    pub metallic: f64,
    /// The dielectric.
    pub dielectric: Schlick,
    /// Share of the dielectric.
    pub opaque: f64,
}

impl Film {
    fn at(&self, cos: f64) -> Rgb {
        let mut sum = Rgb::ZERO;
        if self.metallic > 0.0 {
            sum += self.on(schlick(self.metal, 1.0, cos), self.metal, cos) * self.metallic;
        }
        if self.opaque > 0.0 {
            sum += self.on(self.dielectric.at(cos), self.dielectric.f0, cos) * self.opaque;
        }
        sum
    }

    /// The film on what reflects `bare` without it.
    fn on(&self, bare: Rgb, f0: Rgb, cos: f64) -> Rgb {
        bare * (1.0 - self.strength) + self.film.reflectance(cos, f0) * self.strength
    }
}

impl From<Schlick> for Fresnel {
    #[inline]
    fn from(s: Schlick) -> Self {
        Self::Schlick(s)
    }
}

impl Fresnel {
    /// Reflectance at the cosine of the angle to the microfacet.
    #[inline]
    pub fn at(&self, cos: f64) -> Rgb {
        match self {
            Self::Schlick(s) => s.at(cos),
            Self::Film(film) => film.at(cos),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectance_and_transmittance_sum_to_one_at_every_angle() {
        for eta in [1.0, 1.0 + 1e-6, 1.33, 1.5, 2.4, 1.0 / 1.5, 1.0 / 2.4] {
            for c in [0.0, 1e-8, 1e-6, 1e-4, 1e-2, 0.1, 0.5, 0.745_355_9, 0.9, 1.0] {
                let f = dielectric(c, eta);
                assert!(
                    (f.reflectance + f.transmittance - 1.0).abs() < 4e-16 * 4.0,
                    "{eta} {c}"
                );
                assert!((0.0..=1.0 + 1e-15).contains(&f.reflectance));
            }
        }
    }

    #[test]
    fn normal_incidence_and_reciprocity() {
        for eta in [1.0, 1.000_001, 1.5, 2.4] {
            let r = ((eta - 1.0) / (eta + 1.0f64)).powi(2);
            assert!((dielectric(1.0, eta).reflectance - r).abs() < 1e-15);
            for i in 1..100 {
                let f = dielectric(f64::from(i) / 100.0, eta);
                let back = dielectric(f.cos_t, 1.0 / eta);
                assert!((f.reflectance - back.reflectance).abs() < 1e-13);
            }
        }
        assert_eq!(
            dielectric(0.3, 1.0 / 1.5).reflectance,
            1.0,
            "total internal reflection"
        );
    }

    #[test]
    fn grazing_transmittance_keeps_its_digits() {
        // T → 4 c·√(η²−1)/η... leading term: 4 c (η² + 1) / (2 √(η²−1)) · ½ · 2 = 2c(1+η²)/√(η²−1).
        let (eta, c) = (1.5f64, 1e-9);
        let lead = 2.0 * c * (1.0 + eta * eta) / (eta * eta - 1.0).sqrt();
        let t = dielectric(c, eta).transmittance;
        assert!((t / lead - 1.0).abs() < 1e-7, "{t} {lead}");
    }
}
