//! Where edge collapses cost too much for what they give.

use super::edges::EdgeCounts;

/// Most pairs of faces at a vertex, summed over the vertices, that a call of the collapses may look at (see [`pairs`]).
/// It takes some tenths of a second at most; a vertex of 14 000 faces alone makes as many.
pub(super) const MOST_PAIRS: u64 = 200_000_000;

/// Share of the vertices that may lie where a mesh is no surface.
const IRREGULAR: f64 = 0.01;

/// Share of them above which the mesh is a surface hardly anywhere.
const NO_SURFACE: f64 = 0.5;

/// Σ deg(v)² over the vertices, deg(v) the number of faces at v: to tell borders from other edges, the collapses look
/// through all edges of a vertex for each of them. It is some 36 per vertex of a surface, but a hub of a million faces
/// makes 10¹².
pub(super) fn pairs(vertices: usize, corners: &[u32]) -> u64 {
    let mut degree = vec![0u64; vertices];
    for &v in corners {
        degree[v as usize] += 1;
    }
    degree.iter().map(|d| d * d).sum()
}

/// Whether hardly any collapse is possible while each round of looking for them is as long as on a surface: at many
/// vertices more than two border edges meet, or an edge has more than two faces.
pub(super) fn is_tangle(vertices: usize, edges: &EdgeCounts) -> bool {
    edges.irregular as f64 > IRREGULAR * vertices as f64
}

/// Whether a mesh is a surface hardly anywhere, so that collapses need not be tried.
pub(super) fn is_no_surface(vertices: usize, edges: &EdgeCounts) -> bool {
    edges.irregular as f64 > NO_SURFACE * vertices as f64
}
