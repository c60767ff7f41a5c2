//! Mesh → cotangent stiffness and lumped mass → smallest eigenpairs.

pub mod doubled;
pub mod eigen;
pub mod error;
pub mod laplacian;
pub mod mollify;

mod band;
mod basis;
mod block_qr;
mod dense;
mod inverse_iteration;
mod lanczos;
mod loss;
mod near;
mod normalised;
pub mod options;
mod pairs;
mod parts;
mod residual;
mod rows;
mod scratch;
mod shift_invert;
mod simd;
mod solve;

pub use doubled::{dirichlet_eigenpairs, doubled_eigenpairs};
pub use eigen::{Eigenpairs, estimated_bytes, smallest_eigenpairs};
pub use error::SpectralError;
pub use laplacian::{Operators, assemble};
pub use options::EigenOptions;
