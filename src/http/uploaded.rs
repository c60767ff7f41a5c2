//! A mesh as it was sent, and the buffers a glTF finds beside it.

use super::problem::Problem;
use crate::cancel::Cancel;
use crate::memory::Reservation;
use crate::mesh::{Companion, Format, Limits, Pose, ReadContext, Source, TriangleSoup};
use bytes::Bytes;
use serde::Deserialize;
use std::sync::Arc;

/// A file of a request's body.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Its name, with folders only where it came out of an archive.
    pub name: String,
    /// The declared media type.
    pub media_type: Option<String>,
    /// Its contents.
    pub bytes: Bytes,
    /// Whether it came out of an archive, where files that are no meshes are nothing unusual.
    pub packed: bool,
}

/// A mesh file that was sent, with the buffers that came along.
#[derive(Clone, Debug)]
pub struct UploadedMesh {
    /// Its name, or `mesh` where it was sent without one.
    pub name: String,
    /// The declared media type, where it names a mesh format.
    pub media_type: Option<String>,
    /// Its contents.
    pub bytes: Bytes,
    pub(super) buffers: Arc<Vec<Part>>,
    /// The memory of the request it came with.
    pub(super) memory: Arc<Reservation>,
}

/// Bytes that a reader may take per byte of the file beside what it reserves by itself. The floor under readers that do
/// not reserve everything yet: a triangle of a binary STL has 50 bytes in the file and 84 in memory, a number of a text
/// some 3 bytes and 8.
const READING_FACTOR: u64 = 10;

impl UploadedMesh {
    /// What reading it works within: the service's limits, until it is stopped, and memory for this step of the
    /// request's work.
    pub fn context(&self, limits: Limits, cancel: &Cancel) -> ReadContext {
        ReadContext {
            limits,
            cancel: cancel.clone(),
            memory: Arc::new(self.memory.step()),
        }
    }

    /// Reads it as one mesh, which stays reserved.
    ///
    /// # Errors
    /// The reader's; `mesh_too_large` or `overloaded` where memory is short.
    pub fn read(&self, context: &ReadContext) -> Result<(Format, TriangleSoup), Problem> {
        let (format, soup) = {
            let _floor = context.memory.hold(self.reading_bytes())?;
            let companions = self.companions();
            crate::mesh::read_within(&self.source(&companions), context)?
        };
        context.memory.grow(soup_bytes(&soup))?;
        Ok((format, soup))
    }

    fn reading_bytes(&self) -> u64 {
        (self.bytes.len() as u64).saturating_mul(READING_FACTOR)
    }

    /// Samples poses of an animated glTF.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_poses(&self, poses: usize, context: &ReadContext) -> Result<(Format, Vec<Pose>), Problem> {
        let (format, poses) = {
            let _floor = context.memory.hold(self.reading_bytes())?;
            let companions = self.companions();
            crate::mesh::read_poses_within(&self.source(&companions), poses, context)?
        };
        let bytes = poses.iter().map(|pose| soup_bytes(&pose.soup)).sum();
        context.memory.grow(bytes)?;
        Ok((format, poses))
    }

    /// The file as the readers want it.
    pub fn source<'a>(&'a self, companions: &'a [Companion]) -> Source<'a> {
        Source {
            bytes: &self.bytes,
            name: Some(&self.name),
            media_type: self.media_type.as_deref(),
            companions,
        }
    }

    /// The buffers a glTF refers to, under the names it calls them by. Copied on demand, so that a thousand meshes
    /// beside one large buffer do not hold a thousand copies.
    pub fn companions(&self) -> Vec<Companion> {
        let is_json = self.bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
        if !is_json || self.buffers.is_empty() {
            return Vec::new();
        }
        // A document that does not parse gets no buffers here and its own error from the reader.
        let document: GltfBuffers = serde_json::from_slice(&self.bytes).unwrap_or_default();
        let folder = self.name.rsplit_once('/').map_or("", |(folder, _)| folder);
        let mut companions: Vec<Companion> = Vec::new();
        for uri in document.buffers.into_iter().filter_map(|buffer| buffer.uri) {
            if uri.starts_with("data:") || companions.iter().any(|c| c.name == uri) {
                continue;
            }
            if let Some(part) = self.buffer(folder, &uri) {
                companions.push(Companion {
                    name: uri,
                    bytes: part.bytes.to_vec(),
                });
            }
        }
        companions
    }

    /// The buffer a URI means: relative to the mesh's own folder or, since browsers send names without folders, by
    /// its last part alone.
    fn buffer(&self, folder: &str, uri: &str) -> Option<&Part> {
        let uri = percent_decoded(uri);
        let uri = uri.trim_start_matches("./");
        let path = match folder {
            "" => uri.to_owned(),
            _ => format!("{folder}/{uri}"),
        };
        let last = uri.rsplit('/').next().unwrap_or(uri);
        let exact = self.buffers.iter().find(|part| part.name == path);
        exact.or_else(|| self.buffers.iter().find(|part| !part.packed && part.name == last))
    }
}

/// Memory of a mesh as read, in bytes.
fn soup_bytes(soup: &TriangleSoup) -> u64 {
    (24 * soup.vertices.len() + 12 * soup.faces.len()) as u64
}

/// The part of a glTF document that names other files.
#[derive(Default, Deserialize)]
struct GltfBuffers {
    #[serde(default)]
    buffers: Vec<GltfBuffer>,
}

#[derive(Deserialize)]
struct GltfBuffer {
    uri: Option<String>,
}

fn percent_decoded(text: &str) -> String {
    let digit = |byte: Option<&u8>| byte.and_then(|b| char::from(*b).to_digit(16));
    let bytes = text.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        match (bytes[i], digit(bytes.get(i + 1)), digit(bytes.get(i + 2))) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                i += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                i += 1;
            }
        }
    }
    String::from_utf8_lossy(&decoded).into_owned()
}
