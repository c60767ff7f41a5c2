//! The discrete Laplace-Beltrami operator (method, step 2).

use super::SpectralError;
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
pub fn assemble(_mesh: &TriMesh) -> Result<Operators, SpectralError> {
    Err(SpectralError::Factorisation {
        detail: "to be written".into(),
    })
}
