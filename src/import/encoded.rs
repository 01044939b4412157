//! Data that stands in a JSON text as base64. It stays there: what is kept of it is where its blocks
//! begin, and each range is decoded when it is read.

use std::io;
use std::ops::Range;

use base64::Engine;
use base64::engine::general_purpose::{
    GeneralPurpose, STANDARD, STANDARD_NO_PAD, URL_SAFE, URL_SAFE_NO_PAD,
};
use twox_hash::xxhash3_128::Hasher;

use super::buffer::Buffer;

/// Characters that are read at once, escapes counted as they are written.
const BLOCK: usize = 1 << 16;

/// The ways to write base64: what decodes all but the end, and what decodes the end.
const WAYS: [(&GeneralPurpose, &GeneralPurpose); 4] = [
    (&STANDARD_NO_PAD, &STANDARD),
    (&STANDARD_NO_PAD, &STANDARD_NO_PAD),
    (&URL_SAFE_NO_PAD, &URL_SAFE),
    (&URL_SAFE_NO_PAD, &URL_SAFE_NO_PAD),
];

/// Bytes that are in a text as base64.
pub(super) struct Encoded {
    text: Buffer,
    way: usize,
    blocks: Vec<Block>,
    /// Where the last block ends, in the text.
    end: usize,
    len: usize,
}

/// Up to [`BLOCK`] characters: four for each three bytes, and fewer at the end only.
struct Block {
    /// Where it begins in the text.
    at: usize,
    /// Which byte its first one is.
    first: usize,
    /// Whether no character of it is escaped.
    plain: bool,
}

impl Encoded {
    /// What the characters `range` of a JSON `text` hold, which are a part of a string, with a
    /// fingerprint of its bytes; `None` if that is no base64.
    pub(super) fn find(text: &Buffer, range: Range<usize>) -> io::Result<Option<(Self, u128)>> {
        for way in 0..WAYS.len() {
            let found = Self::walk(text, range.clone(), way)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    fn walk(text: &Buffer, range: Range<usize>, way: usize) -> io::Result<Option<(Self, u128)>> {
        let mut print = Hasher::new();
        let mut out = Self {
            text: text.clone(),
            way,
            blocks: Vec::new(),
            end: range.end,
            len: 0,
        };
        let mut at = range.start;
        while at < range.end {
            let written = text.read(at, BLOCK.min(range.end - at))?;
            let last = at + written.len() == range.end;
            let Some((characters, used)) = unescape(&written, last) else {
                return Ok(None);
            };
            let Ok(bytes) = engine(way, last).decode(&characters) else {
                return Ok(None);
            };
            print.write(&bytes);
            out.blocks.push(Block {
                at,
                first: out.len,
                plain: characters.len() == used,
            });
            out.len += bytes.len();
            at += used;
        }
        Ok(Some((out, print.finish_128())))
    }

    /// Number of bytes.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// `len` bytes from `at` on.
    pub(super) fn read(&self, at: usize, len: usize) -> io::Result<Vec<u8>> {
        let mut out = Vec::with_capacity(len);
        let block = self.blocks.partition_point(|b| b.first <= at);
        for (i, block) in self.blocks.iter().enumerate().skip(block.max(1) - 1) {
            if out.len() == len {
                break;
            }
            let skip = at + out.len() - block.first;
            out.extend(self.decode(i, skip, len - out.len())?);
        }
        if out.len() < len {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(out)
    }

    /// Up to `len` bytes of a block from its byte `skip` on.
    fn decode(&self, block: usize, skip: usize, len: usize) -> io::Result<Vec<u8>> {
        // The file may have changed since.
        let changed = |_| io::Error::from(io::ErrorKind::InvalidData);
        let from = &self.blocks[block];
        let end = self.blocks.get(block + 1).map_or(self.end, |next| next.at);
        // Whole groups of four characters are three bytes.
        let begin = skip / 3 * 4;
        let wanted = skip.saturating_add(len).div_ceil(3).saturating_mul(4);
        let written = end - from.at;
        let (characters, last) = if from.plain {
            let to = wanted.min(written);
            let some = self.text.read(from.at + begin, to - begin)?;
            (some.to_vec(), from.at + to == self.end)
        } else {
            let all = self.text.read(from.at, written)?;
            let (all, _) = unescape(&all, end == self.end).ok_or(()).map_err(changed)?;
            let to = wanted.min(all.len());
            let some = all.get(begin..to).ok_or(()).map_err(changed)?;
            (some.to_vec(), end == self.end && to == all.len())
        };
        let bytes = engine(self.way, last).decode(characters);
        let mut bytes = bytes.map_err(|_| changed(()))?;
        bytes.truncate(skip % 3 + len.min(usize::MAX - 2));
        bytes.drain(..(skip % 3).min(bytes.len()));
        Ok(bytes)
    }
}

fn engine(way: usize, last: bool) -> &'static GeneralPurpose {
    let (middle, end) = WAYS[way];
    if last { end } else { middle }
}

/// The characters that a part of a JSON string stands for, and how many are written for them: all if
/// it is the `last` part, otherwise as many as make whole groups of four. `None` where one of them is
/// not ASCII or badly escaped.
fn unescape(written: &[u8], last: bool) -> Option<(Vec<u8>, usize)> {
    let mut out = Vec::with_capacity(written.len());
    let mut whole = (0, 0);
    let mut at = 0;
    while at < written.len() {
        if out.len().is_multiple_of(4) {
            whole = (out.len(), at);
        }
        // Nearly all is a run without escapes.
        let rest = &written[at..];
        let run = rest.iter().position(|b| *b == b'\\').unwrap_or(rest.len());
        if run > 0 {
            out.extend_from_slice(&rest[..run]);
            at += run;
            let odd = out.len() % 4;
            if odd <= run {
                whole = (out.len() - odd, at - odd);
            }
            continue;
        }
        let long = match rest.get(1) {
            Some(b'u') => 6,
            _ => 2,
        };
        let Some(escape) = rest.get(..long) else {
            // Cut off by the end of the block.
            return (!last).then(|| (out[..whole.0].to_vec(), whole.1));
        };
        out.push(match escape {
            [_, b'u', digits @ ..] => {
                let digits = std::str::from_utf8(digits).ok()?;
                let hex = digits.bytes().all(|d| d.is_ascii_hexdigit());
                let code = hex.then(|| u8::from_str_radix(digits, 16).ok())??;
                Some(code).filter(u8::is_ascii)?
            }
            [_, plain @ (b'/' | b'\\' | b'"')] => *plain,
            _ => return None,
        });
        at += long;
    }
    if last || out.len().is_multiple_of(4) {
        return Some((out, written.len()));
    }
    out.truncate(whole.0);
    Some((out, whole.1))
}
