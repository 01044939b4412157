//! Triangles: refinement of a known hit, and a watertight search.

use crate::ad::{Real, V3};
use crate::math::DVec3;

/// Cosine below which derivatives of the point hit say nothing: they have a pole at zero.
const GRAZING: f64 = 1e-6;

/// Where a line meets the plane of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct PlaneHit<R> {
    /// Distance along the direction, in units of its length.
    pub t: R,
    /// Barycentric weight of the second vertex.
    pub b1: R,
    /// Barycentric weight of the third vertex.
    pub b2: R,
}

/// Intersects the line `o + t·d` with the plane of the triangle `v0, v0 + e1, v0 + e2`, whether
/// or not the point lies inside it; `n = e1 × e2`. `None` if the line is parallel to the plane or
/// the triangle has no area.
///
/// Möller and Trumbore, *Fast, Minimum Storage Ray/Triangle Intersection*, JGT 2(1), 1997, with
/// the triple products arranged around the normal, which the caller needs anyway.
/// Inlined by force, as [`line_sphere`](super::sphere::line_sphere).
#[inline(always)]
pub fn plane_hit<R: Real>(
    o: V3<R>,
    d: V3<R>,
    v0: DVec3,
    e1: DVec3,
    e2: DVec3,
    n: DVec3,
) -> Option<PlaneHit<R>> {
    let n = V3::constant(n);
    let det = -d.dot(n);
    if det.re() == 0.0 || !det.re().is_finite() {
        return None;
    }
    let mut inv = R::constant(1.0) / det;
    if det.re() * det.re() < GRAZING * GRAZING * d.re().length_squared() * n.re().length_squared() {
        inv = inv.branch_point();
    }
    // The direction comes last: as long as only it varies, all before it are constants.
    let s = o - V3::constant(v0);
    Some(PlaneHit {
        t: s.dot(n) * inv,
        b1: d.dot(V3::constant(e2).cross(s)) * inv,
        b2: d.dot(s.cross(V3::constant(e1))) * inv,
    })
}

/// A ray prepared for [`Watertight::intersect`]: translated and sheared so that it runs along
/// `+z` from the origin.
///
/// Source: Woop, Benthin and Wald, *Watertight Ray/Triangle Intersection*, JCGT 2(1), 2013. An
/// edge shared by two triangles gets the same edge function up to its sign, so that no ray
/// slips between them; done in `f64` from `f32` data, it needs no fallback precision.
#[derive(Clone, Copy, Debug)]
pub struct Watertight {
    o: DVec3,
    axes: [usize; 3],
    /// The origin's coordinates along `axes`.
    permuted: DVec3,
    shear: DVec3,
}

/// A hit found by [`Watertight::intersect`].
#[derive(Clone, Copy, Debug)]
pub struct TriangleHit {
    /// Distance along the direction, in units of its length.
    pub t: f64,
    /// Barycentric weight of the second vertex.
    pub b1: f64,
    /// Barycentric weight of the third vertex.
    pub b2: f64,
}

impl Watertight {
    /// Prepares the ray from `o` along `d`, which must not be zero.
    #[inline]
    pub fn new(o: DVec3, d: DVec3) -> Self {
        let a = d.abs();
        let kz = if a.x > a.y {
            if a.x > a.z { 0 } else { 2 }
        } else if a.y > a.z {
            1
        } else {
            2
        };
        let (mut kx, mut ky) = ((kz + 1) % 3, (kz + 2) % 3);
        if d[kz] < 0.0 {
            std::mem::swap(&mut kx, &mut ky);
        }
        let inv = 1.0 / d[kz];
        Self {
            o,
            axes: [kx, ky, kz],
            permuted: DVec3::new(o[kx], o[ky], o[kz]),
            shear: DVec3::new(d[kx] * inv, d[ky] * inv, inv),
        }
    }

    /// What a version of [`intersect_single`](Self::intersect_single) for several triangles
    /// needs: which coordinates take the place of `x`, `y`, `z`, the origin's along them, and the
    /// shear.
    #[inline]
    pub fn parts(&self) -> ([usize; 3], DVec3, DVec3) {
        (self.axes, self.permuted, self.shear)
    }

    /// A point relative to the origin, its coordinates given along `axes`.
    #[inline]
    fn shear(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [x - self.shear.x * z, y - self.shear.y * z, z * self.shear.z]
    }

    /// The hit with the triangle `v` in `tmin ≤ t ≤ tmax`; edges and vertices count as inside.
    #[inline]
    pub fn intersect(&self, v: [DVec3; 3], tmin: f64, tmax: f64) -> Option<TriangleHit> {
        let [kx, ky, kz] = self.axes;
        let relative = |v: DVec3| {
            let r = v - self.o;
            [r[kx], r[ky], r[kz]]
        };
        let v = [relative(v[0]), relative(v[1]), relative(v[2])];
        self.intersect_relative(v, tmin, tmax)
    }

    /// The same, bit for bit, for corners in single precision: coordinates are picked where they
    /// lie in memory, which is faster than out of a vector register.
    #[inline]
    pub fn intersect_single(&self, v: &[[f32; 3]; 3], tmin: f64, tmax: f64) -> Option<TriangleHit> {
        let [kx, ky, kz] = self.axes;
        let relative = |v: &[f32; 3]| {
            [
                f64::from(v[kx]) - self.permuted.x,
                f64::from(v[ky]) - self.permuted.y,
                f64::from(v[kz]) - self.permuted.z,
            ]
        };
        let v = [relative(&v[0]), relative(&v[1]), relative(&v[2])];
        self.intersect_relative(v, tmin, tmax)
    }

    #[inline(always)]
    fn intersect_relative(&self, v: [[f64; 3]; 3], tmin: f64, tmax: f64) -> Option<TriangleHit> {
        let [ax, ay, az] = self.shear(v[0]);
        let [bx, by, bz] = self.shear(v[1]);
        let [cx, cy, cz] = self.shear(v[2]);
        let u = cx * by - cy * bx;
        let w = bx * ay - by * ax;
        let v = ax * cy - ay * cx;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }
        let inv = 1.0 / det;
        let t = (u * az + v * bz + w * cz) * inv;
        (t >= tmin && t <= tmax).then_some(TriangleHit {
            t,
            b1: v * inv,
            b2: w * inv,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::Rng;

    const TRI: [DVec3; 3] = [
        DVec3::new(0.0, 0.0, 0.0),
        DVec3::new(1.0, 0.0, 0.0),
        DVec3::new(0.0, 1.0, 0.0),
    ];

    #[test]
    fn both_forms_agree_on_a_known_point() {
        let (o, d) = (DVec3::new(0.25, 0.5, 3.0), DVec3::new(0.0, 0.0, -2.0));
        let n = DVec3::Z;
        let a = plane_hit(
            V3::<f64>::constant(o),
            V3::constant(d),
            TRI[0],
            TRI[1],
            TRI[2],
            n,
        )
        .expect("not parallel");
        let b = Watertight::new(o, d)
            .intersect(TRI, 0.0, 10.0)
            .expect("inside");
        for (t, b1, b2) in [(a.t, a.b1, a.b2), (b.t, b.b1, b.b2)] {
            assert_eq!((t, b1, b2), (1.5, 0.25, 0.5));
        }
        let c = plane_hit(
            V3::<f32>::constant(o),
            V3::constant(d),
            TRI[0],
            TRI[1],
            TRI[2],
            n,
        )
        .expect("not parallel");
        assert!((c.t - 1.5).abs() < 1e-6);
    }

    #[test]
    fn parallel_rays_and_degenerate_triangles_are_missed_without_nan() {
        let o = DVec3::new(-1.0, 0.25, 0.0);
        let (o64, d64) = (V3::<f64>::constant(o), V3::constant(DVec3::X));
        assert!(plane_hit(o64, d64, TRI[0], TRI[1], TRI[2], DVec3::Z).is_none());
        assert!(
            Watertight::new(o, DVec3::X)
                .intersect(TRI, 0.0, 10.0)
                .is_none()
        );
        let line = [TRI[0], TRI[1], TRI[1]];
        let o = DVec3::new(0.5, 0.0, 1.0);
        assert!(
            Watertight::new(o, -DVec3::Z)
                .intersect(line, 0.0, 10.0)
                .is_none()
        );
    }

    #[test]
    fn no_ray_slips_between_the_triangles_of_a_fan() {
        // 24 triangles around one vertex, far from the origin; rays aimed at edges and the vertex.
        let c = DVec3::new(148_376.0, 1234.0, -223_423.0);
        let rim: Vec<DVec3> = (0..24)
            .map(|k| {
                let a = f64::from(k) / 24.0 * std::f64::consts::TAU;
                (c + DVec3::new(a.cos(), a.sin(), 0.0)).as_vec3().as_dvec3()
            })
            .collect();
        let mut rng = Rng::new(5);
        for i in 0..20_000 {
            let s = if i % 5 == 0 {
                0.0
            } else {
                rng.next_1d() * 0.95
            };
            let target = c + (rim[i % 24] - c) * s;
            let o = (c + DVec3::new(
                rng.next_1d() - 0.5,
                rng.next_1d() - 0.5,
                1.0 + rng.next_1d(),
            ))
            .as_vec3()
            .as_dvec3();
            let ray = Watertight::new(o, (target - o).as_vec3().as_dvec3());
            let hits = (0..24)
                .filter(|&k| {
                    ray.intersect([c, rim[k], rim[(k + 1) % 24]], 0.0, 1e9)
                        .is_some()
                })
                .count();
            assert!(hits >= 1, "ray {i} slipped through");
        }
    }
}
