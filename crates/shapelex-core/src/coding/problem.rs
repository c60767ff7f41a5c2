//! One Lasso: min ½‖s − Da‖² + λ‖a‖₁, with everything that its solvers share.

use super::dot::dot;
use super::rows::{Lanes, Rows};
use faer::MatRef;

/// One Lasso. Correlations and Gram matrix at single precision find the atoms that matter, and exact ones decide.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    /// D, M × L, columns contiguous.
    pub atoms: MatRef<'a, f64>,
    /// ‖d_j‖² of each atom.
    pub squares: &'a [f64],
    /// DᵀD, L × L, columns contiguous, where it is known.
    pub gram: Option<MatRef<'a, f64>>,
    /// DᵀD at single precision.
    pub rough_gram: &'a Rows,
    /// Bound on the error of its entries beyond their own rounding.
    pub rough_gram_error: f64,
    /// s, M values.
    pub signal: &'a [f64],
    /// ‖s‖.
    pub norm: f64,
    /// Dᵀs to within `error`, L values.
    pub rough_correlation: &'a [Lanes],
    pub error: f64,
    pub lambda: f64,
    /// How far |d_jᵀ(s − Da)| may exceed λ.
    pub tolerance: f64,
}

impl Problem<'_> {
    /// d_iᵀd_j.
    #[inline(always)]
    pub fn product(&self, i: usize, j: usize) -> f64 {
        match self.gram {
            Some(gram) => column(gram, j)[i],
            None => dot(column(self.atoms, i), column(self.atoms, j)),
        }
    }

    /// How far the gradient at single precision may be off under a code of so many non-zeros with so large a ‖a‖₁.
    #[inline(always)]
    pub fn gradient_error(&self, nonzeros: usize, norm1: f64) -> f64 {
        let terms = (nonzeros + 1) as f64;
        self.error
            + 4.0 * f64::from(f32::EPSILON) * terms.sqrt() * (self.norm + norm1)
            + self.rough_gram_error * norm1
    }
}

/// Column `j` of a column-major matrix.
#[inline(always)]
pub(super) fn column<T>(matrix: MatRef<'_, T>, j: usize) -> &[T] {
    // Callers make sure of the layout; an empty slice would be met by the checks of dimensions in front.
    matrix
        .col(j)
        .try_as_col_major()
        .map_or(&[], |column| column.as_slice())
}
