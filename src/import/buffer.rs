//! Bytes that are read when they are needed: a large file is never held in memory as a whole,
//! only the range that is being decoded.

use std::fs::File;
use std::io::{self, Read};
use std::ops::Deref;
use std::path::Path;
#[cfg(feature = "meshopt")]
use std::sync::Arc;

/// A run of bytes, in memory or in a file.
pub(super) enum Buffer {
    /// Here.
    Memory(Vec<u8>),
    /// `len` bytes of a file from `start` on.
    #[cfg(unix)]
    File { file: File, start: u64, len: usize },
    /// Nowhere, as the fallback buffers of `EXT_meshopt_compression` may be.
    Absent { len: usize },
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

impl Buffer {
    /// The file at `path`, opened but not read where that is possible.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let mut file = File::open(path)?;
        let meta = file.metadata()?;
        if meta.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        #[cfg(unix)]
        if meta.is_file() {
            let len = usize::try_from(meta.len())
                .map_err(|_| io::Error::from(io::ErrorKind::FileTooLarge))?;
            return Ok(Self::File {
                file,
                start: 0,
                len,
            });
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(Self::Memory(bytes))
    }

    /// Number of bytes.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Memory(bytes) => bytes.len(),
            #[cfg(unix)]
            Self::File { len, .. } => *len,
            Self::Absent { len } => *len,
        }
    }

    /// `len` bytes from `at` on.
    pub(super) fn read(&self, at: usize, len: usize) -> io::Result<Bytes<'_>> {
        let end = at
            .checked_add(len)
            .filter(|end| *end <= self.len())
            .ok_or(io::ErrorKind::UnexpectedEof)?;
        match self {
            Self::Memory(bytes) => Ok(Bytes::Here(&bytes[at..end])),
            #[cfg(unix)]
            Self::File { file, start, .. } => {
                use std::os::unix::fs::FileExt;
                let mut out = vec![0; len];
                file.read_exact_at(&mut out, start + at as u64)?;
                Ok(Bytes::Owned(out))
            }
            Self::Absent { .. } => Err(io::ErrorKind::NotFound.into()),
        }
    }

    /// The part of it that begins at `at` and is `len` bytes long; shorter where it ends before.
    pub(super) fn part(self, at: usize, len: usize) -> Self {
        let at = at.min(self.len());
        let len = len.min(self.len() - at);
        match self {
            Self::Memory(mut bytes) => {
                bytes.truncate(at + len);
                bytes.drain(..at);
                Self::Memory(bytes)
            }
            #[cfg(unix)]
            Self::File { file, start, .. } => Self::File {
                file,
                start: start + at as u64,
                len,
            },
            Self::Absent { .. } => Self::Absent { len },
        }
    }
}
