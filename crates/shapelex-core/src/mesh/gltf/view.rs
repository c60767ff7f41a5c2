//! The bytes of a document's buffer views, decoded and decompressed where they are.

use super::buffers::{Loaded, Unpacked};
use super::document::Document;
use super::meshopt;
use super::schema::{self, BufferView, Whole};
use super::uri::{self, BufferUri};
use crate::mesh::MeshError;
use base64::Engine;
use base64::alphabet::{STANDARD, URL_SAFE};
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use serde_json::value::RawValue;
use std::borrow::Cow;

/// Characters of base64 that are decoded between two looks at the stop flag: whole groups of four.
const BASE64_PIECE: usize = 1 << 20;
const DECODING: &str = "steps of decoding its data URIs";

/// A buffer view's bytes, and how far its elements are apart where it says so.
pub(super) struct View<'s> {
    pub bytes: &'s [u8],
    pub stride: Option<usize>,
}

impl<'d> Document<'d> {
    /// The bytes of a view, decompressed where they are compressed.
    pub fn view(&self, index: usize, what: &str) -> Result<View<'_>, MeshError> {
        let view: BufferView<'d> = self.get(&self.views, index)?;
        // A stride of 0 is against the specification and means that elements are packed, as other readers take it.
        let stride = |stride: Whole| usize::try_from(stride.0).unwrap_or(usize::MAX);
        let extensions = view.extensions.unwrap_or_default();
        if let Some(compressed) = extensions.ext_meshopt.or(extensions.khr_meshopt) {
            let slot = self.buffers.views.get(index);
            let slot = slot.ok_or_else(|| self.malformed(format!("there is no buffer view {index}")))?;
            if slot.get().is_none() {
                let unpacked = self.decompress(&compressed, what)?;
                let _ = slot.set(Box::new(unpacked));
            }
            let bytes = slot.get().map_or(&[][..], |unpacked| &unpacked.bytes);
            return Ok(View {
                bytes,
                stride: Some(stride(compressed.byte_stride)),
            });
        }
        Ok(View {
            bytes: self.slice(view.buffer.value(), view.byte_offset, view.byte_length, what)?,
            stride: view.byte_stride.map(stride).filter(|s| *s > 0),
        })
    }

    fn decompress(&self, compressed: &schema::Meshopt<'_>, what: &str) -> Result<Unpacked<'d>, MeshError> {
        let stream = self.slice(
            compressed.buffer.value(),
            compressed.byte_offset,
            compressed.byte_length,
            what,
        )?;
        let layout =
            meshopt::Layout::parse(compressed).map_err(|e| self.malformed(format!("{what}: {e}")))?;
        let memory = self.buffers.reserve_unpacked(layout.bytes())?;
        // The decoder's result and its copy into plain bytes are there at the same time.
        let _copy = self.context.memory.hold(layout.bytes() as u64)?;
        self.work
            .spend(layout.bytes(), 2, "steps of decompressing its buffers")?;
        let bytes = layout
            .decode(stream)
            .map_err(|e| self.malformed(format!("{what}: {e}")))?;
        Ok(Unpacked {
            bytes,
            _memory: memory,
        })
    }

    /// A range of a buffer.
    fn slice(
        &self,
        buffer: usize,
        offset: Option<Whole>,
        length: Whole,
        what: &str,
    ) -> Result<&[u8], MeshError> {
        let bytes = self.buffer(buffer)?;
        let start = offset.unwrap_or_default().0;
        let end = start.checked_add(length.0);
        end.filter(|&end| end <= bytes.len() as u64)
            .and_then(|end| bytes.get(start as usize..end as usize))
            .ok_or_else(|| {
                self.truncated(format!(
                    "{what}: its buffer view needs {} bytes from byte {start} of a buffer of {}",
                    length.0,
                    bytes.len()
                ))
            })
    }

    /// The contents of a buffer, at least as long as it declares.
    fn buffer(&self, index: usize) -> Result<&[u8], MeshError> {
        let slot = match self.buffers.loaded.get(index) {
            Some(slot) => slot,
            None => {
                return Err(self
                    .element(&self.buffers.list, index)
                    .err()
                    .unwrap_or_else(|| self.malformed(format!("there is no buffer {index}"))));
            }
        };
        if let Some(loaded) = slot.get() {
            return Ok(loaded.bytes());
        }
        let buffer: schema::Buffer<'d> = self.get(&self.buffers.list, index)?;
        let loaded = self.load(index, buffer.uri)?;
        let (found, declared) = (loaded.bytes().len(), buffer.byte_length.unwrap_or_default().0);
        if (found as u64) < declared {
            return Err(self.truncated(format!(
                "buffer {index} declares {declared} bytes and has {found}"
            )));
        }
        Ok(slot.get_or_init(|| loaded).bytes())
    }

    fn load(&self, index: usize, uri: Option<&'d RawValue>) -> Result<Loaded<'d>, MeshError> {
        let Some(uri) = uri else {
            return match self.buffers.binary {
                Some(binary) if index == 0 => Ok(Loaded::There(binary)),
                _ => Err(self.malformed(format!("buffer {index} has neither a `uri` nor a binary chunk"))),
            };
        };
        // Only text with escapes is copied.
        let _copy = match uri.get().contains('\\') {
            true => Some(self.context.memory.hold(2 * uri.get().len() as u64)?),
            false => None,
        };
        let uri = schema::text(uri)
            .ok_or_else(|| self.malformed(format!("buffer {index}: its `uri` is no string")))?;
        if let Some(data) = uri::data(&uri) {
            return Ok(Loaded::Unpacked(Box::new(self.decode_data_uri(index, data)?)));
        }
        let bytes = BufferUri::parse(&uri)
            .and_then(|file| self.buffers.file(&file))
            .ok_or_else(|| MeshError::MissingBuffer {
                uri: uri.chars().take(200).collect(),
            })?;
        self.buffers.count_file(bytes)?;
        Ok(Loaded::There(bytes))
    }

    fn decode_data_uri(&self, index: usize, uri: &str) -> Result<Unpacked<'d>, MeshError> {
        let Some((head, data)) = uri.split_once(',') else {
            return Err(self.malformed(format!("buffer {index}: its data URI has no comma")));
        };
        let head = head.trim_end();
        let base64 = head.len() >= 7 && head.as_bytes()[head.len() - 7..].eq_ignore_ascii_case(b";base64");
        let memory = self.buffers.reserve_unpacked(match base64 {
            true => data.len() / 4 * 3 + 3,
            false => data.len(),
        })?;
        self.work.spend(data.len(), 1, DECODING)?;
        // A copy is made only of text that is not base64 alone.
        let clean = !data.bytes().any(|b| b == b'%' || b.is_ascii_whitespace());
        let _copy = match clean {
            true => None,
            false => Some(self.context.memory.hold(2 * data.len() as u64)?),
        };
        let text = uri::percent_decode(data.as_bytes());
        let bytes = match base64 {
            true => self.decode_base64(index, text)?,
            false => text.into_owned(),
        };
        Ok(Unpacked {
            bytes,
            _memory: memory,
        })
    }

    /// Base64 in either alphabet, with or without padding, broken into lines or not.
    fn decode_base64(&self, index: usize, text: Cow<'_, [u8]>) -> Result<Vec<u8>, MeshError> {
        let text: Cow<'_, [u8]> = match text.iter().any(u8::is_ascii_whitespace) {
            true => text
                .iter()
                .copied()
                .filter(|b| !b.is_ascii_whitespace())
                .collect(),
            false => text,
        };
        let lenient = GeneralPurposeConfig::new()
            .with_decode_padding_mode(DecodePaddingMode::Indifferent)
            .with_decode_allow_trailing_bits(true);
        let alphabet = match text.iter().any(|&b| b == b'-' || b == b'_') {
            true => &URL_SAFE,
            false => &STANDARD,
        };
        let engine = GeneralPurpose::new(alphabet, lenient);
        let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 3);
        for piece in text.chunks(BASE64_PIECE) {
            self.work.spend(piece.len(), 3, DECODING)?;
            engine
                .decode_vec(piece, &mut bytes)
                .map_err(|error| self.malformed(format!("buffer {index}: its data URI: {error}")))?;
        }
        Ok(bytes)
    }
}
