//! A density over the unit square, constant in the cells of a quadtree.

use super::Lesson;

/// Fewest lessons of a cell, and of those that brought something.
const LEAST: usize = 32;
const LEAST_USEFUL: f64 = 8.0;

/// Most divisions.
const DEEPEST: u32 = 8;

/// Quarters whose weights differ by less than this factor are not worth dividing a cell: so much is
/// chance.
const ALIKE: f64 = 1.3;

/// What a cell's neighbourhood says of it counts as so many lessons.
const NEIGHBOURHOOD: f64 = 2.0;

/// A density over the unit square.
#[derive(Clone, Debug, Default)]
pub(in crate::photons) struct Square {
    /// The first is the whole square; none if the density is even.
    nodes: Vec<Node>,
}

/// A cell that is divided. Quarter `k`: bit 0 in the first dimension, bit 1 in the second.
#[derive(Clone, Debug)]
struct Node {
    /// What of the cell's mass lies in each quarter.
    mass: [f64; 4],
    /// Nodes of the quarters; 0 for one that is whole.
    child: [u32; 4],
}

/// What is known of a cell: mean square of the power with which photons leave, and of what they
/// bring, over that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    pub(super) power: f64,
    pub(super) yields: f64,
}

impl Known {
    /// What lessons tell, together with what was known before, which counts as `before` lessons.
    pub(super) fn learn(self, lessons: &[Lesson], before: f64) -> Self {
        let n = lessons.len() as f64;
        if n == 0.0 {
            return self;
        }
        let power = lessons.iter().map(|l| l.power).sum::<f64>() / n;
        let worth = lessons.iter().map(|l| l.worth).sum::<f64>() / n;
        let own = if power > 0.0 { worth / power } else { 0.0 };
        Self {
            power,
            yields: self.yields + (own - self.yields) * (n / (n + before)),
        }
    }

    /// Photons by which the variance of what they bring is least, in proportion (Neyman): that of
    /// `n` photons of power `P/n` is `E (P t)² / n`.
    fn weight(self) -> f64 {
        (self.power * self.yields).sqrt()
    }
}

impl Square {
    /// What lessons of one light tell, and the weight of the light.
    pub(super) fn learn(lessons: &mut [Lesson], known: Known) -> (Self, f64) {
        let mut out = Self::default();
        let (weight, _) = out.grow(lessons, known, [0.0; 2], 0);
        if !(weight > 0.0) {
            out.nodes.clear();
        }
        (out, weight)
    }

    /// Divides a cell as far as its lessons tell of a difference; its weight, and its node.
    fn grow(
        &mut self,
        lessons: &mut [Lesson],
        known: Known,
        corner: [f64; 2],
        level: u32,
    ) -> (f64, u32) {
        let size = 0.5f64.powi(level as i32);
        let whole = known.weight() * size * size;
        let few = lessons.len() < 4 * LEAST || useful(lessons) < 4.0 * LEAST_USEFUL;
        if few || level == DEEPEST {
            return (whole, 0);
        }
        let half = 0.5 * size;
        let quarter = |u: &[f64; 2]| {
            usize::from(u[0] >= corner[0] + half) + 2 * usize::from(u[1] >= corner[1] + half)
        };
        lessons.sort_by_key(|l| quarter(&l.u));
        let node = self.nodes.len();
        self.nodes.push(Node {
            mass: [0.25; 4],
            child: [0; 4],
        });
        let mut weights = [0.0; 4];
        let mut rest = lessons;
        for (k, weight) in weights.iter_mut().enumerate() {
            let n = rest.partition_point(|l| quarter(&l.u) <= k);
            let (own, others) = rest.split_at_mut(n);
            rest = others;
            let corner = [0, 1].map(|i| corner[i] + half * (k >> i & 1) as f64);
            let known = known.learn(own, NEIGHBOURHOOD);
            let child;
            (*weight, child) = self.grow(own, known, corner, level + 1);
            self.nodes[node].child[k] = child;
        }
        let most = weights.iter().copied().fold(0.0, f64::max);
        let least = weights.iter().copied().fold(f64::INFINITY, f64::min);
        if self.nodes[node].child == [0; 4] && most <= ALIKE * least {
            self.nodes.truncate(node);
            return (whole, 0);
        }
        let sum: f64 = weights.iter().sum();
        if sum > 0.0 {
            self.nodes[node].mass = weights.map(|w| w / sum);
        }
        (sum, node as u32)
    }

    /// Mixes it with so much of an even density.
    pub(super) fn mix(&mut self, even: f64) {
        if !self.nodes.is_empty() {
            self.mix_cell(0, [1.0; 2], even);
        }
    }

    fn mix_cell(&mut self, node: usize, [mass, area]: [f64; 2], even: f64) {
        let mixed = |mass: f64, area: f64| (1.0 - even) * mass + even * area;
        let before = self.nodes[node].clone();
        let own = mixed(mass, area);
        for k in 0..4 {
            let part = [mass * before.mass[k], 0.25 * area];
            self.nodes[node].mass[k] = mixed(part[0], part[1]) / own;
            if before.child[k] != 0 {
                self.mix_cell(before.child[k] as usize, part, even);
            }
        }
    }

    /// Moves a point that is spread evenly to where it is spread by this density, which is told,
    /// too. Neighbours stay neighbours, so that what is stratified remains so.
    #[inline]
    pub(in crate::photons) fn place(&self, [mut x, mut y]: [f64; 2]) -> ([f64; 2], f64) {
        let (mut corner, mut size, mut density) = ([0.0; 2], 1.0, 1.0);
        let mut next = 0;
        while let Some(node) = self.nodes.get(next) {
            let m = &node.mass;
            let i = part(&mut x, m[0] + m[2]);
            let j = part(&mut y, m[i] / (m[i] + m[i + 2]));
            size *= 0.5;
            corner[0] += size * i as f64;
            corner[1] += size * j as f64;
            let k = i + 2 * j;
            density *= 4.0 * m[k];
            next = match node.child[k] {
                0 => usize::MAX,
                child => child as usize,
            };
        }
        ([corner[0] + x * size, corner[1] + y * size], density)
    }

    /// Mass of a cell, given by the quarters that lead to it.
    pub(in crate::photons) fn mass(&self, quarters: impl Iterator<Item = usize>) -> f64 {
        let (mut mass, mut node) = (1.0, self.nodes.first());
        for k in quarters {
            mass *= node.map_or(0.25, |n| n.mass[k]);
            node = node
                .map(|n| n.child[k] as usize)
                .filter(|child| *child != 0)
                .map(|child| &self.nodes[child]);
        }
        mass
    }
}

/// How many lessons brought something; fewer if some brought much more than others.
fn useful(lessons: &[Lesson]) -> f64 {
    let sum: f64 = lessons.iter().map(|l| l.worth).sum();
    let squares: f64 = lessons.iter().map(|l| l.worth * l.worth).sum();
    if squares > 0.0 {
        sum * sum / squares
    } else {
        0.0
    }
}

/// Which of two parts of the unit interval `x` lies in, the first being `first` long; `x` becomes
/// its place in that part.
#[inline]
fn part(x: &mut f64, first: f64) -> usize {
    let second = *x >= first;
    let (from, length) = match second {
        false => (0.0, first),
        true => (first, 1.0 - first),
    };
    *x = ((*x - from) / length).clamp(0.0, 1.0 - f64::EPSILON);
    usize::from(second)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::Rng;

    /// Lessons of a light of which only what leaves in a quarter disc arrives.
    fn square() -> Square {
        let mut rng = Rng::new(3);
        let mut lessons: Vec<Lesson> = (0..20_000)
            .map(|_| {
                let u = rng.next_2d();
                let within = u[0].hypot(u[1]) < 0.4;
                Lesson {
                    u,
                    power: 2.0,
                    worth: if within { 2.0 } else { 0.0 },
                }
            })
            .collect();
        let known = Known {
            power: 2.0,
            yields: 0.1,
        };
        let (mut out, weight) = Square::learn(&mut lessons, known);
        assert!(weight > 0.0);
        out.mix(0.1);
        out
    }

    #[test]
    fn points_have_the_density_that_is_told() {
        let square = square();
        // E 1/density over the placed points is the area of what they may reach, 1, in any part.
        let mut rng = Rng::new(4);
        let n = 400_000;
        let (mut sum, mut squares, mut inside) = ([0.0; 2], [0.0; 2], 0u32);
        for _ in 0..n {
            let (u, density) = square.place(rng.next_2d());
            assert!(u.iter().all(|x| (0.0..1.0).contains(x)));
            let within = u[0].hypot(u[1]) < 0.4;
            let x = 1.0 / density;
            assert!(x <= 10.0 + 1e-9, "{x}");
            sum[usize::from(within)] += x;
            squares[usize::from(within)] += x * x;
            inside += u32::from(within);
        }
        let disc = std::f64::consts::PI * 0.04;
        for (k, area) in [(0, 1.0 - disc), (1, disc)] {
            let mean = sum[k] / f64::from(n);
            let sigma = ((squares[k] / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
            assert!((mean - area).abs() < 4.0 * sigma, "{mean} {area} {sigma}");
            assert!(sigma < 0.01 * area);
        }
        // Most go where they arrive.
        let share = f64::from(inside) / f64::from(n);
        assert!(share > 0.7, "{share}");
    }

    #[test]
    fn masses_are_those_of_the_points() {
        let square = square();
        let mut rng = Rng::new(5);
        let mut counts = [0u32; 16];
        let n = 160_000;
        for _ in 0..n {
            let (u, _) = square.place(rng.next_2d());
            counts[(u[0] * 4.0) as usize + 4 * (u[1] * 4.0) as usize] += 1;
        }
        let mut sum = 0.0;
        for (cell, count) in counts.iter().enumerate() {
            let (x, y) = (cell % 4, cell / 4);
            let quarters = [1, 0].map(|l| (x >> l & 1) + 2 * (y >> l & 1));
            let mass = square.mass(quarters.into_iter());
            sum += mass;
            let sigma = (mass / f64::from(n)).sqrt();
            let share = f64::from(*count) / f64::from(n);
            assert!((share - mass).abs() < 4.0 * sigma, "{x} {y} {share} {mass}");
        }
        assert!((sum - 1.0).abs() < 1e-9);
        let even = Square::default();
        assert_eq!(even.place([0.3, 0.7]), ([0.3, 0.7], 1.0));
        assert_eq!(even.mass([1, 2, 3].into_iter()), 0.25f64.powi(3));
    }

    #[test]
    fn what_is_all_alike_is_not_divided() {
        let mut rng = Rng::new(6);
        let lesson = |_| Lesson {
            u: rng.next_2d(),
            power: 1.0,
            worth: 0.5,
        };
        let mut lessons: Vec<Lesson> = (0..5000).map(lesson).collect();
        let known = Known {
            power: 1.0,
            yields: 0.5,
        };
        let (square, weight) = Square::learn(&mut lessons, known);
        assert!(square.nodes.is_empty());
        assert!((weight - 0.5f64.sqrt()).abs() < 1e-9);
    }
}
