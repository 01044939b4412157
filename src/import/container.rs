//! From bytes to JSON and buffers: `.gltf` with data URIs or files beside it, and `.glb`.

use std::io;
use std::path::Path;

use serde_json::Value;

use super::buffer::Buffer;
use super::json::Cursor;
use super::uri::Uris;
use super::views::COMPRESSION;
use super::{Problem, schema};

/// A parsed file.
pub(super) struct Document {
    pub(super) json: Value,
    pub(super) buffers: Vec<Buffer>,
    /// What its URIs hold and name.
    pub(super) uris: Uris,
    /// Bytes of the file and of all buffers.
    pub(super) size: usize,
}

/// Opens the file and all buffers it names; `check` sees the JSON before any buffer is opened.
pub(super) fn open(
    path: &Path,
    check: impl FnOnce(&Cursor<'_>) -> Result<(), Problem>,
) -> Result<Document, Problem> {
    let Opened {
        file,
        parts,
        uris,
        mut json,
    } = open_json(path)?;
    let mut size = file.len();
    let root = Cursor::root(&json);
    check_version(&root)?;
    schema::check(&root)?;
    check(&root)?;
    let mut chunk = parts.binary.map(|(at, len)| file.part(at, len));
    drop(file);
    let mut buffers = Vec::new();
    for (i, buffer) in root.items("buffers")?.into_iter().enumerate() {
        let data = read_buffer(&buffer, i, &mut chunk, &uris)?;
        if buffer.get("uri").is_some() {
            size += data.len();
        }
        buffers.push(data);
    }
    forget_data(&mut json);
    Ok(Document {
        json,
        buffers,
        uris,
        size,
    })
}

/// Drops the text of buffers that stand in the JSON themselves: it is in memory as bytes now.
fn forget_data(json: &mut Value) {
    let buffers = json.get_mut("buffers").and_then(Value::as_array_mut);
    for uri in buffers
        .into_iter()
        .flatten()
        .filter_map(|b| b.get_mut("uri"))
    {
        if uri.as_str().is_some_and(|u| u.starts_with("data:")) {
            *uri = Value::Null;
        }
    }
}

/// The JSON of the file at `path`. Data in it is left out.
pub(super) fn json(path: &Path) -> Result<Value, Problem> {
    open_json(path).map(|opened| opened.json)
}

/// A file whose JSON was read.
struct Opened {
    file: Buffer,
    parts: Parts,
    uris: Uris,
    json: Value,
}

fn open_json(path: &Path) -> Result<Opened, Problem> {
    let unreadable = |e: io::Error| Problem::file(path, &e);
    let file = Buffer::open(path, true).map_err(unreadable)?;
    let parts = split(&file, path)?;
    let mut text = file.part(parts.json.0, parts.json.1);
    if text.len() >= 3 && *text.read(0, 3).map_err(unreadable)? == *b"\xef\xbb\xbf" {
        // The mark of UTF-8, which some editors write; readers may pass over it (RFC 8259, 8.1).
        text = text.part(3, text.len() - 3);
    }
    let (short, uris) = Uris::take(&text, path).map_err(unreadable)?;
    let json = match serde_json::from_slice(&short) {
        Ok(json) => json,
        Err(e) => {
            drop(short);
            // The place counts what was taken out as well.
            let whole = text.read(0, text.len()).map_err(unreadable)?;
            let e = serde_json::from_slice::<Value>(&whole).err().unwrap_or(e);
            let place = format!("line {} column {}", e.line(), e.column());
            return Err(Problem::invalid(&place, format!("is not JSON ({e})")));
        }
    };
    Ok(Opened {
        file,
        parts,
        uris,
        json,
    })
}

/// Where the parts of a file are: begin and length.
struct Parts {
    json: (usize, usize),
    binary: Option<(usize, usize)>,
}

/// Finds the chunks of a GLB file (glTF 2.0, 4.4); anything else is JSON as a whole.
fn split(file: &Buffer, path: &Path) -> Result<Parts, Problem> {
    let broken = |problem: String| Problem::invalid("GLB container", problem);
    let read = |at: usize, len: usize| file.read(at, len).map_err(|e| Problem::file(path, &e));
    let word = |bytes: &[u8], at: usize| {
        let mut w = [0; 4];
        w.copy_from_slice(&bytes[at..at + 4]);
        u32::from_le_bytes(w)
    };
    let len = file.len();
    if len < 4 || *read(0, 4)? != *b"glTF" {
        return Ok(Parts {
            json: (0, len),
            binary: None,
        });
    }
    if len < 12 {
        return Err(broken(format!("is truncated: it has {len} bytes")));
    }
    let head = read(0, 12)?;
    match word(&head, 4) {
        2 => {}
        other => {
            return Err(Problem::unsupported(
                "GLB container",
                format!("binary glTF {other} is not glTF 2"),
                "convert the file to glTF 2.0",
            ));
        }
    }
    let claimed = word(&head, 8) as usize;
    if claimed > len {
        return Err(broken(format!(
            "is truncated: {len} bytes of {claimed} are there"
        )));
    }
    let (mut at, mut json, mut binary) = (12, None, None);
    while at + 8 <= claimed {
        let chunk = read(at, 8)?;
        let (n, kind) = (word(&chunk, 0) as usize, &chunk[4..8]);
        let begin = at + 8;
        if n > claimed - begin {
            return Err(broken(format!(
                "the chunk at byte {at} claims {n} bytes of {}",
                claimed - begin
            )));
        }
        match (kind, &json) {
            (b"JSON", None) => json = Some((begin, n)),
            (_, None) => return Err(broken("its first chunk is not JSON".into())),
            (b"BIN\0", Some(_)) if binary.is_none() => binary = Some((begin, n)),
            // Chunks of other kinds are for others (glTF 2.0, 4.4.3.1).
            _ => {}
        }
        // The length counts the padding (glTF 2.0, 4.4.3).
        at = begin + n;
    }
    match json {
        Some(json) => Ok(Parts { json, binary }),
        None => Err(broken("has no JSON chunk".into())),
    }
}

fn check_version(root: &Cursor<'_>) -> Result<(), Problem> {
    if !root.value().is_object() {
        return Err(root.problem("is not a JSON object, so this is not glTF"));
    }
    let version = root.need("asset")?.need("version")?;
    let text = version.str()?;
    let major = text.split('.').next().and_then(|m| m.parse::<u32>().ok());
    let Some(major) = major else {
        return Err(version.problem(format!("'{text}' is no version of glTF")));
    };
    if major != 2 {
        return Err(Problem::unsupported(
            version.path(),
            format!("glTF {text} is not glTF 2"),
            "convert the file to glTF 2.0",
        ));
    }
    // What the file needs at least (glTF 2.0, 3.2); its own version may be newer than that.
    if let Some(least) = root.need("asset")?.get("minVersion")
        && least.str()? != "2.0"
    {
        return Err(Problem::unsupported(
            least.path(),
            format!("the file needs glTF {}, not 2.0", least.str()?),
            "convert the file to glTF 2.0",
        ));
    }
    Ok(())
}

fn read_buffer(
    buffer: &Cursor<'_>,
    index: usize,
    chunk: &mut Option<Buffer>,
    uris: &Uris,
) -> Result<Buffer, Problem> {
    let length = buffer.need("byteLength")?.index()?;
    let data = match buffer.get("uri") {
        None => match chunk.take().filter(|_| index == 0) {
            Some(chunk) => chunk,
            // What was compressed may come without the uncompressed bytes.
            None if is_fallback(buffer) => return Ok(Buffer::absent(length)),
            None => return Err(buffer.problem("has neither a URI nor a binary chunk")),
        },
        Some(uri) => uris.open(&uri, index)?,
    };
    if data.len() < length {
        return Err(buffer.problem(format!(
            "is truncated: {} bytes of {length} are there",
            data.len()
        )));
    }
    Ok(data.part(0, length))
}

/// Whether a buffer is a placeholder for what is unpacked into it.
fn is_fallback(buffer: &Cursor<'_>) -> bool {
    let mut packed = COMPRESSION.iter().filter_map(|name| buffer.extension(name));
    packed.any(|e| e.flag("fallback"))
}
