//! Why coding or learning failed.

use crate::cancel::Cancelled;

/// Why signatures could not be coded or a dictionary not be learnt.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CodingError {
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Signatures and dictionary have different lengths M.
    #[error("signatures have {signature} values, the dictionary's atoms {atoms}")]
    DimensionMismatch {
        /// M of the signatures.
        signature: usize,
        /// M of the atoms.
        atoms: usize,
    },
    /// Nothing to learn from.
    #[error("there are no signatures to learn a dictionary from")]
    NoSignatures,
    /// A parameter is outside its range.
    #[error("{name} must be {expected}, got {found}")]
    BadParameter {
        /// The parameter.
        name: &'static str,
        /// Its range.
        expected: &'static str,
        /// The value given.
        found: String,
    },
    /// The data holds NaN or infinity.
    #[error("the {what} holds a value that is not finite")]
    NotFinite {
        /// Which matrix or value.
        what: &'static str,
    },
    /// A Lasso did not meet its optimality conditions within its step limit.
    #[error("the Lasso of signal {signal} did not converge (KKT violation {violation:e})")]
    NotConverged {
        /// The signal, from 0.
        signal: usize,
        /// How far the optimality conditions are missed.
        violation: f64,
    },
}
