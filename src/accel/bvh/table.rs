//! Arrays that rays jump about in, on pages large enough for that.
//!
//! A tree of a million triangles is some 70 MB: 17 000 pages of 4 KiB, which no processor holds
//! translations of, so that nearly every node would cost a walk through page tables first. Pages of
//! 2 MiB end that. Linux gives them to those who ask, which allocators of programs do not.

use std::ops::Deref;

use bytemuck::Pod;

/// Bytes below which large pages would be mostly empty.
#[cfg(unix)]
const LARGE: usize = 4 << 20;

/// An array that is read only, on large pages where it is large.
#[derive(Debug)]
pub(super) enum Table<T> {
    /// Where the allocator puts it.
    Small(Vec<T>),
    /// Mapped, and its length.
    #[cfg(unix)]
    Mapped(memmap2::MmapMut, usize),
}

impl<T: Pod> Table<T> {
    /// So many items, which `fill` gets as zeros and writes.
    pub(super) fn new(len: usize, fill: impl FnOnce(&mut [T])) -> Self {
        #[cfg(unix)]
        if let Some(mut map) = map(len.saturating_mul(size_of::<T>())) {
            fill(bytemuck::cast_slice_mut(&mut map));
            return Self::Mapped(map, len);
        }
        let mut items = vec![T::zeroed(); len];
        fill(&mut items);
        Self::Small(items)
    }

    /// Moves an array where it is best read.
    pub(super) fn from_vec(items: Vec<T>) -> Self {
        Self::new(items.len(), |out| out.copy_from_slice(&items))
    }
}

/// Memory on large pages; `None` where it would be small, or is not to be had.
#[cfg(unix)]
fn map(bytes: usize) -> Option<memmap2::MmapMut> {
    if bytes < LARGE {
        return None;
    }
    let map = memmap2::MmapMut::map_anon(bytes).ok()?;
    // A system without large pages says so: small ones serve too.
    #[cfg(target_os = "linux")]
    let _: std::io::Result<()> = map.advise(memmap2::Advice::HugePage);
    Some(map)
}

impl<T: Pod> Deref for Table<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        match self {
            Self::Small(items) => items,
            #[cfg(unix)]
            Self::Mapped(map, len) => &bytemuck::cast_slice(map)[..*len],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_and_large_tables_hold_what_they_were_given() {
        for n in [0, 1, 1000, 3_000_001] {
            let items: Vec<u32> = (0..n).map(|i| i ^ 0x5a5a).collect();
            assert_eq!(Table::from_vec(items.clone())[..], items[..]);
        }
    }
}
