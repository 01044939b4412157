//! Images: found, checked by their headers, and decoded in parallel, each one once.
//!
//! Materials are read twice. The first time their textures only say which images they need;
//! then those are decoded together; the second time textures get them. So images that nothing
//! shows are not even opened, and no other code has to know in advance which slots there are.

use std::collections::HashMap;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader};
use rayon::prelude::*;

use super::accessor::Source;
use super::json::Cursor;
#[cfg(feature = "ktx2")]
use super::ktx2;
use super::uri::Uris;
use super::{Notes, Problem};
use crate::textures::{Image, Texels};

/// Most texels of one image: 16384 × 16384.
const MAX_TEXELS: u64 = 1 << 28;

/// Longest side of an image, four times that of the largest square. Smaller sizes are made by rows,
/// of which a few are in memory at a time.
const MAX_SIDE: u32 = 1 << 16;

/// Most bytes of all decoded images together. A few kilobytes of a well-packed file can claim
/// gigabytes, so the headers are added up before anything is decoded.
const MAX_BYTES: u64 = 1 << 33;

/// What is known of an image that was asked for.
#[derive(Clone)]
enum State {
    Waiting,
    Decoded(Arc<Image>),
    /// It is in a format that is not supported.
    Foreign,
}

/// Where the bytes of an image are.
#[derive(PartialEq, Eq, Hash)]
enum Bytes<'a> {
    Uri(&'a str),
    View(usize),
}

/// The images of a file.
pub(super) struct Images<'a> {
    root: Cursor<'a>,
    source: &'a Source<'a>,
    uris: &'a Uris,
    /// Images that were asked for, by index.
    wanted: HashMap<usize, State>,
    decoded: bool,
    placeholder: Arc<Image>,
}

impl<'a> Images<'a> {
    /// The images of a file, none of them decoded.
    pub(super) fn new(source: &'a Source<'a>, uris: &'a Uris) -> Self {
        Self {
            root: source.root.clone(),
            source,
            uris,
            wanted: HashMap::new(),
            decoded: false,
            placeholder: Arc::new(Image::white()),
        }
    }

    /// The document, for what refers to images.
    pub(super) fn root(&self) -> &Cursor<'a> {
        &self.root
    }

    /// The image whose index stands at `at`. Before [`decode`](Self::decode) this notes that it
    /// is needed and gives a white texel; so it does after for images that were not asked for
    /// before. `None`, with a note, if its format is not supported.
    pub(super) fn get(
        &mut self,
        at: &Cursor<'a>,
        notes: &mut Notes,
    ) -> Result<Option<Arc<Image>>, Problem> {
        let index = at.index()?;
        self.root.element("images", index, at)?;
        if !self.decoded {
            self.wanted.entry(index).or_insert(State::Waiting);
        }
        Ok(match self.wanted.get(&index) {
            Some(State::Decoded(image)) => Some(Arc::clone(image)),
            Some(State::Foreign) => {
                notes.add(FOREIGN, 1);
                None
            }
            _ => Some(Arc::clone(&self.placeholder)),
        })
    }

    /// Reads and decodes, in parallel, what was asked for.
    pub(super) fn decode(&mut self) -> Result<(), Problem> {
        self.decoded = true;
        let mut indices: Vec<usize> = self.wanted.keys().copied().collect();
        indices.sort_unstable();
        // Entries that name the same bytes are one image.
        let mut first: HashMap<Bytes<'_>, usize> = HashMap::new();
        let mut same = Vec::new();
        let mut tasks = Vec::new();
        for index in indices {
            let image = self.root.element("images", index, &self.root)?;
            let key = match (image.get("uri"), image.get("bufferView")) {
                (Some(uri), _) => Bytes::Uri(uri.str()?),
                (None, Some(view)) => Bytes::View(view.index()?),
                _ => return Err(image.problem("has neither a URI nor a buffer view")),
            };
            match first.get(&key) {
                Some(&original) => same.push((index, original)),
                None => {
                    first.insert(key, index);
                    tasks.push((index, image));
                }
            }
        }
        let budget = AtomicU64::new(MAX_BYTES);
        let results: Vec<(usize, Result<Option<Image>, Problem>)> = tasks
            .par_iter()
            .map(|(index, image)| (*index, self.load(image, &budget)))
            .collect();
        for (index, image) in results {
            let state = image?.map_or(State::Foreign, |i| State::Decoded(Arc::new(i)));
            self.wanted.insert(index, state);
        }
        for (index, original) in same {
            if let Some(state) = self.wanted.get(&original).cloned() {
                self.wanted.insert(index, state);
            }
        }
        Ok(())
    }

    fn load(&self, image: &Cursor<'a>, budget: &AtomicU64) -> Result<Option<Image>, Problem> {
        if let Some(uri) = image.get("uri") {
            return decode(&self.uris.read(&uri)?, &uri, budget);
        }
        let view = image.need("bufferView")?;
        decode(&self.source.views.bytes(&view)?, image, budget)
    }
}

/// What is told of images in other formats.
const FOREIGN: &str = "images that are not PNG, JPEG, WebP or KTX2 (Basis Universal or plain \
     texels) are not supported: the factors of their textures alone are used";

/// Decodes the image file `bytes`, found at `place`; `None` if its format is known but not
/// supported. The format is told by the first bytes: names and MIME types are often wrong.
/// Embedded colour profiles and orientation are ignored, as glTF 2.0, 3.8.3 demands. The decoded
/// size is taken off `budget`.
pub(super) fn decode(
    bytes: &[u8],
    place: &Cursor<'_>,
    budget: &AtomicU64,
) -> Result<Option<Image>, Problem> {
    #[cfg(feature = "ktx2")]
    if ktx2::recognises(bytes) {
        return decode_ktx2(bytes, place, budget);
    }
    let format = match image::guess_format(bytes) {
        Ok(f @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) => f,
        Ok(_) => return Ok(None),
        Err(_) if is_container(bytes) => return Ok(None),
        Err(_) => return Err(place.problem("is no image of a known format")),
    };
    let broken = |e: ImageError| place.problem(format!("cannot be decoded ({e})"));
    let decoder = ImageReader::with_format(io::Cursor::new(bytes), format)
        .into_decoder()
        .map_err(broken)?;
    let (width, height) = decoder.dimensions();
    claim(width, height, decoder.total_bytes(), place, budget)?;
    let pixels = DynamicImage::from_decoder(decoder).map_err(broken)?;
    let (channels, texels) = match pixels {
        DynamicImage::ImageLuma8(i) => (1, Texels::U8(i.into_raw())),
        DynamicImage::ImageLumaA8(i) => (2, Texels::U8(i.into_raw())),
        DynamicImage::ImageRgb8(i) => (3, Texels::U8(i.into_raw())),
        DynamicImage::ImageRgba8(i) => (4, Texels::U8(i.into_raw())),
        DynamicImage::ImageLuma16(i) => (1, Texels::U16(i.into_raw())),
        DynamicImage::ImageLumaA16(i) => (2, Texels::U16(i.into_raw())),
        DynamicImage::ImageRgb16(i) => (3, Texels::U16(i.into_raw())),
        DynamicImage::ImageRgba16(i) => (4, Texels::U16(i.into_raw())),
        other => (4, Texels::U8(other.into_rgba8().into_raw())),
    };
    Image::from_texels(width, height, channels, texels)
        .map(Some)
        .ok_or_else(|| place.problem(format!("is an image of {width} × {height} texels")))
}

#[cfg(feature = "ktx2")]
fn decode_ktx2(
    bytes: &[u8],
    place: &Cursor<'_>,
    budget: &AtomicU64,
) -> Result<Option<Image>, Problem> {
    let tell = |fault: ktx2::Fault| match fault {
        ktx2::Fault::Broken(what) => Err(place.problem(what)),
        ktx2::Fault::Foreign => Ok(None),
    };
    let file = match ktx2::Ktx2::open(bytes) {
        Ok(file) => file,
        Err(fault) => return tell(fault),
    };
    claim(file.width, file.height, file.decoded_bytes(), place, budget)?;
    file.decode().map(Some).or_else(tell)
}

/// The format of an image file and its columns and rows, as far as its header tells.
pub(super) fn header(bytes: &[u8]) -> (&'static str, Option<[u32; 2]>) {
    #[cfg(feature = "ktx2")]
    if ktx2::recognises(bytes) {
        let file = ktx2::Ktx2::open(bytes).ok();
        return ("ktx2", file.map(|f| [f.width, f.height]));
    }
    let Ok(format) = image::guess_format(bytes) else {
        let container = if is_container(bytes) {
            "texture container"
        } else {
            "unknown"
        };
        return (container, None);
    };
    let name = format.extensions_str().first().copied();
    let size = ImageReader::with_format(io::Cursor::new(bytes), format).into_dimensions();
    (name.unwrap_or("unknown"), size.ok().map(|(w, h)| [w, h]))
}

/// Whether the bytes begin as a texture container does that is known by name: KTX, KTX2, Basis.
fn is_container(bytes: &[u8]) -> bool {
    [&b"\xABKTX 11\xBB"[..], b"\xABKTX 20\xBB", b"sB\x13\x00"]
        .iter()
        .any(|magic| bytes.starts_with(magic))
}

/// Refuses images that are too large, by what their header says.
fn claim(
    width: u32,
    height: u32,
    bytes: u64,
    place: &Cursor<'_>,
    budget: &AtomicU64,
) -> Result<(), Problem> {
    if u64::from(width) * u64::from(height) > MAX_TEXELS {
        return Err(Problem::unsupported(
            place.path(),
            format!("is an image of {width} × {height} texels, more than {MAX_TEXELS}"),
            "make it smaller",
        ));
    }
    if width.max(height) > MAX_SIDE {
        return Err(Problem::unsupported(
            place.path(),
            format!("is an image of {width} × {height} texels, a side longer than {MAX_SIDE}"),
            "make it smaller",
        ));
    }
    let taken = budget.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
        left.checked_sub(bytes)
    });
    if taken.is_err() {
        return Err(Problem::unsupported(
            place.path(),
            format!(
                "with this one the images take more than {} GiB decoded",
                MAX_BYTES >> 30
            ),
            "make them smaller",
        ));
    }
    Ok(())
}
