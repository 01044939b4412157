//! Leaves: up to four primitives with their data side by side, as four are tested at a time.

use bytemuck::{Pod, Zeroable};

use super::{Kind, Prim};

/// Most primitives in a leaf.
pub(super) const WIDTH: usize = 4;

/// The primitives of a leaf.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(super) struct Block {
    /// See [`Prim::data`]: corner or row, then coordinate, then primitive.
    pub(super) data: [[[f32; WIDTH]; 3]; 3],
    object: [u32; WIDTH],
    prim: [u32; WIDTH],
    /// Of each, [`Kind`] as a number: a table holds numbers only.
    kind: [u8; WIDTH],
    count: u8,
    /// How many of them are triangles.
    triangles: u8,
    /// Up to whole lines of the cache.
    unused: [u8; 10],
}

impl Block {
    /// A leaf without primitives.
    pub(super) const EMPTY: Self = Self {
        data: [[[0.0; WIDTH]; 3]; 3],
        object: [0; WIDTH],
        prim: [0; WIDTH],
        kind: [Kind::Triangle as u8; WIDTH],
        count: 0,
        triangles: 0,
        unused: [0; 10],
    };

    /// A leaf of at most four primitives.
    pub(super) fn new(prims: impl Iterator<Item = Prim>) -> Self {
        let mut block = Self::EMPTY;
        for (lane, p) in prims.take(WIDTH).enumerate() {
            for (row, values) in block.data.iter_mut().zip(p.data) {
                for (column, value) in row.iter_mut().zip(values) {
                    column[lane] = value;
                }
            }
            block.object[lane] = p.object;
            block.prim[lane] = p.prim;
            block.kind[lane] = p.kind as u8;
            block.triangles += u8::from(p.kind == Kind::Triangle);
            block.count += 1;
        }
        block
    }

    /// Whether all of them are triangles.
    #[inline]
    pub(super) fn is_of_triangles(&self) -> bool {
        self.triangles == self.count
    }

    #[inline]
    pub(super) fn count(&self) -> usize {
        usize::from(self.count)
    }

    /// A bit for each primitive.
    #[inline]
    pub(super) fn lanes(&self) -> i32 {
        (1 << self.count) - 1
    }

    /// The corners of a triangle.
    #[inline]
    pub(super) fn corners(&self, lane: usize) -> [[f32; 3]; 3] {
        self.data.map(|row| row.map(|column| column[lane & 3]))
    }

    /// Object and number of a primitive.
    #[inline]
    pub(super) fn name(&self, lane: usize) -> (u32, u32) {
        (self.object[lane & 3], self.prim[lane & 3])
    }

    /// One of the primitives.
    #[inline]
    pub(super) fn get(&self, lane: usize) -> Prim {
        let (object, prim) = self.name(lane);
        Prim {
            data: self.corners(lane),
            kind: Kind::ALL[usize::from(self.kind[lane & 3]) % Kind::ALL.len()],
            object,
            prim,
        }
    }
}
