//! A plane through weighted values.

/// Weighted least squares of a plane over `1, x, y`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Normal {
    n: u32,
    w: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Normal {
    /// Adds a place with its weight.
    pub(super) fn add(&mut self, w: f64, x: f64, y: f64) {
        self.n += 1;
        self.w += w;
        self.x += w * x;
        self.y += w * y;
        self.xx += w * x * x;
        self.xy += w * x * y;
        self.yy += w * y * y;
    }

    /// The inverse of the matrix; `None` if the pixels lie on a line, but for a single one, which
    /// is a plane without slope.
    pub(super) fn inverse(&self) -> Option<[[f64; 3]; 3]> {
        if self.n == 1 {
            let mut single = [[0.0; 3]; 3];
            single[0][0] = 1.0 / self.w;
            return Some(single);
        }
        let Self {
            w,
            x,
            y,
            xx,
            xy,
            yy,
            ..
        } = *self;
        let (c00, c01, c02) = (xx * yy - xy * xy, xy * y - x * yy, x * xy - xx * y);
        let (c11, c12, c22) = (w * yy - y * y, x * y - w * xy, w * xx - x * x);
        let det = w * c00 + x * c01 + y * c02;
        if !(det > 1e-6 * w * xx * yy) {
            return None;
        }
        Some([[c00, c01, c02], [c01, c11, c12], [c02, c12, c22]].map(|r| r.map(|c| c / det)))
    }
}

/// The right-hand side of one quantity: sums over `w·v`, `w·v·x` and `w·v·y`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments([f64; 3]);

impl Moments {
    /// Adds a value with its place and weight.
    pub(super) fn add(&mut self, w: f64, x: f64, y: f64, value: f64) {
        let v = w * value;
        self.0 = [self.0[0] + v, self.0[1] + v * x, self.0[2] + v * y];
    }

    /// The product with a row of the inverse matrix: a coefficient of the plane.
    pub(super) fn dot(&self, row: [f64; 3]) -> f64 {
        self.0.iter().zip(row).map(|(a, b)| a * b).sum()
    }
}
