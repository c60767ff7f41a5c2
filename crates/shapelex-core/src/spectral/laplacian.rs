//! The discrete Laplace-Beltrami operator (docs/method.md#laplacian).
//!
//! Cotangent weights (Pinkall and Polthier 1993) with natural boundary conditions and a lumped barycentric mass. An
//! edge shared by more than two faces sums the contributions of all of them: the result is symmetric and positive
//! semi-definite whatever the connectivity, because it is a sum of one such matrix per triangle. (The tufted cover of
//! Sharp and Crane 2020 would also give a maximum principle; nothing downstream needs one.)

use super::SpectralError;
use super::mollify::{EdgeLengths, intrinsic_triangle, mollification};
use crate::mesh::TriMesh;
use sprs::CsMat;

/// Stiffness and mass of a mesh with V vertices, dimensionless: the mass sums to 1 whatever the mesh's scale.
#[derive(Clone, Debug)]
pub struct Operators {
    /// Weak stiffness W, V × V, symmetric, positive semi-definite, rows summing to zero; both triangles stored (CSC).
    pub stiffness: CsMat<f64>,
    /// Lumped barycentric mass A, V entries, summing to 1.
    pub mass: Vec<f64>,
}

/// Assembles W and A.
///
/// Good meshes use the exact extrinsic cotangents; a mesh with a (nearly) degenerate triangle is mollified first, see
/// [`mollify`](super::mollify). Coordinates may be of any magnitude.
///
/// # Errors
/// [`SpectralError::Factorisation`] if an entry is not finite or a vertex has no mass, which takes edge lengths that
/// differ by more than double precision can hold.
pub fn assemble(mesh: &TriMesh) -> Result<Operators, SpectralError> {
    let points = rescaled(mesh.vertices());
    let corners = mesh.faces().iter().map(|f| f.map(|k| points[k as usize]));
    let lengths: Vec<EdgeLengths> = corners
        .clone()
        .map(|[a, b, c]| [norm(sub(c, b)), norm(sub(a, c)), norm(sub(b, a))])
        .collect();
    let epsilon = mollification(&lengths);
    let triangles: Vec<(f64, [f64; 3])> = if epsilon > 0.0 {
        lengths
            .iter()
            .map(|l| intrinsic_triangle(l.map(|x| x + epsilon)))
            .collect()
    } else {
        corners.map(extrinsic_triangle).collect()
    };
    let mass = lumped_mass(points.len(), mesh.faces(), &triangles)?;
    let stiffness = stiffness(points.len(), mesh.faces(), &triangles);
    if let Some(bad) = stiffness.data().iter().find(|w| !w.is_finite()) {
        return Err(SpectralError::Factorisation {
            detail: format!("a cotangent weight is {bad}"),
        });
    }
    Ok(Operators { stiffness, mass })
}

/// The vertices times a power of two that brings the largest coordinate near 1, so that no square overflows; exact.
fn rescaled(vertices: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let largest = vertices.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
    // Two half steps: the factor itself may lie outside the range of a double.
    let exponent = -(largest.log2().floor().clamp(-1073.0, 1023.0) as i32);
    let (first, second) = (2f64.powi(exponent / 2), 2f64.powi(exponent - exponent / 2));
    vertices.iter().map(|p| p.map(|x| x * first * second)).collect()
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// Area and cotangents from coordinates: cot = (u·v)/|u×v| at each corner, |u×v| = 2·area.
fn extrinsic_triangle([a, b, c]: [[f64; 3]; 3]) -> (f64, [f64; 3]) {
    let (ab, ac, bc) = (sub(b, a), sub(c, a), sub(c, b));
    let cross = [
        ab[1] * ac[2] - ab[2] * ac[1],
        ab[2] * ac[0] - ab[0] * ac[2],
        ab[0] * ac[1] - ab[1] * ac[0],
    ];
    let double_area = norm(cross);
    let cot = [dot(ab, ac), -dot(ab, bc), dot(ac, bc)].map(|d| d / double_area);
    (0.5 * double_area, cot)
}

/// A third of the incident areas per vertex, divided by the total.
fn lumped_mass(
    vertices: usize,
    faces: &[[u32; 3]],
    triangles: &[(f64, [f64; 3])],
) -> Result<Vec<f64>, SpectralError> {
    let mut mass = vec![0.0; vertices];
    for (face, (area, _)) in faces.iter().zip(triangles) {
        for &k in face {
            mass[k as usize] += area / 3.0;
        }
    }
    let total: f64 = mass.iter().sum();
    for (vertex, m) in mass.iter_mut().enumerate() {
        *m /= total;
        if !(m.is_normal() && *m > 0.0) {
            return Err(SpectralError::Factorisation {
                detail: format!("vertex {vertex} has no area"),
            });
        }
    }
    Ok(mass)
}

/// W from the cotangents of every face: half a cotangent to the edge opposite each corner.
fn stiffness(vertices: usize, faces: &[[u32; 3]], triangles: &[(f64, [f64; 3])]) -> CsMat<f64> {
    // Both directions of every half edge, grouped by column by counting.
    let mut first = vec![0usize; vertices + 1];
    for face in faces {
        for &k in face {
            first[k as usize + 1] += 2;
        }
    }
    for k in 0..vertices {
        first[k + 1] += first[k];
    }
    let mut next = first.clone();
    let mut entries = vec![(0u32, 0.0f64); first[vertices]];
    for (face, (_, cot)) in faces.iter().zip(triangles) {
        for k in 0..3 {
            let (i, j) = (face[(k + 1) % 3], face[(k + 2) % 3]);
            for (row, column) in [(i, j), (j, i)] {
                let slot = &mut next[column as usize];
                entries[*slot] = (row, -0.5 * cot[k]);
                *slot += 1;
            }
        }
    }
    let mut pointers = Vec::with_capacity(vertices + 1);
    let mut rows: Vec<usize> = Vec::with_capacity(7 * vertices);
    let mut values: Vec<f64> = Vec::with_capacity(7 * vertices);
    pointers.push(0);
    for column in 0..vertices {
        let start = rows.len();
        let bucket = &mut entries[first[column]..first[column + 1]];
        // By value too, so that W_ij and W_ji are summed in one order and come out bitwise equal.
        bucket.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut diagonal_at = None;
        for &(row, weight) in bucket.iter() {
            if diagonal_at.is_none() && row as usize > column {
                diagonal_at = Some(rows.len());
                rows.push(column);
                values.push(0.0);
            }
            if rows.len() > start && rows[rows.len() - 1] == row as usize {
                values[rows.len() - 1] += weight;
            } else {
                rows.push(row as usize);
                values.push(weight);
            }
        }
        let diagonal_at = diagonal_at.unwrap_or_else(|| {
            rows.push(column);
            values.push(0.0);
            rows.len() - 1
        });
        values[diagonal_at] = -values[start..].iter().sum::<f64>();
        pointers.push(rows.len());
    }
    CsMat::new_csc((vertices, vertices), pointers, rows, values)
}
