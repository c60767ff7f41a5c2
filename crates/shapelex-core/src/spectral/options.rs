//! How the eigen-solve is run.

use serde::{Deserialize, Serialize};

/// How the eigen-solve is run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EigenOptions {
    /// Largest ‖Wφ − λAφ‖_{A⁻¹} / (λ ‖φ‖_A) accepted, beyond what rounding of the operator itself explains.
    pub tolerance: f64,
    /// Seed of the starting block.
    pub seed: u64,
}

impl Default for EigenOptions {
    /// Residual 1e-6, seed 1. Eigenvalues are then right to about the square of it.
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            seed: 1,
        }
    }
}
