//! Atomic writing: a file appears whole under its name, or what was there before stays.
//!
//! The bytes go to a temporary file in the same directory, which is flushed to the disk and then
//! renamed. The temporary file goes away on every error, and [`discard_unfinished`] removes it
//! when the process is about to exit without unwinding.

use std::fs::{self, File, Permissions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::NamedTempFile;

use super::Sink;
use crate::error::{Error, Result};

/// Temporary files that exist right now.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files of writes that are under way, and lets none begin any more. Only
/// for the moment before the process exits: writes in other threads wait for ever.
pub fn discard_unfinished() {
    let list = unfinished();
    for path in &*list {
        // Nothing is left to be done about a file that cannot be removed.
        let _ = fs::remove_file(path);
    }
    std::mem::forget(list);
}

/// A temporary file that [`discard_unfinished`] knows.
struct Unfinished {
    file: NamedTempFile,
}

impl Unfinished {
    fn create(directory: &Path) -> io::Result<Self> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".dualight-").suffix(".tmp");
        // As any other new file: the process's umask decides, not the secrecy of temporary files.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(Permissions::from_mode(0o666));
        }
        // The lock is held from before the file exists until it is on the list.
        let mut list = unfinished();
        let mut file = builder.tempfile_in(directory)?;
        file.disable_cleanup(true);
        list.push(file.path().into());
        Ok(Self { file })
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let mut list = unfinished();
        // After the renaming there is nothing of this name.
        let _ = fs::remove_file(self.file.path());
        list.retain(|p| p != self.file.path());
    }
}

/// The file that a write to `path` replaces, and the permissions of what is there.
fn target(path: &Path) -> Result<(PathBuf, Option<Permissions>)> {
    // Through a symbolic link, the file it points to is meant.
    let real = fs::canonicalize(path).unwrap_or_else(|_| path.into());
    match fs::metadata(&real) {
        Ok(m) if m.is_dir() => Err(Error::file(path, "is a directory", "name a file inside it")),
        Ok(m) if !m.is_file() => Err(Error::file(
            path,
            "is not a regular file",
            "choose another name",
        )),
        Ok(m) if m.permissions().readonly() => Err(Error::file(
            path,
            "is write-protected",
            "choose another name or make it writable",
        )),
        Ok(m) => Ok((real, Some(m.permissions()))),
        Err(_) => Ok((real, None)),
    }
}

fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    }
}

/// The error for a directory that no file can be made in.
fn no_place(path: &Path, e: &io::Error) -> Error {
    let directory = directory_of(path).display();
    let problem = if directory_of(path).is_dir() {
        format!("cannot create a file in {directory} ({})", e.kind())
    } else {
        format!("{directory} is not a directory")
    };
    Error::file(
        path,
        problem,
        "create it or choose a directory you can write to",
    )
}

/// Whether `path` can be written, found out before any work is done. Leaves what is there as it
/// is, and nothing behind.
///
/// # Errors
/// [`Error::File`] with the reason and a remedy.
pub fn check_writable(path: &Path) -> Result<()> {
    let (real, _) = target(path)?;
    Unfinished::create(directory_of(&real)).map_err(|e| no_place(path, &e))?;
    Ok(())
}

/// Writes a file: all of it, or nothing.
///
/// # Errors
/// [`Error::File`]; what was there before is untouched then.
pub fn write_atomically(
    path: &Path,
    encode: impl FnOnce(&mut dyn Sink) -> io::Result<()>,
) -> Result<()> {
    let (real, permissions) = target(path)?;
    let mut unfinished = Unfinished::create(directory_of(&real)).map_err(|e| no_place(path, &e))?;
    let written = (|| {
        let mut buffer = BufWriter::new(unfinished.file.as_file_mut());
        encode(&mut buffer)?;
        buffer.flush()?;
        drop(buffer);
        let file: &File = unfinished.file.as_file();
        if let Some(p) = permissions {
            file.set_permissions(p)?;
        }
        file.sync_all()?;
        fs::rename(unfinished.file.path(), &real)
    })();
    written.map_err(|e| {
        Error::file(
            path,
            format!("could not be written ({e})"),
            "make room or choose another place",
        )
    })?;
    sync_directory(directory_of(&real));
    Ok(())
}

/// Makes the new name itself survive a power failure, where directories can be synced.
fn sync_directory(directory: &Path) {
    if let Ok(d) = File::open(directory) {
        // The file is complete in any case.
        let _ = d.sync_all();
    }
}
