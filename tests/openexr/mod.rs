//! An OpenEXR reader written from the file format's description alone, to check what the
//! library writes: one part, scan lines, ZIP in blocks of 16 lines, half and float.

use std::collections::BTreeMap;
use std::io::Read;

/// A file as it is.
#[derive(Debug)]
pub(crate) struct Exr {
    /// Name to type and value bytes.
    pub(crate) attributes: BTreeMap<String, (String, Vec<u8>)>,
    /// In the order of the file: name, and whether it is half.
    pub(crate) channels: Vec<(String, bool)>,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) data: BTreeMap<String, Vec<f32>>,
}

struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, n: usize) -> &'a [u8] {
        let (head, tail) = self.0.split_at(n);
        self.0 = tail;
        head
    }
    fn i32(&mut self) -> i32 {
        i32::from_le_bytes(self.take(4).try_into().unwrap())
    }
    fn text(&mut self) -> String {
        let end = self.0.iter().position(|b| *b == 0).unwrap();
        let text = String::from_utf8(self.take(end).to_vec()).unwrap();
        self.take(1);
        text
    }
}

fn half_to_f32(h: u16) -> f32 {
    let sign = if h >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, mantissa) = (i32::from(h >> 10 & 31), f32::from(h & 1023));
    sign * match exponent {
        0 => mantissa * 2.0_f32.powi(-24),
        31 if mantissa == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        e => (1.0 + mantissa / 1024.0) * 2.0_f32.powi(e - 15),
    }
}

pub(crate) fn parse(file: &[u8]) -> Exr {
    let mut b = Bytes(file);
    assert_eq!(b.take(4), [0x76, 0x2f, 0x31, 0x01], "magic number");
    let version = b.i32();
    assert_eq!(version & 0xff, 2, "version");
    assert_eq!(version & 0x1a00, 0, "single part, scan lines, not deep");
    let mut attributes = BTreeMap::new();
    loop {
        let name = b.text();
        if name.is_empty() {
            break;
        }
        let kind = b.text();
        let size = b.i32() as usize;
        attributes.insert(name, (kind, b.take(size).to_vec()));
    }
    let value = |name: &str| Bytes(&attributes[name].1);
    assert_eq!(value("compression").take(1), [3], "ZIP");
    let mut window = value("dataWindow");
    let [x0, y0, x1, y1] = std::array::from_fn(|_| window.i32());
    let (width, height) = ((x1 - x0 + 1) as usize, (y1 - y0 + 1) as usize);

    let mut channels = Vec::new();
    let mut list = value("channels");
    loop {
        let name = list.text();
        if name.is_empty() {
            break;
        }
        let kind = list.i32();
        assert!(kind == 1 || kind == 2, "half or float");
        list.take(4);
        assert_eq!((list.i32(), list.i32()), (1, 1), "sampling");
        channels.push((name, kind == 1));
    }

    let blocks = height.div_ceil(16);
    b.take(8 * blocks);
    let row: usize = channels
        .iter()
        .map(|(_, half)| width * if *half { 2 } else { 4 })
        .sum();
    let mut data: BTreeMap<String, Vec<f32>> = BTreeMap::new();
    for block in 0..blocks {
        assert_eq!(b.i32() - y0, 16 * block as i32, "increasing lines");
        let size = b.i32() as usize;
        let packed = b.take(size);
        let lines = 16.min(height - 16 * block);
        let pixels = if size == row * lines {
            packed.to_vec()
        } else {
            unzip(packed, row * lines)
        };
        let mut p = Bytes(&pixels);
        for _ in 0..lines {
            for (name, half) in &channels {
                let out = data.entry(name.clone()).or_default();
                for _ in 0..width {
                    out.push(if *half {
                        half_to_f32(u16::from_le_bytes(p.take(2).try_into().unwrap()))
                    } else {
                        f32::from_le_bytes(p.take(4).try_into().unwrap())
                    });
                }
            }
        }
    }
    assert!(b.0.is_empty(), "bytes after the end");
    Exr {
        attributes,
        channels,
        width,
        height,
        data,
    }
}

/// Inflates, undoes the differences, and joins the two halves.
fn unzip(packed: &[u8], size: usize) -> Vec<u8> {
    let mut raw = Vec::new();
    flate2::read::ZlibDecoder::new(packed)
        .read_to_end(&mut raw)
        .unwrap();
    assert_eq!(raw.len(), size);
    for i in 1..raw.len() {
        raw[i] = raw[i - 1].wrapping_add(raw[i]).wrapping_sub(128);
    }
    let half = raw.len().div_ceil(2);
    (0..raw.len())
        .map(|i| raw[if i % 2 == 0 { i / 2 } else { half + i / 2 }])
        .collect()
}
