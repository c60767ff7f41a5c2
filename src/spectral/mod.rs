//! Mesh → cotangent stiffness and lumped mass → smallest eigenpairs.

pub mod eigen;
pub mod error;
pub mod laplacian;

pub use eigen::{EigenOptions, Eigenpairs, smallest_eigenpairs};
pub use error::SpectralError;
pub use laplacian::{Operators, assemble};
