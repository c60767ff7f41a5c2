//! Why a job could not be queued, found or stopped.

use crate::model::{JobId, JobState};
use crate::store::StoreError;

/// The job queue's errors.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JobError {
    /// The queue is as long as it may be.
    #[error("{limit} jobs are waiting, as many as may; try again when some are done")]
    QueueFull {
        /// The longest the queue may be.
        limit: usize,
    },
    /// There is no such job.
    #[error("there is no job {id}")]
    NoJob {
        /// The identifier asked for.
        id: JobId,
    },
    /// The job ended already, so it cannot be cancelled.
    #[error("job {id} has {} already", state.name())]
    Finished {
        /// The job.
        id: JobId,
        /// How it ended.
        state: JobState,
    },
    /// The store as a whole is to be changed, and jobs are in the way.
    #[error("{jobs} jobs wait or run; wait for them or cancel them first")]
    Unfinished {
        /// How many.
        jobs: usize,
    },
    /// The store as a whole is being changed.
    #[error("a snapshot is being restored; try again when it is done")]
    Paused,
    /// The parameters of the job are not usable.
    #[error(transparent)]
    Parameter(#[from] shapelex_core::parameters::ParameterError),
    /// The service is going down.
    #[error("the service is shutting down")]
    ShuttingDown,
    /// The worker could not be started.
    #[error("the indexing worker could not be started: {detail}")]
    NoWorker {
        /// The failure.
        detail: String,
    },
    /// The store failed.
    #[error(transparent)]
    Store(StoreError),
}

impl From<StoreError> for JobError {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::NoJob { id } => Self::NoJob { id },
            other => Self::Store(other),
        }
    }
}
