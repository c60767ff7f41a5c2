//! A mesh as it was sent, and the buffers a glTF finds beside it.

use super::problem::Problem;
use bytes::Bytes;
use shapelex_core::cancel::Cancel;
use shapelex_core::memory::Reservation;
use shapelex_core::mesh::gltf::external_buffers;
use shapelex_core::mesh::{Companion, Format, Limits, Pose, ReadContext, Source, TriangleSoup};
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

/// Bytes held per byte of the file while it is read, beside what the reader reserves for its arrays: small buffers and
/// the allocator's slack.
const READING_FACTOR: u64 = 1;

impl UploadedMesh {
    /// What reading it works within: the service's limits, until it is stopped, and memory for this step of the
    /// request's work.
    pub fn context(&self, limits: Limits, cancel: &Cancel) -> ReadContext {
        ReadContext {
            cancel: cancel.clone(),
            memory: Arc::new(self.memory.step()),
            ..ReadContext::new(limits)
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
            shapelex_core::mesh::read_within(&self.source(&companions), context)?
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
            shapelex_core::mesh::read_poses_within(&self.source(&companions), poses, context)?
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

/// Memory of a mesh as read, in bytes.
fn soup_bytes(soup: &TriangleSoup) -> u64 {
    (24 * soup.vertices.len() + 12 * soup.faces.len()) as u64
}
