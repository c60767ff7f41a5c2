//! When a code is optimal, and how far a code is from it.
//!
//! a minimises ½‖s − Da‖² + λ‖a‖₁ if and only if, with q = Dᵀ(s − Da), q_j = λ sign(a_j) where a_j ≠ 0 and |q_j| ≤ λ
//! elsewhere.

use super::{Codes, CodingError, Dictionary};
use faer::MatRef;

/// The largest violation of the optimality conditions over all atoms: max of |q_j − λ sign(a_j)| where a_j ≠ 0 and of
/// |q_j| − λ elsewhere, for every signal (column of `signals`, M × N). The residual is formed in full, so the check
/// shares nothing with the solver.
pub fn kkt_violation(
    dictionary: &Dictionary,
    signals: MatRef<'_, f64>,
    lambda: f64,
    codes: &Codes,
) -> Result<Vec<f64>, CodingError> {
    let atoms = dictionary.atoms();
    if signals.nrows() != atoms.nrows() || codes.objective.len() != signals.ncols() {
        return Err(CodingError::DimensionMismatch {
            signature: signals.nrows(),
            atoms: atoms.nrows(),
        });
    }
    let mut violations = Vec::with_capacity(signals.ncols());
    for i in 0..signals.ncols() {
        let mut residual = signals.col(i).to_owned();
        let mut code = vec![0.0; atoms.ncols()];
        for k in codes.offsets[i]..codes.offsets[i + 1] {
            let j = codes.atoms[k] as usize;
            code[j] = codes.values[k];
            residual -= faer::Scale(codes.values[k]) * atoms.col(j);
        }
        let gradient = atoms.transpose() * &residual;
        let violation = gradient
            .iter()
            .zip(&code)
            .map(|(q, a)| violation(*q, *a, lambda))
            .fold(0.0, f64::max);
        violations.push(violation);
    }
    Ok(violations)
}

/// By how much one atom violates the conditions.
pub(super) fn violation(gradient: f64, value: f64, lambda: f64) -> f64 {
    if value == 0.0 {
        gradient.abs() - lambda
    } else {
        (gradient - lambda * value.signum()).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::Cancel;
    use crate::coding::encode;
    use faer::Mat;

    #[test]
    fn a_wrong_code_is_found_out() {
        let dictionary = Dictionary::new(Mat::identity(3, 3)).unwrap();
        let signals = Mat::from_fn(3, 1, |i, _| i as f64);
        let mut codes = encode(&dictionary, signals.as_ref(), 0.25, &Cancel::new()).unwrap();
        assert!(kkt_violation(&dictionary, signals.as_ref(), 0.25, &codes).unwrap()[0] <= 1e-15);
        codes.values[0] += 0.125;
        assert_eq!(
            kkt_violation(&dictionary, signals.as_ref(), 0.25, &codes).unwrap(),
            [0.125]
        );
    }
}
