//! Interference in a thin film.
//!
//! Source: Belcour and Barla, *A Practical Extension to Microfacet Theory for the Modeling of
//! Varying Iridescence*, SIGGRAPH 2017, as `KHR_materials_iridescence` states it.

use std::f64::consts::{PI, TAU};

use super::fresnel::f0;
use crate::color::Rgb;

/// A film on a surface, in air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinFilm {
    /// Index of refraction.
    pub ior: f64,
    /// Thickness in nanometres.
    pub thickness: f64,
}

fn schlick(f0: f64, cos: f64) -> f64 {
    f0 + (1.0 - f0) * (1.0 - cos).clamp(0.0, 1.0).powi(5)
}

/// The index whose reflectance at normal incidence is `f0`, in air.
fn index(f0: f64) -> f64 {
    let root = f0.clamp(0.0, 0.9999).sqrt();
    (1.0 + root) / (1.0 - root)
}

/// Fourier transform of the eye's sensitivity, in linear Rec.709, for an optical path difference
/// in nanometres.
fn sensitivity(path: f64, shift: [f64; 3]) -> [f64; 3] {
    let phase = TAU * path * 1e-9;
    let term = |val: f64, pos: f64, var: f64, shift: f64| {
        val * (TAU * var).sqrt() * (pos * phase + shift).cos() * (-phase * phase * var).exp()
    };
    let scale = 1.0 / 1.0685e-7;
    let x = term(5.4856e-13, 1.6810e6, 4.3278e9, shift[0])
        + term(9.7470e-14, 2.2399e6, 4.5282e9, shift[0]);
    let y = term(4.4201e-13, 1.7953e6, 9.3046e9, shift[1]);
    let z = term(5.2481e-13, 2.2084e6, 6.6121e9, shift[2]);
    let [x, y, z] = [x, y, z].map(|c| c * scale);
    [
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266 * x + 1.876_010_8 * y + 0.041_556 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    ]
}

impl ThinFilm {
    /// From 0 where there is no film to 1 where it is thick enough to be one.
    pub(super) fn presence(&self) -> f64 {
        let x = (self.thickness / 0.03).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }

    /// Reflectance of the film on a base of reflectance `base` at normal incidence.
    pub fn reflectance(&self, cos: f64, base: Rgb) -> Rgb {
        let cos = cos.clamp(0.0, 1.0);
        // As the film vanishes its index becomes that of air.
        let ior = 1.0 + (self.ior - 1.0) * self.presence();
        let sin2 = (1.0 - cos * cos) / (ior * ior);
        if sin2 >= 1.0 {
            return Rgb::ONE;
        }
        let cos2 = (1.0 - sin2).sqrt();
        let r12 = schlick(f0(ior, 1.0), cos);
        let t121 = 1.0 - r12;
        let phi21 = if ior < 1.0 { 0.0 } else { PI };
        let base = [base.r, base.g, base.b];
        let mut phi = [0.0; 3];
        let mut r123 = [0.0; 3];
        let mut rs = [0.0; 3];
        for k in 0..3 {
            let below = index(base[k]);
            let r23 = schlick(f0(below, ior), cos2);
            phi[k] = phi21 + if below < ior { PI } else { 0.0 };
            let product = (r12 * r23).clamp(1e-5, 0.9999);
            r123[k] = product.sqrt();
            rs[k] = t121 * t121 * r23 / (1.0 - product);
        }
        let path = 2.0 * ior * self.thickness * cos2;
        let mut sum: [f64; 3] = std::array::from_fn(|k| r12 + rs[k]);
        let mut amplitude: [f64; 3] = std::array::from_fn(|k| rs[k] - t121);
        for m in [1.0, 2.0] {
            let s = sensitivity(m * path, phi.map(|p| m * p));
            for k in 0..3 {
                amplitude[k] *= r123[k];
                sum[k] += amplitude[k] * 2.0 * s[k];
            }
        }
        // Interference can leave the gamut, and truncated series the range of a reflectance.
        let [r, g, b] = sum.map(|c| c.clamp(0.0, 1.0));
        Rgb::new(r, g, b)
    }

    /// The largest reflectance of any channel over the angles where Schlick's own term is small.
    pub(super) fn bound(&self, base: Rgb) -> f64 {
        (0..8)
            .map(|k| {
                self.reflectance(0.3 + 0.1 * f64::from(k), base)
                    .max_channel()
            })
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_thickness_the_base_alone_reflects() {
        for base in [0.04, 0.5, 0.9] {
            let film = ThinFilm {
                ior: 1.3,
                thickness: 0.0,
            };
            for cos in [1.0, 0.9, 0.8] {
                let r = film.reflectance(cos, Rgb::splat(base)).g;
                let want = schlick(base, cos);
                // The model gives both faces of the vanished film Schlick's grazing term.
                let twice = 2.0 * (1.0 - cos).powi(5);
                assert!((r - want).abs() < 0.02 + twice, "{base} {cos}: {r} {want}");
            }
        }
    }

    #[test]
    fn values_are_reflectances_for_every_film() {
        for ior in [1.0, 1.3, 1.8, 2.5] {
            for thickness in [0.0, 0.02, 100.0, 400.0, 1200.0, 1e9] {
                for cos in [0.0, 1e-6, 0.1, 0.5, 1.0] {
                    for base in [0.0, 0.04, 0.5, 1.0] {
                        let film = ThinFilm { ior, thickness };
                        let c = film.reflectance(cos, Rgb::splat(base));
                        for x in [c.r, c.g, c.b] {
                            assert!((0.0..=1.0).contains(&x), "{film:?} {cos} {base}: {c:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_quarter_wave_of_the_right_index_stops_green() {
        // n = √n_base and n·d = λ/4: the classical antireflection coating.
        let base = ((1.9f64 - 1.0) / 2.9).powi(2);
        let film = ThinFilm {
            ior: 1.9f64.sqrt(),
            thickness: 550.0 / 4.0 / 1.9f64.sqrt(),
        };
        let green = film.reflectance(1.0, Rgb::splat(base)).g;
        assert!(green < 0.15 * base, "{green} of {base}");
    }
}
