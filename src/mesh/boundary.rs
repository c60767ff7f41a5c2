//! The boundary of a surface: which vertices lie on it, and how much of it there is.

use super::TriMesh;
use super::edges::edge_census;

/// Which vertices lie on the boundary: V flags, true for the ends of every edge with exactly one face.
///
/// These are the vertices a mirrored copy shares ([`double`](super::double::double)) and the ones a Dirichlet
/// problem on the same mesh sets to zero. All false for a closed surface.
pub fn boundary_vertices(mesh: &TriMesh) -> Vec<bool> {
    let mut on_boundary = vec![false; mesh.vertices().len()];
    for edge in edge_census(mesh.vertices().len(), mesh.faces()).boundary {
        for v in edge {
            on_boundary[v as usize] = true;
        }
    }
    on_boundary
}

/// Boundary length / √area: 0 for a closed surface, 2.507 for a half sphere, 8–16 for a single view of a shape.
pub fn openness(mesh: &TriMesh) -> f64 {
    let boundary = edge_census(mesh.vertices().len(), mesh.faces()).boundary;
    boundary_length(mesh.vertices(), &boundary) / mesh.area().sqrt()
}

/// Summed length of edges.
pub(super) fn boundary_length(vertices: &[[f64; 3]], edges: &[[u32; 2]]) -> f64 {
    // Folded from +0, as an empty float sum is −0.
    edges.iter().fold(0.0, |length, e| {
        length + distance(&vertices[e[0] as usize], &vertices[e[1] as usize])
    })
}

/// Euclidean distance of two points.
pub(super) fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_square_is_all_boundary_but_its_centre() {
        let vertices = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.5, 0.5, 0.0],
        ];
        let faces = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        let mesh = TriMesh::new(vertices, faces, 5).unwrap();
        assert_eq!(boundary_vertices(&mesh), [true, true, true, true, false]);
        assert!((openness(&mesh) - 4.0).abs() < 1e-12);
    }
}
