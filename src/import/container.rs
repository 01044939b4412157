//! From bytes to JSON and buffers: `.gltf` with data URIs or files beside it, and `.glb`.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::{STANDARD, STANDARD_NO_PAD, URL_SAFE};
use serde_json::Value;

use super::Problem;
use super::json::Cursor;

/// A parsed file.
pub(super) struct Document {
    pub(super) json: Value,
    pub(super) buffers: Vec<Vec<u8>>,
}

/// Reads the file and all buffers it names; `check` sees the JSON before any buffer is read.
pub(super) fn open(
    path: &Path,
    check: impl FnOnce(&Cursor<'_>) -> Result<(), Problem>,
) -> Result<Document, Problem> {
    let bytes = std::fs::read(path).map_err(|e| Problem::file(path, &e))?;
    let (json, chunk) = split(&bytes)?;
    let json: Value = serde_json::from_slice(&json).map_err(|e| {
        let place = format!("line {} column {}", e.line(), e.column());
        Problem::invalid(&place, format!("is not JSON ({e})"))
    })?;
    let root = Cursor::root(&json);
    check_version(&root)?;
    check(&root)?;
    let mut chunk = chunk.map(Cow::into_owned);
    let mut buffers = Vec::new();
    for (i, buffer) in root.items("buffers")?.into_iter().enumerate() {
        buffers.push(read_buffer(&buffer, i, &mut chunk, path)?);
    }
    Ok(Document { json, buffers })
}

type Parts<'a> = (Cow<'a, [u8]>, Option<Cow<'a, [u8]>>);

fn split(bytes: &[u8]) -> Result<Parts<'_>, Problem> {
    if !bytes.starts_with(b"glTF") {
        return Ok((Cow::Borrowed(bytes), None));
    }
    let glb = gltf::binary::Glb::from_slice(bytes)
        .map_err(|e| Problem::invalid("GLB container", format!("is broken ({e})")))?;
    Ok((glb.json, glb.bin))
}

fn check_version(root: &Cursor<'_>) -> Result<(), Problem> {
    if !root.value().is_object() {
        return Err(root.problem("is not a JSON object, so this is not glTF"));
    }
    let version = root.need("asset")?.need("version")?;
    let text = version.str()?;
    let major = text.split('.').next().and_then(|m| m.parse::<u32>().ok());
    if major != Some(2) {
        return Err(Problem::unsupported(
            version.path(),
            format!("glTF {text} is not glTF 2"),
            "convert the file to glTF 2.0",
        ));
    }
    Ok(())
}

fn read_buffer(
    buffer: &Cursor<'_>,
    index: usize,
    chunk: &mut Option<Vec<u8>>,
    file: &Path,
) -> Result<Vec<u8>, Problem> {
    let length = buffer.need("byteLength")?.index()?;
    let data = match buffer.get("uri") {
        None if index == 0 => chunk
            .take()
            .ok_or_else(|| buffer.problem("has neither a URI nor a binary chunk"))?,
        None => return Err(buffer.problem("has no URI")),
        Some(uri) => read_uri(&uri, file)?,
    };
    if data.len() < length {
        return Err(buffer.problem(format!(
            "is truncated: {} bytes of {length} are there",
            data.len()
        )));
    }
    Ok(data)
}

/// The bytes that a URI holds or names, in a file beside `file`.
pub(super) fn read_uri(uri: &Cursor<'_>, file: &Path) -> Result<Vec<u8>, Problem> {
    let text = uri.str()?;
    if let Some(data) = text.strip_prefix("data:") {
        let (head, body) = data
            .split_once(',')
            .ok_or_else(|| uri.problem("is a data URI without data"))?;
        if !head.ends_with(";base64") {
            return percent_decode(body).ok_or_else(|| uri.problem("is badly escaped"));
        }
        return STANDARD
            .decode(body)
            .or_else(|_| STANDARD_NO_PAD.decode(body))
            .or_else(|_| URL_SAFE.decode(body))
            .map_err(|e| uri.problem(format!("is not base64 ({e})")));
    }
    if text.contains("://") {
        return Err(uri.problem(format!(
            "'{text}' is not beside the file; remote files are not read"
        )));
    }
    let name = percent_decode(text)
        .and_then(|bytes| String::from_utf8(bytes).ok())
        .ok_or_else(|| uri.problem("is badly escaped"))?;
    let path: PathBuf = file.parent().unwrap_or(Path::new("")).join(&name);
    std::fs::read(&path)
        .map_err(|e| uri.problem(format!("the file {} cannot be read ({e})", path.display())))
}

fn percent_decode(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len());
    let mut bytes = text.bytes();
    while let Some(b) = bytes.next() {
        out.push(if b == b'%' {
            let digit = |d: u8| char::from(d).to_digit(16);
            (digit(bytes.next()?)? * 16 + digit(bytes.next()?)?) as u8
        } else {
            b
        });
    }
    Some(out)
}
