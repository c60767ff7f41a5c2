//! The Lasso of every signal against one dictionary (method, step 6; Eq. 1).

use super::{CodingError, Dictionary};
use crate::cancel::Cancel;
use faer::MatRef;

/// Sparse codes of N signals under one dictionary of L atoms, and what they cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Codes {
    /// N + 1 offsets into `atoms` and `values`: the code of signal i is `offsets[i]..offsets[i + 1]`.
    pub offsets: Vec<usize>,
    /// Atom of each non-zero.
    pub atoms: Vec<u32>,
    /// Value of each non-zero.
    pub values: Vec<f64>,
    /// N values ½‖s − Da‖² + λ‖a‖₁.
    pub objective: Vec<f64>,
    /// N values ‖s − Da‖².
    pub residual2: Vec<f64>,
}

/// Codes every column of `signals` (M × N): argmin_a ½‖s − D a‖² + λ‖a‖₁, to its KKT conditions.
pub fn encode(
    _dictionary: &Dictionary,
    _signals: MatRef<'_, f64>,
    _lambda: f64,
    _cancel: &Cancel,
) -> Result<Codes, CodingError> {
    Err(CodingError::NoSignatures)
}
