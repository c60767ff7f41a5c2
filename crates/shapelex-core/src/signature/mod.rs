//! Eigenpairs → local signatures, one per vertex.

pub mod descriptor;
pub mod grid;
pub mod hks;
pub mod local;
pub mod normalise;
pub mod options;
pub mod sample;
pub mod si_hks;
pub mod spectrum;
pub mod wks;

pub use descriptor::{Descriptor, DescriptorParameters, describe_vertices};
pub use local::{LocalParameters, local_signatures};
pub use normalise::Normalisation;

use faer::Mat;

/// Signatures of N vertices, M values each: the signals that are coded.
#[derive(Clone, Debug)]
pub struct Signatures {
    /// M × N, one signature per column.
    pub matrix: Mat<f64>,
    /// N vertex indices of the prepared mesh, one per column.
    pub vertices: Vec<u32>,
}

impl Signatures {
    /// M, the length of a signature.
    pub fn dimension(&self) -> usize {
        self.matrix.nrows()
    }

    /// ‖S‖²_F, the sum of all squared values.
    pub fn energy(&self) -> f64 {
        self.matrix.squared_norm_l2()
    }

    /// N, the number of signatures.
    pub fn len(&self) -> usize {
        self.matrix.ncols()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
