//! The JSON document and its buffers.

use crate::mesh::{Format, Limits, MeshError, Source};
use base64::Engine;
use base64::alphabet::{STANDARD, URL_SAFE};
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::Root;
use gltf::{Error as GltfError, Glb, binary};
use std::borrow::Cow;
use std::cell::{Cell, OnceCell};

/// Most JSON objects in one document. Each becomes a few hundred bytes of structures, whatever its length in text.
const MAX_OBJECTS: usize = 400_000;
/// Most JSON values in one document, by its commas. A number of two bytes in a list becomes over thirty.
const MAX_VALUES: usize = 4_000_000;

/// Required extensions that change nothing about the surface, by prefix, and the one that we read.
const HARMLESS: [&str; 9] = [
    "KHR_mesh_quantization",
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_xmp",
    "KHR_audio",
];

/// A parsed document with access to its buffers.
pub(super) struct Document<'a> {
    pub root: Root,
    pub format: Format,
    pub limits: Limits,
    blob: Option<&'a [u8]>,
    source: Source<'a>,
    buffers: Vec<OnceCell<Cow<'a, [u8]>>>,
    /// Bytes of buffers taken in so far.
    taken: Cell<usize>,
    /// Numbers that may still be read from accessors; see [`Document::spend`].
    budget: Cell<usize>,
}

impl<'a> Document<'a> {
    /// Parses the container and the JSON and refuses required extensions that are not read.
    pub fn open(source: &Source<'a>, format: Format, limits: &Limits) -> Result<Self, MeshError> {
        let (json, blob): (&'a [u8], Option<&'a [u8]>) = match format {
            Format::Glb => split_glb(source.bytes)?,
            _ => (source.bytes, None),
        };
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
        for (what, byte, limit) in [
            ("JSON objects", b'{', MAX_OBJECTS),
            ("JSON values", b',', MAX_VALUES),
        ] {
            let found = json.iter().filter(|&&b| b == byte).count();
            if found > limit {
                return Err(MeshError::TooLarge { what, found, limit });
            }
        }
        let root: Root = gltf::json::deserialize::from_slice(json).map_err(|error| {
            if error.is_eof() {
                MeshError::truncated(format, format!("its JSON ends too early: {error}"))
            } else {
                MeshError::malformed(format, format!("its JSON: {error}"))
            }
        })?;
        if let Some(extension) = root
            .extensions_required
            .iter()
            .find(|e| !HARMLESS.iter().any(|h| e.starts_with(h)))
        {
            return Err(MeshError::Unsupported {
                format,
                feature: extension.clone(),
            });
        }
        let document = Self {
            buffers: root.buffers.iter().map(|_| OnceCell::new()).collect(),
            root,
            format,
            limits: *limits,
            blob,
            source: *source,
            taken: Cell::new(source.bytes.len()),
            budget: Cell::new(0),
        };
        document.refill();
        Ok(document)
    }

    /// A [`MeshError::Malformed`] of this document.
    pub fn malformed(&self, detail: impl Into<String>) -> MeshError {
        MeshError::malformed(self.format, detail)
    }

    /// A [`MeshError::Truncated`] of this document.
    pub fn truncated(&self, detail: impl Into<String>) -> MeshError {
        MeshError::truncated(self.format, detail)
    }

    /// What `index` points to, or the error that there is no such `what`.
    pub fn get<'s, T>(&self, list: &'s [T], index: usize, what: &str) -> Result<&'s T, MeshError> {
        list.get(index).ok_or_else(|| {
            self.malformed(format!(
                "it refers to {what} {index}, but has {} of them",
                list.len()
            ))
        })
    }

    /// Allows the reading of another pose.
    pub fn refill(&self) {
        self.budget.set(self.limits.max_bytes);
    }

    /// Counts numbers read from accessors. An honest file stores each number it needs, in a byte at least; a small file
    /// that reads the same bytes through a million accessors is stopped here.
    pub fn spend(&self, numbers: usize) -> Result<(), MeshError> {
        match self.budget.get().checked_sub(numbers) {
            Some(left) => {
                self.budget.set(left);
                Ok(())
            }
            None => Err(MeshError::TooLarge {
                what: "numbers in its accessors",
                found: self.limits.max_bytes.saturating_add(1),
                limit: self.limits.max_bytes,
            }),
        }
    }

    /// The contents of a buffer, at least as long as it declares.
    pub fn buffer(&self, index: usize) -> Result<&[u8], MeshError> {
        let slot = self.get(&self.buffers, index, "buffer")?;
        if let Some(bytes) = slot.get() {
            return Ok(bytes);
        }
        let bytes = self.load(index)?;
        let declared = self.root.buffers[index].byte_length.0;
        if (bytes.len() as u64) < declared {
            return Err(self.truncated(format!(
                "buffer {index} declares {declared} bytes and has {}",
                bytes.len()
            )));
        }
        Ok(slot.get_or_init(|| bytes))
    }

    fn load(&self, index: usize) -> Result<Cow<'a, [u8]>, MeshError> {
        let Some(uri) = &self.root.buffers[index].uri else {
            return match self.blob {
                Some(blob) if index == 0 => Ok(Cow::Borrowed(blob)),
                _ => Err(self.malformed(format!("buffer {index} has neither a `uri` nor a binary chunk"))),
            };
        };
        if uri.len() >= 5 && uri.as_bytes()[..5].eq_ignore_ascii_case(b"data:") {
            return self.decode_data_uri(index, &uri[5..]).map(Cow::Owned);
        }
        let bytes = self.companion(uri).ok_or_else(|| MeshError::MissingBuffer {
            uri: uri.chars().take(200).collect(),
        })?;
        self.taken.set(self.taken.get().saturating_add(bytes.len()));
        self.limits.check_bytes(self.taken.get())?;
        Ok(Cow::Borrowed(bytes))
    }

    /// The file sent along under the name the URI gives: the same path, else the same last part of it.
    fn companion(&self, uri: &str) -> Option<&'a [u8]> {
        let path = String::from_utf8_lossy(&percent_decode(uri)).into_owned();
        let path = path.trim_start_matches("./").replace('\\', "/");
        let base = |name: &str| name.rsplit(['/', '\\']).next().map(str::to_owned);
        let companions = self.source.companions;
        companions
            .iter()
            .find(|c| c.name.trim_start_matches("./") == path || c.name == uri)
            .or_else(|| companions.iter().find(|c| base(&c.name) == base(&path)))
            .map(|c| c.bytes.as_slice())
    }

    fn decode_data_uri(&self, index: usize, uri: &str) -> Result<Vec<u8>, MeshError> {
        let Some((head, data)) = uri.split_once(',') else {
            return Err(self.malformed(format!("buffer {index}: its data URI has no comma")));
        };
        if !head.trim_end().ends_with(";base64") {
            return Ok(percent_decode(data));
        }
        let text: Cow<'_, [u8]> = if data.bytes().any(|b| b == b'%') {
            percent_decode(data).into()
        } else {
            data.as_bytes().into()
        };
        let text: Cow<'_, [u8]> = if text.iter().any(u8::is_ascii_whitespace) {
            text.iter()
                .copied()
                .filter(|b| !b.is_ascii_whitespace())
                .collect()
        } else {
            text
        };
        let lenient = GeneralPurposeConfig::new()
            .with_decode_padding_mode(DecodePaddingMode::Indifferent)
            .with_decode_allow_trailing_bits(true);
        let alphabet = if text.iter().any(|&b| b == b'-' || b == b'_') {
            &URL_SAFE
        } else {
            &STANDARD
        };
        GeneralPurpose::new(alphabet, lenient)
            .decode(&text)
            .map_err(|error| self.malformed(format!("buffer {index}: its data URI: {error}")))
    }
}

/// `%20` → a blank, and so on; a `%` without two hexadecimal digits stays as it is.
fn percent_decode(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut k = 0;
    while k < bytes.len() {
        let hex = |at: usize| bytes.get(at).and_then(|&b| (b as char).to_digit(16));
        match (bytes[k], hex(k + 1), hex(k + 2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                k += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                k += 1;
            }
        }
    }
    decoded
}

/// The JSON and binary chunks of a GLB.
fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), MeshError> {
    if !bytes.starts_with(b"glTF") {
        return Err(MeshError::malformed(
            Format::Glb,
            "a GLB begins with the four bytes `glTF`, this file does not; send JSON as model/gltf+json",
        ));
    }
    let glb = Glb::from_slice(bytes).map_err(|error| match error {
        GltfError::Binary(binary::Error::Io(_)) => {
            MeshError::truncated(Format::Glb, "it ends within a header")
        }
        GltfError::Binary(binary::Error::Length { length, length_read }) => MeshError::truncated(
            Format::Glb,
            format!("its header promises {length} bytes, but {length_read} follow"),
        ),
        GltfError::Binary(binary::Error::ChunkLength {
            length, length_read, ..
        }) => MeshError::truncated(
            Format::Glb,
            format!("a chunk promises {length} bytes, but {length_read} follow"),
        ),
        GltfError::Binary(binary::Error::Version(version)) => MeshError::Unsupported {
            format: Format::Glb,
            feature: format!("version {version} of the container"),
        },
        error => MeshError::malformed(Format::Glb, error.to_string()),
    })?;
    // Both were split off the slice; a copy would be the crate's own doing.
    match (glb.json, glb.bin) {
        (Cow::Borrowed(json), None) => Ok((json, None)),
        (Cow::Borrowed(json), Some(Cow::Borrowed(bin))) => Ok((json, Some(bin))),
        _ => Err(MeshError::malformed(Format::Glb, "its chunks could not be split")),
    }
}
