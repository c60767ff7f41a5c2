//! Ceilings checked before anything is allocated.

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
