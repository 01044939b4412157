//! Bytes that are read when they are needed: a large file is never held in memory as a whole,
//! only the range that is being decoded.

use std::fs::File;
use std::io::{self, Read};
use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;

use super::encoded::Encoded;

/// A run of bytes. A copy of it names the same ones.
#[derive(Clone)]
pub(super) struct Buffer {
    data: Data,
    start: usize,
    len: usize,
}

/// Where the bytes are.
#[derive(Clone)]
enum Data {
    Memory(Arc<Vec<u8>>),
    #[cfg(unix)]
    File(Arc<File>),
    /// A file that is open only while it is read, since there are too many of its kind.
    #[cfg(unix)]
    Named(Arc<Path>),
    /// In a text, as base64.
    Text(Arc<Encoded>),
    /// Nowhere, as the fallback buffers of `EXT_meshopt_compression` may be.
    Absent,
}

/// Bytes that were read.
pub(super) enum Bytes<'a> {
    /// They are in memory elsewhere.
    Here(&'a [u8]),
    /// Read for this.
    Owned(Vec<u8>),
    /// So many from a place on of some that others read, too.
    #[cfg(feature = "meshopt")]
    Shared(Arc<[u8]>, usize, usize),
}

impl Deref for Bytes<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Here(bytes) => bytes,
            Self::Owned(bytes) => bytes,
            #[cfg(feature = "meshopt")]
            Self::Shared(bytes, at, len) => &bytes[*at..*at + *len],
        }
    }
}

impl From<Vec<u8>> for Buffer {
    fn from(bytes: Vec<u8>) -> Self {
        Self {
            start: 0,
            len: bytes.len(),
            data: Data::Memory(Arc::new(bytes)),
        }
    }
}

impl From<Encoded> for Buffer {
    fn from(text: Encoded) -> Self {
        Self {
            start: 0,
            len: text.len(),
            data: Data::Text(Arc::new(text)),
        }
    }
}

impl Buffer {
    /// `len` bytes that are nowhere.
    pub(super) fn absent(len: usize) -> Self {
        Self {
            data: Data::Absent,
            start: 0,
            len,
        }
    }

    /// The file at `path`, not read where that is possible, and open from now on if it is to `stay` so.
    pub(super) fn open(path: &Path, stay: bool) -> io::Result<Self> {
        let mut file = File::open(path)?;
        let meta = file.metadata()?;
        if meta.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        #[cfg(unix)]
        if meta.is_file() {
            let len = usize::try_from(meta.len())
                .map_err(|_| io::Error::from(io::ErrorKind::FileTooLarge))?;
            return Ok(Self {
                data: if stay {
                    Data::File(Arc::new(file))
                } else {
                    Data::Named(path.into())
                },
                start: 0,
                len,
            });
        }
        let _ = stay;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(bytes.into())
    }

    /// Number of bytes.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Whether its bytes are nowhere.
    pub(super) fn is_absent(&self) -> bool {
        matches!(self.data, Data::Absent)
    }

    /// `len` bytes from `at` on.
    pub(super) fn read(&self, at: usize, len: usize) -> io::Result<Bytes<'_>> {
        let end = at
            .checked_add(len)
            .filter(|end| *end <= self.len)
            .ok_or(io::ErrorKind::UnexpectedEof)?;
        let (at, end) = (self.start + at, self.start + end);
        match &self.data {
            Data::Memory(bytes) => Ok(Bytes::Here(&bytes[at..end])),
            #[cfg(unix)]
            Data::File(file) => read_at(file, at, len).map(Bytes::Owned),
            #[cfg(unix)]
            Data::Named(path) => read_at(&File::open(path)?, at, len).map(Bytes::Owned),
            Data::Text(text) => text.read(at, len).map(Bytes::Owned),
            Data::Absent => Err(io::ErrorKind::NotFound.into()),
        }
    }

    /// The part of it that begins at `at` and is `len` bytes long; shorter where it ends before.
    pub(super) fn part(&self, at: usize, len: usize) -> Self {
        let at = at.min(self.len);
        Self {
            data: self.data.clone(),
            start: self.start + at,
            len: len.min(self.len - at),
        }
    }
}

#[cfg(unix)]
fn read_at(file: &File, at: usize, len: usize) -> io::Result<Vec<u8>> {
    use std::os::unix::fs::FileExt;
    let mut out = vec![0; len];
    file.read_exact_at(&mut out, at as u64)?;
    Ok(out)
}
