//! Films that wait to be gone on with: a file of their own, bit for bit, with a checksum.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use super::write_atomically;
use crate::error::{Error, Result};
use crate::film::Film;

/// First bytes of the file; the digit is the version of the layout.
const MAGIC: &[u8; 16] = b"Dualight film 2\n";

/// Longest name of an integrator.
const LONGEST: u32 = 1024;

/// A film and what it belongs to.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    /// Name of the integrator that rendered it.
    pub integrator: String,
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
    pub fn write(
        path: &Path,
        integrator: &str,
        identity: u64,
        seconds: f64,
        film: &Film,
    ) -> Result<()> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend((integrator.len() as u32).to_le_bytes());
        bytes.extend(integrator.as_bytes());
        bytes.extend(identity.to_le_bytes());
        bytes.extend(seconds.to_le_bytes());
        bytes.extend(film.to_bytes());
        let sum = fingerprint(0, &bytes);
        bytes.extend(sum.to_le_bytes());
        write_atomically(path, |sink| sink.write_all(&bytes))
    }

    /// Name of the integrator that a file was rendered by; `None` if there is no file. No more than
    /// its beginning is read, so whether it is whole is not known.
    ///
    /// # Errors
    /// What is no film.
    pub fn integrator_of(path: &Path) -> Result<Option<String>> {
        let unreadable = |e| Error::file(path, e, "name a file that can be read");
        let file = match File::open(path) {
            Ok(file) => file,
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(unreadable(e)),
        };
        let mut head = Vec::new();
        file.take(MAGIC.len() as u64 + 4 + u64::from(LONGEST))
            .read_to_end(&mut head)
            .map_err(unreadable)?;
        let (name, _) = head_of(&head).ok_or_else(|| damaged(path))?;
        Ok(Some(name.into()))
    }

    /// Reads the file; `None` if there is none.
    ///
    /// # Errors
    /// A file that is damaged, or something else, or of another scene or other settings than
    /// `identity`.
    pub fn read(path: &Path, identity: u64) -> Result<Option<Self>> {
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::file(path, e, "name a file that can be read")),
        };
        let found = Self::parse(&bytes).ok_or_else(|| damaged(path))?;
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
        if fingerprint(0, body) != u64::from_le_bytes(*sum) {
            return None;
        }
        let (integrator, rest) = head_of(body)?;
        let (identity, rest) = rest.split_first_chunk::<8>()?;
        let (seconds, rest) = rest.split_first_chunk::<8>()?;
        Some(Self {
            integrator: integrator.into(),
            identity: u64::from_le_bytes(*identity),
            seconds: f64::from_le_bytes(*seconds),
            film: Film::from_bytes(rest)?,
        })
    }
}

/// The integrator's name, and what follows it.
fn head_of(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (length, rest) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<4>()?;
    let length = u32::from_le_bytes(*length);
    let (name, rest) = rest.split_at_checked(length.min(LONGEST) as usize)?;
    Some((std::str::from_utf8(name).ok()?, rest)).filter(|_| length <= LONGEST)
}

fn damaged(path: &Path) -> Error {
    let remedy = "name another file to begin anew";
    Error::file(path, "is damaged, or no film of this version", remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_damaged_byte_and_every_stranger_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.film");
        assert!(Checkpoint::read(&path, 5).unwrap().is_none());
        assert!(Checkpoint::integrator_of(&path).unwrap().is_none());
        Checkpoint::write(&path, "a new one", 5, 1.5, &Film::new(2, 1)).unwrap();
        let name = Checkpoint::integrator_of(&path).unwrap();
        assert_eq!(name.as_deref(), Some("a new one"));
        let back = Checkpoint::read(&path, 5).unwrap().unwrap();
        assert_eq!((back.seconds, back.film.width()), (1.5, 2));
        assert_eq!(back.integrator, "a new one");
        let stranger = Checkpoint::read(&path, 6).unwrap_err().to_string();
        assert!(stranger.contains("other settings"), "{stranger}");
        let whole = std::fs::read(&path).unwrap();
        for i in (0..whole.len()).step_by(7) {
            let mut bytes = whole.clone();
            bytes[i] ^= 0x10;
            assert!(Checkpoint::parse(&bytes).is_none(), "byte {i}");
            assert!(Checkpoint::parse(&whole[..i]).is_none(), "cut at {i}");
            // Of the beginning alone damage is not told, but it does no harm.
            let _ = (head_of(&bytes), head_of(&whole[..i]));
        }
        std::fs::write(&path, b"something else").unwrap();
        assert!(Checkpoint::integrator_of(&path).is_err());
    }
}
