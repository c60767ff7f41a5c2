//! A file's JSON text and, in a GLB, its binary chunk.

use crate::mesh::{Format, MeshError};
use std::borrow::Cow;

pub(super) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
const JSON: &[u8] = b"JSON";
const BINARY: &[u8] = b"BIN\0";
/// Most JSON objects in one document.
const MAX_OBJECTS: usize = 400_000;
/// Most JSON values in one document, by its commas.
const MAX_VALUES: usize = 4_000_000;
/// Bytes that the lists of a document take, with what is kept of their elements, per object and per value of the text:
/// a node's state and its place in the hierarchy, the index of a child or a joint.
const BYTES_PER_OBJECT: u64 = 240;
const BYTES_PER_VALUE: u64 = 8;

/// Bytes of a GLB's header, and of a chunk's.
const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;

/// What a file consists of.
pub(super) struct Container<'a> {
    pub format: Format,
    /// The document. Bytes that are no UTF-8, which occur in names, are replaced one by one.
    pub json: Cow<'a, str>,
    /// The first binary chunk of a GLB.
    pub binary: Option<&'a [u8]>,
}

impl<'a> Container<'a> {
    /// Takes a file apart. `copied` is asked before the JSON text is copied, with its length.
    ///
    /// Chunks of types that we do not know are skipped, and so is what follows the last chunk.
    pub fn open(
        bytes: &'a [u8],
        format: Format,
        copied: impl FnOnce(usize) -> Result<(), MeshError>,
    ) -> Result<Self, MeshError> {
        let (json, binary) = match format {
            Format::Glb => split(bytes)?,
            _ => (bytes, None),
        };
        let json = json.strip_prefix(BYTE_ORDER_MARK).unwrap_or(json);
        let padding = json
            .iter()
            .rev()
            .take_while(|b| **b == 0 || b.is_ascii_whitespace())
            .count();
        let json = &json[..json.len() - padding];
        let json = match std::str::from_utf8(json) {
            Ok(text) => Cow::Borrowed(text),
            Err(_) => {
                copied(json.len())?;
                Cow::Owned(replaced(json))
            }
        };
        Ok(Self { format, json, binary })
    }
}

impl Container<'_> {
    /// An upper bound of the memory that the document's lists take, or the refusal of one with too many parts.
    pub fn check_counts(&self) -> Result<u64, MeshError> {
        let count = |byte: u8| self.json.bytes().filter(|b| *b == byte).count();
        let (objects, values) = (count(b'{'), count(b','));
        for (what, found, limit) in [
            ("JSON objects", objects, MAX_OBJECTS),
            ("JSON values", values, MAX_VALUES),
        ] {
            if found > limit {
                return Err(MeshError::TooLarge { what, found, limit });
            }
        }
        Ok(objects as u64 * BYTES_PER_OBJECT + values as u64 * BYTES_PER_VALUE)
    }
}

/// The text with `?` for every byte that belongs to no character: never longer than the bytes.
fn replaced(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len());
    for chunk in bytes.utf8_chunks() {
        text.push_str(chunk.valid());
        text.extend(chunk.invalid().iter().map(|_| '?'));
    }
    text
}

/// A chunk of a GLB.
struct Chunk<'a> {
    kind: &'a [u8],
    /// Its contents, or the length that it promises where the file ends before.
    contents: Result<&'a [u8], usize>,
    /// Where the next one begins.
    next: usize,
}

/// The chunk that begins at `at`; `None` where there is none.
fn chunk(bytes: &[u8], at: usize) -> Option<Chunk<'_>> {
    let head = bytes.get(at..at.checked_add(CHUNK_HEADER)?)?;
    let length = u32::from_le_bytes([head[0], head[1], head[2], head[3]]) as usize;
    let start = at + CHUNK_HEADER;
    let next = start.saturating_add(length);
    Some(Chunk {
        kind: &head[4..],
        contents: bytes.get(start..next).ok_or(length),
        next,
    })
}

fn known(bytes: &[u8], at: usize) -> bool {
    chunk(bytes, at).is_some_and(|chunk| chunk.kind == JSON || chunk.kind == BINARY)
}

/// The length that a GLB's header promises, at most that of the file.
fn promised_length(bytes: &[u8]) -> Result<usize, MeshError> {
    if !bytes.starts_with(b"glTF") {
        return Err(MeshError::malformed(
            Format::Glb,
            "a GLB begins with the four bytes `glTF`, this file does not; send JSON as model/gltf+json",
        ));
    }
    let number = |at: usize| {
        let b = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    };
    let (Some(version), Some(length)) = (number(4), number(8)) else {
        return Err(MeshError::truncated(Format::Glb, "it ends within a header"));
    };
    if version != 2 {
        return Err(MeshError::Unsupported {
            format: Format::Glb,
            feature: match version {
                1 => "glTF 1.0".to_owned(),
                _ => format!("version {version} of the container"),
            },
        });
    }
    let length = length as usize;
    if length > bytes.len() {
        return Err(MeshError::truncated(
            Format::Glb,
            format!("its header promises {length} bytes, but it has {}", bytes.len()),
        ));
    }
    Ok(length)
}

/// The JSON and binary chunks of a GLB.
fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), MeshError> {
    let length = promised_length(bytes)?;
    let (mut json, mut binary) = (None, None);
    let mut at = HEADER;
    while let Some(Chunk {
        kind,
        contents,
        mut next,
    }) = chunk(bytes, at)
    {
        let contents = match contents {
            Ok(contents) => contents,
            // What follows the promised length need not be a chunk.
            Err(_) if at >= length && json.is_some() => break,
            Err(promised) => {
                return Err(MeshError::truncated(
                    Format::Glb,
                    format!(
                        "a chunk promises {promised} bytes, but {} follow",
                        bytes.len() - at - CHUNK_HEADER
                    ),
                ));
            }
        };
        match kind {
            JSON if json.is_none() => json = Some(contents),
            BINARY if binary.is_none() => binary = Some(contents),
            _ => {}
        }
        // Some exporters count a chunk without the padding that follows it.
        if !known(bytes, next) && known(bytes, next.next_multiple_of(4)) {
            next = next.next_multiple_of(4);
        }
        at = next;
    }
    match json {
        Some(json) => Ok((json, binary)),
        None if bytes.len() < HEADER + CHUNK_HEADER => {
            Err(MeshError::truncated(Format::Glb, "it ends within a header"))
        }
        None => Err(MeshError::malformed(Format::Glb, "it has no JSON chunk")),
    }
}
