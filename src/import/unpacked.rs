//! What a compressed buffer view holds, freed piece by piece as it is used up: otherwise all that
//! was compressed would be in memory twice, as it is unpacked and as what is made of it.

use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::Problem;
use super::buffer::Bytes;
use super::json::Cursor;
use super::views::COMPRESSION;

/// The contents of one view.
pub(super) struct Unpacked {
    /// Where its parts begin, from 0 on: elements of accessors that overlap are in one part, all
    /// others in parts of their own.
    bounds: Vec<usize>,
    /// For each part, accessors that are still to be read.
    users: Vec<AtomicUsize>,
    parts: Mutex<Parts>,
}

/// Nothing yet, why there is nothing, or what there is of each part.
type Parts = Option<Result<Vec<Option<Arc<[u8]>>>, Problem>>;

impl Unpacked {
    /// Of a view whose accessors lie at these ranges.
    fn new(mut ranges: Vec<(usize, usize)>) -> Self {
        ranges.sort_unstable();
        let (mut bounds, mut end) = (vec![0], 0);
        for (start, stop) in ranges {
            if start >= end && start > 0 {
                bounds.push(start);
            }
            end = end.max(stop);
        }
        Self {
            users: bounds.iter().map(|_| AtomicUsize::new(0)).collect(),
            bounds,
            parts: Mutex::new(None),
        }
    }

    fn part(&self, at: usize) -> usize {
        self.bounds.partition_point(|b| *b <= at) - 1
    }

    /// Unpacks it, unless that was done: `unpack` gets the bounds of the parts that it is to make.
    pub(super) fn fill(
        &self,
        unpack: impl FnOnce(&[usize]) -> Result<Vec<Arc<[u8]>>, Problem>,
    ) -> Result<(), Problem> {
        let mut parts = self.parts.lock().unwrap_or_else(PoisonError::into_inner);
        let made =
            parts.get_or_insert_with(|| Ok(unpack(&self.bounds)?.into_iter().map(Some).collect()));
        made.as_ref().map(|_| ()).map_err(Problem::clone)
    }

    /// `len` bytes from `at` on; `None` if they are in several parts, or gone.
    pub(super) fn read(&self, at: usize, len: usize) -> Option<Bytes<'static>> {
        let part = self.part(at);
        let parts = self.parts.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes = parts.as_ref()?.as_ref().ok()?.get(part)?.clone()?;
        let begin = at - self.bounds[part];
        (begin + len <= bytes.len()).then_some(Bytes::Shared(bytes, begin, len))
    }

    /// One more accessor that begins at `at` will be read.
    fn expect(&self, at: usize) {
        self.users[self.part(at)].fetch_add(1, Ordering::Relaxed);
    }

    /// An accessor that was expected has been read, and will not be again.
    fn forget(&self, at: usize) {
        let part = self.part(at);
        if self.users[part].fetch_sub(1, Ordering::AcqRel) == 1
            && let Some(Ok(parts)) = &mut *self.parts.lock().unwrap_or_else(PoisonError::into_inner)
            && let Some(slot) = parts.get_mut(part)
        {
            *slot = None;
        }
    }
}

/// The contents of all compressed views of a file, by index.
pub(super) fn all(root: &Cursor<'_>) -> HashMap<usize, Unpacked> {
    let mut ranges: HashMap<usize, Vec<(usize, usize)>> = HashMap::new();
    // What is wrong in the file is told when it is needed.
    let views = root.items("bufferViews").unwrap_or_default();
    let packed = |v: &Cursor<'_>| COMPRESSION.iter().any(|name| v.extension(name).is_some());
    for (i, _) in views.iter().enumerate().filter(|(_, v)| packed(v)) {
        ranges.insert(i, Vec::new());
    }
    if ranges.is_empty() {
        return HashMap::new();
    }
    for accessor in root.items("accessors").unwrap_or_default() {
        for (view, start) in places(&accessor) {
            if let (Some(own), Some(view)) = (ranges.get_mut(&view), views.get(view)) {
                let stride = view.index_or("byteStride", 0).unwrap_or(0);
                own.push((start, start.saturating_add(span(&accessor, stride))));
            }
        }
    }
    let all = ranges.into_iter();
    all.map(|(i, ranges)| (i, Unpacked::new(ranges))).collect()
}

/// Most bytes that an accessor can take in a view of this stride. Those of sparse ones are fewer.
fn span(accessor: &Cursor<'_>, stride: usize) -> usize {
    let count = accessor.get("count").and_then(|c| c.index().ok());
    let kind = accessor.get("type");
    let width = match kind.as_ref().and_then(|k| k.str().ok()) {
        Some("SCALAR") => 1,
        Some("VEC2") => 2,
        Some("VEC3") => 3,
        Some("VEC4") => 4,
        _ => 16,
    };
    let component = match accessor.index_or("componentType", 0) {
        Ok(5120 | 5121) => 1,
        Ok(5122 | 5123) => 2,
        _ => 4,
    };
    let size = width * component;
    let before = count.unwrap_or(0).saturating_sub(1);
    before.saturating_mul(stride.max(size)).saturating_add(size)
}

/// The views that an accessor reads, and from where on.
fn places(accessor: &Cursor<'_>) -> Vec<(usize, usize)> {
    let sparse = accessor.get("sparse");
    let of = |key: &str| sparse.as_ref().and_then(|s| s.get(key));
    [Some(accessor.clone()), of("indices"), of("values")]
        .into_iter()
        .flatten()
        .filter_map(|at| {
            let view = at.get("bufferView")?.index().ok()?;
            Some((view, at.index_or("byteOffset", 0).ok()?))
        })
        .collect()
}

/// Which accessors are still to be read, and how often.
pub(super) struct Users<'s> {
    views: &'s HashMap<usize, Unpacked>,
    left: HashMap<usize, (AtomicUsize, Vec<(usize, usize)>)>,
}

impl<'s> Users<'s> {
    /// Accessors of the document `root`, each as often as it will be read.
    pub(super) fn new(
        root: &Cursor<'_>,
        views: &'s HashMap<usize, Unpacked>,
        accessors: impl Iterator<Item = usize>,
    ) -> Self {
        let mut left = HashMap::new();
        if !views.is_empty() {
            let list = root.items("accessors").unwrap_or_default();
            for index in accessors {
                let (n, _) = left.entry(index).or_insert_with(|| {
                    let mut places = list.get(index).map(places).unwrap_or_default();
                    places.retain(|(view, _)| views.contains_key(view));
                    for (view, at) in &places {
                        views[view].expect(*at);
                    }
                    (AtomicUsize::new(0), places)
                });
                n.fetch_add(1, Ordering::Relaxed);
            }
        }
        Self { views, left }
    }

    /// An accessor has been read once.
    pub(super) fn done(&self, accessor: usize) {
        if let Some((left, places)) = self.left.get(&accessor)
            && left.fetch_sub(1, Ordering::AcqRel) == 1
        {
            for (view, at) in places {
                self.views[view].forget(*at);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_freed_when_all_that_overlap_in_them_are_read() {
        // Two interleaved accessors, a gap, and one of its own.
        let all = Unpacked::new(vec![(4, 40), (0, 36), (48, 60)]);
        assert_eq!(all.bounds, [0, 48]);
        let bytes: Vec<u8> = (0..60).collect();
        let unpack = |bounds: &[usize]| {
            assert_eq!(bounds, [0, 48]);
            Ok(vec![bytes[..48].into(), bytes[48..].into()])
        };
        for at in [0, 4, 48] {
            all.expect(at);
        }
        assert!(all.read(0, 1).is_none());
        all.fill(unpack).unwrap();
        all.fill(|_| unreachable!()).unwrap();
        assert_eq!(*all.read(4, 3).unwrap(), [4, 5, 6]);
        assert_eq!(*all.read(50, 10).unwrap(), bytes[50..]);
        assert!(all.read(40, 9).is_none() && all.read(50, 11).is_none());
        all.forget(4);
        assert!(all.read(4, 3).is_some());
        all.forget(0);
        assert!(all.read(4, 3).is_none() && all.read(48, 3).is_some());
        all.forget(48);
        assert!(all.read(48, 3).is_none());
    }
}
