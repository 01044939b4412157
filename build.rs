//! Tells the program its git commit, leaves out effects for measurements and, with feature
//! `embree`, finds Embree 4 and builds the C shim of `ffi/`.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=DUALIGHT_GIT_COMMIT={}", git_commit());
    leave_out();
    #[cfg(feature = "embree")]
    embree::build();
}

/// Leaves the code of the effects named in `DUALIGHT_WITHOUT` out of the program, so that
/// scripts/effects_cost.py can count what it costs where there is nothing to do for them.
fn leave_out() {
    println!("cargo::rerun-if-env-changed=DUALIGHT_WITHOUT");
    println!("cargo::rustc-check-cfg=cfg(dualight_without, values(any()))");
    let names = std::env::var("DUALIGHT_WITHOUT").unwrap_or_default();
    for name in names.split(',').filter(|name| !name.is_empty()) {
        println!("cargo::rustc-cfg=dualight_without=\"{name}\"");
    }
}

/// The short hash of the commit that is built, "unknown" outside a git checkout.
fn git_commit() -> String {
    // Not the commit of some other repository this package was unpacked in.
    if !Path::new(".git").exists() {
        return "unknown".into();
    }
    // HEAD changes with the branch, its log with every commit.
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name])
            && Path::new(&path).exists()
        {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    git(&["rev-parse", "--short=12", "HEAD"]).unwrap_or_else(|| "unknown".into())
}

/// What `git` prints, `None` if it is missing or fails.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// Embree: where it is, how to link it, and the shim.
#[cfg(feature = "embree")]
mod embree {
    use std::ffi::OsStr;
    use std::path::{Path, PathBuf};
    use std::{env, fs, io};

    /// Where `scripts/setup` puts the library, below the user's data directory.
    const SETUP_PLACE: &str = "dualight/embree-4.4.0";

    /// Finds Embree, then links it and builds the shim; or ends with what to do.
    pub(super) fn build() {
        for variable in ["EMBREE_DIR", "XDG_DATA_HOME", "HOME"] {
            println!("cargo::rerun-if-env-changed={variable}");
        }
        let result = find().and_then(|library| {
            link(&library).map_err(|e| format!("cannot link {}: {e}", library.display()))?;
            shim()
        });
        if let Err(message) = result {
            // Cargo prints this as the one error and ends the build.
            println!("cargo::error={message}");
        }
    }

    /// The path of the Embree 4 library.
    ///
    /// `EMBREE_DIR` if it is set, else the place of `scripts/setup`, else the usual
    /// directories of a system.
    fn find() -> Result<PathBuf, String> {
        if let Some(prefix) = env::var_os("EMBREE_DIR").filter(|value| !value.is_empty()) {
            let prefix = PathBuf::from(prefix);
            return libraries_below(&prefix).iter().find_map(|dir| library_in(dir)).ok_or_else(|| {
                format!(
                    "EMBREE_DIR={} holds no Embree 4 (libembree4.so in it, its lib or its lib64). \
                     Correct it, or unset it and run scripts/setup, \
                     or build without Embree: --no-default-features",
                    prefix.display()
                )
            });
        }
        let places = usual_places();
        places
            .iter()
            .find_map(|dir| library_in(dir))
            .ok_or_else(|| {
                let older = places.iter().any(|dir| dir.join("libembree3.so").exists());
                format!(
                    "{}. Run scripts/setup, which installs it, or set EMBREE_DIR to its prefix, \
                 or build without Embree: --no-default-features",
                    if older {
                        "found Embree 3, but Dualight needs Embree 4"
                    } else {
                        "found no Embree 4"
                    }
                )
            })
    }

    /// The directories searched when `EMBREE_DIR` does not say, best first.
    fn usual_places() -> Vec<PathBuf> {
        let data = env::var_os("XDG_DATA_HOME")
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
            .or_else(|| Some(Path::new(&env::var_os("HOME")?).join(".local/share")));
        let mut places: Vec<PathBuf> = data
            .map(|dir| dir.join(SETUP_PLACE).join("lib"))
            .into_iter()
            .collect();

        let arch = env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default();
        places.push(format!("/usr/lib/{arch}-linux-gnu").into());
        places.extend(
            [
                "/usr/lib",
                "/usr/lib64",
                "/usr/local/lib",
                "/usr/local/lib64",
            ]
            .map(PathBuf::from),
        );

        let mut optional: Vec<PathBuf> = entries(Path::new("/opt"));
        optional.retain(|path| {
            path.file_name()
                .is_some_and(|name| name.to_string_lossy().contains("embree"))
        });
        places.extend(optional.iter().flat_map(|prefix| libraries_below(prefix)));
        places
    }

    /// Where below a prefix libraries may lie.
    fn libraries_below(prefix: &Path) -> [PathBuf; 3] {
        [prefix.join("lib"), prefix.join("lib64"), prefix.to_owned()]
    }

    /// The Embree 4 library in this directory, by its plainest name.
    fn library_in(dir: &Path) -> Option<PathBuf> {
        let mut found = entries(dir);
        found.retain(|path| is_library(path, "libembree4"));
        found.into_iter().min_by_key(|path| path.as_os_str().len())
    }

    /// Whether this is a shared library whose name begins so.
    fn is_library(path: &Path, beginning: &str) -> bool {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(beginning) && name.contains(".so") && path.exists()
    }

    /// What lies in a directory, sorted; nothing if it cannot be read.
    fn entries(dir: &Path) -> Vec<PathBuf> {
        let mut paths: Vec<PathBuf> = fs::read_dir(dir)
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .collect();
        paths.sort();
        paths
    }

    /// Makes the linker find the library now and the programs find it when they run.
    fn link(library: &Path) -> io::Result<()> {
        println!("cargo::rerun-if-changed={}", library.display());
        let library = std::path::absolute(library)?;
        let dir = library.parent().unwrap_or(Path::new("/"));

        // Programs, tests (doctests too), examples and benches carry the directory with
        // them: they run without an environment variable, also where they are installed.
        println!("cargo::rustc-link-arg=-Wl,-rpath,{}", dir.display());

        // The linker looks for this one name. A library without its development package,
        // or out of a Python wheel, has another.
        let name = OsStr::new("libembree4.so");
        if library.file_name() == Some(name) {
            println!("cargo::rustc-link-search=native={}", dir.display());
            return Ok(());
        }
        let link = out_dir().join("embree").join(name);
        fs::create_dir_all(out_dir().join("embree"))?;
        if link.is_symlink() {
            fs::remove_file(&link)?;
        }
        symlink(&library, &link)?;
        println!(
            "cargo::rustc-link-search=native={}",
            out_dir().join("embree").display()
        );
        Ok(())
    }

    #[cfg(unix)]
    use std::os::unix::fs::symlink;

    #[cfg(not(unix))]
    fn symlink(_: &Path, _: &Path) -> io::Result<()> {
        Err(io::Error::other(
            "linking Embree is known for Unix only; build with --no-default-features",
        ))
    }

    /// Compiles `ffi/shim.c` and makes the Rust declarations of `ffi/shim.h`.
    fn shim() -> Result<(), String> {
        for path in ["ffi/shim.c", "ffi/shim.h"] {
            println!("cargo::rerun-if-changed={path}");
        }
        cc::Build::new()
            .file("ffi/shim.c")
            .std("c11")
            .warnings(true)
            .extra_warnings(true)
            .try_compile("dualight_shim")
            .map_err(|e| format!("cannot compile ffi/shim.c: {e}"))?;
        bindgen::Builder::default()
            .header("ffi/shim.h")
            .allowlist_file("ffi/shim.h")
            .generate_comments(false)
            .generate()
            .map_err(|e| {
                format!(
                    "bindgen cannot read ffi/shim.h (scripts/setup installs what it needs): {e}"
                )
            })?
            .write_to_file(out_dir().join("shim.rs"))
            .map_err(|e| format!("cannot write the declarations of ffi/shim.h: {e}"))
    }

    fn out_dir() -> PathBuf {
        env::var_os("OUT_DIR").expect("cargo sets OUT_DIR").into()
    }
}
