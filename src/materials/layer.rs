//! Directional albedos of reflecting layers, by which what lies below them is scaled.
//!
//! The albedo of a GGX layer under Schlick's Fresnel term is linear in `f0` and `f90` (Karis,
//! *Real Shading in Unreal Engine 4*, 2013); its two coefficients, and the albedo of sheen, are
//! tabulated over cosine and roughness by quadrature when they are first needed.

use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

use super::lobes::Sheen;
use super::microfacet::Ggx;
use crate::math::DVec3;

/// Nodes over the square root of the cosine, which are denser toward grazing angles.
const COSINES: usize = 49;
/// Nodes over the square root of roughness: smooth layers change fastest.
const ROUGHNESSES: usize = 25;
/// Points of the quadrature per node and axis.
const POINTS: u32 = 16;

/// Values over roughness and cosine, with their cosine-weighted means.
struct Table {
    at: [[f64; COSINES]; ROUGHNESSES],
    mean: [f64; ROUGHNESSES],
}

/// Position between two nodes.
#[derive(Clone, Copy, Debug)]
struct Between {
    index: usize,
    share: f64,
}

impl Between {
    fn new(x: f64, nodes: usize) -> Self {
        let x = x.clamp(0.0, 1.0) * (nodes - 1) as f64;
        let index = (x as usize).min(nodes - 2);
        Self {
            index,
            share: x - index as f64,
        }
    }

    #[inline]
    fn mix(self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.share
    }
}

impl Table {
    fn new(f: impl Fn(f64, f64) -> f64) -> Self {
        let node = |i: usize, n: usize| i as f64 / (n - 1) as f64;
        let at: [[f64; COSINES]; ROUGHNESSES] = std::array::from_fn(|j| {
            std::array::from_fn(|i| {
                let s = node(i, COSINES);
                f((s * s).max(1e-4), node(j, ROUGHNESSES).powi(2))
            })
        });
        // ∫ 2 μ E dμ with μ = s²: 4 s³ ds, by Simpson's rule over pairs of intervals.
        let mean = at.map(|row| {
            let h = 1.0 / (COSINES - 1) as f64;
            let g = |i: usize| 4.0 * node(i, COSINES).powi(3) * row[i];
            (0..COSINES / 2)
                .map(|k| h / 3.0 * (g(2 * k) + 4.0 * g(2 * k + 1) + g(2 * k + 2)))
                .sum()
        });
        Self { at, mean }
    }

    #[inline]
    fn at(&self, row: Between, cos: f64) -> f64 {
        let c = Between::new(cos.max(0.0).sqrt(), COSINES);
        let along = |r: &[f64; COSINES]| c.mix(r[c.index], r[c.index + 1]);
        row.mix(along(&self.at[row.index]), along(&self.at[row.index + 1]))
    }

    #[inline]
    fn mean(&self, row: Between) -> f64 {
        row.mix(self.mean[row.index], self.mean[row.index + 1])
    }
}

/// Midpoints of a grid over the unit square.
fn grid() -> impl Iterator<Item = [f64; 2]> {
    let x = |i: u32| (f64::from(i) + 0.5) / f64::from(POINTS);
    (0..POINTS).flat_map(move |i| (0..POINTS).map(move |j| [x(i), x(j)]))
}

/// Albedo of GGX where the Fresnel term is one (`0`) and where it is Schlick's `(1 − cos)⁵` (`1`).
static GGX: LazyLock<[Table; 2]> = LazyLock::new(|| {
    [0, 1].map(|which| {
        Table::new(|cos, roughness| {
            let term = |c: f64| {
                if which == 0 {
                    1.0
                } else {
                    (1.0 - c).clamp(0.0, 1.0).powi(5)
                }
            };
            let wo = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
            if roughness == 0.0 {
                return term(cos);
            }
            let ggx = Ggx::round(roughness * roughness);
            let value = |u| {
                let h = ggx.sample_visible(wo, u);
                let cos_h = wo.dot(h);
                let wi = h * (2.0 * cos_h) - wo;
                if wi.z <= 0.0 {
                    return 0.0;
                }
                term(cos_h) * ggx.g2(wo, wi) / ggx.g1(wo)
            };
            grid().map(value).sum::<f64>() / f64::from(POINTS * POINTS)
        })
    })
});

/// Albedo of white sheen.
static SHEEN: LazyLock<Table> = LazyLock::new(|| {
    Table::new(|cos, roughness| {
        let sheen = Sheen::new(crate::color::Rgb::ONE, roughness);
        let wo = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        // Over the half vector's colatitude, which the narrow rim of small roughness needs, with
        // dωi = 4 (wo·h) dωh.
        let value = |[u, v]: [f64; 2]| {
            let cos_h = 1.0 - (1.0 - u) * (1.0 - u);
            let (sin_h, phi) = ((1.0 - cos_h * cos_h).max(0.0).sqrt(), PI * v);
            let h = DVec3::new(sin_h * phi.cos(), sin_h * phi.sin(), cos_h);
            let oh = wo.dot(h);
            let wi = h * (2.0 * oh) - wo;
            if oh <= 0.0 || wi.z <= 0.0 {
                return 0.0;
            }
            sheen.value(wo, wi) * wi.z * 4.0 * oh * 2.0 * (1.0 - u) * TAU
        };
        let fine = 4 * POINTS;
        let x = |i: u32| (f64::from(i) + 0.5) / f64::from(fine);
        let sum: f64 = (0..fine)
            .flat_map(|i| (0..fine).map(move |j| value([x(i), x(j)])))
            .sum();
        sum / f64::from(fine * fine)
    })
});

/// Directional albedo of a reflecting layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct LayerAlbedo {
    row: Between,
    f0: f64,
    f90: f64,
}

impl LayerAlbedo {
    /// The layer of a roughness with Schlick's term between `f0` and `f90`, of which `share`
    /// covers the surface.
    #[inline]
    pub(super) fn new(roughness: f64, f0: f64, f90: f64, share: f64) -> Self {
        Self {
            row: Between::new(roughness.sqrt(), ROUGHNESSES),
            f0: f0 * share,
            f90: f90 * share,
        }
    }

    /// Albedo seen along a direction of the given cosine.
    #[inline]
    pub(super) fn at(&self, cos: f64) -> f64 {
        let [one, fifth] = &*GGX;
        self.f0 * one.at(self.row, cos) + (self.f90 - self.f0) * fifth.at(self.row, cos)
    }

    /// Mean over directions, weighted by the cosine: the albedo under uniform light.
    #[inline]
    pub(super) fn mean(&self) -> f64 {
        let [one, fifth] = &*GGX;
        self.f0 * one.mean(self.row) + (self.f90 - self.f0) * fifth.mean(self.row)
    }
}

/// Directional albedo of sheen, largest channel.
#[derive(Clone, Copy, Debug)]
pub(super) struct SheenAlbedo {
    row: Between,
    strength: f64,
}

impl SheenAlbedo {
    pub(super) fn new(roughness: f64, strength: f64) -> Self {
        Self {
            row: Between::new(roughness.sqrt(), ROUGHNESSES),
            strength,
        }
    }

    /// Albedo seen along a direction of the given cosine.
    pub(super) fn at(&self, cos: f64) -> f64 {
        self.strength * self.unheld(cos).min(1.0)
    }

    /// Albedo of white sheen as the model has it, which can exceed one.
    pub(super) fn unheld(&self, cos: f64) -> f64 {
        SHEEN.at(self.row, cos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_layer_reflects_as_schlick_says() {
        let layer = LayerAlbedo::new(0.0, 0.04, 1.0, 1.0);
        for cos in [0.0, 0.01, 0.1, 0.3, 0.5, 0.9, 1.0] {
            let want = 0.04 + 0.96 * (1.0f64 - cos).powi(5);
            assert!((layer.at(cos) - want).abs() < 2e-3, "{cos}");
        }
        // ∫ 2 μ (1 − μ)⁵ dμ = 2/42.
        assert!((layer.mean() - (0.04 + 0.96 / 21.0)).abs() < 1e-4);
    }

    #[test]
    fn a_rough_white_layer_loses_what_single_scattering_loses() {
        // Width 1, seen from above: ∫ G₁(wi) over the microfacets' normals is 1 − ln 2.
        let white = |r| LayerAlbedo::new(r, 1.0, 1.0, 1.0);
        assert!((white(0.1).at(1.0) - 1.0).abs() < 1e-3);
        assert!((white(1.0).at(1.0) - (1.0 - 2f64.ln())).abs() < 2e-3);
        for k in 0..20 {
            let r = f64::from(k) / 20.0;
            assert!(white(r).at(0.5) >= white(r + 0.05).at(0.5) - 1e-3);
        }
    }
}
