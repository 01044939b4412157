//! Accessors: typed views into buffers, every bound checked before anything is allocated.
//!
//! Interleaved, normalised, quantised and sparse accessors, and those without data, as glTF 2.0,
//! 3.6.2 defines them.

use super::Problem;
use super::json::Cursor;

/// Where accessors read.
pub(super) struct Source<'a> {
    pub(super) root: Cursor<'a>,
    pub(super) buffers: &'a [Vec<u8>],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
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

    /// The number at the start of `b`, which holds at least [`size`](Self::size) bytes.
    fn read(self, b: &[u8], normalized: bool) -> f64 {
        let word = |n: usize| {
            let mut w = [0; 4];
            w[..n].copy_from_slice(&b[..n]);
            u32::from_le_bytes(w)
        };
        let signed = |x: f64, max: f64| if normalized { (x / max).max(-1.0) } else { x };
        let unsigned = |x: f64, max: f64| if normalized { x / max } else { x };
        match self {
            Self::I8 => signed(f64::from(word(1) as u8 as i8), 127.0),
            Self::U8 => unsigned(f64::from(word(1)), 255.0),
            Self::I16 => signed(f64::from(word(2) as u16 as i16), 32767.0),
            Self::U16 => unsigned(f64::from(word(2)), 65535.0),
            Self::U32 => f64::from(word(4)),
            Self::F32 => f64::from(f32::from_bits(word(4))),
        }
    }
}

/// A checked run of equally spaced elements.
struct Run<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> Source<'a> {
    /// The elements of accessor `at`, which must have `N` components each.
    pub(super) fn read<const N: usize>(&self, at: &Cursor<'a>) -> Result<Vec<[f64; N]>, Problem> {
        let accessor = self.root.element("accessors", at.index()?, at)?;
        let kind = accessor.need("type")?;
        let wanted = match N {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            _ => "VEC4",
        };
        if kind.str()? != wanted {
            return Err(kind.problem(format!("is {}, {wanted} is needed", kind.str()?)));
        }
        let component = Component::parse(&accessor.need("componentType")?)?;
        let count = accessor.need("count")?.index()?;
        let normalized = accessor.flag("normalized");
        let size = component.size();
        let mut out = match accessor.get("bufferView") {
            Some(view) => {
                let offset = accessor.index_or("byteOffset", 0)?;
                let run = self.run(&accessor, &view, offset, count, size * N)?;
                (0..count)
                    .map(|i| element(&run, i, component, normalized))
                    .collect()
            }
            None => {
                // No data means zeros; a count without bytes behind it must not claim memory.
                if count > MAX_ZEROS {
                    return Err(accessor.problem(format!("claims {count} elements without data")));
                }
                vec![[0.0; N]; count]
            }
        };
        if let Some(sparse) = accessor.get("sparse") {
            self.patch(&sparse, component, normalized, &mut out)?;
        }
        Ok(out)
    }

    /// The indices of accessor `at`.
    pub(super) fn read_indices(&self, at: &Cursor<'a>) -> Result<Vec<u32>, Problem> {
        let values = self.read::<1>(at)?;
        Ok(values.into_iter().map(|[x]| x as u32).collect())
    }

    /// Replaces the elements that a sparse accessor lists.
    fn patch<const N: usize>(
        &self,
        sparse: &Cursor<'a>,
        component: Component,
        normalized: bool,
        out: &mut [[f64; N]],
    ) -> Result<(), Problem> {
        let count = sparse.need("count")?.index()?;
        let indices = sparse.need("indices")?;
        let index_type = Component::parse(&indices.need("componentType")?)?;
        let index_run = self.run(
            &indices,
            &indices.need("bufferView")?,
            indices.index_or("byteOffset", 0)?,
            count,
            index_type.size(),
        )?;
        let values = sparse.need("values")?;
        let value_run = self.run(
            &values,
            &values.need("bufferView")?,
            values.index_or("byteOffset", 0)?,
            count,
            component.size() * N,
        )?;
        for i in 0..count {
            let [at] = element::<1>(&index_run, i, index_type, false);
            let slot = out
                .get_mut(at as usize)
                .ok_or_else(|| indices.problem(format!("index {at} is out of range")))?;
            *slot = element(&value_run, i, component, normalized);
        }
        Ok(())
    }

    /// The bytes of `count` elements of `size` bytes in a buffer view.
    fn run(
        &self,
        owner: &Cursor<'a>,
        view_index: &Cursor<'a>,
        offset: usize,
        count: usize,
        size: usize,
    ) -> Result<Run<'a>, Problem> {
        let view = self
            .root
            .element("bufferViews", view_index.index()?, view_index)?;
        let buffer_index = view.need("buffer")?;
        let buffer = self
            .buffers
            .get(buffer_index.index()?)
            .ok_or_else(|| buffer_index.problem("names a buffer that does not exist"))?;
        let start = view.index_or("byteOffset", 0)?;
        let length = view.need("byteLength")?.index()?;
        let bytes = start
            .checked_add(length)
            .and_then(|end| buffer.get(start..end))
            .ok_or_else(|| {
                view.problem(format!(
                    "covers bytes {start} to {} of a buffer of {}",
                    start.saturating_add(length),
                    buffer.len()
                ))
            })?;
        let stride = match view.index_or("byteStride", 0)? {
            0 => size,
            s => s,
        };
        let last = count.checked_sub(1).map_or(Some(0), |n| {
            n.checked_mul(stride)?
                .checked_add(size)?
                .checked_add(offset)
        });
        match last {
            Some(end) if end <= bytes.len() => Ok(Run {
                bytes: bytes.get(offset..).unwrap_or_default(),
                stride,
            }),
            _ => Err(owner.problem(format!(
                "{count} elements of {size} bytes reach beyond the {} bytes of {}",
                bytes.len(),
                view.path()
            ))),
        }
    }
}

/// Most elements of an accessor that has no data.
const MAX_ZEROS: usize = 1 << 26;

fn element<const N: usize>(
    run: &Run<'_>,
    i: usize,
    component: Component,
    normalized: bool,
) -> [f64; N] {
    let size = component.size();
    let at = i * run.stride;
    std::array::from_fn(|k| component.read(&run.bytes[at + k * size..], normalized))
}
