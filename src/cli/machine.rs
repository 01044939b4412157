//! What measured numbers depend on besides the program: the machine and what it is busy with.

use std::fs;

use crate::output::Metadata;

/// The processor's name, where the system tells it.
pub(super) fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|l| l.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// The widest vector instructions that the processor has, of those that ray tracers use.
pub(super) fn instructions() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") {
            return "avx512";
        }
        if is_x86_feature_detected!("avx2") {
            return "avx2";
        }
        if is_x86_feature_detected!("avx") {
            return "avx";
        }
        "sse"
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        std::env::consts::ARCH
    }
}

/// Processes that wanted a processor over the last minute, on average.
pub(super) fn load() -> Option<f64> {
    let text = fs::read_to_string("/proc/loadavg").ok()?;
    text.split_whitespace().next()?.parse().ok()
}

/// The commit this was built from.
pub(super) fn commit() -> &'static str {
    Metadata::COMMIT.unwrap_or("unknown")
}

/// All of it in lines for people.
pub(super) fn lines(threads: usize, load_before: Option<f64>) -> Vec<String> {
    let processor = processor().unwrap_or_else(|| "unknown processor".into());
    let mut out = vec![
        format!("{processor}, {}, {threads} threads", instructions()),
        format!("{}, commit {}", Metadata::SOFTWARE, commit()),
    ];
    if let (Some(a), Some(b)) = (load_before, load()) {
        out.push(format!("load of the machine {a:.1} before, {b:.1} after"));
    }
    out
}
