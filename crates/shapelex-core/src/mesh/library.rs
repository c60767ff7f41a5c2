//! What all calls of meshoptimizer have in common.

use super::MeshError;
use super::clean::{Cleaned, drop_unreferenced};
use super::work::Work;

/// No bound on the error: the target is a size.
pub(super) const ANY_ERROR: f32 = 1e3;

/// Bytes that a call of the collapses takes for each vertex and for each face.
pub(super) const COLLAPSE_BYTES: [usize; 2] = [150, 150];

/// Positions as the library takes them.
pub(super) fn single_precision(vertices: &[[f64; 3]]) -> Vec<[f32; 3]> {
    vertices.iter().map(|p| p.map(|x| x as f32)).collect()
}

/// Takes an index list over the mesh's own vertices as its faces.
pub(super) fn adopt(mesh: &mut Cleaned, indices: &[u32], work: Work) -> Result<(), MeshError> {
    mesh.faces = indices.chunks_exact(3).map(|f| [f[0], f[1], f[2]]).collect();
    drop_unreferenced(&mut mesh.vertices, &mut mesh.faces, work)
}
