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
    DimensionMismatch { signature: usize, atoms: usize },
    /// Nothing to learn from.
    #[error("there are no signatures to learn a dictionary from")]
    NoSignatures,
    /// A parameter is outside its range.
    #[error("{name} must be {expected}, got {found}")]
    BadParameter {
        name: &'static str,
        expected: &'static str,
        found: String,
    },
    /// The data holds NaN or infinity.
    #[error("the {what} holds a value that is not finite")]
    NotFinite { what: &'static str },
    /// A Lasso did not meet its optimality conditions within its step limit.
    #[error("the Lasso of signal {signal} did not converge (KKT violation {violation:e})")]
    NotConverged { signal: usize, violation: f64 },
}
