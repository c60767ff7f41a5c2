//! The durable job queue and the indexing worker. CONTRACT STAGE.

pub mod error;

pub use error::JobError;

use crate::mesh::Limits;
use crate::model::*;
use crate::ranking::Index;
use crate::store::{Store, StoreError};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;

/// How jobs are run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobOptions {
    /// Threads of the indexing pool.
    pub indexing_threads: usize,
    /// Jobs that may wait.
    pub queue_limit: usize,
    /// What reading a shape's file may build.
    pub limits: Limits,
}

impl Default for JobOptions {
    /// One thread less than there are cores, at least one; 1000 waiting jobs; the default limits.
    fn default() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Self {
            indexing_threads: cores.saturating_sub(1).max(1),
            queue_limit: 1000,
            limits: Limits::default(),
        }
    }
}

/// The index queries run against. A query holds the one it began with, whatever is switched in meanwhile.
#[derive(Clone, Debug)]
pub struct LiveIndex {
    /// `None` before the first reindex; the index is empty then.
    pub generation: Option<Generation>,
    /// Its dictionaries in memory. A class's label is its [`ClassId`] as text, a shape's its [`ShapeId`].
    pub index: Index,
}

/// The job queue with its worker and the live index. Cheap to clone; every clone is the same queue.
#[derive(Clone)]
pub struct Jobs(Arc<()>);

const STUB: fn() -> JobError = || {
    JobError::Store(StoreError::ReadOnly {
        why: "not yet".into(),
    })
};

#[allow(missing_docs, unused_variables)]
impl Jobs {
    /// Loads the live index, queues interrupted jobs again and starts the worker.
    pub fn start(store: Store, options: JobOptions) -> Result<Self, JobError> {
        Err(STUB())
    }
    pub fn enqueue(&self, kind: JobKind) -> Result<Job, JobError> {
        Err(STUB())
    }
    pub fn job(&self, id: JobId) -> Result<Job, JobError> {
        Err(STUB())
    }
    /// Newest first, those older than `before`, at most `limit`.
    pub fn list(&self, before: Option<JobId>, limit: usize) -> Result<Vec<Job>, JobError> {
        Err(STUB())
    }
    pub fn cancel(&self, id: JobId) -> Result<Job, JobError> {
        Err(STUB())
    }
    /// The job as it changes; the channel closes after the final state.
    pub fn subscribe(&self, id: JobId) -> Result<watch::Receiver<Job>, JobError> {
        Err(STUB())
    }
    /// Never blocks.
    pub fn live_index(&self) -> Arc<LiveIndex> {
        Arc::new(LiveIndex {
            generation: None,
            index: Index {
                parameters: crate::parameters::Parameters::default(),
                classes: Vec::new(),
            },
        })
    }
    /// Jobs waiting or being worked on.
    pub fn queue_depth(&self) -> usize {
        0
    }
    /// Whether the worker thread is alive; readiness asks.
    pub fn is_running(&self) -> bool {
        false
    }
    /// Stops the worker; a running job goes back to the queue. Blocks up to the deadline; true if the worker ended.
    pub fn shutdown(&self, deadline: Duration) -> bool {
        true
    }
}
