//! `dualight bench`: how fast every stage is, backends side by side.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::measure_args::BenchArgs;
use super::{Ending, console, machine, progress, signal};
use crate::control::{Control, Stopped};
use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::output;
use crate::pipeline;
use crate::plugins::Registry;
use crate::report::bench::{self, BenchOptions, Record, Synthetic};

/// Where a scene comes from.
enum Subject<'a> {
    File(&'a Path),
    Made(&'a Synthetic),
}

/// Measures, tells, and compares with a baseline.
pub(super) fn run(args: &BenchArgs) -> Result<Ending> {
    let registry = Registry::builtin();
    let backends = backends(args, &registry)?;
    let baseline = args.baseline.as_deref().map(read_baseline).transpose()?;
    let control = Arc::new(Control::new(progress::reporter(args.quiet), None));
    signal::install(&control, args.quiet);
    let all = pipeline::in_pool(None, rayon::current_num_threads)?;
    let threads = match args.threads.as_slice() {
        [] => vec![all],
        list => list.iter().map(|n| *n as usize).collect(),
    };
    let scaling = scaling(args.scaling.as_deref(), &args.threads, all)?;
    let subjects = (args.files.iter().map(|f| Subject::File(f)))
        .chain(args.synthetic.iter().map(Subject::Made))
        .map(|subject| (subject, &threads))
        .chain(scaling.iter().map(|(s, t)| (Subject::Made(s), t)));
    let mut record = Record {
        schema: bench::SCHEMA.into(),
        seed: args.seed,
        commit: machine::commit().into(),
        backends: Vec::new(),
        isa: machine::instructions().into(),
        processor: machine::processor().unwrap_or_default(),
        results: Vec::new(),
    };
    for (subject, threads) in subjects {
        let scene = Prepared::new(&subject)?;
        for &threads in threads {
            let options = BenchOptions {
                backends: backends.clone(),
                rays: args.rays as usize,
                repeats: args.repeats as usize,
                threads,
                seed: args.seed,
                size: args.size,
            };
            let import = ImportOptions::default();
            let measured = bench::bench(
                &scene.path,
                &scene.name,
                &import,
                &options,
                &registry,
                &control,
            )?;
            let Some((results, versions)) = measured else {
                return Ok(Ending::Empty(Stopped::Interrupted));
            };
            record.results.extend(results);
            record.backends = versions;
        }
    }
    if !args.quiet {
        console::print(&record.table())?;
        console::print(&format!("{}\n", record.scaling()))?;
    }
    console::print(&record.line())?;
    Ok(match baseline {
        Some(before) => judge(&record, &before, args.tolerance)?,
        None => Ending::Done,
    })
}

/// What `--scaling` adds: a terrain of each size on the most threads, the smallest of them on 1, 2, 4,
/// … threads up to those.
fn scaling(
    sizes: Option<&[u64]>,
    threads: &[u32],
    all: usize,
) -> Result<Vec<(Synthetic, Vec<usize>)>> {
    let Some(sizes) = sizes else {
        return Ok(Vec::new());
    };
    let steps: Vec<usize> = match threads {
        [] => (0..usize::BITS)
            .map(|k| 1 << k)
            .take_while(|n| *n < all)
            .chain([all])
            .collect(),
        list => list.iter().map(|n| *n as usize).collect(),
    };
    let most = steps.iter().copied().max().unwrap_or(all);
    let mut sizes = sizes.to_vec();
    sizes.sort_unstable();
    sizes.dedup();
    let terrain = |(i, size): (usize, &u64)| {
        let scene = Synthetic::parse(&format!("terrain:{size}"), |_| Ok(*size));
        let scene = scene.map_err(|e| Error::Usage(format!("--scaling {size}: {e}")))?;
        Ok((scene, if i == 0 { steps.clone() } else { vec![most] }))
    };
    sizes.iter().enumerate().map(terrain).collect()
}

/// The backends that were named, or all that are fast.
fn backends(args: &BenchArgs, registry: &Registry) -> Result<Vec<String>> {
    if args.accel.is_empty() {
        let all = registry.accelerators.entries().iter().map(|e| e.name);
        return Ok(all.filter(|n| *n != "linear").map(Into::into).collect());
    }
    let find = |n: &String| registry.accelerators.find(n).map(|e| e.name.to_string());
    args.accel.iter().map(find).collect()
}

fn read_baseline(path: &Path) -> Result<Record> {
    let remedy = "give a file with the output of dualight bench";
    let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e, remedy))?;
    Record::parse(&text).map_err(|e| Error::file(path, e, remedy))
}

/// Tells what became worse.
///
/// # Errors
/// A baseline that says nothing about what was measured.
fn judge(now: &Record, before: &Record, tolerance: f64) -> Result<Ending> {
    let (found, shared) = now.regressions(before, tolerance);
    if shared == 0 {
        return Err(Error::Usage(
            "the baseline has nothing to compare with; measure the same scenes, backends and \
             threads, both times with --repeats 3 or more"
                .into(),
        ));
    }
    let unknown = now.unknown_to(before);
    if !unknown.is_empty() {
        console::say(format_args!(
            "warning: the baseline does not have, so nothing is said of: {}",
            unknown.join(", ")
        ));
    }
    if (&now.processor, &now.isa) != (&before.processor, &before.isa) {
        console::say("warning: the baseline was measured on another machine");
    }
    for r in &found {
        let m = &r.now;
        console::say(format_args!(
            "worse: {} on {} threads, {} {}: {:.4} {} was {:.4}, {:.1} % worse",
            m.scene,
            m.threads,
            m.metric,
            m.backend,
            m.median,
            m.unit,
            r.before.median,
            100.0 * (r.factor - 1.0)
        ));
    }
    console::say(format_args!(
        "{} of {shared} quantities became worse by more than {:.1} % and beyond the noise",
        found.len(),
        100.0 * tolerance
    ));
    Ok(if found.is_empty() {
        Ending::Done
    } else {
        Ending::Different
    })
}

/// A scene as a file, which goes away again if it was made up.
struct Prepared {
    path: PathBuf,
    name: String,
    _directory: Option<tempfile::TempDir>,
}

impl Prepared {
    fn new(subject: &Subject<'_>) -> Result<Self> {
        match subject {
            Subject::File(path) => Ok(Self {
                path: path.to_path_buf(),
                name: path
                    .file_name()
                    .unwrap_or_default()
                    .to_string_lossy()
                    .into_owned(),
                _directory: None,
            }),
            Subject::Made(synthetic) => {
                let directory = tempfile::tempdir().map_err(|e| {
                    let place = std::env::temp_dir();
                    Error::file(&place, e, "set TMPDIR to a directory you can write to")
                })?;
                let path = directory.path().join("scene.glb");
                let bytes = synthetic.glb()?;
                output::write_atomically(&path, |sink| sink.write_all(&bytes))?;
                Ok(Self {
                    path,
                    name: synthetic.to_string(),
                    _directory: Some(directory),
                })
            }
        }
    }
}
