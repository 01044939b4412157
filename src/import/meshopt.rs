//! Buffer views that `EXT_meshopt_compression` or its successor `KHR_meshopt_compression` packs.
//! The decoder is meshoptimizer's own, which is written for data that nobody vouches for.

use std::sync::Arc;

use bytemuck::Pod;
use meshopt::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat,
    decode_index_buffer, decode_index_sequence, decode_vertex_buffer,
};

use super::Problem;
use super::json::Cursor;

/// A vertex of more than 32 words of 32 bits, up to which arrays have a default.
#[derive(Clone)]
#[repr(transparent)]
struct Words<const N: usize>([u32; N]);

impl<const N: usize> Default for Words<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

/// What an extension object says of its view.
pub(super) struct Packed {
    pub(super) count: usize,
    pub(super) stride: usize,
    mode: Mode,
    filter: Filter,
}

#[derive(Clone, Copy, PartialEq)]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, PartialEq)]
enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

impl Packed {
    /// Reads the extension object, and refuses what the decoder does not take.
    pub(super) fn read(e: &Cursor<'_>) -> Result<Self, Problem> {
        let mode = e.need("mode")?;
        let mode = match mode.str()? {
            "ATTRIBUTES" => Mode::Attributes,
            "TRIANGLES" => Mode::Triangles,
            "INDICES" => Mode::Indices,
            other => return Err(mode.problem(format!("'{other}' is no mode"))),
        };
        let filter = match e.get("filter") {
            None => Filter::None,
            Some(f) => match f.str()? {
                "NONE" => Filter::None,
                "OCTAHEDRAL" => Filter::Octahedral,
                "QUATERNION" => Filter::Quaternion,
                "EXPONENTIAL" => Filter::Exponential,
                "COLOR" => Filter::Color,
                other => return Err(f.problem(format!("'{other}' is no filter"))),
            },
        };
        let at = e.need("byteStride")?;
        let stride = at.index()?;
        let count = e.need("count")?.index()?;
        let fits = match (mode, filter) {
            (Mode::Attributes, Filter::None | Filter::Exponential) => {
                stride.is_multiple_of(4) && (4..=256).contains(&stride)
            }
            (Mode::Attributes, Filter::Octahedral | Filter::Color) => stride == 4 || stride == 8,
            (Mode::Attributes, Filter::Quaternion) => stride == 8,
            (_, Filter::None) => stride == 2 || stride == 4,
            _ => return Err(e.problem("has a filter, which indices do not take")),
        };
        if !fits {
            return Err(at.problem(format!("{stride} does not fit the mode and filter")));
        }
        if mode == Mode::Triangles && !count.is_multiple_of(3) {
            return Err(e.problem(format!("{count} indices make no triangles")));
        }
        Ok(Self {
            count,
            stride,
            mode,
            filter,
        })
    }

    /// The unpacked bytes, in parts that begin at the ascending `bounds`; `None` if `bytes` are
    /// damaged.
    pub(super) fn decode(&self, bytes: &[u8], bounds: &[usize]) -> Option<Vec<Arc<[u8]>>> {
        let n = self.count;
        let short = self.stride == 2;
        Some(match (self.mode, self.filter) {
            (Mode::Triangles, _) if short => {
                split(shorts(decode_index_buffer::<u16>(bytes, n).ok()?), bounds)
            }
            (Mode::Triangles, _) => {
                split(words(decode_index_buffer::<u32>(bytes, n).ok()?), bounds)
            }
            (Mode::Indices, _) if short => {
                split(shorts(decode_index_sequence::<u16>(bytes, n).ok()?), bounds)
            }
            (Mode::Indices, _) => {
                split(words(decode_index_sequence::<u32>(bytes, n).ok()?), bounds)
            }
            (_, Filter::None) => split(words(self.vertices(bytes)?), bounds),
            (_, Filter::Exponential) => {
                let mut out = self.vertices(bytes)?;
                decode_filter_exp::<1>(bytemuck::cast_slice_mut(&mut out));
                split(words(out), bounds)
            }
            (_, Filter::Quaternion) => {
                let mut out: Vec<[i16; 4]> = decode_vertex_buffer(bytes, n).ok()?;
                decode_filter_quat(&mut out);
                let flat = out.into_flattened().into_iter().map(|x| x as u16);
                split(shorts(flat.collect()), bounds)
            }
            (_, filter) if self.stride == 4 => {
                let mut out: Vec<[u8; 4]> = decode_vertex_buffer(bytes, n).ok()?;
                match filter {
                    Filter::Color => decode_filter_color(&mut out),
                    _ => decode_filter_oct(&mut out),
                }
                split(out.into_flattened(), bounds)
            }
            (_, filter) => {
                let mut out: Vec<[u16; 4]> = decode_vertex_buffer(bytes, n).ok()?;
                match filter {
                    Filter::Color => decode_filter_color(&mut out),
                    _ => decode_filter_oct(&mut out),
                }
                split(shorts(out.into_flattened()), bounds)
            }
        })
    }

    /// Vertices as words; the library takes their size as a type.
    fn vertices(&self, bytes: &[u8]) -> Option<Vec<u32>> {
        macro_rules! by_size {
            ($($small:literal)*; $($large:literal)*) => {
                match self.stride / 4 {
                    $($small => {
                        let out: Vec<[u32; $small]> = decode_vertex_buffer(bytes, self.count).ok()?;
                        Some(out.into_flattened())
                    })*
                    $($large => {
                        let out: Vec<Words<$large>> = decode_vertex_buffer(bytes, self.count).ok()?;
                        let mut flat = Vec::with_capacity(self.count * $large);
                        out.iter().for_each(|w| flat.extend_from_slice(&w.0));
                        Some(flat)
                    })*
                    _ => None,
                }
            };
        }
        by_size!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30
            31 32; 33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59
            60 61 62 63 64)
    }
}

/// Words in the order of bytes that files have.
fn words(mut values: Vec<u32>) -> Vec<u32> {
    values.iter_mut().for_each(|x| *x = x.to_le());
    values
}

fn shorts(mut values: Vec<u16>) -> Vec<u16> {
    values.iter_mut().for_each(|x| *x = x.to_le());
    values
}

/// Parts of `all` that begin at the bytes `bounds`. It shrinks as they grow.
fn split<T: Pod>(mut all: Vec<T>, bounds: &[usize]) -> Vec<Arc<[u8]>> {
    let mut end = size_of::<T>() * all.len();
    let mut parts = Vec::new();
    for &start in bounds.iter().rev() {
        let start = start.min(end);
        parts.push(Arc::from(&bytemuck::cast_slice(&all)[start..end]));
        all.truncate(start.div_ceil(size_of::<T>()));
        all.shrink_to_fit();
        end = start;
    }
    parts.reverse();
    parts
}
