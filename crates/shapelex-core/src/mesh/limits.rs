//! Ceilings checked before anything is allocated.

use super::MeshError;
use serde::{Deserialize, Serialize};

/// What a reader may build at most. A file whose header or counts promise more is refused before it is loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Largest number of vertices of one mesh.
    pub max_vertices: usize,
    /// Largest number of triangles of one mesh, after polygons are split.
    pub max_faces: usize,
    /// Largest number of bytes of one file, buffers of a glTF included.
    pub max_bytes: usize,
    /// Largest number of poses sampled from one animated file.
    pub max_poses: usize,
}

impl Default for Limits {
    /// 2 million vertices, 4 million faces, 256 MiB, 64 poses.
    fn default() -> Self {
        Self {
            max_vertices: 2_000_000,
            max_faces: 4_000_000,
            max_bytes: 256 << 20,
            max_poses: 64,
        }
    }
}

fn at_most(what: &'static str, found: usize, limit: usize) -> Result<(), MeshError> {
    if found > limit {
        return Err(MeshError::TooLarge { what, found, limit });
    }
    Ok(())
}

impl Limits {
    /// Refuses more vertices than allowed with [`MeshError::TooLarge`].
    pub fn check_vertices(&self, found: usize) -> Result<(), MeshError> {
        at_most("vertices", found, self.max_vertices)
    }

    /// Refuses more triangles than allowed with [`MeshError::TooLarge`].
    pub fn check_faces(&self, found: usize) -> Result<(), MeshError> {
        at_most("faces", found, self.max_faces)
    }

    /// Refuses more bytes than allowed with [`MeshError::TooLarge`].
    pub fn check_bytes(&self, found: usize) -> Result<(), MeshError> {
        at_most("bytes", found, self.max_bytes)
    }

    /// Refuses more poses than allowed with [`MeshError::TooLarge`].
    pub fn check_poses(&self, found: usize) -> Result<(), MeshError> {
        at_most("poses", found, self.max_poses)
    }
}
