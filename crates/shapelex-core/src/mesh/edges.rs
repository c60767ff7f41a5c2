//! Undirected edges of a triangle list, sorted by how many faces meet there.

use super::components::DisjointSets;
use super::sort::sort;
use super::work::{Unwatched, Watch, Work};
use super::{MeshError, TriMesh};
use crate::cancel::Cancel;
use crate::memory::Reservation;

/// Half-edges at one vertex from which on their sort is one that can be stopped.
const LARGE_BUCKET: usize = 1 << 16;

/// The edges where a triangle list is not an oriented surface without boundary.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EdgeCensus {
    /// Edges of exactly one face, in that face's direction, ascending by (smaller, larger) index.
    pub boundary: Vec<[u32; 2]>,
    /// Number of edges with more than two faces.
    pub non_manifold: usize,
    /// Number of edges whose two faces run through them the same way.
    pub inconsistent: usize,
}

/// How many edges there are of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct EdgeCounts {
    /// Edges in all.
    pub edges: usize,
    /// Edges with one face.
    pub boundary: usize,
    /// Edges with more than two faces.
    pub non_manifold: usize,
    /// Edges whose two faces run through them the same way.
    pub inconsistent: usize,
    /// Vertices at which more than two boundary edges meet, and edges with more than two faces: where the mesh is no
    /// surface.
    pub irregular: usize,
}

/// Half-edges grouped by edge: calls `visit(smaller, larger, group)` once per undirected edge, in ascending order.
///
/// An entry of `group` is a half-edge `3 · face + corner` that runs from the corner to the next one, shifted left by
/// one; the low bit is set where it runs from the larger to the smaller index. Within a group entries ascend by face.
/// There are at most 2³² / 6 faces, far above what any reader takes.
///
/// Half-edges are bucketed by the smaller index and each bucket is sorted, so the cost is linear for bounded degree
/// and n log n at worst. It takes 4 bytes for each vertex and 24 for each face, 16 more where all faces are at one.
///
/// # Errors
/// Those of the watch.
pub(super) fn for_each_edge<W: Watch>(
    vertex_count: usize,
    faces: &[[u32; 3]],
    watch: &W,
    mut visit: impl FnMut(u32, u32, &[u32]),
) -> Result<(), W::Error> {
    let _held = (watch.hold(vertex_count, 4)?, watch.hold(faces.len(), 24)?);
    debug_assert!(faces.len() <= (u32::MAX / 6) as usize);
    // Counted two places up and filled one place up, so that in the end `start[v]` is where the bucket of v starts.
    let mut start = vec![0u32; vertex_count + 2];
    for (f, face) in faces.iter().enumerate() {
        watch.look(f)?;
        for k in 0..3 {
            start[face[k].min(face[(k + 1) % 3]) as usize + 2] += 1;
        }
    }
    for v in 1..=vertex_count {
        start[v + 1] += start[v];
    }
    // The larger index above, the half-edge below: half the memory of a pair, and one comparison.
    let mut entries = vec![0u64; 3 * faces.len()];
    for (f, face) in faces.iter().enumerate() {
        watch.look(f)?;
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            let slot = &mut start[a.min(b) as usize + 1];
            let half_edge = ((3 * f + k) as u32) << 1 | u32::from(a > b);
            entries[*slot as usize] = u64::from(a.max(b)) << 32 | u64::from(half_edge);
            *slot += 1;
        }
    }
    let mut group = Vec::new();
    for v in 0..vertex_count {
        watch.look(v)?;
        let (from, to) = (start[v] as usize, start[v + 1] as usize);
        watch.pass(from, to)?;
        let bucket = &mut entries[from..to];
        if bucket.len() < LARGE_BUCKET {
            bucket.sort_unstable();
        } else {
            sort(bucket, watch)?;
        }
        for (n, run) in bucket.chunk_by(|x, y| x >> 32 == y >> 32).enumerate() {
            watch.look(n + 1)?;
            group.clear();
            group.extend(run.iter().map(|e| *e as u32));
            visit(v as u32, (run[0] >> 32) as u32, &group);
        }
    }
    Ok(())
}

/// Counts the edges of `faces` by kind; indices must be below `vertex_count`.
pub fn edge_census(vertex_count: usize, faces: &[[u32; 3]]) -> EdgeCensus {
    let mut census = EdgeCensus::default();
    let Ok(()) = for_each_edge(vertex_count, faces, &Unwatched, |a, b, group| {
        census.add(a, b, group)
    });
    census
}

/// As [`edge_census`], until it is stopped.
pub(super) fn edge_census_within(
    vertex_count: usize,
    faces: &[[u32; 3]],
    work: Work,
) -> Result<EdgeCensus, MeshError> {
    let mut census = EdgeCensus::default();
    let mut boundary = 0;
    for_each_edge(vertex_count, faces, &work, |_, _, group| {
        boundary += usize::from(group.len() == 1);
    })?;
    let _boundary = work.hold(boundary, size_of::<[u32; 2]>())?;
    census.boundary.reserve_exact(boundary);
    for_each_edge(vertex_count, faces, &work, |a, b, group| census.add(a, b, group))?;
    Ok(census)
}

/// Counts edges without a list of them.
pub(super) fn count_edges(
    vertex_count: usize,
    faces: &[[u32; 3]],
    work: Work,
) -> Result<EdgeCounts, MeshError> {
    let _held = work.hold(vertex_count, 1)?;
    let mut counts = EdgeCounts::default();
    let mut borders = vec![0u8; vertex_count];
    for_each_edge(vertex_count, faces, &work, |a, b, group| {
        counts.edges += 1;
        match group {
            [_] => {
                counts.boundary += 1;
                for v in [a, b] {
                    borders[v as usize] = borders[v as usize].saturating_add(1);
                }
            }
            [x, y] => counts.inconsistent += usize::from(x & 1 == y & 1),
            _ => counts.non_manifold += 1,
        }
    })?;
    counts.irregular = borders.iter().filter(|&&b| b > 2).count() + counts.non_manifold;
    Ok(counts)
}

/// How many changes a mesh is away from a surface that can be drawn in the plane: its handles, the edges of more than two
/// faces, and the vertices at which more than two boundary edges meet. The square root of it bounds how large the separators
/// of the mesh are, and so what a factor of its Laplacian takes.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub fn separator_excess(mesh: &TriMesh, cancel: &Cancel, memory: &Reservation) -> Result<usize, MeshError> {
    let work = Work { cancel, memory };
    let (v, f) = (mesh.vertices().len(), mesh.faces().len());
    let counts = count_edges(v, mesh.faces(), work)?;
    let _sets = work.hold(v, 4)?;
    let mut sets = DisjointSets::new(v);
    for (i, face) in mesh.faces().iter().enumerate() {
        work.look(i)?;
        sets.union(face[0], face[1]);
        sets.union(face[0], face[2]);
    }
    let parts = (0..v as u32).filter(|x| sets.find(*x) == *x).count();
    // Half of 2 − χ for each part: a hole in the surface counts as half a handle.
    let handles = (2 * parts + counts.edges).saturating_sub(v + f) / 2;
    Ok(handles + counts.irregular)
}

impl EdgeCensus {
    fn add(&mut self, a: u32, b: u32, group: &[u32]) {
        match group {
            [only] => self.boundary.push(if only & 1 == 0 { [a, b] } else { [b, a] }),
            [x, y] => self.inconsistent += usize::from(x & 1 == y & 1),
            _ => self.non_manifold += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_boundary_non_manifold_and_inconsistent_edges() {
        // Three faces on the edge 0–1; the third and the fourth share the edge 1–4 in the same direction.
        let faces = [[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 4, 5]];
        let census = edge_census(6, &faces);
        assert_eq!(census.non_manifold, 1);
        assert_eq!(census.inconsistent, 1);
        assert_eq!(
            census.boundary,
            vec![[2, 0], [0, 3], [4, 0], [1, 2], [3, 1], [5, 1], [4, 5]]
        );
    }

    #[test]
    fn a_closed_oriented_surface_has_none_of_them() {
        let tetrahedron = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
        assert_eq!(edge_census(4, &tetrahedron), EdgeCensus::default());
    }
}
