//! `KHR_draco_mesh_compression`: the triangles and attributes of a primitive as a Draco stream.
//!
//! The decoder has no unsafe code and takes ceilings for what a stream may become. They follow what the primitive's
//! accessors declare, which is known before anything is decoded.

use super::document::Document;
use super::schema;
use crate::memory::Held;
use crate::mesh::MeshError;
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};

/// Bytes the decoder takes per face while it works, at most: corners, their opposites, the traversal.
const BYTES_PER_FACE: u64 = 80;
/// Bytes of all attributes of a vertex, at most: positions, normals, tangents, joints, weights, colours and a few sets
/// of texture coordinates.
const BYTES_PER_VERTEX: u64 = 160;
/// Steps of decoding a face.
const STEPS_PER_FACE: u64 = 160;

/// What a primitive declares about its stream.
pub(super) struct Declared {
    pub faces: usize,
    pub vertices: usize,
}

/// A decoded stream.
pub(super) struct Decoded<'s> {
    mesh: Mesh,
    _memory: Held<'s>,
}

/// A tenth more than is declared, since streams may split vertices at seams.
fn with_room(declared: usize) -> usize {
    declared.saturating_add(declared / 8).saturating_add(4096)
}

impl<'s> Decoded<'s> {
    /// Decodes a stream within what is declared about it.
    pub fn open(
        document: &'s Document<'_>,
        draco: &schema::Draco,
        declared: &Declared,
    ) -> Result<Self, MeshError> {
        document.limits.check_faces(declared.faces)?;
        document.limits.check_vertices(declared.vertices)?;
        let stream = document.view(draco.buffer_view.value(), "a Draco stream")?.bytes;
        let (faces, vertices) = (with_room(declared.faces), with_room(declared.vertices));
        let bytes = (vertices as u64).saturating_mul(BYTES_PER_VERTEX);
        let bytes = bytes.min(document.limits.max_bytes as u64 / 2);
        let memory = document
            .context
            .memory
            .hold(bytes.saturating_add(faces as u64 * BYTES_PER_FACE))?;
        let steps = declared.faces.saturating_add(declared.vertices);
        document
            .work
            .spend(steps, STEPS_PER_FACE, "steps of decoding its Draco streams")?;
        document
            .work
            .spend(stream.len(), 20, "steps of decoding its Draco streams")?;
        let limits = DecodeLimits::default()
            .with_max_faces(faces as u64)
            .with_max_points(vertices as u64)
            .with_max_decoded_bytes(bytes);
        let mut mesh = Mesh::new();
        MeshDecoder::new()
            .decode(&mut DecoderBuffer::new(stream).with_limits(limits), &mut mesh)
            .map_err(|error| document.malformed(format!("Draco compression: {error}")))?;
        if mesh.num_points() > vertices {
            return Err(document.malformed(format!(
                "Draco compression: the stream has {} vertices, its accessor declares {}",
                mesh.num_points(),
                declared.vertices
            )));
        }
        document.work.spend(0, 0, "steps of decoding its Draco streams")?;
        Ok(Self {
            mesh,
            _memory: memory,
        })
    }

    /// The triangles.
    pub fn faces(&self) -> Vec<[u32; 3]> {
        self.mesh
            .faces()
            .iter()
            .map(|face| face.map(|point| point.0))
            .collect()
    }

    /// How many vertices there are.
    pub fn vertices(&self) -> usize {
        self.mesh.num_points()
    }

    /// An attribute by the number the primitive gives, `components` numbers per vertex.
    pub fn attribute(
        &self,
        document: &Document<'_>,
        id: schema::Index,
        components: usize,
        what: &str,
    ) -> Result<Vec<f32>, MeshError> {
        let attribute = u32::try_from(id.value())
            .ok()
            .and_then(|id| self.mesh.attribute_by_unique_id(id))
            .filter(|attribute| usize::from(attribute.num_components()) >= components)
            .ok_or_else(|| {
                document.malformed(format!(
                    "Draco compression: the stream has no attribute {} for {what}",
                    id.value()
                ))
            })?;
        Ok(attribute.read_f32s(self.vertices(), components))
    }
}
