//! Photon maps kept in a file for later renderings of the same scene.
//!
//! Layout, numbers in little-endian order: [`MAGIC`]; bytes of the key (64 bits); the key, then the
//! maps, both in the format of postcard; bytes of the maps (64 bits); a sum over all that came before
//! (XXH3, 128 bits).

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use twox_hash::xxhash3_128::Hasher;

use super::clock::Clock;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::output::write_atomically;
use crate::photons::{PhotonKey, PhotonMaps};

/// First bytes of the file; the digit is the version of the layout.
const MAGIC: &[u8; 18] = b"Dualight photons 1";

/// Bytes before the key, and after the maps.
const HEAD: u64 = MAGIC.len() as u64 + 8;
const TAIL: u64 = 8 + 16;

/// What to do with the photons of a rendering.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PhotonFile {
    /// Keep those of the first pass.
    Save(PathBuf),
    /// Take those of the first pass from here.
    Load(PathBuf),
}

/// The maps of a pass: traced, or from the file that is to hold those of this key. They are kept only
/// if all of them are there.
pub(super) fn obtain(
    kept: Option<&(PhotonFile, PhotonKey)>,
    trace: impl FnOnce() -> PhotonMaps,
    clock: &mut Clock,
    control: &Control,
) -> Result<PhotonMaps> {
    let maps = match kept {
        Some((PhotonFile::Load(path), key)) => {
            let maps = load_photons(path, key)?;
            clock.lap("load photons");
            maps
        }
        _ => trace(),
    };
    clock.split("photons", maps.tracing, "photon maps");
    if let Some((PhotonFile::Save(path), key)) = kept
        && control.stopped().is_none()
    {
        save_photons(path, key, &maps)?;
        clock.lap("save photons");
    }
    Ok(maps)
}

/// Sums up what is written.
struct Summed<W> {
    to: W,
    sum: Hasher,
    bytes: u64,
}

impl<W: Write> Write for Summed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.to.write(bytes)?;
        self.sum.write(&bytes[..n]);
        self.bytes += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

/// Writes the file: all of it, or nothing.
///
/// # Errors
/// [`Error::File`].
pub fn save_photons(path: &Path, key: &PhotonKey, maps: &PhotonMaps) -> Result<()> {
    write_atomically(path, |sink| {
        let key = postcard::to_stdvec(key).map_err(io::Error::other)?;
        let mut out = Summed {
            to: sink,
            sum: Hasher::new(),
            bytes: 0,
        };
        out.write_all(MAGIC)?;
        out.write_all(&(key.len() as u64).to_le_bytes())?;
        out.write_all(&key)?;
        let before = out.bytes;
        maps.write(&mut out).map_err(io::Error::other)?;
        let length = out.bytes - before;
        out.write_all(&length.to_le_bytes())?;
        let sum = out.sum.finish_128();
        out.to.write_all(&sum.to_le_bytes())
    })
}

/// Reads the file.
///
/// # Errors
/// A file that is damaged, or something else, or that holds the photons of another scene or of other
/// settings than `key`.
pub fn load_photons(path: &Path, key: &PhotonKey) -> Result<PhotonMaps> {
    let unreadable = |e| Error::file(path, e, "name a file that --save-photons has written");
    let mut file = File::open(path).map_err(unreadable)?;
    let size = file.metadata().map_err(unreadable)?.len();
    let damaged = || {
        Error::file(
            path,
            "is damaged, or holds no photons of this version",
            "save them anew with --save-photons",
        )
    };
    // Nothing is read that cannot be what it should be, however large the file is.
    let mut head = Vec::new();
    let part = &mut file;
    part.take(HEAD).read_to_end(&mut head).map_err(unreadable)?;
    let key_bytes = head
        .strip_prefix(MAGIC)
        .and_then(|rest| Some(u64::from_le_bytes(*rest.first_chunk()?)))
        .filter(|n| n.saturating_add(HEAD + TAIL) <= size)
        .ok_or_else(damaged)?;
    let mut found = Vec::new();
    let part = &mut file;
    part.take(key_bytes)
        .read_to_end(&mut found)
        .map_err(unreadable)?;
    let mut rest = Vec::new();
    file.read_to_end(&mut rest).map_err(unreadable)?;

    let (body, sum) = rest.split_last_chunk::<16>().ok_or_else(damaged)?;
    let (maps, length) = body.split_last_chunk::<8>().ok_or_else(damaged)?;
    let mut hasher = Hasher::new();
    for part in [&*head, &*found, body] {
        hasher.write(part);
    }
    if u64::from_le_bytes(*length) != maps.len() as u64
        || u128::from_le_bytes(*sum) != hasher.finish_128()
    {
        return Err(damaged());
    }
    let found: PhotonKey = postcard::from_bytes(&found).map_err(|_| damaged())?;
    if let Some(difference) = found.difference(key) {
        return Err(Error::file(
            path,
            format!("holds the photons of {difference}"),
            "repeat those that they were saved with, or save them anew with --save-photons",
        ));
    }
    PhotonMaps::parse(maps).ok_or_else(damaged)
}
