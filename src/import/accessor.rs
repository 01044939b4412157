//! Accessors: typed views into buffers, every bound checked before anything is allocated.
//!
//! Interleaved, normalised, quantised and sparse accessors, and those without data, as glTF 2.0,
//! 3.6.2 defines them. Numbers go to single precision without a detour.

use rayon::prelude::*;

use super::Problem;
use super::buffer::{Buffer, Bytes};
#[cfg(feature = "draco")]
use super::gate::Gate;
use super::json::Cursor;
use super::views::{View, Views};

/// Where accessors read.
pub(super) struct Source<'a> {
    pub(super) root: Cursor<'a>,
    pub(super) views: Views<'a>,
    /// Before decoders that take much memory.
    #[cfg(feature = "draco")]
    pub(super) gate: Gate,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn parse(c: &Cursor<'_>) -> Result<Self, Problem> {
        Ok(match c.index()? {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            other => return Err(c.problem(format!("{other} is not a component type"))),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

/// What an accessor says of itself.
pub(super) struct Accessor<'a> {
    /// The accessor.
    at: Cursor<'a>,
    /// The reference to it, which messages about its values name.
    pub(super) from: Cursor<'a>,
    pub(super) component: Component,
    /// Numbers in an element.
    pub(super) width: usize,
    /// Elements.
    pub(super) count: usize,
    pub(super) normalized: bool,
}

/// Equally spaced elements in a buffer view, within its bounds.
struct Placed<'v> {
    view: View<'v>,
    /// Where the first one begins.
    offset: usize,
    stride: usize,
    /// Bytes of each.
    size: usize,
}

/// The bytes of a few of them.
struct Run<'a> {
    bytes: Bytes<'a>,
    stride: usize,
}

/// Bytes that are read at a time: numbers go to where they stay in pieces, so that what they are
/// made of is never in memory as a whole.
const BLOCK: usize = 1 << 16;

/// More blocks than this are worth being shared among threads.
const SHARED: usize = 8;

impl<'a> Source<'a> {
    /// The accessors of the document `root`, a file of `size` bytes.
    pub(super) fn new(root: Cursor<'a>, buffers: &'a [Buffer], size: usize) -> Self {
        Self {
            views: Views::new(root.clone(), buffers, size),
            #[cfg(feature = "draco")]
            gate: Gate::new(super::draco::total(&root)),
            root,
        }
    }

    /// The accessor whose index stands at `from`.
    pub(super) fn accessor(&self, from: &Cursor<'a>) -> Result<Accessor<'a>, Problem> {
        let at = self.root.element("accessors", from.index()?, from)?;
        let kind = at.need("type")?;
        let width = match kind.str()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            "MAT2" | "MAT3" => 0,
            other => return Err(kind.problem(format!("'{other}' is no type"))),
        };
        Ok(Accessor {
            component: Component::parse(&at.need("componentType")?)?,
            width,
            count: at.need("count")?.index()?,
            normalized: at.flag("normalized"),
            from: from.clone(),
            at,
        })
    }

    /// The elements of an accessor, or those that `pick` lists, as single precision. They must
    /// have `N` components each.
    pub(super) fn floats<const N: usize>(
        &self,
        a: &Accessor<'a>,
        pick: Option<&[u32]>,
    ) -> Result<Vec<[f32; N]>, Problem> {
        a.expect_width(N)?;
        let (component, normalized) = (a.component, a.normalized);
        let placed = self.check(a, pick, 4 * N)?;
        let mut out = vec![[0.0; N]; pick.map_or(a.count, <[u32]>::len)];
        self.elements(a, pick, placed, &mut out, |run, out| {
            floats(run, out, component, normalized);
        })?;
        Ok(out)
    }

    /// The whole numbers of an accessor of unsigned scalars.
    pub(super) fn indices(&self, from: &Cursor<'a>) -> Result<Vec<u32>, Problem> {
        let a = self.accessor(from)?;
        a.expect_width(1)?;
        Ok(self.whole::<1>(&a, None)?.into_flattened())
    }

    /// As [`indices`](Self::indices), by threes; `None` if their number is no multiple of that.
    pub(super) fn triples(&self, from: &Cursor<'a>) -> Result<Option<Vec<[u32; 3]>>, Problem> {
        let a = self.accessor(from)?;
        a.expect_width(1)?;
        if !a.count.is_multiple_of(3) {
            return Ok(None);
        }
        let component = a.unsigned()?;
        let placed = self.check(&a, None, 4)?;
        let mut out = vec![[0; 3]; a.count / 3];
        let flat = out.as_flattened_mut().as_chunks_mut::<1>().0;
        self.elements(&a, None, placed, flat, |run, out| {
            integers(run, out, component);
        })?;
        Ok(Some(out))
    }

    /// As [`floats`](Self::floats) for unsigned whole numbers.
    pub(super) fn whole<const N: usize>(
        &self,
        a: &Accessor<'a>,
        pick: Option<&[u32]>,
    ) -> Result<Vec<[u32; N]>, Problem> {
        a.expect_width(N)?;
        let component = a.unsigned()?;
        let placed = self.check(a, pick, 4 * N)?;
        let mut out = vec![[0; N]; pick.map_or(a.count, <[u32]>::len)];
        self.elements(a, pick, placed, &mut out, |run, out| {
            integers(run, out, component);
        })?;
        Ok(out)
    }

    /// Where the elements of an accessor are, if they are anywhere, once it is known that there is
    /// room for as many of `bytes` bytes as are asked for.
    fn check(
        &self,
        a: &Accessor<'a>,
        pick: Option<&[u32]>,
        bytes: usize,
    ) -> Result<Option<Placed<'_>>, Problem> {
        let placed = match a.at.get("bufferView") {
            Some(view) => {
                let offset = a.at.index_or("byteOffset", 0)?;
                let size = a.component.size() * a.width;
                Some(self.placed(&a.at, &view, offset, a.count, size)?)
            }
            None => None,
        };
        let last = pick.and_then(<[u32]>::last);
        if let Some(last) = last.filter(|&&i| i as usize >= a.count) {
            let n = a.count;
            return Err(a.at.problem(format!("has no element {last}: it has {n}")));
        }
        let n = pick.map_or(a.count, <[u32]>::len);
        self.views.claim(n.saturating_mul(bytes), &a.at)?;
        Ok(placed)
    }

    /// Reads elements to `out`, which holds zeros.
    fn elements<T: Copy + Default + Send, const N: usize>(
        &self,
        a: &Accessor<'a>,
        pick: Option<&[u32]>,
        placed: Option<Placed<'_>>,
        out: &mut [[T; N]],
        convert: impl Fn(&Run<'_>, &mut [[T; N]]) + Sync,
    ) -> Result<(), Problem> {
        if let Some(placed) = placed {
            placed.read(pick, out, &convert)?;
        }
        match a.at.get("sparse") {
            Some(sparse) => self.patch(&sparse, a, pick, convert, out),
            None => Ok(()),
        }
    }

    /// Replaces the elements that a sparse accessor lists.
    fn patch<T: Copy + Default + Send, const N: usize>(
        &self,
        sparse: &Cursor<'a>,
        a: &Accessor<'a>,
        pick: Option<&[u32]>,
        convert: impl Fn(&Run<'_>, &mut [[T; N]]) + Sync,
        out: &mut [[T; N]],
    ) -> Result<(), Problem> {
        let count = sparse.need("count")?.index()?;
        if count > a.count {
            return Err(sparse.problem(format!("lists {count} elements of {}", a.count)));
        }
        let indices = sparse.need("indices")?;
        let kind = indices.need("componentType")?;
        let component = Component::parse(&kind)?;
        if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
            return Err(kind.problem("is not an unsigned integer, as indices are"));
        }
        let at = self.placed(
            &indices,
            &indices.need("bufferView")?,
            indices.index_or("byteOffset", 0)?,
            count,
            component.size(),
        )?;
        let values = sparse.need("values")?;
        let placed = self.placed(
            &values,
            &values.need("bufferView")?,
            values.index_or("byteOffset", 0)?,
            count,
            a.component.size() * N,
        )?;
        self.views.claim(count.saturating_mul(4 * N + 4), sparse)?;
        let (mut which, mut what) = (vec![[0; 1]; count], vec![[T::default(); N]; count]);
        at.read(None, &mut which, |run, out| integers(run, out, component))?;
        placed.read(None, &mut what, convert)?;
        for ([i], value) in which.into_iter().zip(what) {
            if i as usize >= a.count {
                return Err(indices.problem(format!("index {i} is out of range")));
            }
            let slot = match pick {
                None => Some(i as usize),
                Some(pick) => pick.binary_search(&i).ok(),
            };
            if let Some(slot) = slot.and_then(|s| out.get_mut(s)) {
                *slot = value;
            }
        }
        Ok(())
    }

    /// Where `count` elements of `size` bytes are in a buffer view.
    fn placed(
        &self,
        owner: &Cursor<'a>,
        view_index: &Cursor<'a>,
        offset: usize,
        count: usize,
        size: usize,
    ) -> Result<Placed<'_>, Problem> {
        let view = self.views.get(view_index)?;
        let stride = match view.stride {
            0 => size,
            s if s < size => {
                return Err(owner.problem(format!(
                    "elements of {size} bytes overlap at the stride of {s} bytes of {}",
                    view.at.path()
                )));
            }
            s => s,
        };
        let last = count.checked_sub(1).map_or(Some(0), |n| {
            n.checked_mul(stride)?
                .checked_add(size)?
                .checked_add(offset)
        });
        if last.is_none_or(|end| end > view.len) {
            return Err(owner.problem(format!(
                "{count} elements of {size} bytes reach beyond the {} bytes of {}",
                view.len,
                view.at.path()
            )));
        }
        Ok(Placed {
            view,
            offset,
            stride,
            size,
        })
    }
}

impl Placed<'_> {
    /// Reads the first elements, or those that `pick` lists in ascending order, to `out`; `convert`
    /// makes numbers of bytes. All threads share the work where there is much of it.
    fn read<T: Send>(
        &self,
        pick: Option<&[u32]>,
        out: &mut [T],
        convert: impl Fn(&Run<'_>, &mut [T]) + Sync,
    ) -> Result<(), Problem> {
        let rows = (BLOCK / self.stride).max(1);
        let block = |(i, out): (usize, &mut [T])| {
            let (first, n) = (i * rows, out.len());
            let run = match pick {
                None => Run {
                    bytes: self.view.read(
                        self.offset + first * self.stride,
                        (n - 1) * self.stride + self.size,
                    )?,
                    stride: self.stride,
                },
                Some(pick) => self.gather(&pick[first..first + n])?,
            };
            convert(&run, out);
            Ok(())
        };
        if out.len() > SHARED * rows {
            out.par_chunks_mut(rows).enumerate().try_for_each(block)
        } else {
            out.chunks_mut(rows).enumerate().try_for_each(block)
        }
    }

    /// The bytes of the elements that `pick` lists, one after the other.
    fn gather(&self, pick: &[u32]) -> Result<Run<'_>, Problem> {
        let at = |i: u32| self.offset + i as usize * self.stride;
        let mut bytes = Vec::with_capacity(pick.len() * self.size);
        if let (Some(&first), Some(&last)) = (pick.first(), pick.last()) {
            // Few elements scattered over a large file are read one by one.
            let span = (last - first) as usize + 1;
            if span / 8 <= pick.len() {
                let all = self
                    .view
                    .read(at(first), at(last) + self.size - at(first))?;
                for &i in pick {
                    let begin = at(i) - at(first);
                    bytes.extend_from_slice(&all[begin..begin + self.size]);
                }
            } else {
                for &i in pick {
                    bytes.extend_from_slice(&self.view.read(at(i), self.size)?);
                }
            }
        }
        Ok(Run {
            bytes: Bytes::Owned(bytes),
            stride: self.size,
        })
    }
}

impl<'a> Accessor<'a> {
    /// The type of its components, which must be unsigned whole numbers.
    fn unsigned(&self) -> Result<Component, Problem> {
        if matches!(
            self.component,
            Component::U8 | Component::U16 | Component::U32
        ) {
            return Ok(self.component);
        }
        let kind = self.at.need("componentType")?;
        Err(kind.problem("is not an unsigned integer, as indices are"))
    }

    /// Refuses an accessor whose elements do not have `n` numbers.
    fn expect_width(&self, n: usize) -> Result<(), Problem> {
        if self.width == n {
            return Ok(());
        }
        let wanted = match n {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        let kind = self.at.need("type")?;
        Err(kind.problem(format!(
            "is {}, {wanted} is needed (by {})",
            kind.str()?,
            self.from.path()
        )))
    }
}

/// Elements of `N` numbers of `size` bytes each.
#[inline(always)]
fn map<T, const N: usize>(
    run: &Run<'_>,
    out: &mut [[T; N]],
    size: usize,
    read: impl Fn(&[u8]) -> T,
) {
    let one = |c: &[u8]| std::array::from_fn(|k| read(&c[k * size..(k + 1) * size]));
    // Elements without gaps are read in chunks of known size, which become vector code.
    if run.stride == N * size {
        for (out, c) in out.iter_mut().zip(run.bytes.chunks_exact(N * size)) {
            *out = one(c);
        }
    } else {
        for (out, c) in out.iter_mut().zip(run.bytes.chunks(run.stride)) {
            *out = one(c);
        }
    }
}

fn integers<const N: usize>(run: &Run<'_>, out: &mut [[u32; N]], component: Component) {
    match component {
        Component::U8 => map(run, out, 1, |b| u32::from(b[0])),
        Component::U16 => map(run, out, 2, |b| u32::from(u16::from_le_bytes([b[0], b[1]]))),
        _ => map(run, out, 4, |b| {
            u32::from_le_bytes([b[0], b[1], b[2], b[3]])
        }),
    }
}

/// Numbers as glTF 2.0, 3.6.2.2 makes them of integers.
fn floats<const N: usize>(
    run: &Run<'_>,
    out: &mut [[f32; N]],
    component: Component,
    normalized: bool,
) {
    let i16 = |b: &[u8]| i16::from_le_bytes([b[0], b[1]]);
    let u16 = |b: &[u8]| u16::from_le_bytes([b[0], b[1]]);
    let u32 = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    match (component, normalized) {
        (Component::F32, _) => map(run, out, 4, |b| f32::from_bits(u32(b))),
        (Component::U32, _) => map(run, out, 4, |b| u32(b) as f32),
        (Component::I8, false) => map(run, out, 1, |b| f32::from(b[0] as i8)),
        (Component::U8, false) => map(run, out, 1, |b| f32::from(b[0])),
        (Component::I16, false) => map(run, out, 2, |b| f32::from(i16(b))),
        (Component::U16, false) => map(run, out, 2, |b| f32::from(u16(b))),
        (Component::I8, true) => map(run, out, 1, |b| (f32::from(b[0] as i8) / 127.0).max(-1.0)),
        (Component::U8, true) => map(run, out, 1, |b| f32::from(b[0]) / 255.0),
        (Component::I16, true) => map(run, out, 2, |b| (f32::from(i16(b)) / 32767.0).max(-1.0)),
        (Component::U16, true) => map(run, out, 2, |b| f32::from(u16(b)) / 65535.0),
    }
}
