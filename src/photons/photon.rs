//! A stored photon.

use serde::{Deserialize, Serialize};

use crate::color::Rgb;
use crate::math::{DVec3, Vec3};

/// By which kind of path a photon came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum PhotonClass {
    /// Straight from the light: `L D`.
    Direct,
    /// By specular surfaces only: `L S⁺ D`.
    Caustic,
    /// By at least one other diffuse surface.
    Indirect,
}

/// A photon that arrived at a diffuse surface; 36 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Photon {
    /// Where, world space.
    pub p: [f32; 3],
    /// Flux in W, per channel.
    pub power: [f32; 3],
    /// Direction it came from, packed.
    wi: [i16; 2],
    /// Geometric normal on the side it came from, packed.
    ng: [i16; 2],
    /// By which kind of path it came.
    pub class: PhotonClass,
}

impl Photon {
    /// A photon at `p` that arrived from direction `wi` on the side of `ng`.
    #[inline]
    pub fn new(p: DVec3, wi: DVec3, ng: DVec3, power: Rgb, class: PhotonClass) -> Self {
        Self {
            p: p.as_vec3().into(),
            power: power.to_f32(),
            wi: pack(wi),
            ng: pack(ng),
            class,
        }
    }

    /// Unit direction it came from, away from the surface.
    #[inline]
    pub fn wi(&self) -> DVec3 {
        unpack(self.wi).as_dvec3()
    }

    /// Unit geometric normal on the side it came from.
    #[inline]
    pub fn ng(&self) -> Vec3 {
        unpack(self.ng)
    }

    /// The geometric normal as it is stored.
    #[inline]
    pub(super) fn packed_ng(&self) -> PackedNormal {
        PackedNormal(self.ng)
    }

    /// Whether some channel is lit by both: behind glass that disperses, photons of one colour
    /// say nothing of the others.
    #[inline]
    pub(super) fn shares_channel(&self, o: &Self) -> bool {
        (0..3).any(|k| self.power[k] > 0.0 && o.power[k] > 0.0)
    }

    /// Flux in W.
    #[inline]
    pub fn power(&self) -> Rgb {
        self.power.into()
    }
}

/// A unit normal as photons store it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct PackedNormal([i16; 2]);

impl PackedNormal {
    #[inline]
    pub(super) fn new(ng: DVec3) -> Self {
        Self(pack(ng))
    }

    #[inline]
    pub(super) fn unpack(self) -> Vec3 {
        unpack(self.0)
    }
}

/// Octahedral map of a unit vector to two 16-bit numbers; error below 1e-4 rad.
///
/// Source: Cigolle et al., *A Survey of Efficient Representations for Independent Unit Vectors*,
/// JCGT 3(2), 2014.
#[inline]
fn pack(v: DVec3) -> [i16; 2] {
    let inv = 1.0 / (v.x.abs() + v.y.abs() + v.z.abs());
    let (mut x, mut y) = (v.x * inv, v.y * inv);
    if v.z < 0.0 {
        (x, y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
    }
    [(x * 32767.0).round() as i16, (y * 32767.0).round() as i16]
}

#[inline]
fn unpack(p: [i16; 2]) -> Vec3 {
    let (mut x, mut y) = (f32::from(p[0]) / 32767.0, f32::from(p[1]) / 32767.0);
    let z = 1.0 - x.abs() - y.abs();
    if z < 0.0 {
        (x, y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
    }
    Vec3::new(x, y, z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{Rng, warp};

    #[test]
    fn directions_survive_packing_to_a_ten_thousandth() {
        let mut rng = Rng::new(1);
        for _ in 0..100_000 {
            let v = warp::sphere(rng.next_2d());
            let back = unpack(pack(v)).as_dvec3();
            assert!((v - back).length() < 1e-4, "{v} {back}");
        }
        for v in [
            DVec3::X,
            DVec3::Y,
            DVec3::Z,
            -DVec3::X,
            -DVec3::Y,
            -DVec3::Z,
        ] {
            assert!((unpack(pack(v)).as_dvec3() - v).length() < 1e-6);
        }
        assert_eq!(size_of::<Photon>(), 36);
    }
}
