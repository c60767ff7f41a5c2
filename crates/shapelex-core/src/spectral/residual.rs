//! The check every answer passes before it is returned: residual of each pair, orthonormality of all.

use super::normalised::Normalised;
use super::rows::{BLOCK, Rows};
use super::simd::{Simd, dispatch, fused};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Random ±1 vectors used to estimate ‖XᵀX − I‖_F.
const PROBES: usize = 8;

/// What was found.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// Largest ‖Sx − λx‖ / λ over the eigenvalues above `floor`.
    pub residual: f64,
    /// Largest ‖Sx − λx‖ beyond what rounding of S explains, over max(λ, floor): what the tolerance is held against.
    pub excess: f64,
    /// Estimate of ‖XᵀX − I‖_F, the null space included.
    pub orthogonality: f64,
}

/// Measures the pairs: `x` is n × k, rows by their places in `s`.
///
/// In terms of φ = A^(-1/2) x the residual is ‖Wφ − λAφ‖_{A⁻¹} / (λ ‖φ‖_A). The Gram matrix itself would cost as much
/// as assembling the vectors; for random signs g, E‖(XᵀX − I) g‖² = ‖XᵀX − I‖_F² (Hutchinson 1990), and eight draws
/// find any defect to within a small factor.
pub fn check(s: &Normalised, values: &[f64], x: &Rows, floor: f64) -> Check {
    let k = values.len();
    let mut squares = vec![0.0; k];
    let mut row = vec![0.0; k];
    squared_residuals(Simd::detect(), s, values, x, &mut row, &mut squares);
    let rounding = 16.0 * f64::EPSILON * s.norm;
    let (mut residual, mut excess) = (0.0f64, 0.0f64);
    for (sum, &value) in squares.iter().zip(values) {
        let norm = sum.sqrt();
        if value > floor {
            residual = residual.max(norm / value);
        }
        excess = excess.max((norm - rounding) / value.max(floor));
        if !norm.is_finite() {
            return Check {
                residual: f64::INFINITY,
                excess: f64::INFINITY,
                orthogonality: f64::INFINITY,
            };
        }
    }
    Check {
        residual,
        excess,
        orthogonality: orthogonality(s, x),
    }
}

dispatch! {
    fn squared_residuals(
        s: &Normalised, values: &[f64], x: &Rows, row: &mut [f64], squares: &mut [f64],
    ) => squared_residuals_body
}

#[inline(always)]
fn squared_residuals_body<const FMA: bool>(
    s: &Normalised,
    values: &[f64],
    x: &Rows,
    row: &mut [f64],
    squares: &mut [f64],
) {
    for j in 0..s.n {
        for ((r, v), y) in row.iter_mut().zip(values).zip(x.row(j)) {
            *r = -v * y;
        }
        for (i, value) in s.column(j) {
            for (r, y) in row.iter_mut().zip(x.row(i)) {
                *r = fused::<FMA>(value, *y, *r);
            }
        }
        for (sum, r) in squares.iter_mut().zip(row.iter()) {
            *sum = fused::<FMA>(*r, *r, *sum);
        }
    }
}

fn orthogonality(s: &Normalised, x: &Rows) -> f64 {
    let k = x.width();
    let mut rng = ChaCha8Rng::seed_from_u64(0x0123_4567);
    let signs = Mat::<f64>::from_fn(k, PROBES, |_, _| if rng.random::<bool>() { 1.0 } else { -1.0 });
    let mut defect = signs.clone();
    // Against the null space: NᵀX g, one number per null vector and probe.
    let mut against_null = vec![0.0; s.null.count * PROBES];
    let mut y = [0.0; BLOCK * PROBES];
    for (block, names) in x.blocks() {
        let rows = names.len();
        let block = MatRef::from_row_major_slice(block, rows, k);
        let y = &mut y[..rows * PROBES];
        matmul(
            MatMut::from_row_major_slice_mut(y, rows, PROBES),
            Accum::Replace,
            block,
            signs.as_ref(),
            1.0,
            Par::Seq,
        );
        matmul(
            defect.as_mut(),
            Accum::Add,
            block.transpose(),
            MatRef::from_row_major_slice(y, rows, PROBES),
            -1.0,
            Par::Seq,
        );
        for (&i, row) in names.iter().zip(y.chunks_exact(PROBES)) {
            let label = s.null.label[i];
            if label != u32::MAX {
                for (sum, v) in against_null[label as usize * PROBES..].iter_mut().zip(row) {
                    *sum += s.null.entry[i] * v;
                }
            }
        }
    }
    let total = defect.squared_norm_l2() + 2.0 * against_null.iter().map(|v| v * v).sum::<f64>();
    (total / PROBES as f64).sqrt()
}
