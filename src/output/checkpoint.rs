//! Films that wait to be gone on with: a file of their own, bit for bit, with a checksum.

use std::path::Path;

use super::write_atomically;
use crate::error::{Error, Result};
use crate::film::Film;

/// First bytes of the file; the digit is the version of the layout.
const MAGIC: &[u8; 16] = b"Dualight film 1\n";

/// A film and what it belongs to.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    /// Says which scene and settings it is of.
    pub identity: u64,
    /// Seconds that it took.
    pub seconds: f64,
    /// The film.
    pub film: Film,
}

/// A number that says which bytes these are (FNV-1a, 64 bits); `seed` is 0 or that of what goes
/// before.
pub fn fingerprint(seed: u64, bytes: &[u8]) -> u64 {
    let start = 0xcbf2_9ce4_8422_2325 ^ seed;
    bytes.iter().fold(start, |h, b| {
        (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

impl Checkpoint {
    /// Writes the file: all of it, or nothing. See the fields for what is what.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn write(path: &Path, identity: u64, seconds: f64, film: &Film) -> Result<()> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(identity.to_le_bytes());
        bytes.extend(seconds.to_le_bytes());
        bytes.extend(film.to_bytes());
        let sum = fingerprint(0, &bytes);
        bytes.extend(sum.to_le_bytes());
        write_atomically(path, |sink| sink.write_all(&bytes))
    }

    /// Reads the file; `None` if there is none.
    ///
    /// # Errors
    /// A file that is damaged, or something else, or of another scene or other settings than
    /// `identity`.
    pub fn read(path: &Path, identity: u64) -> Result<Option<Self>> {
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::file(path, e, "name a file that can be read")),
        };
        let found = Self::parse(&bytes).ok_or_else(|| {
            Error::file(
                path,
                "is damaged, or no film of this version",
                "name another file to begin anew",
            )
        })?;
        if found.identity != identity {
            return Err(Error::file(
                path,
                "is the film of another scene or other settings",
                "repeat those that it was begun with, or name another file to begin anew",
            ));
        }
        Ok(Some(found))
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let (body, sum) = bytes.split_last_chunk::<8>()?;
        let rest = body.strip_prefix(MAGIC)?;
        if fingerprint(0, body) != u64::from_le_bytes(*sum) {
            return None;
        }
        let (identity, rest) = rest.split_first_chunk::<8>()?;
        let (seconds, rest) = rest.split_first_chunk::<8>()?;
        Some(Self {
            identity: u64::from_le_bytes(*identity),
            seconds: f64::from_le_bytes(*seconds),
            film: Film::from_bytes(rest)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_damaged_byte_and_every_stranger_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.film");
        assert!(Checkpoint::read(&path, 5).unwrap().is_none());
        Checkpoint::write(&path, 5, 1.5, &Film::new(2, 1)).unwrap();
        let back = Checkpoint::read(&path, 5).unwrap().unwrap();
        assert_eq!((back.seconds, back.film.width()), (1.5, 2));
        let stranger = Checkpoint::read(&path, 6).unwrap_err().to_string();
        assert!(stranger.contains("other settings"), "{stranger}");
        let whole = std::fs::read(&path).unwrap();
        for i in (0..whole.len()).step_by(7) {
            let mut bytes = whole.clone();
            bytes[i] ^= 0x10;
            assert!(Checkpoint::parse(&bytes).is_none(), "byte {i}");
            assert!(Checkpoint::parse(&whole[..i]).is_none(), "cut at {i}");
        }
    }
}
