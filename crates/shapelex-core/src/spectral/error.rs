//! Why a mesh has no usable spectrum.

use crate::cancel::Cancelled;

/// Why operators or eigenpairs could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpectralError {
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The stiffness matrix has an entry that is not finite, or could not be factorised.
    #[error("the Laplacian of this mesh cannot be factorised: {detail}")]
    Factorisation {
        /// Which step, and why.
        detail: String,
    },
    /// The residual or orthogonality check failed after every attempt.
    #[error("the eigen-solve did not reach the requested accuracy: {detail}")]
    NotConverged {
        /// Which check, and by how much.
        detail: String,
    },
    /// Too few different non-zero eigenvalues for a signature; `found` counts equal ones too.
    #[error("the mesh has {found} non-zero eigenvalues; at least {needed} that differ are needed")]
    TooFewEigenpairs {
        /// Non-zero eigenvalues, equal ones included.
        found: usize,
        /// How many that differ are needed.
        needed: usize,
    },
}
