//! The Lasso of every signal against one dictionary (docs/method.md#coding; Eq. 1).

use super::encoder::with_kept;
use super::prepared::Prepared;
use super::{CodeScore, Codes, CodingError, Dictionary, Signals};
use crate::cancel::Cancel;
use faer::MatRef;

/// Codes every column of `signals` (M × N): argmin_a ½‖s − D a‖² + λ‖a‖₁.
///
/// Exact up to rounding: an active set with a Cholesky factor ends at the optimality conditions, which hold to 1e-9 λ.
/// Each signal starts from nothing along the Lasso path and, where its code has many non-zeros, goes on from there at λ,
/// so a code does not depend on the other signals. An atom that is zero or a copy of another is harmless. λ above max |Dᵀs| gives
/// an empty code.
///
/// # Errors
/// [`CodingError::DimensionMismatch`] where M differs, [`CodingError::BadParameter`] where λ is not positive and
/// finite, [`CodingError::NotFinite`] for NaN or infinity in the signals, [`CodingError::Cancelled`], and
/// [`CodingError::NotConverged`] where neither the active set nor coordinate descent reached the conditions.
pub fn encode(
    dictionary: &Dictionary,
    signals: MatRef<'_, f64>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<Codes, CodingError> {
    encode_signals(dictionary, &Signals::new(signals)?, lambda, cancel)
}

/// As [`encode`], for signals made ready once and coded under many dictionaries.
pub fn encode_signals(
    dictionary: &Dictionary,
    signals: &Signals<'_>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<Codes, CodingError> {
    check(dictionary.dimension(), signals, lambda)?;
    encode_prepared(&dictionary.prepared(signals.len()), signals, lambda, cancel)
}

/// As [`encode_signals`], under atoms that are prepared already.
pub(super) fn encode_prepared(
    dictionary: &Prepared,
    signals: &Signals<'_>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<Codes, CodingError> {
    with_kept(|encoder| {
        encoder.run(dictionary, signals, lambda, cancel)?;
        Ok(encoder.codes())
    })
}

/// As [`encode_signals`], but keeps only what each signal cost: N scores in the order of the signals.
pub fn score_signals(
    dictionary: &Dictionary,
    signals: &Signals<'_>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<Vec<CodeScore>, CodingError> {
    check(dictionary.dimension(), signals, lambda)?;
    score_prepared(&dictionary.prepared(signals.len()), signals, lambda, cancel)
}

/// As [`score_signals`], under atoms that are prepared already.
pub(super) fn score_prepared(
    dictionary: &Prepared,
    signals: &Signals<'_>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<Vec<CodeScore>, CodingError> {
    with_kept(|encoder| {
        encoder.run(dictionary, signals, lambda, cancel)?;
        Ok(encoder.scores())
    })
}

fn check(dimension: usize, signals: &Signals<'_>, lambda: f64) -> Result<(), CodingError> {
    check_lambda(lambda)?;
    if signals.dimension() != dimension {
        return Err(CodingError::DimensionMismatch {
            signature: signals.dimension(),
            atoms: dimension,
        });
    }
    Ok(())
}

pub(super) fn check_lambda(lambda: f64) -> Result<(), CodingError> {
    if lambda > 0.0 && lambda.is_finite() {
        return Ok(());
    }
    Err(CodingError::BadParameter {
        name: "lambda",
        expected: "positive and finite",
        found: format!("{lambda}"),
    })
}
