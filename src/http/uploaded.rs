//! A mesh as it was sent, and the buffers a glTF finds beside it.

use crate::mesh::gltf::external_buffers;
use crate::mesh::{Companion, Format, MeshError, Pose, ReadContext, Source, TriangleSoup};
use bytes::Bytes;
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
    pub fn read(&self, context: &ReadContext) -> Result<(Format, TriangleSoup), MeshError> {
        let companions = self.companions();
        crate::mesh::read_within(&self.source(&companions), context)
    }

    /// Samples poses of an animated glTF.
    pub fn read_poses(&self, poses: usize, context: &ReadContext) -> Result<(Format, Vec<Pose>), MeshError> {
        let companions = self.companions();
        crate::mesh::read_poses_within(&self.source(&companions), poses, context)
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

    /// The buffers a glTF refers to, as far as they came along, each once. They share the request's bytes.
    ///
    /// A buffer is looked for from the mesh's own folder or, since browsers send names without folders, by its last
    /// part alone.
    pub fn companions(&self) -> Vec<Companion> {
        if self.buffers.is_empty() {
            return Vec::new();
        }
        let folder = self.name.rsplit_once('/').map_or("", |(folder, _)| folder);
        external_buffers(&self.bytes)
            .into_iter()
            .filter_map(|uri| {
                let part = uri.find(folder, &self.buffers, |part| &part.name, |part| !part.packed)?;
                Some(Companion::new(uri.path(), part.bytes.clone()))
            })
            .collect()
    }
}
