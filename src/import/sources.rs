//! Which files a scene is read from.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::uri::percent_decode;
use super::{EnvironmentSource, ImportOptions, container};
use crate::error::Result;

/// The file at `path` and all files that it names and that are there: buffers, images, skies; and
/// those that `options` name. Whatever a scene is made from is in one of them.
///
/// # Errors
/// A file that cannot be read or is no glTF.
pub fn sources(path: &Path, options: &ImportOptions) -> Result<Vec<PathBuf>> {
    let json = container::json(path).map_err(|p| p.into_error(path))?;
    let mut named = Vec::new();
    collect(&json, &mut named);
    let beside = path.parent().unwrap_or(Path::new(""));
    let mut out = vec![path.to_owned()];
    for name in named {
        // Skies are named as they are, all else by URI.
        let plain = percent_decode(name).and_then(|bytes| String::from_utf8(bytes).ok());
        let spellings = [Some(name.to_owned()), plain];
        let found = spellings.into_iter().flatten().map(|n| beside.join(n));
        out.extend(found.filter(|p| p.is_file()));
    }
    if let Some(EnvironmentSource::Image(sky)) = options.environment.as_ref().map(|e| &e.source) {
        out.push(sky.clone());
    }
    out.sort();
    out.dedup();
    Ok(out)
}

/// Everything in `json` that may name a file.
fn collect<'a>(json: &'a Value, out: &mut Vec<&'a str>) {
    match json {
        Value::Array(items) => items.iter().for_each(|v| collect(v, out)),
        Value::Object(fields) => {
            for (key, value) in fields {
                match value {
                    Value::String(s) if key == "uri" || key == "image" => {
                        if !s.starts_with("data:") {
                            out.push(s);
                        }
                    }
                    _ => collect(value, out),
                }
            }
        }
        _ => {}
    }
}
