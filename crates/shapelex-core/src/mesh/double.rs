//! The doubled hypothesis (docs/method.md#hypotheses): an open surface glued to its mirror image along the boundary.

use super::boundary::boundary_vertices;
use super::{MeshError, TriMesh};

/// Glues a mirrored copy of an open surface to it along the boundary; the result is closed and has unit area.
///
/// With V vertices of which B lie on the boundary the result has 2V − B vertices: the original's in their order,
/// then a copy of every vertex inside, in the same order. It has 2F faces: the original's, then the copies with
/// their direction reversed. Boundary vertices are shared; a copy stands at the same place as its original, since
/// only lengths within faces matter. Signatures are those of the original copy:
/// [`signature_vertices`](TriMesh::signature_vertices) stays what it was.
///
/// The spectrum of the result is the union of the open mesh's Neumann spectrum (functions even under the exchange
/// of the copies) and its Dirichlet spectrum (odd functions, zero on the [boundary](boundary_vertices)), masses
/// counted twice. Two solves on the open mesh give the same as one on this. A face with all three vertices on the
/// boundary appears twice, which is what makes this exact; it must not be dropped as a duplicate.
///
/// Errors: [`MeshError::Invalid`] for a closed surface, which has nothing to glue.
pub fn double(mesh: &TriMesh) -> Result<TriMesh, MeshError> {
    let on_boundary = boundary_vertices(mesh);
    if !on_boundary.contains(&true) {
        return Err(MeshError::Invalid {
            detail: "a closed surface has no boundary to glue a copy to".to_owned(),
        });
    }
    let mut vertices = mesh.vertices().to_vec();
    let mut copy = Vec::with_capacity(vertices.len());
    for (v, shared) in on_boundary.iter().enumerate() {
        if *shared {
            copy.push(v as u32);
        } else {
            copy.push(vertices.len() as u32);
            vertices.push(mesh.vertices()[v]);
        }
    }
    let mut faces = mesh.faces().to_vec();
    faces.extend(mesh.faces().iter().map(|f| {
        let [a, b, c] = f.map(|v| copy[v as usize]);
        [a, c, b]
    }));
    TriMesh::new(vertices, faces, mesh.signature_vertices())?.normalised()
}

#[cfg(test)]
mod tests {
    use super::super::edges::edge_census;
    use super::*;

    #[test]
    fn a_doubled_square_is_a_closed_pillow_of_unit_area() {
        let vertices = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.5, 0.5, 0.0],
        ];
        let faces = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        let open = TriMesh::new(vertices, faces, 4).unwrap();
        let closed = double(&open).unwrap();
        assert_eq!((closed.vertices().len(), closed.faces().len()), (6, 8));
        assert_eq!(closed.signature_vertices(), 4);
        assert!((closed.area() - 1.0).abs() < 1e-12);
        assert_eq!(edge_census(6, closed.faces()), Default::default());
        assert!(matches!(double(&closed), Err(MeshError::Invalid { .. })));
    }
}
