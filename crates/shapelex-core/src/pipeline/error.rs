//! Why a mesh's way to a ranking ended early.

use crate::cancel::Cancelled;
use crate::coding::CodingError;
use crate::memory::MemoryError;
use crate::mesh::MeshError;
use crate::parameters::ParameterError;
use crate::ranking::RankingError;
use crate::spectral::SpectralError;

/// The error of whichever stage failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PipelineError {
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(Cancelled),
    /// The bytes are no usable mesh.
    #[error(transparent)]
    Mesh(MeshError),
    /// The mesh has no usable spectrum.
    #[error(transparent)]
    Spectral(SpectralError),
    /// Coding or learning failed.
    #[error(transparent)]
    Coding(CodingError),
    /// The query could not be ranked.
    #[error(transparent)]
    Ranking(RankingError),
    /// A parameter is outside its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

impl From<Cancelled> for PipelineError {
    fn from(error: Cancelled) -> Self {
        Self::Cancelled(error)
    }
}

impl From<MeshError> for PipelineError {
    fn from(error: MeshError) -> Self {
        match error {
            MeshError::Cancelled(c) => Self::Cancelled(c),
            other => Self::Mesh(other),
        }
    }
}

impl From<MemoryError> for PipelineError {
    fn from(error: MemoryError) -> Self {
        Self::Mesh(error.into())
    }
}

impl From<SpectralError> for PipelineError {
    fn from(error: SpectralError) -> Self {
        match error {
            SpectralError::Cancelled(c) => Self::Cancelled(c),
            other => Self::Spectral(other),
        }
    }
}

impl From<CodingError> for PipelineError {
    fn from(error: CodingError) -> Self {
        match error {
            CodingError::Cancelled(c) => Self::Cancelled(c),
            other => Self::Coding(other),
        }
    }
}

impl From<RankingError> for PipelineError {
    fn from(error: RankingError) -> Self {
        match error {
            RankingError::Coding(c) => c.into(),
            other => Self::Ranking(other),
        }
    }
}
