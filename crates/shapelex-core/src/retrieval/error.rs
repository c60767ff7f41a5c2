//! Why a query has no answer.

use crate::cancel::Cancelled;
use crate::pipeline::PipelineError;
use crate::ranking::RankingError;

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum QueryError {
    /// No class can be compared with.
    #[error("the index is empty: no class has a dictionary yet")]
    EmptyIndex,
    /// The index has nothing that the baseline could compare with.
    #[error("the index has no shapes that this method could compare with")]
    NoBaselines,
    /// The query asks for the best ranking at its deadline, and no class was scored by then.
    #[error("no class was scored within the query's time")]
    NothingScored,
    /// A stage failed, or the query was cancelled.
    #[error(transparent)]
    Pipeline(PipelineError),
}

impl From<PipelineError> for QueryError {
    fn from(error: PipelineError) -> Self {
        match error {
            PipelineError::Ranking(RankingError::EmptyIndex) => Self::EmptyIndex,
            other => Self::Pipeline(other),
        }
    }
}

impl From<RankingError> for QueryError {
    fn from(error: RankingError) -> Self {
        PipelineError::from(error).into()
    }
}

impl QueryError {
    /// Whether the query was stopped by its flag.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Pipeline(PipelineError::Cancelled(Cancelled)))
    }
}
