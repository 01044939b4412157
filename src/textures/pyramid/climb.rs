//! How large levels are made: row by row, each as soon as those below it are there, so that beside
//! the image and what is kept a few rows are in memory and never a level of sums.

use rayon::prelude::*;

use super::{Level, Part, half, weigh};
use crate::textures::{Content, Image};

/// How the columns and rows of a level come from those of the one below it.
struct Rung {
    width: usize,
    height: u32,
    below: u32,
    columns: Vec<Taps>,
}

/// Makes `levels`, of which the first is half of the image, and gives the sums of the last. Each
/// task makes some of the rows of the last level and all that lies below them.
pub(super) fn climb(
    image: &Image,
    content: Content,
    channels: usize,
    levels: &mut [Level],
    parallel: bool,
) -> Vec<[f32; 4]> {
    let Some(top) = levels.last().map(|l| l.height) else {
        return Vec::new();
    };
    let mut below = [image.width(), image.height()];
    let mut rungs = Vec::new();
    for l in levels.iter() {
        rungs.push(Rung {
            width: l.width as usize,
            height: l.height,
            below: below[1],
            columns: (0..l.width)
                .map(|x| Taps::new(x, l.width, below[0]))
                .collect(),
        });
        below = [l.width, l.height];
    }
    let most = if parallel {
        4 * rayon::current_num_threads() as u64
    } else {
        1
    };
    let tasks = most.min(u64::from(top));
    let mut climbers: Vec<Climber<'_>> = (0..tasks)
        .map(|t| {
            let row = |t: u64| (t * u64::from(top) / tasks) as u32;
            Climber {
                image,
                content,
                channels,
                rungs: &rungs,
                rows: row(t)..row(t + 1),
                steps: Vec::new(),
            }
        })
        .collect();
    share(&mut climbers, levels);
    let sums: Vec<Vec<[f32; 4]>> = if parallel {
        climbers.par_iter_mut().map(Climber::run).collect()
    } else {
        climbers.iter_mut().map(Climber::run).collect()
    };
    sums.concat()
}

/// Hands out the rows of each level: those from the first that a climber needs on are its own, up
/// to the first of the next one. Where they need the same row both make it, and one keeps it.
fn share<'a>(climbers: &mut [Climber<'a>], levels: &'a mut [Level]) {
    let mut firsts: Vec<u32> = climbers.iter().map(|c| c.rows.start).collect();
    for level in levels.iter_mut().rev() {
        let (height, row) = (level.height, level.width as usize * climbers[0].channels);
        let mut left = level.texels.as_mut();
        let mut ends = firsts[1..].to_vec();
        ends.push(height);
        for ((climber, first), end) in climbers.iter_mut().zip(&firsts).zip(ends) {
            let [own, others] = left.split(row * end.saturating_sub(*first) as usize);
            left = others;
            climber.steps.push(Step {
                first: *first,
                own,
                rows: Default::default(),
            });
        }
        let below = climbers[0].rungs[climbers[0].rungs.len() - climbers[0].steps.len()].below;
        for first in &mut firsts {
            *first = Taps::new(*first, height, below).first as u32;
        }
    }
    // From the lowest on, as rungs are.
    for climber in climbers {
        climber.steps.reverse();
    }
}

/// One level of a [`Climber`].
struct Step<'a> {
    /// The first row that is its own to keep.
    first: u32,
    own: Part<'a>,
    /// The last two rows that were made, those of even and of odd index.
    rows: [Option<(u32, Vec<[f32; 4]>)>; 2],
}

/// Makes rows of the last level, and those below them when they are needed.
struct Climber<'a> {
    image: &'a Image,
    content: Content,
    channels: usize,
    rungs: &'a [Rung],
    rows: std::ops::Range<u32>,
    steps: Vec<Step<'a>>,
}

impl Climber<'_> {
    /// The sums of its rows.
    fn run(&mut self) -> Vec<[f32; 4]> {
        let last = self.rungs.len() - 1;
        let mut out = Vec::new();
        for y in self.rows.clone() {
            self.make(last, y);
            if let Some((_, row)) = &self.steps[last].rows[(y % 2) as usize] {
                out.extend_from_slice(row);
            }
        }
        out
    }

    /// Makes row `y` of level `l`, counted from 0 here, if it is not there.
    fn make(&mut self, l: usize, y: u32) {
        let slot = (y % 2) as usize;
        let rung = &self.rungs[l];
        let mut row = match self.steps[l].rows[slot].take() {
            Some((at, row)) if at == y => {
                self.steps[l].rows[slot] = Some((at, row));
                return;
            }
            Some((_, row)) => row,
            None => Vec::new(),
        };
        row.clear();
        row.resize(rung.width, [0.0; 4]);
        for (from, weight) in Taps::new(y, rung.height, rung.below).iter() {
            if l == 0 {
                let start = from * self.image.width() as usize;
                let at = |x| weigh(self.image.at(start + x, self.content), self.content);
                average(&mut row, &rung.columns, weight, at);
            } else {
                self.make(l - 1, from as u32);
                if let Some((_, below)) = &self.steps[l - 1].rows[from % 2] {
                    average(&mut row, &rung.columns, weight, |x| below[x]);
                }
            }
        }
        let step = &mut self.steps[l];
        if let Some(k) = y.checked_sub(step.first) {
            let numbers = rung.width * self.channels;
            let at = k as usize * numbers;
            if at + numbers <= step.own.len() {
                step.own.write(at, &row, self.channels, self.content);
            }
        }
        step.rows[slot] = Some((y, row));
    }
}

/// Adds one row, with its share, to the row above it.
#[inline]
fn average(row: &mut [[f32; 4]], columns: &[Taps], weight: f32, at: impl Fn(usize) -> [f32; 4]) {
    for (out, columns) in row.iter_mut().zip(columns) {
        for (x, wx) in columns.iter() {
            for (o, t) in out.iter_mut().zip(at(x)) {
                *o += t * (wx * weight);
            }
        }
    }
}

/// Half the size of `sums`. Each new texel is the mean of the old ones by the area it covers, also
/// where sizes are odd, so the mean of the image stays.
pub(super) fn halve(width: u32, height: u32, sums: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let (w, h) = (half(width), half(height));
    let columns: Vec<Taps> = (0..w).map(|x| Taps::new(x, w, width)).collect();
    let mut texels = vec![[0.0; 4]; w as usize * h as usize];
    for (y, row) in texels.chunks_mut(w as usize).enumerate() {
        for (from, weight) in Taps::new(y as u32, h, height).iter() {
            let start = from * width as usize;
            average(row, &columns, weight, |x| sums[start + x]);
        }
    }
    texels
}

/// The old texels below a new one, along one axis, with their shares: three at most.
struct Taps {
    first: usize,
    count: usize,
    weights: [f32; 3],
}

impl Taps {
    /// For texel `i` of `m`, which replace `n`; `m` is half of `n` or both are 1.
    fn new(i: u32, m: u32, n: u32) -> Self {
        let (i, m, n) = (u64::from(i), u64::from(m), u64::from(n));
        // In units of 1/m of an old texel, the new one reaches from i·n to (i + 1)·n.
        let (from, to) = (i * n, (i + 1) * n);
        let (first, end) = (from / m, to.div_ceil(m));
        let mut weights = [0.0; 3];
        for (k, w) in weights.iter_mut().enumerate() {
            let (a, b) = ((first + k as u64) * m, (first + k as u64 + 1) * m);
            *w = (b.min(to).saturating_sub(a.max(from)) as f64 / n as f64) as f32;
        }
        Self {
            first: first as usize,
            count: (end - first) as usize,
            weights,
        }
    }

    #[inline]
    fn iter(&self) -> impl Iterator<Item = (usize, f32)> {
        (self.first..).zip(self.weights).take(self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_texel_add_up_to_one_and_each_old_texel_counts_the_same() {
        for n in 1..40 {
            let m = (n / 2_u32).max(1);
            let mut used = vec![0.0; n as usize];
            for i in 0..m {
                let taps = Taps::new(i, m, n);
                let sum: f32 = taps.iter().map(|(_, w)| w).sum();
                assert!((sum - 1.0).abs() < 1e-6 && taps.count <= 3, "{i} of {m}");
                for (x, w) in taps.iter() {
                    used[x] += w;
                }
            }
            let each = m as f32 / n as f32;
            assert!(
                used.iter().all(|u: &f32| (u - each).abs() < 1e-6),
                "{used:?}"
            );
        }
    }
}
