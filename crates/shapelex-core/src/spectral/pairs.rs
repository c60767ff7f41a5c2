//! Eigenpairs of the normalised operator, as its solvers hand them on.

use super::residual::Check;
use super::rows::Rows;

/// Eigenpairs of S outside its null space.
pub struct Pairs {
    /// Ascending.
    pub values: Vec<f64>,
    /// n × k, rows by their places in S.
    pub vectors: Rows,
    pub check: Check,
}
