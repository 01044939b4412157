//! What URIs name, in files beside the glTF file, and what they hold. Data in base64 is taken out of
//! the text before that is parsed: as long as it is not decoded, it need not be in memory.

use std::collections::HashMap;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::{STANDARD, STANDARD_NO_PAD, URL_SAFE, URL_SAFE_NO_PAD};

use super::Problem;
use super::buffer::{Buffer, Bytes};
use super::encoded::Encoded;
use super::json::Cursor;

/// What stands in the place of data that was taken out, before its number of eight digits. That is
/// base64 itself: if the file had a string like this, it was taken out as well.
const TAKEN: &str = "data:;base64,";

/// Most buffers whose files stay open.
const MAX_OPEN: usize = 64;

/// Longest beginning of a data URI, up to the comma, that is recognised.
const MAX_HEAD: usize = 256;

/// Characters that are looked through at once.
const BLOCK: usize = 1 << 16;

/// The URIs of a file.
pub(super) struct Uris {
    file: PathBuf,
    /// What was taken out of its text.
    data: Vec<Buffer>,
}

impl Uris {
    /// The URIs of the glTF file `file`, none of them taken out.
    #[cfg(test)]
    pub(super) fn of(file: &Path) -> Self {
        Self {
            file: file.to_owned(),
            data: Vec::new(),
        }
    }

    /// The JSON `text` of the file `file` without the data in it.
    pub(super) fn take<'t>(text: &'t Buffer, file: &Path) -> io::Result<(Bytes<'t>, Self)> {
        let mut out = Self {
            file: file.to_owned(),
            data: Vec::new(),
        };
        let mut places = Vec::new();
        let mut known = HashMap::new();
        for string in strings(text)? {
            let Some((data, print)) = Encoded::find(text, string.data.clone())? else {
                // Who needs it says what is wrong with it.
                continue;
            };
            // What is the same in two places is told to be.
            let next = out.data.len();
            let number = *known.entry((print, data.len())).or_insert(next);
            if number == next {
                out.data.push(data.into());
            }
            places.push((string.begin..string.data.end, format!("{TAKEN}{number:08}")));
        }
        if places.is_empty() {
            return Ok((text.read(0, text.len())?, out));
        }
        let taken: usize = places.iter().map(|(place, _)| place.len()).sum();
        let put: usize = places.iter().map(|(_, name)| name.len()).sum();
        let mut short = Vec::with_capacity(text.len() - taken + put);
        let mut at = 0;
        for (place, name) in places {
            short.extend_from_slice(&text.read(at, place.start - at)?);
            short.extend_from_slice(name.as_bytes());
            at = place.end;
        }
        short.extend_from_slice(&text.read(at, text.len() - at)?);
        Ok((Bytes::Owned(short), out))
    }

    /// What was taken out where `uri` stands now.
    fn taken(&self, uri: &str) -> Option<&Buffer> {
        let number = uri.strip_prefix(TAKEN).filter(|n| n.len() == 8)?;
        self.data.get(number.parse::<usize>().ok()?)
    }

    /// What the URI of buffer `index` holds or names.
    pub(super) fn open(&self, uri: &Cursor<'_>, index: usize) -> Result<Buffer, Problem> {
        let text = uri.str()?;
        if let Some(data) = self.taken(text) {
            return Ok(data.clone());
        }
        if text.starts_with("data:") {
            return decode(uri).map(Buffer::from);
        }
        let path = beside(uri, &self.file)?;
        Buffer::open(&path, index < MAX_OPEN).map_err(|e| unreadable(uri, &path, &e))
    }

    /// The bytes that a URI holds or names.
    pub(super) fn read(&self, uri: &Cursor<'_>) -> Result<Vec<u8>, Problem> {
        let text = uri.str()?;
        if let Some(data) = self.taken(text) {
            let bytes = data.read(0, data.len());
            let bytes = bytes.map_err(|e| uri.problem(format!("cannot be read ({e})")))?;
            return Ok(bytes.to_vec());
        }
        if text.starts_with("data:") {
            return decode(uri);
        }
        let path = beside(uri, &self.file)?;
        std::fs::read(&path).map_err(|e| unreadable(uri, &path, &e))
    }
}

/// Where a string stands in a text that is a data URI in base64.
struct DataUri {
    /// After the quotation mark.
    begin: usize,
    /// From after the comma to the other quotation mark.
    data: Range<usize>,
}

/// The strings of a JSON text that are data URIs in base64. Where it is no JSON, that is found out by
/// who parses it.
fn strings(text: &Buffer) -> io::Result<Vec<DataUri>> {
    let mut out = Vec::new();
    let mut state = State::Outside;
    let mut escaped = false;
    let mut begin = 0;
    let mut at = 0;
    while at < text.len() {
        let block = text.read(at, BLOCK.min(text.len() - at))?;
        let mut i = 0;
        while i < block.len() {
            // All that makes no difference is passed at once.
            i += match &state {
                State::Outside => run(&block[i..], |b| b == b'"'),
                State::Inside(_) if !escaped => run(&block[i..], |b| matches!(b, b'"' | b'\\')),
                _ => 0,
            };
            let Some(&b) = block.get(i) else {
                break;
            };
            i += 1;
            let here = at + i;
            if escaped {
                escaped = false;
                match &mut state {
                    State::Head(head) if b == b'/' => head.push(b),
                    _ => state = State::Inside(state.data()),
                }
                continue;
            }
            match (&mut state, b) {
                (State::Outside, _) => {
                    begin = here;
                    state = State::Head(Vec::new());
                }
                (State::Inside(data), b'"') => {
                    if let Some(data) = data.take() {
                        let data = data..here - 1;
                        out.push(DataUri { begin, data });
                    }
                    state = State::Outside;
                }
                (State::Head(_), b'"') => state = State::Outside,
                (_, b'\\') => escaped = true,
                (State::Head(head), b',') => {
                    let is_data = head.starts_with(b"data:") && head.ends_with(b";base64");
                    state = State::Inside(is_data.then_some(here));
                }
                (State::Head(head), b) => {
                    head.push(b);
                    let part = head.len().min(5);
                    if head[..part] != b"data:"[..part] || head.len() > MAX_HEAD {
                        state = State::Inside(None);
                    }
                }
                (State::Inside(_), _) => {}
            }
        }
        at += block.len();
    }
    Ok(out)
}

enum State {
    /// Between strings.
    Outside,
    /// In a string that has begun like this.
    Head(Vec<u8>),
    /// In a string; of a data URI, where the data begins.
    Inside(Option<usize>),
}

impl State {
    /// Where the data of a data URI begins, if this is in one.
    fn data(&self) -> Option<usize> {
        match self {
            Self::Inside(data) => *data,
            _ => None,
        }
    }
}

/// How many bytes there are before the first that is `wanted`.
fn run(bytes: &[u8], wanted: impl Fn(u8) -> bool) -> usize {
    let found = bytes.iter().position(|b| wanted(*b));
    found.unwrap_or(bytes.len())
}

fn unreadable(uri: &Cursor<'_>, path: &Path, e: &io::Error) -> Problem {
    Problem {
        remedy: "put it there, or export all as one .glb".into(),
        ..uri.problem(format!("the file {} cannot be read ({e})", path.display()))
    }
}

/// The bytes of a data URI that was left in the text.
fn decode(uri: &Cursor<'_>) -> Result<Vec<u8>, Problem> {
    let data = uri.str()?.strip_prefix("data:").unwrap_or_default();
    let (head, body) = data
        .split_once(',')
        .ok_or_else(|| uri.problem("is a data URI without data"))?;
    if !head.ends_with(";base64") {
        return percent_decode(body).ok_or_else(|| uri.problem("is badly escaped"));
    }
    let by = match (body.contains(['-', '_']), body.ends_with('=')) {
        (false, true) => STANDARD,
        (false, false) => STANDARD_NO_PAD,
        (true, true) => URL_SAFE,
        (true, false) => URL_SAFE_NO_PAD,
    };
    by.decode(body)
        .map_err(|e| uri.problem(format!("is not base64 ({e})")))
}

/// The path that a URI names, relative to `file`.
fn beside(uri: &Cursor<'_>, file: &Path) -> Result<PathBuf, Problem> {
    let text = uri.str()?;
    if text.contains("://") {
        return Err(Problem {
            remedy: "fetch it, and name it by its path".into(),
            ..uri.problem(format!(
                "'{text}' is not beside the file; remote files are not read"
            ))
        });
    }
    let name = percent_decode(text)
        .and_then(|bytes| String::from_utf8(bytes).ok())
        .ok_or_else(|| uri.problem("is badly escaped"))?;
    Ok(file.parent().unwrap_or(Path::new("")).join(&name))
}

pub(super) fn percent_decode(text: &str) -> Option<Vec<u8>> {
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
