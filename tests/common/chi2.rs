//! Samples against densities over the sphere, by Pearson's χ² test.

use std::f64::consts::{PI, TAU};

use dualight::math::DVec3;
use dualight::sampling::Rng;

/// Cells over the cosine to z.
pub const COS_CELLS: usize = 12;
const PHI_CELLS: usize = 16;
/// χ² tests in one file, at most.
const TESTS: f64 = 140.0;

/// Compares samples with a density over the sphere of directions. `sample` may fail, which
/// counts as probability outside of the sphere.
pub fn chi2(name: &str, sample: impl Fn(&mut Rng) -> Option<DVec3>, pdf: impl Fn(DVec3) -> f64) {
    let n = 200_000;
    let mut rng = Rng::new(17);
    let mut count = vec![0.0; COS_CELLS * PHI_CELLS];
    for _ in 0..n {
        let Some(d) = sample(&mut rng) else { continue };
        let c = ((d.z + 1.0) * 0.5 * COS_CELLS as f64) as usize;
        let p = (d.y.atan2(d.x).rem_euclid(TAU) / TAU * PHI_CELLS as f64) as usize;
        count[c.min(COS_CELLS - 1) * PHI_CELLS + p.min(PHI_CELLS - 1)] += 1.0;
    }
    // Midpoint rule in each cell, fine enough in height for the narrow lobe of refraction.
    let (sub_z, sub_phi) = (256, 12);
    let cell = 4.0 * PI / (COS_CELLS * PHI_CELLS) as f64;
    let (mut chi, mut cells) = (0.0, 0.0);
    let (mut pool_o, mut pool_e) = (0.0, 0.0);
    let mut total = 0.0;
    for (i, &observed) in count.iter().enumerate() {
        let (ci, pi) = (i / PHI_CELLS, i % PHI_CELLS);
        let mut sum = 0.0;
        for a in 0..sub_z {
            for b in 0..sub_phi {
                let u = |k: usize, s: usize, sub: usize, of: usize| {
                    (k as f64 + (s as f64 + 0.5) / sub as f64) / of as f64
                };
                let z = 2.0 * u(ci, a, sub_z, COS_CELLS) - 1.0;
                let phi = TAU * u(pi, b, sub_phi, PHI_CELLS);
                let r = (1.0 - z * z).sqrt();
                sum += pdf(DVec3::new(r * phi.cos(), r * phi.sin(), z));
            }
        }
        let expected = sum / (sub_z * sub_phi) as f64 * cell * f64::from(n);
        total += expected / f64::from(n);
        if expected < 5.0 {
            pool_o += observed;
            pool_e += expected;
        } else {
            chi += (observed - expected).powi(2) / expected;
            cells += 1.0;
        }
    }
    if pool_e > 5.0 {
        chi += (pool_o - pool_e).powi(2) / pool_e;
        cells += 1.0;
    }
    assert!(total < 1.01, "{name}: the density integrates to {total}");
    // Wilson and Hilferty's normal approximation of χ²; z of 0.01 / 140 is 3.80.
    let k: f64 = f64::max(cells - 1.0, 1.0);
    let z = ((chi / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt();
    let limit = 3.80;
    assert!(
        z < limit,
        "{name}: χ² {chi:.1} over {cells} cells, z {z:.2} (of {TESTS} tests)"
    );
}
