//! The n smallest eigenpairs of W φ = λ A φ (docs/method.md#eigenpairs).

use super::normalised::Normalised;
use super::rows::Rows;
use super::solve::{self, ZERO};
use super::{EigenOptions, Operators, SpectralError};
use crate::cancel::Cancel;
use faer::Mat;
use std::borrow::Cow;

/// Eigenpairs in ascending order.
#[derive(Clone, Debug)]
pub struct Eigenpairs {
    /// n eigenvalues, ascending, those of constant functions exactly 0.
    pub values: Vec<f64>,
    /// V × n eigenvectors, ΦᵀAΦ = I, one per column; the entry of largest magnitude is positive.
    pub vectors: Mat<f64>,
    /// Largest relative residual ‖Wφ − λAφ‖_{A⁻¹} / (λ ‖φ‖_A) over the non-zero eigenvalues, measured.
    pub residual: f64,
}

impl Eigenpairs {
    /// The first `n` of them; all where there are no more.
    pub fn first(&self, n: usize) -> Cow<'_, Self> {
        if n >= self.values.len() {
            return Cow::Borrowed(self);
        }
        Cow::Owned(Self {
            values: self.values[..n].to_vec(),
            vectors: self.vectors.subcols(0, n).to_owned(),
            residual: self.residual,
        })
    }
}

/// The `n` smallest eigenpairs; fewer (V − 1) where the mesh has no more.
///
/// Every connected component contributes one eigenvalue that is exactly 0, with its indicator function (scaled) for
/// an eigenvector; the others below 1e-9 of the largest are rounding and set to 0 too. Small problems are solved
/// densely, the rest by block Lanczos on a shifted inverse. Whatever the way, the residuals and the orthonormality of
/// the returned vectors are measured, and the sparse way also proves by an inertia count that none was missed.
///
/// # Errors
/// [`SpectralError::Cancelled`]; [`SpectralError::Factorisation`] if the operator is not finite;
/// [`SpectralError::NotConverged`] if no attempt passed the checks.
pub fn smallest_eigenpairs(
    operators: &Operators,
    n: usize,
    options: &EigenOptions,
    cancel: &Cancel,
) -> Result<Eigenpairs, SpectralError> {
    cancel.check()?;
    let s = Normalised::new(operators, None)?;
    let n = n.min(s.n.saturating_sub(1));
    eigenpairs_of(&s, n, options, cancel)
}

/// Peak memory of [`smallest_eigenpairs`] for a mesh of so many vertices, in bytes: for admission control, not exact.
pub fn estimated_bytes(vertices: usize, n: usize) -> usize {
    solve::estimated_bytes(vertices, n)
}

/// The `n` smallest eigenpairs of an operator, null space first; rows in the order of `s`.
pub(super) fn eigenpairs_of(
    s: &Normalised,
    n: usize,
    options: &EigenOptions,
    cancel: &Cancel,
) -> Result<Eigenpairs, SpectralError> {
    let zeros = s.null.count.min(n);
    let wanted = n - zeros;
    let mut values = vec![0.0; n];
    let pairs = match wanted {
        0 => None,
        _ => Some(solve::smallest(s, wanted, options, cancel)?),
    };
    // Not before the solve, whose basis takes as much memory again.
    let mut vectors = Mat::<f64>::zeros(s.n, n);
    for (i, &label) in s.null.label.iter().enumerate() {
        if (label as usize) < zeros {
            vectors[(i, label as usize)] = s.null.entry[i] * s.inv_sqrt_mass[i];
        }
    }
    let mut residual = 0.0;
    if let Some(pairs) = pairs {
        let floor = ZERO * pairs.values[wanted - 1];
        for (slot, &value) in values[zeros..].iter_mut().zip(&pairs.values) {
            *slot = if value > floor { value } else { 0.0 };
        }
        let signs = signs(s, &pairs.vectors);
        // From rows to columns in tiles that stay in the first-level cache.
        const TILE: usize = 16;
        for first in (0..s.n).step_by(TILE) {
            let tile = first..s.n.min(first + TILE);
            let rows: [&[f64]; TILE] = std::array::from_fn(|t| {
                if first + t < s.n {
                    pairs.vectors.row(first + t)
                } else {
                    &[]
                }
            });
            let scales = &s.inv_sqrt_mass[tile.clone()];
            for (k, sign) in signs.iter().enumerate() {
                let column = vectors.col_mut(zeros + k).subrows_mut(first, tile.len());
                for ((slot, row), scale) in column.iter_mut().zip(&rows).zip(scales) {
                    *slot = sign * row[k] * scale;
                }
            }
        }
        residual = pairs.check.residual;
    }
    Ok(Eigenpairs {
        values,
        vectors,
        residual,
    })
}

/// ±1 per column, so that the entry of φ of largest magnitude (the first of equals) becomes positive.
fn signs(s: &Normalised, x: &Rows) -> Vec<f64> {
    let mut largest = vec![0.0f64; x.width()];
    for (i, scale) in s.inv_sqrt_mass.iter().enumerate() {
        for (best, v) in largest.iter_mut().zip(x.row(i)) {
            let v = v * scale;
            // A hair of preference for the earlier vertex keeps symmetric shapes from flipping on rounding.
            if v.abs() > best.abs() * (1.0 + 1e-6) {
                *best = v;
            }
        }
    }
    largest
        .iter()
        .map(|v| if *v < 0.0 { -1.0 } else { 1.0 })
        .collect()
}
