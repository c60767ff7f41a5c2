//! The whitened hypothesis (docs/method.md#hypotheses): the representative of a shape's affine class whose second
//! moments are isotropic.

use super::trimesh::face_area;
use super::{MeshError, TriMesh};
use faer::{Mat, Side};

/// Iterations at most.
pub const ITERATIONS: usize = 30;

/// The fixed point is reached when the largest eigenvalue of C is below this times the smallest.
pub const ISOTROPIC: f64 = 1.0 + 1e-6;

/// Eigenvalues of C are floored at this share of the largest within one iteration.
pub const FLOOR: f64 = 1e-8;

/// A direction with less than this share of the largest second moment is rounding noise of a flat shape.
const FLAT: f64 = 1e-14;

/// Area-weighted second moments of a triangle list about its area centroid.
struct Moments {
    mean: [f64; 3],
    /// C = (1/12) Σ_f w_f (x₁x₁ᵀ + x₂x₂ᵀ + x₃x₃ᵀ + ssᵀ), 3 × 3.
    covariance: [[f64; 3]; 3],
}

/// Maps a mesh by v ← C^(−1/2) (v − μ) until its second moments are isotropic; the result has unit area.
///
/// μ is the area-weighted mean and C the exact covariance of the surface (not of the vertices): with x_k = v_k − μ,
/// s = x₁ + x₂ + x₃ and w_f a face's share of the area, C = (1/12) Σ_f w_f (x₁x₁ᵀ + x₂x₂ᵀ + x₃x₃ᵀ + ssᵀ). The
/// weights change with the map, so only the fixed point is the same, up to a rotation, for all affine images of a
/// shape. Iterated until the eigenvalues of C agree to 1e-6 or 30 times; eigenvalues are floored at 1e-8 of the
/// largest. Faces, order and signature vertices stay.
///
/// A flat shape has no third direction to stretch: a direction below 1e-14 of the largest moment is taken for
/// rounding and pressed to exactly zero, and the other two are whitened.
///
/// Errors: [`MeshError::Degenerate`] when the mapped mesh has no area.
pub fn whiten(mesh: &TriMesh) -> Result<TriMesh, MeshError> {
    let mesh = mesh.clone().normalised()?;
    let signature_vertices = mesh.signature_vertices();
    let (mut vertices, faces) = mesh.into_parts();
    for iteration in 0..=ITERATIONS {
        let moments = Moments::of(&vertices, &faces);
        let (values, vectors) = eigen(&moments.covariance)?;
        let largest = values[2];
        let flat = values[0] < FLAT * largest;
        let smallest = values[usize::from(flat)];
        let pressed = !flat || iteration > 0;
        if iteration == ITERATIONS || (pressed && largest < ISOTROPIC * smallest) {
            break;
        }
        let factor: [f64; 3] = std::array::from_fn(|k| {
            if k == 0 && flat {
                0.0
            } else {
                1.0 / values[k].max(FLOOR * largest).sqrt()
            }
        });
        // C^(−1/2) = U diag(factor) Uᵀ
        let map: [[f64; 3]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..3).map(|k| vectors[i][k] * factor[k] * vectors[j][k]).sum())
        });
        for p in &mut vertices {
            let x: [f64; 3] = std::array::from_fn(|k| p[k] - moments.mean[k]);
            *p = map.map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2]);
        }
    }
    TriMesh::new(vertices, faces, signature_vertices)?.normalised()
}

impl Moments {
    fn of(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Self {
        let areas: Vec<f64> = faces.iter().map(|f| face_area(vertices, f)).collect();
        let total: f64 = areas.iter().sum();
        let mut mean = [0.0; 3];
        for (f, area) in faces.iter().zip(&areas) {
            for v in f {
                for (m, x) in mean.iter_mut().zip(vertices[*v as usize]) {
                    *m += area / (3.0 * total) * x;
                }
            }
        }
        let mut covariance = [[0.0; 3]; 3];
        for (f, area) in faces.iter().zip(&areas) {
            let x = f.map(|v| {
                let p = vertices[v as usize];
                [p[0] - mean[0], p[1] - mean[1], p[2] - mean[2]]
            });
            let s: [f64; 3] = std::array::from_fn(|k| x[0][k] + x[1][k] + x[2][k]);
            let weight = area / (12.0 * total);
            for i in 0..3 {
                for j in 0..3 {
                    covariance[i][j] +=
                        weight * (x[0][i] * x[0][j] + x[1][i] * x[1][j] + x[2][i] * x[2][j] + s[i] * s[j]);
                }
            }
        }
        Self { mean, covariance }
    }
}

/// Eigenvalues of a symmetric 3 × 3 matrix, ascending, and its eigenvectors as columns.
fn eigen(c: &[[f64; 3]; 3]) -> Result<([f64; 3], [[f64; 3]; 3]), MeshError> {
    let matrix = Mat::<f64>::from_fn(3, 3, |i, j| c[i][j]);
    let eigen = matrix
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| MeshError::Degenerate)?;
    let values = std::array::from_fn(|k| eigen.S()[k].max(0.0));
    let vectors = std::array::from_fn(|i| std::array::from_fn(|k| eigen.U()[(i, k)]));
    Ok((values, vectors))
}
