//! Buffer views: ranges of buffers, with a bound on what all of them together may grow to.

#[cfg(feature = "meshopt")]
use std::collections::HashMap;
#[cfg(feature = "meshopt")]
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::Problem;
use super::buffer::{Buffer, Bytes};
use super::json::Cursor;
#[cfg(feature = "meshopt")]
use super::meshopt::Packed;
#[cfg(feature = "meshopt")]
use super::unpacked::{self, Unpacked};

/// The buffer views of a file.
pub(super) struct Views<'a> {
    root: Cursor<'a>,
    buffers: &'a [Buffer],
    /// Bytes that may still be decoded.
    budget: AtomicUsize,
    /// What compressed views hold, once somebody asked for it.
    #[cfg(feature = "meshopt")]
    pub(super) unpacked: HashMap<usize, Unpacked>,
}

/// A buffer view.
pub(super) struct View<'a> {
    /// Where it stands.
    pub(super) at: Cursor<'a>,
    /// Bytes from one element to the next; 0 if they follow each other.
    pub(super) stride: usize,
    /// Number of bytes.
    pub(super) len: usize,
    data: Data<'a>,
}

enum Data<'a> {
    /// From this byte on in a buffer.
    Plain(&'a Buffer, usize),
    /// Compressed by what the extension object says, which lies in this view.
    #[cfg(feature = "meshopt")]
    Packed(&'a Unpacked, Box<(Packed, View<'a>)>),
}

/// The extensions that compress a view. They differ in name only.
pub(super) const COMPRESSION: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// What a file may grow to when it is decoded: a small file has room for a scene, a large one for
/// the best that compression does. A few bytes that claim gigabytes are refused.
const BUDGET: usize = 64 << 20;
const GROWTH: usize = 256;

impl<'a> Views<'a> {
    /// The views of the document `root`, a file of `size` bytes.
    pub(super) fn new(root: Cursor<'a>, buffers: &'a [Buffer], size: usize) -> Self {
        Self {
            #[cfg(feature = "meshopt")]
            unpacked: unpacked::all(&root),
            root,
            buffers,
            budget: AtomicUsize::new(size.saturating_mul(GROWTH).saturating_add(BUDGET)),
        }
    }

    /// Takes `bytes` off what may be decoded; `at` is what needs them.
    pub(super) fn claim(&self, bytes: usize, at: &Cursor<'_>) -> Result<(), Problem> {
        self.budget
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
                left.checked_sub(bytes)
            })
            .map(|_| ())
            .map_err(|_| {
                Problem::unsupported(
                    at.path(),
                    format!("{bytes} more bytes are out of proportion to the size of the file"),
                    "make it smaller, or export it without compression",
                )
            })
    }

    /// The view whose index stands at `from`.
    pub(super) fn get(&self, from: &Cursor<'a>) -> Result<View<'_>, Problem> {
        let index = from.index()?;
        let at = self.root.element("bufferViews", index, from)?;
        let stride = at.index_or("byteStride", 0)?;
        let packed = COMPRESSION.iter().find_map(|name| at.extension(name));
        #[cfg(feature = "meshopt")]
        if let (Some(e), Some(unpacked)) = (&packed, self.unpacked.get(&index)) {
            let packed = Packed::read(e)?;
            let from = self.range(e.clone(), 0)?;
            unpacked.fill(|bounds| {
                self.claim(packed.count.saturating_mul(packed.stride), e)?;
                from.unpack(&packed, bounds)
            })?;
            return Ok(View {
                len: packed.count * packed.stride,
                at,
                stride,
                data: Data::Packed(unpacked, Box::new((packed, from))),
            });
        }
        let view = self.range(at, stride)?;
        if let (Some(e), Data::Plain(buffer, _)) = (packed, &view.data)
            && buffer.is_absent()
        {
            return Err(Problem::unsupported(
                e.path(),
                "is compressed, which this build cannot read",
                "build with the feature `meshopt`, or export without compression",
            ));
        }
        Ok(view)
    }

    /// The bytes of the view whose index stands at `from`.
    pub(super) fn bytes(&self, from: &Cursor<'a>) -> Result<Bytes<'_>, Problem> {
        let view = self.get(from)?;
        view.read(0, view.len)
    }

    /// The part of a buffer that `at` describes by `buffer`, `byteOffset` and `byteLength`.
    fn range(&self, at: Cursor<'a>, stride: usize) -> Result<View<'a>, Problem> {
        let index = at.need("buffer")?;
        let buffer = self
            .buffers
            .get(index.index()?)
            .ok_or_else(|| index.problem("names a buffer that does not exist"))?;
        let start = at.index_or("byteOffset", 0)?;
        let len = at.need("byteLength")?.index()?;
        if start.checked_add(len).is_none_or(|end| end > buffer.len()) {
            return Err(at.problem(format!(
                "covers bytes {start} to {} of a buffer of {}",
                start.saturating_add(len),
                buffer.len()
            )));
        }
        Ok(View {
            at,
            stride,
            len,
            data: Data::Plain(buffer, start),
        })
    }
}

impl<'a> View<'a> {
    /// `len` bytes from `at` on.
    pub(super) fn read(&self, at: usize, len: usize) -> Result<Bytes<'a>, Problem> {
        if at.checked_add(len).is_none_or(|end| end > self.len) {
            return Err(self.at.problem(format!("ends before byte {at} + {len}")));
        }
        match &self.data {
            Data::Plain(buffer, start) => buffer
                .read(start + at, len)
                .map_err(|e| self.at.problem(format!("cannot be read ({e})"))),
            #[cfg(feature = "meshopt")]
            Data::Packed(unpacked, packed) => match unpacked.read(at, len) {
                Some(bytes) => Ok(bytes),
                // Who asks for it as a whole gets it for himself.
                None => {
                    let (packed, from) = packed.as_ref();
                    let whole = from.unpack(packed, &[0])?.swap_remove(0);
                    Ok(Bytes::Shared(whole, at, len))
                }
            },
        }
    }

    /// What `packed` compresses in this view, in parts with these bounds.
    #[cfg(feature = "meshopt")]
    fn unpack(&self, packed: &Packed, bounds: &[usize]) -> Result<Vec<Arc<[u8]>>, Problem> {
        let bytes = self.read(0, self.len)?;
        let parts = packed.decode(&bytes, bounds);
        parts.ok_or_else(|| self.at.problem("cannot be decoded: its bytes are damaged"))
    }
}
