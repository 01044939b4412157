//! Accessors: typed views into buffers, every bound checked before anything is allocated.
//!
//! Interleaved, normalised, quantised and sparse accessors, and those without data, as glTF 2.0,
//! 3.6.2 defines them. Numbers go to single precision without a detour.

use std::borrow::Cow;

use super::Problem;
use super::buffer::Buffer;
use super::json::Cursor;
use super::views::Views;

/// Where accessors read.
pub(super) struct Source<'a> {
    pub(super) root: Cursor<'a>,
    pub(super) views: Views<'a>,
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

/// A checked run of equally spaced elements.
struct Run<'a> {
    bytes: Cow<'a, [u8]>,
    stride: usize,
}

impl<'a> Source<'a> {
    /// The accessors of the document `root`, a file of `size` bytes.
    pub(super) fn new(root: Cursor<'a>, buffers: &'a [Buffer], size: usize) -> Self {
        Self {
            views: Views::new(root.clone(), buffers, size),
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
        self.elements(a, pick, |run, n| floats(run, n, component, normalized))
    }

    /// The whole numbers of an accessor of unsigned scalars.
    pub(super) fn indices(&self, from: &Cursor<'a>) -> Result<Vec<u32>, Problem> {
        let a = self.accessor(from)?;
        a.expect_width(1)?;
        let flat = self.whole::<1>(&a, None)?;
        Ok(flat.into_iter().map(|[i]| i).collect())
    }

    /// As [`floats`](Self::floats) for unsigned whole numbers.
    pub(super) fn whole<const N: usize>(
        &self,
        a: &Accessor<'a>,
        pick: Option<&[u32]>,
    ) -> Result<Vec<[u32; N]>, Problem> {
        a.expect_width(N)?;
        let component = a.component;
        if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
            let kind = a.at.need("componentType")?;
            return Err(kind.problem("is not an unsigned integer, as indices are"));
        }
        self.elements(a, pick, |run, n| integers(run, n, component))
    }

    fn elements<T: Copy + Default, const N: usize>(
        &self,
        a: &Accessor<'a>,
        pick: Option<&[u32]>,
        convert: impl Fn(&Run<'_>, usize) -> Vec<[T; N]>,
    ) -> Result<Vec<[T; N]>, Problem> {
        let n = pick.map_or(a.count, <[u32]>::len);
        let size = a.component.size() * N;
        let claim = || self.views.claim(n.saturating_mul(4 * N), &a.at);
        let mut out = match a.at.get("bufferView") {
            Some(view) => {
                let offset = a.at.index_or("byteOffset", 0)?;
                let run = self.run(&a.at, &view, offset, a.count, size, pick)?;
                claim()?;
                convert(&run, n)
            }
            None => {
                claim()?;
                vec![[T::default(); N]; n]
            }
        };
        if let Some(sparse) = a.at.get("sparse") {
            self.patch(&sparse, a, pick, &convert, &mut out)?;
        }
        Ok(out)
    }

    /// Replaces the elements that a sparse accessor lists.
    fn patch<T: Copy, const N: usize>(
        &self,
        sparse: &Cursor<'a>,
        a: &Accessor<'a>,
        pick: Option<&[u32]>,
        convert: impl Fn(&Run<'_>, usize) -> Vec<[T; N]>,
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
        let at = self.run(
            &indices,
            &indices.need("bufferView")?,
            indices.index_or("byteOffset", 0)?,
            count,
            component.size(),
            None,
        )?;
        let values = sparse.need("values")?;
        let run = self.run(
            &values,
            &values.need("bufferView")?,
            values.index_or("byteOffset", 0)?,
            count,
            a.component.size() * N,
            None,
        )?;
        self.views.claim(count.saturating_mul(4 * N + 4), sparse)?;
        let at = integers::<1>(&at, count, component);
        for ([i], value) in at.into_iter().zip(convert(&run, count)) {
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

    /// The bytes of `count` elements of `size` bytes in a buffer view, or of those that `pick`
    /// lists.
    fn run(
        &self,
        owner: &Cursor<'a>,
        view_index: &Cursor<'a>,
        offset: usize,
        count: usize,
        size: usize,
        pick: Option<&[u32]>,
    ) -> Result<Run<'_>, Problem> {
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
        let Some(end) = last.filter(|end| *end <= view.len) else {
            return Err(owner.problem(format!(
                "{count} elements of {size} bytes reach beyond the {} bytes of {}",
                view.len,
                view.at.path()
            )));
        };
        let Some(pick) = pick else {
            let bytes = view.read(offset, end.saturating_sub(offset))?;
            return Ok(Run { bytes, stride });
        };
        let (Some(&first), Some(&last)) = (pick.first(), pick.last()) else {
            return Ok(Run {
                bytes: Cow::Owned(Vec::new()),
                stride: size,
            });
        };
        if last as usize >= count {
            return Err(owner.problem(format!("has no element {last}: it has {count}")));
        }
        let at = |i: u32| offset + i as usize * stride;
        let mut bytes = Vec::with_capacity(pick.len() * size);
        // Few elements scattered over a large file are read one by one.
        let span = (last - first) as usize + 1;
        if span / 8 <= pick.len() {
            let all = view.read(at(first), at(last) + size - at(first))?;
            for &i in pick {
                let begin = at(i) - at(first);
                bytes.extend_from_slice(&all[begin..begin + size]);
            }
        } else {
            for &i in pick {
                bytes.extend_from_slice(&view.read(at(i), size)?);
            }
        }
        Ok(Run {
            bytes: Cow::Owned(bytes),
            stride: size,
        })
    }
}

impl<'a> Accessor<'a> {
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

/// `n` elements of `N` numbers of `size` bytes each.
#[inline(always)]
fn map<T, const N: usize>(
    run: &Run<'_>,
    n: usize,
    size: usize,
    read: impl Fn(&[u8]) -> T,
) -> Vec<[T; N]> {
    let one = |c: &[u8]| std::array::from_fn(|k| read(&c[k * size..(k + 1) * size]));
    // Elements without gaps are read in chunks of known size, which become vector code.
    if run.stride == N * size {
        return run.bytes.chunks_exact(N * size).take(n).map(one).collect();
    }
    run.bytes.chunks(run.stride).take(n).map(one).collect()
}

fn integers<const N: usize>(run: &Run<'_>, n: usize, component: Component) -> Vec<[u32; N]> {
    match component {
        Component::U8 => map(run, n, 1, |b| u32::from(b[0])),
        Component::U16 => map(run, n, 2, |b| u32::from(u16::from_le_bytes([b[0], b[1]]))),
        _ => map(run, n, 4, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
    }
}

/// Numbers as glTF 2.0, 3.6.2.2 makes them of integers.
fn floats<const N: usize>(
    run: &Run<'_>,
    n: usize,
    component: Component,
    normalized: bool,
) -> Vec<[f32; N]> {
    let i16 = |b: &[u8]| i16::from_le_bytes([b[0], b[1]]);
    let u16 = |b: &[u8]| u16::from_le_bytes([b[0], b[1]]);
    let u32 = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    match (component, normalized) {
        (Component::F32, _) => map(run, n, 4, |b| f32::from_bits(u32(b))),
        (Component::U32, _) => map(run, n, 4, |b| u32(b) as f32),
        (Component::I8, false) => map(run, n, 1, |b| f32::from(b[0] as i8)),
        (Component::U8, false) => map(run, n, 1, |b| f32::from(b[0])),
        (Component::I16, false) => map(run, n, 2, |b| f32::from(i16(b))),
        (Component::U16, false) => map(run, n, 2, |b| f32::from(u16(b))),
        (Component::I8, true) => map(run, n, 1, |b| (f32::from(b[0] as i8) / 127.0).max(-1.0)),
        (Component::U8, true) => map(run, n, 1, |b| f32::from(b[0]) / 255.0),
        (Component::I16, true) => map(run, n, 2, |b| (f32::from(i16(b)) / 32767.0).max(-1.0)),
        (Component::U16, true) => map(run, n, 2, |b| f32::from(u16(b)) / 65535.0),
    }
}
