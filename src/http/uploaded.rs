//! A mesh as it was sent, and the buffers a glTF finds beside it.

use crate::mesh::{Companion, Format, Limits, MeshError, Pose, Source, TriangleSoup};
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
}

/// Bytes that reading, cleaning and simplifying take per byte of the file, at most. A triangle of a binary STL has 50
/// bytes in the file; in memory it is three vertices of 24 bytes and three indices before welding, once more while it
/// is welded, and edges and quadrics while it is simplified.
const READING_FACTOR: u64 = 10;

impl UploadedMesh {
    /// Memory that reading and preparing it takes, in bytes.
    pub fn reading_bytes(&self) -> u64 {
        (self.bytes.len() as u64).saturating_mul(READING_FACTOR)
    }

    /// Reads it as one mesh.
    pub fn read(&self, limits: &Limits) -> Result<(Format, TriangleSoup), MeshError> {
        let companions = self.companions();
        crate::mesh::read(&self.source(&companions), limits)
    }

    /// Samples poses of an animated glTF.
    pub fn read_poses(&self, poses: usize, limits: &Limits) -> Result<(Format, Vec<Pose>), MeshError> {
        let companions = self.companions();
        crate::mesh::read_poses(&self.source(&companions), poses, limits)
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
