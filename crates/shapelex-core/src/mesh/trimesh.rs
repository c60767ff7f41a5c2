//! A triangle mesh that is valid by construction.

use super::MeshError;

/// A triangle mesh the spectral work can rely on.
///
/// Invariants, checked by [`TriMesh::new`]: at least four vertices, at least two faces, finite coordinates, every
/// index in range, no face with a repeated vertex, every vertex used by a face, positive total area.
///
/// The first [`signature_vertices`](TriMesh::signature_vertices) vertices carry signatures; those after them were
/// added to close small holes and only shape the operator.
#[derive(Clone, Debug, PartialEq)]
pub struct TriMesh {
    vertices: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    signature_vertices: usize,
    area: f64,
}

impl TriMesh {
    /// Checks the invariants and takes the arrays. `signature_vertices` is at most the number of vertices.
    pub fn new(
        vertices: Vec<[f64; 3]>,
        faces: Vec<[u32; 3]>,
        signature_vertices: usize,
    ) -> Result<Self, MeshError> {
        let n = vertices.len();
        if n < 4 || faces.len() < 2 {
            return Err(MeshError::TooSmall {
                vertices: n,
                faces: faces.len(),
            });
        }
        if let Some(v) = vertices.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(MeshError::NotFinite { vertex: v });
        }
        let mut used = vec![false; n];
        for (i, f) in faces.iter().enumerate() {
            for &k in f {
                let Some(slot) = used.get_mut(k as usize) else {
                    return Err(MeshError::IndexOutOfRange {
                        face: i,
                        index: i64::from(k),
                        vertices: n,
                    });
                };
                *slot = true;
            }
            if f[0] == f[1] || f[1] == f[2] || f[2] == f[0] {
                return Err(MeshError::Invalid {
                    detail: format!("face {i} repeats a vertex"),
                });
            }
        }
        if let Some(v) = used.iter().position(|u| !u) {
            return Err(MeshError::Invalid {
                detail: format!("vertex {v} belongs to no face"),
            });
        }
        let area = total_area(&vertices, &faces);
        if !(area > 0.0 && area.is_finite()) {
            return Err(MeshError::Degenerate);
        }
        Ok(Self {
            vertices,
            faces,
            signature_vertices: signature_vertices.min(n),
            area,
        })
    }

    /// V × 3 coordinates.
    pub fn vertices(&self) -> &[[f64; 3]] {
        &self.vertices
    }

    /// F × 3 vertex indices.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// How many vertices, counted from the first, carry signatures.
    pub fn signature_vertices(&self) -> usize {
        self.signature_vertices
    }

    /// Total surface area, in squared units of the coordinates.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// The area centroid μ = Σ_f w_f (a + b + c) / 3, where w_f is a face's share of the area.
    pub fn centroid(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let mut total = 0.0;
        for f in &self.faces {
            let area = face_area(&self.vertices, f);
            total += area;
            for v in f {
                for (s, x) in sum.iter_mut().zip(self.vertices[*v as usize]) {
                    *s += area / 3.0 * x;
                }
            }
        }
        sum.map(|s| s / total)
    }

    /// The same mesh moved and scaled to unit area, its area centroid at the origin.
    ///
    /// Errors: [`MeshError::Degenerate`] where the area is too small or too large for the scaled coordinates to be
    /// finite.
    pub fn normalised(mut self) -> Result<Self, MeshError> {
        let centroid = self.centroid();
        let scale = 1.0 / self.area.sqrt();
        for p in &mut self.vertices {
            for (x, c) in p.iter_mut().zip(centroid) {
                *x = (*x - c) * scale;
            }
        }
        let area = total_area(&self.vertices, &self.faces);
        if !(area > 0.5 && area < 2.0) {
            return Err(MeshError::Degenerate);
        }
        // One more step takes out the rounding of the first.
        let correction = 1.0 / area.sqrt();
        for x in self.vertices.iter_mut().flatten() {
            *x *= correction;
        }
        self.area = 1.0;
        Ok(self)
    }

    /// The mesh's arrays, given up.
    pub fn into_parts(self) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        (self.vertices, self.faces)
    }
}

fn total_area(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> f64 {
    faces.iter().map(|f| face_area(vertices, f)).sum()
}

/// Area of one face: half the length of the cross product of two edges.
pub fn face_area(vertices: &[[f64; 3]], face: &[u32; 3]) -> f64 {
    let [a, b, c] = face.map(|k| vertices[k as usize]);
    let u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    let v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
    let n = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    0.5 * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt()
}
