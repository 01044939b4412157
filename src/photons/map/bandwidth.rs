//! How far around a site light is even, by a χ² test of uniformity: a kernel may be wider there, for less
//! noise at hardly any bias.
//!
//! Source: for testing whether the photons in a kernel lie evenly before its size is chosen, Lin, Li, Zeng,
//! Zhang, Jia, Wang and Manocha, *CPPM: Chi-squared Progressive Photon Mapping*, ACM TOG 39(6), 2020. There the
//! photons are tested that are also counted; here those of the pilot, which are not.

use super::super::photon::Photon;
use super::Nearest;
use crate::math::{DVec2, Vec3};

/// Parts of the disc that are compared: four quarters, and of each what is nearer than the rest of the
/// same area.
const CELLS: usize = 8;

/// Value of χ² with seven degrees of freedom that one in twenty exceeds by chance.
const CRITICAL: f64 = 14.07;

/// Twice as many photons lie within twice the squared distance where light is even. Nobody looks for them
/// farther away than so many times it, where the test would fail.
pub(super) const FARTHEST: f32 = 3.0;

/// Whether the photons `found` around `site`, the farthest at squared distance `rim`, lie evenly in their
/// disc; `frame` spans the tangent plane.
pub(super) fn is_even(
    photons: &[Photon],
    found: &Nearest,
    rim: f32,
    site: Vec3,
    frame: [Vec3; 2],
) -> bool {
    let mut cells = [0.0; CELLS];
    let mut squares = 0.0;
    // The farthest one lies on the rim by construction.
    for (i, d2) in found.iter().filter(|&(_, d2)| d2 < rim) {
        let way = Vec3::from(photons[i].p) - site;
        let q = DVec2::new(way.dot(frame[0]).into(), way.dot(frame[1]).into());
        let quarter = usize::from(q.x > 0.0) + 2 * usize::from(q.y > 0.0);
        let outer = usize::from(2.0 * d2 > rim);
        let power = photons[i].power().luminance();
        cells[quarter + 4 * outer] += power;
        squares += power * power;
    }
    let sum: f64 = cells.iter().sum();
    let expected = sum / CELLS as f64;
    // Powers that differ are as noisy as fewer that are alike.
    let unit = squares / sum;
    let chi2: f64 = cells.iter().map(|c| (c - expected).powi(2)).sum::<f64>() / (expected * unit);
    chi2 <= CRITICAL
}

#[cfg(test)]
mod tests {
    use super::super::KdTree;
    use super::*;
    use crate::color::Rgb;
    use crate::math::DVec3;
    use crate::photons::PhotonClass;
    use crate::sampling::{Rng, hash2, warp};

    /// How often photons in a disc, of which `lit` tells the density up to 1 and `power` the powers, pass
    /// for even, of 4000 times.
    fn passes(n: usize, lit: impl Fn(DVec2) -> f64, power: impl Fn(f64) -> f64) -> f64 {
        let trials = 4000;
        let mut passed = 0u32;
        for seed in 0..trials {
            let mut rng = Rng::new(hash2(seed, 5));
            let mut photons = Vec::new();
            while photons.len() < n {
                let q = DVec2::from(warp::disc(rng.next_2d()));
                let [keep, u] = rng.next_2d();
                if keep < lit(q) {
                    let at = DVec3::new(q.x, 0.0, q.y);
                    let power = Rgb::splat(power(u));
                    let class = PhotonClass::Direct;
                    photons.push(Photon::new(at, DVec3::Y, DVec3::Y, power, class));
                }
            }
            let tree = KdTree::build(&mut photons, |p| p.p);
            let mut found = Nearest::new();
            found.reset(n, f32::INFINITY);
            tree.visit_near(Vec3::ZERO, &mut found, |_, _, _| true);
            let rim = found.kernel().1;
            passed += u32::from(is_even(
                &photons,
                &found,
                rim,
                Vec3::ZERO,
                [Vec3::X, Vec3::Z],
            ));
        }
        f64::from(passed) / trials as f64
    }

    /// Four standard errors of 4000 trials of 0.05 are 0.014; the distribution is χ²'s only in the limit.
    #[test]
    fn even_light_fails_once_in_twenty() {
        for n in [32, 64] {
            let alike = passes(n, |_| 1.0, |_| 1.0);
            assert!((alike - 0.95).abs() < 0.02, "{n}: {alike}");
            let unlike = passes(n, |_| 1.0, |u| -(1.0 - u).ln());
            assert!((unlike - 0.95).abs() < 0.03, "{n}, powers differ: {unlike}");
        }
    }

    #[test]
    fn edges_and_spots_are_found() {
        let edge = passes(64, |q| f64::from(q.x > 0.0), |_| 1.0);
        assert!(edge < 0.001, "{edge}");
        let spot = passes(64, |q| (-6.0 * q.length_squared()).exp(), |_| 1.0);
        assert!(spot < 0.01, "{spot}");
        let slope = passes(64, |q| 0.5 + 0.5 * q.x, |_| 1.0);
        assert!(slope < 0.5, "{slope}");
    }
}
