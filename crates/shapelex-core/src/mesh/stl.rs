//! Stereolithography STL, binary and ascii.
//!
//! Both forms are read here. Normals, colours and attributes are passed over. An STL repeats each vertex in each of its
//! triangles; corners with the same coordinates become one vertex. (stl_io stops at the first `endsolid` of several,
//! and refuses `solid` without a name, capitals and the `nan` normals that exporters write for slivers; a test compares
//! the two on plain files.)

mod ascii;
mod binary;
mod corners;

use super::{MeshError, ReadContext, TriangleSoup};

pub(super) use ascii::is_text;
pub(super) use binary::is_binary;

/// Reads an STL file. Vertices are ordered by first use.
///
/// Errors: [`MeshError::Truncated`] when a binary file is shorter than its count demands or an ascii one ends within a
/// facet or without `endsolid`; [`MeshError::Malformed`] when a binary file goes on after its last triangle. Vertices
/// of [`MeshError::NotFinite`] are numbered after merging.
pub fn read(bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    if !is_binary(bytes) && ascii::begins_with_solid(bytes) {
        ascii::read(bytes, context)
    } else {
        binary::read(bytes, context)
    }
}
