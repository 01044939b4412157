//! References: exact numbers `m·2^e`, whose sums and products have no error at all, with
//! quotients and roots to 200 bits.

use std::ops::{Add, Mul, Neg, Sub};

use dualight::math::DVec3;
use num_bigint::{BigInt, Sign};

/// Bits that quotients and roots are computed to.
const BITS: u64 = 200;

#[derive(Clone, Debug)]
pub struct Q {
    m: BigInt,
    e: i64,
}

impl From<f64> for Q {
    fn from(x: f64) -> Self {
        assert!(x.is_finite(), "{x} is no number");
        let bits = x.to_bits();
        let exponent = (bits >> 52 & 0x7ff) as i64;
        let fraction = bits & ((1 << 52) - 1);
        let (m, e) = if exponent == 0 {
            (fraction, -1074)
        } else {
            (fraction | 1 << 52, exponent - 1075)
        };
        let zeros = if m == 0 { 0 } else { m.trailing_zeros() };
        let m = BigInt::from(m >> zeros);
        Self {
            m: if x < 0.0 { -m } else { m },
            e: e + i64::from(zeros),
        }
    }
}

impl Q {
    fn aligned(&self, e: i64) -> BigInt {
        &self.m << (self.e - e)
    }

    /// −1, 0 or 1.
    pub fn sign(&self) -> i32 {
        match self.m.sign() {
            Sign::Minus => -1,
            Sign::NoSign => 0,
            Sign::Plus => 1,
        }
    }

    /// The nearest double, but for the last bit.
    pub fn to_f64(&self) -> f64 {
        let excess = self.m.bits() as i64 - 64;
        let (m, e) = if excess > 0 {
            (&self.m >> excess, self.e + excess)
        } else {
            (self.m.clone(), self.e)
        };
        let digits: i128 = m.try_into().unwrap();
        let half = e / 2;
        // In two steps, so that neither factor leaves the range.
        digits as f64 * 2f64.powi(half as i32) * 2f64.powi((e - half) as i32)
    }

    /// Quotient to 200 bits.
    pub fn over(&self, o: &Self) -> Self {
        let shift = (BITS + o.m.bits()).saturating_sub(self.m.bits());
        Self {
            m: (&self.m << shift) / &o.m,
            e: self.e - o.e - shift as i64,
        }
    }

    /// Square root to 200 bits.
    pub fn sqrt(&self) -> Self {
        assert!(self.sign() >= 0);
        let mut shift = (2 * BITS).saturating_sub(self.m.bits()) as i64;
        if (self.e - shift) % 2 != 0 {
            shift += 1;
        }
        Self {
            m: (&self.m << shift).sqrt(),
            e: (self.e - shift) / 2,
        }
    }
}

macro_rules! operator {
    ($trait:ident, $name:ident, $a:ident, $b:ident, $body:expr) => {
        impl $trait for Q {
            type Output = Q;
            fn $name(self, o: Q) -> Q {
                let ($a, $b) = (&self, &o);
                $body
            }
        }
    };
}

operator!(Add, add, a, b, {
    let e = a.e.min(b.e);
    Q {
        m: a.aligned(e) + b.aligned(e),
        e,
    }
});
operator!(Sub, sub, a, b, {
    let e = a.e.min(b.e);
    Q {
        m: a.aligned(e) - b.aligned(e),
        e,
    }
});
operator!(
    Mul,
    mul,
    a,
    b,
    Q {
        m: &a.m * &b.m,
        e: a.e + b.e
    }
);

impl Neg for Q {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            m: -self.m,
            e: self.e,
        }
    }
}

/// An exact vector.
#[derive(Clone, Debug)]
pub struct V(pub [Q; 3]);

impl From<DVec3> for V {
    fn from(v: DVec3) -> Self {
        Self([v.x.into(), v.y.into(), v.z.into()])
    }
}

impl V {
    pub fn sub(&self, o: &Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k].clone() - o.0[k].clone()))
    }

    pub fn dot(&self, o: &Self) -> Q {
        let term = |k: usize| self.0[k].clone() * o.0[k].clone();
        term(0) + term(1) + term(2)
    }

    pub fn cross(&self, o: &Self) -> Self {
        Self(std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            self.0[i].clone() * o.0[j].clone() - self.0[j].clone() * o.0[i].clone()
        }))
    }
}

/// The line `o + t·d` and a sphere, exactly.
pub struct ExactSphere {
    /// `B² − A·C`, of the sign of the discriminant.
    pub discriminant: Q,
    a: Q,
    b: Q,
}

impl ExactSphere {
    pub fn new(o: DVec3, d: DVec3, c: DVec3, r: f64) -> Self {
        let (f, d) = (V::from(o).sub(&c.into()), V::from(d));
        let r = Q::from(r);
        let (a, b) = (d.dot(&d), -f.dot(&d));
        let c = f.dot(&f) - r.clone() * r;
        Self {
            discriminant: b.clone() * b.clone() - a.clone() * c,
            a,
            b,
        }
    }

    /// Both intersections in ascending order.
    pub fn roots(&self) -> Option<[f64; 2]> {
        if self.discriminant.sign() < 0 {
            return None;
        }
        let root = self.discriminant.sqrt();
        let near = (self.b.clone() - root.clone()).over(&self.a);
        let far = (self.b.clone() + root).over(&self.a);
        Some([near.to_f64(), far.to_f64()])
    }
}

/// The line `o + t·d` and a triangle, exactly.
pub struct ExactTriangle {
    /// Edge functions: volumes of the line with the edges opposite to the corners.
    pub uvw: [Q; 3],
    t: Q,
    det: Q,
}

impl ExactTriangle {
    pub fn new(o: DVec3, d: DVec3, v: [DVec3; 3]) -> Self {
        let corner: Vec<V> = v.iter().map(|p| V::from(*p).sub(&o.into())).collect();
        let ray = V::from(d);
        let volume = |i: usize, j: usize| ray.dot(&corner[i].cross(&corner[j]));
        let uvw = [volume(1, 2), volume(2, 0), volume(0, 1)];
        let n = corner[1].sub(&corner[0]).cross(&corner[2].sub(&corner[0]));
        Self {
            uvw,
            t: corner[0].dot(&n),
            det: ray.dot(&n),
        }
    }

    /// Whether the line passes through it, edges included.
    pub fn inside(&self) -> bool {
        let signs = self.uvw.each_ref().map(Q::sign);
        self.det.sign() != 0 && (signs.iter().all(|s| *s >= 0) || signs.iter().all(|s| *s <= 0))
    }

    /// Distance, and the weights of the second and third corner.
    pub fn hit(&self) -> Option<[f64; 3]> {
        if self.det.sign() == 0 {
            return None;
        }
        let [u, v, w] = &self.uvw;
        let sum = u.clone() + v.clone() + w.clone();
        if sum.sign() == 0 {
            return None;
        }
        let part = |a: &Q, b: &Q| a.over(b).to_f64();
        Some([part(&self.t, &self.det), part(v, &sum), part(w, &sum)])
    }
}

#[test]
fn exact_numbers_are_exact() {
    let q = |x: f64| Q::from(x);
    for x in [0.0, 1.0, -0.1, 1e300, 5e-324, 1.5e-310, -3.7e17] {
        assert_eq!(q(x).to_f64(), x);
    }
    let (a, b) = (0.1, 0.3);
    assert_eq!(((q(a) + q(b)) - q(a) - q(b)).sign(), 0);
    assert_eq!((q(a) * q(b)).over(&q(b)).to_f64(), a);
    assert!((q(2.0).sqrt().to_f64() - 2f64.sqrt()).abs() <= f64::EPSILON);
    let ball = ExactSphere::new(DVec3::new(0.0, 0.0, -5.0), DVec3::Z, DVec3::ZERO, 1.0);
    assert_eq!(ball.roots(), Some([4.0, 6.0]));
    let tri = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let hit = ExactTriangle::new(DVec3::new(0.25, 0.5, 3.0), -DVec3::Z, tri);
    assert!(hit.inside());
    assert_eq!(hit.hit(), Some([3.0, 0.25, 0.5]));
}
