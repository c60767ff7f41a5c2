//! The n smallest eigenpairs of W φ = λ A φ (method, step 3).

use super::{Operators, SpectralError};
use crate::cancel::Cancel;
use faer::Mat;
use serde::{Deserialize, Serialize};

/// How the eigen-solve is run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EigenOptions {
    /// Largest ‖Wφ − λAφ‖_{A⁻¹} / (λ ‖φ‖_A) accepted.
    pub tolerance: f64,
    /// Seed of the starting block.
    pub seed: u64,
}

impl Default for EigenOptions {
    /// Residual 1e-8, seed 1.
    fn default() -> Self {
        Self {
            tolerance: 1e-8,
            seed: 1,
        }
    }
}

/// Eigenpairs in ascending order.
#[derive(Clone, Debug)]
pub struct Eigenpairs {
    /// n eigenvalues, ascending, those of constant functions exactly 0.
    pub values: Vec<f64>,
    /// V × n eigenvectors, ΦᵀAΦ = I, one per column.
    pub vectors: Mat<f64>,
    /// Largest relative residual over the non-zero eigenvalues.
    pub residual: f64,
}

/// The `n` smallest eigenpairs; fewer (V − 1) where the mesh has no more.
pub fn smallest_eigenpairs(
    _operators: &Operators,
    _n: usize,
    _options: &EigenOptions,
    _cancel: &Cancel,
) -> Result<Eigenpairs, SpectralError> {
    Err(SpectralError::NotConverged {
        detail: "to be written".into(),
    })
}
