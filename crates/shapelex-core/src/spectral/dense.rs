//! The dense symmetric eigenproblem: small meshes, and the projected problem of the Lanczos recurrence.

use super::SpectralError;
use super::normalised::Normalised;
use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::{Mat, MatRef, Par};

/// All eigenpairs of a symmetric matrix, eigenvalues ascending, one eigenvector per column.
pub fn symmetric_eigen(matrix: MatRef<'_, f64>) -> Result<(Vec<f64>, Mat<f64>), SpectralError> {
    let n = matrix.nrows();
    let mut values = Diag::<f64>::zeros(n);
    let mut vectors = Mat::<f64>::zeros(n, n);
    let scratch = self_adjoint_evd_scratch::<f64>(n, ComputeEigenvectors::Yes, Par::Seq, Default::default());
    let mut memory = MemBuffer::try_new(scratch).map_err(|e| SpectralError::NotConverged {
        detail: format!("out of memory: {e:?}"),
    })?;
    self_adjoint_evd(
        matrix,
        values.as_mut(),
        Some(vectors.as_mut()),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    )
    .map_err(|e| SpectralError::NotConverged {
        detail: format!("dense eigen-solve: {e:?}"),
    })?;
    Ok(((0..n).map(|i| values[i]).collect(), vectors))
}

/// The `wanted` smallest eigenpairs of S outside its null space: values and n × wanted vectors, row by row.
///
/// The null vectors are first lifted to the top of the spectrum, S + 2‖S‖ N Nᵀ, so that they mix with nothing.
pub fn smallest(s: &Normalised, wanted: usize) -> Result<(Vec<f64>, Vec<f64>), SpectralError> {
    let mut matrix = Mat::<f64>::zeros(s.n, s.n);
    for j in 0..s.n {
        for (i, value) in s.column(j) {
            matrix[(i, j)] = value;
        }
    }
    let (label, entry) = (&s.null.label, &s.null.entry);
    for j in (0..s.n).filter(|&j| label[j] != u32::MAX) {
        let lift = 2.0 * s.norm * entry[j];
        for i in (0..s.n).filter(|&i| label[i] == label[j]) {
            matrix[(i, j)] += lift * entry[i];
        }
    }
    let (mut values, vectors) = symmetric_eigen(matrix.as_ref())?;
    values.truncate(wanted);
    let mut x = vec![0.0; s.n * wanted];
    for (i, row) in x.chunks_exact_mut(wanted.max(1)).enumerate() {
        for (k, slot) in row.iter_mut().enumerate() {
            *slot = vectors[(i, k)];
        }
    }
    Ok((values, x))
}
