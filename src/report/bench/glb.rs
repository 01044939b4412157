//! Writing glTF files as other programs do: one buffer, little-endian, in a `.glb`.

use serde_json::{Value, json};

/// A file under construction: its JSON, and the buffer that its accessors read.
pub(super) struct Glb {
    pub(super) json: Value,
    bytes: Vec<u8>,
}

/// `FLOAT` and `UNSIGNED_INT`.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

impl Glb {
    pub(super) fn new(json: Value) -> Self {
        Self {
            json,
            bytes: Vec::new(),
        }
    }

    /// Adds an accessor over numbers of four bytes and returns its index.
    fn accessor(&mut self, bytes: impl Iterator<Item = [u8; 4]>, mut rest: Value) -> usize {
        let begin = self.bytes.len();
        self.bytes.extend(bytes.flatten());
        let view = push(
            &mut self.json["bufferViews"],
            json!({"buffer": 0, "byteOffset": begin, "byteLength": self.bytes.len() - begin}),
        );
        rest["bufferView"] = view.into();
        push(&mut self.json["accessors"], rest)
    }

    /// An accessor of vectors of floats; with the bounds that positions must have.
    pub(super) fn vectors<const N: usize>(&mut self, v: &[[f32; N]]) -> usize {
        let mut bounds = ([f32::INFINITY; N], [f32::NEG_INFINITY; N]);
        for x in v {
            for (k, c) in x.iter().enumerate() {
                bounds.0[k] = bounds.0[k].min(*c);
                bounds.1[k] = bounds.1[k].max(*c);
            }
        }
        let kind = if N == 1 {
            "SCALAR".to_string()
        } else {
            format!("VEC{N}")
        };
        let rest = json!({
            "componentType": FLOAT, "count": v.len(), "type": kind,
            "min": bounds.0.to_vec(), "max": bounds.1.to_vec(),
        });
        self.accessor(v.iter().flatten().map(|x| x.to_le_bytes()), rest)
    }

    /// An accessor of indices of triangles.
    pub(super) fn indices(&mut self, v: &[[u32; 3]]) -> usize {
        let rest = json!({"componentType": UNSIGNED_INT, "count": 3 * v.len(), "type": "SCALAR"});
        self.accessor(v.iter().flatten().map(|x| x.to_le_bytes()), rest)
    }

    /// Adds to a list of the file and returns the index.
    pub(super) fn add(&mut self, list: &str, value: Value) -> usize {
        push(&mut self.json[list], value)
    }

    /// The file; `None` if it is larger than the format can hold.
    pub(super) fn finish(mut self) -> Option<Vec<u8>> {
        self.json["buffers"] = json!([{"byteLength": self.bytes.len()}]);
        let mut text = self.json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let total = u32::try_from(28 + text.len() + self.bytes.len()).ok()?;
        let mut out = Vec::with_capacity(total as usize);
        out.extend(*b"glTF");
        for n in [2, total, text.len() as u32] {
            out.extend(n.to_le_bytes());
        }
        out.extend(*b"JSON");
        out.extend(text);
        out.extend((self.bytes.len() as u32).to_le_bytes());
        out.extend(*b"BIN\0");
        out.extend(self.bytes);
        Some(out)
    }
}

fn push(list: &mut Value, value: Value) -> usize {
    if list.is_null() {
        *list = json!([]);
    }
    // It is a list: nothing else is ever put there.
    let Some(list) = list.as_array_mut() else {
        return 0;
    };
    list.push(value);
    list.len() - 1
}
