//! Undirected edges of a triangle list, sorted by how many faces meet there.

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

/// Half-edges grouped by edge: calls `visit(smaller, larger, group)` once per undirected edge, in ascending order.
///
/// An entry of `group` is a half-edge `3 · face + corner` that runs from the corner to the next one, shifted left by
/// one; the low bit is set where it runs from the larger to the smaller index. Within a group entries ascend by face.
/// There are at most 2³² / 6 faces, far above what any reader takes.
///
/// Half-edges are bucketed by the smaller index and each bucket is sorted, so the cost is linear for bounded degree
/// and n log n at worst.
pub(super) fn for_each_edge(
    vertex_count: usize,
    faces: &[[u32; 3]],
    mut visit: impl FnMut(u32, u32, &[u32]),
) {
    debug_assert!(faces.len() <= (u32::MAX / 6) as usize);
    let mut start = vec![0u32; vertex_count + 1];
    for face in faces {
        for k in 0..3 {
            start[face[k].min(face[(k + 1) % 3]) as usize + 1] += 1;
        }
    }
    for v in 0..vertex_count {
        start[v + 1] += start[v];
    }
    let mut next = start.clone();
    // The larger index above, the half-edge below: half the memory of a pair, and one comparison.
    let mut entries = vec![0u64; 3 * faces.len()];
    for (f, face) in faces.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            let slot = &mut next[a.min(b) as usize];
            let half_edge = ((3 * f + k) as u32) << 1 | u32::from(a > b);
            entries[*slot as usize] = u64::from(a.max(b)) << 32 | u64::from(half_edge);
            *slot += 1;
        }
    }
    drop(next);
    let mut group = Vec::new();
    for v in 0..vertex_count {
        let bucket = &mut entries[start[v] as usize..start[v + 1] as usize];
        bucket.sort_unstable();
        for run in bucket.chunk_by(|x, y| x >> 32 == y >> 32) {
            group.clear();
            group.extend(run.iter().map(|e| *e as u32));
            visit(v as u32, (run[0] >> 32) as u32, &group);
        }
    }
}

/// Counts the edges of `faces` by kind; indices must be below `vertex_count`.
pub fn edge_census(vertex_count: usize, faces: &[[u32; 3]]) -> EdgeCensus {
    let mut census = EdgeCensus::default();
    for_each_edge(vertex_count, faces, |a, b, group| match group {
        [only] => census.boundary.push(if only & 1 == 0 { [a, b] } else { [b, a] }),
        [x, y] => census.inconsistent += usize::from(x & 1 == y & 1),
        _ => census.non_manifold += 1,
    });
    census
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
