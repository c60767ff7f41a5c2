//! What a file says, before anything is cleaned.

/// Triangles as a file gave them: indices are in range and coordinates finite, nothing else is promised.
///
/// `vertices` is V rows of x, y, z in the file's own units and order; `faces` is F rows of indices into it, with
/// polygons already fan-triangulated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleSoup {
    /// V × 3 coordinates.
    pub vertices: Vec<[f64; 3]>,
    /// F × 3 vertex indices.
    pub faces: Vec<[u32; 3]>,
}
