//! KTX 2.0 images: Basis Universal (`KHR_texture_basisu`) and plain texels, packed by Zstandard
//! or not. Only the first level is read; smaller ones are made anew.
//!
//! Source: Khronos Group, *KTX File Format Specification*, version 2.0.

use std::io::Read;

use basisu::{DecodeFlags, TargetFormat, Transcoder};

use super::quiet::quietly;
use crate::textures::{Image, Texels};

const MAGIC: [u8; 12] = *b"\xABKTX 20\xBB\r\n\x1A\n";

/// Why an image cannot be read.
pub(super) enum Fault {
    /// The file is broken.
    Broken(String),
    /// It is of a kind that is not supported.
    Foreign,
}

fn broken(what: impl Into<String>) -> Fault {
    Fault::Broken(what.into())
}

/// A file whose header was checked.
pub(super) struct Ktx2<'a> {
    bytes: &'a [u8],
    pub(super) width: u32,
    pub(super) height: u32,
    format: Format,
    packed: bool,
    /// Place and length of the first level in the file.
    level: std::ops::Range<usize>,
}

#[derive(Clone, Copy)]
enum Format {
    Basis,
    /// Channels, bytes per number.
    Plain(usize, usize),
}

/// Whether these bytes begin as such a file does.
pub(super) fn recognises(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

impl<'a> Ktx2<'a> {
    /// Reads and checks the header.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, Fault> {
        let word = |at: usize| {
            let b = bytes.get(at..at + 4).and_then(|b| b.try_into().ok());
            b.map(u32::from_le_bytes)
                .ok_or_else(|| broken("ends within its header"))
        };
        let long = |at: usize| Ok((u64::from(word(at + 4)?) << 32) | u64::from(word(at)?));
        let (width, height) = (word(20)?, word(24)?);
        if width == 0 || height == 0 || word(28)? != 0 || word(32)? > 1 || word(36)? != 1 {
            return Err(Fault::Foreign);
        }
        // VkFormat: 8 or 16 bits per channel, linear or sRGB (which the slot decides anyway).
        let format = match word(12)? {
            0 => Format::Basis,
            9 | 15 => Format::Plain(1, 1),
            16 | 22 => Format::Plain(2, 1),
            23 | 29 => Format::Plain(3, 1),
            37 | 43 => Format::Plain(4, 1),
            70 => Format::Plain(1, 2),
            77 => Format::Plain(2, 2),
            84 => Format::Plain(3, 2),
            91 => Format::Plain(4, 2),
            _ => return Err(Fault::Foreign),
        };
        let scheme = word(44)?;
        if scheme > 2 || (scheme == 1 && !matches!(format, Format::Basis)) {
            return Err(Fault::Foreign);
        }
        // Every level is checked, since the transcoder adds these numbers up unchecked.
        let levels = word(40)?.max(1) as usize;
        let mut first = 0..0;
        for i in 0..levels {
            let (at, n) = (long(80 + 24 * i)?, long(88 + 24 * i)?);
            let end = at.checked_add(n).filter(|&end| end <= bytes.len() as u64);
            let Some(end) = end else {
                return Err(broken(format!("is truncated: level {i} ends beyond it")));
            };
            if i == 0 {
                first = at as usize..end as usize;
            }
        }
        let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
        if matches!(format, Format::Basis) && long(96)? > 16 * blocks {
            return Err(broken("claims more data than its size has blocks for"));
        }
        Ok(Self {
            bytes,
            width,
            height,
            format,
            packed: scheme == 2,
            level: first,
        })
    }

    /// Decoded size in bytes.
    pub(super) fn decoded_bytes(&self) -> u64 {
        let per_texel = match self.format {
            Format::Basis => 4,
            Format::Plain(channels, bytes) => (channels * bytes) as u64,
        };
        (u64::from(self.width) * u64::from(self.height)).saturating_mul(per_texel)
    }

    /// Decodes the first level.
    pub(super) fn decode(&self) -> Result<Image, Fault> {
        let (channels, texels) = match self.format {
            Format::Basis => (4, Texels::U8(self.transcode()?)),
            Format::Plain(channels, bytes) => self.unpack(channels, bytes)?,
        };
        Image::from_texels(self.width, self.height, channels, texels)
            .ok_or_else(|| broken("has the wrong number of texels"))
    }

    fn transcode(&self) -> Result<Vec<u8>, Fault> {
        // The key-value data is not needed and its bounds are not checked by the transcoder.
        let mut bytes = self.bytes.to_vec();
        bytes[56..64].fill(0);
        let decoded = quietly(|| {
            Transcoder::new(&bytes)?.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE)
        });
        match decoded {
            Some(Ok(texels)) => Ok(texels),
            Some(Err(basisu::Error::Unsupported { .. })) => Err(Fault::Foreign),
            Some(Err(e)) => Err(broken(format!("cannot be transcoded ({e:?})"))),
            None => Err(broken("cannot be transcoded: its bytes are damaged")),
        }
    }

    fn unpack(&self, channels: usize, bytes: usize) -> Result<(usize, Texels), Fault> {
        let size = self.decoded_bytes() as usize;
        let level = &self.bytes[self.level.clone()];
        let mut raw = Vec::new();
        if self.packed {
            let failed = |e: &dyn std::fmt::Display| broken(format!("cannot be unpacked ({e})"));
            let stream = ruzstd::StreamingDecoder::new(level).map_err(|e| failed(&e))?;
            stream
                .take(size as u64)
                .read_to_end(&mut raw)
                .map_err(|e| failed(&e))?;
        } else {
            raw.extend_from_slice(&level[..level.len().min(size)]);
        }
        if raw.len() != size {
            return Err(broken(format!("holds {} bytes of {size}", raw.len())));
        }
        let mut channels = channels;
        if channels == 2 {
            // Red and green, unlike the grey and alpha that two channels are elsewhere.
            raw = raw
                .chunks_exact(2 * bytes)
                .flat_map(|t| t.iter().copied().chain(std::iter::repeat_n(0, bytes)))
                .collect();
            channels = 3;
        }
        let texels = if bytes == 1 {
            Texels::U8(raw)
        } else {
            Texels::U16(
                raw.chunks_exact(2)
                    .map(|b| u16::from_le_bytes([b[0], b[1]]))
                    .collect(),
            )
        };
        Ok((channels, texels))
    }
}
