//! A film as bytes, and back, bit for bit: what a rendering needs to go on later.

use super::passes::Passes;
use super::{Film, VALUES};

/// Bytes before the pixels.
const HEAD: usize = 32;

/// Bytes of a pixel.
const PIXEL: usize = 4 * (VALUES + 1 + 3 + 1 + 3);

impl Film {
    /// The film as bytes: width, height, finished passes, what was left out, then the pixels;
    /// little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let none = Passes::new(0);
        let passes = self.passes.as_ref().unwrap_or(&none);
        let mut out = Vec::with_capacity(HEAD + PIXEL * self.counts.len());
        let has_passes = u32::from(self.passes.is_some());
        for n in [self.width, self.height, has_passes, passes.finished] {
            out.extend(n.to_le_bytes());
        }
        out.extend(self.rejected.to_le_bytes());
        let [row, column] = self.first_rejected.unwrap_or_default();
        out.extend([row, column].map(u32::to_le_bytes).as_flattened());
        for (i, (sums, count)) in self.sums.iter().zip(&self.counts).enumerate() {
            let (current, n) = passes.current.get(i).copied().unwrap_or_default();
            let squares = passes.squares.get(i).copied().unwrap_or_default();
            out.extend(sums.iter().flat_map(|v| v.to_le_bytes()));
            out.extend(count.to_le_bytes());
            out.extend(current.iter().flat_map(|v| v.to_le_bytes()));
            out.extend(n.to_le_bytes());
            out.extend(squares.iter().flat_map(|v| v.to_le_bytes()));
        }
        out
    }

    /// The film that [`to_bytes`](Self::to_bytes) wrote; `None` of anything else.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (head, mut rest) = bytes.split_at_checked(HEAD)?;
        let head = array(&mut &*head)?.map(u32::from_le_bytes);
        let [width, height, has_passes, finished, low, high, row, column] = head;
        let rejected = u64::from(low) | u64::from(high) << 32;
        let n = (width as usize).checked_mul(height as usize)?;
        if has_passes > 1 || n.checked_mul(PIXEL)? != rest.len() {
            return None;
        }
        if rejected > 0 && (row >= height || column >= width) {
            return None;
        }
        let mut film = Self::new(width, height);
        film.rejected = rejected;
        film.first_rejected = (rejected > 0).then_some([row, column]);
        let mut passes = Passes::new(n);
        passes.finished = finished;
        for i in 0..n {
            film.sums[i] = array(&mut rest)?.map(f32::from_le_bytes);
            film.counts[i] = u32::from_le_bytes(array::<1>(&mut rest)?[0]);
            passes.current[i].0 = array(&mut rest)?.map(f32::from_le_bytes);
            passes.current[i].1 = u32::from_le_bytes(array::<1>(&mut rest)?[0]);
            passes.squares[i] = array(&mut rest)?.map(f32::from_le_bytes);
        }
        let finite = film.sums.iter().flatten().all(|v| v.is_finite());
        film.passes = (has_passes == 1).then_some(passes);
        finite.then_some(film)
    }
}

/// Takes groups of four bytes off the front.
fn array<const N: usize>(bytes: &mut &[u8]) -> Option<[[u8; 4]; N]> {
    let (head, tail) = bytes.split_at_checked(4 * N)?;
    *bytes = tail;
    let mut out = [[0; 4]; N];
    for (o, c) in out.iter_mut().zip(head.chunks_exact(4)) {
        o.copy_from_slice(c);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Rgb;
    use crate::film::{Component, PixelSample, Tile};

    #[test]
    fn a_film_comes_back_bit_for_bit_and_damage_is_noticed() {
        let mut film = Film::new(3, 2);
        film.count_passes();
        let mut s = PixelSample::default();
        s.add(Component::Direct, Rgb::new(0.1, 0.2, 0.3));
        for k in 0..3 {
            film.add(&Tile {
                x: 1,
                y: 0,
                width: 2,
                height: 2,
                sums: vec![s; 4],
                samples: 1 + k,
            });
            if k < 2 {
                film.finish_pass();
            }
        }
        s.add(Component::Direct, Rgb::splat(f64::NAN));
        film.add(&Tile {
            x: 2,
            y: 1,
            width: 1,
            height: 1,
            sums: vec![s],
            samples: 1,
        });
        let bytes = film.to_bytes();
        let back = Film::from_bytes(&bytes).unwrap();
        assert_eq!(back.to_bytes(), bytes);
        assert_eq!(back.develop(), film.develop());
        assert_eq!((back.passes(), back.samples_of_pass(1, 0)), (2, 3));
        // What was left out is not forgotten.
        assert_eq!((back.rejected(), back.first_rejected()), (1, Some([2, 1])));
        assert!(Film::from_bytes(&bytes[1..]).is_none());
        assert!(Film::from_bytes(&bytes[..bytes.len() - 1]).is_none());
        assert!(Film::from_bytes(&[0xff; HEAD]).is_none());
        assert!(Film::from_bytes(&[]).is_none());
    }
}
