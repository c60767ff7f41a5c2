//! Mesh → signatures, for training shapes and for queries.

use super::PipelineError;
use crate::cancel::Cancel;
use crate::mesh::{PrepareReport, TriangleSoup};
use crate::parameters::Parameters;
use crate::ranking::View;

/// A stage of the data flow, announced as it begins so that a caller with a clock can time it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Bytes → soup.
    Read,
    /// Soup → clean mesh.
    Prepare,
    /// Mesh → stiffness and mass.
    Laplacian,
    /// Operators → eigenpairs.
    Eigenpairs,
    /// Eigenpairs → signals.
    Signatures,
    /// Signals → codes and ranking.
    Ranking,
}

impl Stage {
    /// The stage's name on the wire and in metrics.
    pub fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Prepare => "prepare",
            Self::Laplacian => "laplacian",
            Self::Eigenpairs => "eigenpairs",
            Self::Signatures => "signatures",
            Self::Ranking => "ranking",
        }
    }
}

/// Everything a shape's coding needs.
#[derive(Clone, Debug)]
pub struct Description {
    /// The ways the shape is seen. For a training shape one per channel; the first is always plain.
    pub views: Vec<View>,
    /// What preparing did.
    pub report: PrepareReport,
    /// The first eigenvalues of the plain view (up to 20), dimensionless.
    pub eigenvalues: Vec<f64>,
}

/// Describes a training shape: one view per channel of the parameters, `samples_per_shape` signatures each.
pub fn describe_shape(
    _soup: TriangleSoup,
    _parameters: &Parameters,
    _cancel: &Cancel,
    _observer: &dyn Fn(Stage),
) -> Result<Description, PipelineError> {
    Err(crate::mesh::MeshError::Degenerate.into())
}

/// Describes a query: one view per hypothesis (an open surface's doubling gives one per assumed area),
/// `query_samples` signatures each.
pub fn describe_query(
    _soup: TriangleSoup,
    _parameters: &Parameters,
    _cancel: &Cancel,
    _observer: &dyn Fn(Stage),
) -> Result<Description, PipelineError> {
    Err(crate::mesh::MeshError::Degenerate.into())
}
