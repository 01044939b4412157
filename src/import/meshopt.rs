//! Buffer views that `EXT_meshopt_compression` or its successor `KHR_meshopt_compression` packs.
//! The decoder is meshoptimizer's own, which is written for data that nobody vouches for.

use meshopt::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat,
    decode_index_buffer, decode_index_sequence, decode_vertex_buffer,
};

use super::Problem;
use super::json::Cursor;

/// A vertex of `N` 32-bit words.
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

    /// The unpacked bytes; `None` if `bytes` are damaged.
    pub(super) fn decode(&self, bytes: &[u8]) -> Option<Vec<u8>> {
        let n = self.count;
        Some(match (self.mode, self.filter, self.stride) {
            (Mode::Triangles, _, 2) => shorts(&decode_index_buffer::<u16>(bytes, n).ok()?),
            (Mode::Triangles, ..) => words(decode_index_buffer::<u32>(bytes, n).ok()?),
            (Mode::Indices, _, 2) => shorts(&decode_index_sequence::<u16>(bytes, n).ok()?),
            (Mode::Indices, ..) => words(decode_index_sequence::<u32>(bytes, n).ok()?),
            (_, Filter::None, _) => words(self.vertices(bytes)?),
            (_, Filter::Exponential, _) => {
                let mut out: Vec<[u32; 1]> =
                    self.vertices(bytes)?.into_iter().map(|w| [w]).collect();
                decode_filter_exp(&mut out);
                words(out.into_iter().flatten())
            }
            (_, Filter::Quaternion, _) => {
                let mut out: Vec<[i16; 4]> = decode_vertex_buffer(bytes, n).ok()?;
                decode_filter_quat(&mut out);
                let flat: Vec<u16> = out.into_iter().flatten().map(|x| x as u16).collect();
                shorts(&flat)
            }
            (_, filter, 4) => {
                let mut out: Vec<[u8; 4]> = decode_vertex_buffer(bytes, n).ok()?;
                match filter {
                    Filter::Color => decode_filter_color(&mut out),
                    _ => decode_filter_oct(&mut out),
                }
                out.into_iter().flatten().collect()
            }
            (_, filter, _) => {
                let mut out: Vec<[u16; 4]> = decode_vertex_buffer(bytes, n).ok()?;
                match filter {
                    Filter::Color => decode_filter_color(&mut out),
                    _ => decode_filter_oct(&mut out),
                }
                let flat: Vec<u16> = out.into_iter().flatten().collect();
                shorts(&flat)
            }
        })
    }

    /// Vertices as words; the library takes their size as a type.
    fn vertices(&self, bytes: &[u8]) -> Option<Vec<u32>> {
        macro_rules! by_size {
            ($($words:literal)*) => {
                match self.stride / 4 {
                    $($words => {
                        let out = decode_vertex_buffer::<Words<$words>>(bytes, self.count).ok()?;
                        Some(out.into_iter().flat_map(|w| w.0).collect())
                    })*
                    _ => None,
                }
            };
        }
        by_size!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30
            31 32 33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59
            60 61 62 63 64)
    }
}

fn words(values: impl IntoIterator<Item = u32>) -> Vec<u8> {
    values.into_iter().flat_map(u32::to_le_bytes).collect()
}

fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}
