//! What every handler shares.

use super::admission::{Compute, ComputeOptions};
use super::audit::Audit;
use super::auth;
use super::config::ServiceConfig;
use super::keyring::Keyring;
use super::limits::Limits;
use super::problem::Problem;
use super::{metrics, openapi, recovery_mode};
use crate::jobs::{JobError, Jobs};
use crate::memory::MemoryBudget;
use crate::store::{Health, Store, StoreError};
use std::net::SocketAddr;
use std::ops::Deref;
use std::sync::{Arc, Mutex};
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

/// Why the service did not start.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The data directory could not be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The job queue could not be started.
    #[error(transparent)]
    Jobs(#[from] JobError),
    /// The system gives no threads.
    #[error("the query threads could not be started: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// Anyone could use it.
    #[error(
        "listening on {listen} lets others in, and there is no API key yet; make one with `shapelex keys create admin \
         --scope admin --data {}`, or let everyone in with --allow-anonymous", data.display()
    )]
    Unguarded {
        /// Where it would listen.
        listen: SocketAddr,
        /// Its data directory.
        data: std::path::PathBuf,
    },
    /// The audit log cannot be written.
    #[error("the audit log could not be opened: {0}")]
    Audit(std::io::Error),
    /// The API's document could not be written.
    #[error("the OpenAPI document could not be written: {0}")]
    Document(String),
}

/// The service's parts. Cheap to clone; every clone is the same service.
#[derive(Clone)]
pub struct AppState(Arc<Parts>);

/// See [`AppState`].
pub struct Parts {
    /// The settings.
    pub config: ServiceConfig,
    /// Classes, shapes, generations.
    pub store: Store,
    /// The API keys.
    pub keys: Keyring,
    /// How much each key has used.
    pub limits: Limits,
    /// Who changed what.
    pub audit: Audit,
    /// Places for connections.
    pub connections: Arc<Semaphore>,
    /// The job queue and the live index.
    pub jobs: Jobs,
    /// Where requests compute.
    pub compute: Compute,
    /// Where their archives are unpacked: as many at a time as there are query threads, and not in a query's way.
    pub unpacking: Compute,
    /// What requests may take of the memory.
    pub memory: MemoryBudget,
    /// Held while a request reads the catalogue and then changes it by what it read.
    pub catalogue: Mutex<()>,
    /// Set when the service is asked to stop; open streams end then.
    pub stopping: CancellationToken,
    /// `openapi.yaml`.
    pub document_yaml: String,
    /// The same as JSON.
    pub document_json: String,
}

impl Deref for AppState {
    type Target = Parts;

    fn deref(&self) -> &Parts {
        &self.0
    }
}

/// What the service needs to answer, and whether it has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Readiness {
    /// Part → `None` where it is well, or what is wrong.
    pub checks: Vec<(&'static str, Option<String>)>,
}

impl Readiness {
    /// Whether everything is well.
    pub fn is_ready(&self) -> bool {
        self.checks.iter().all(|(_, wrong)| wrong.is_none())
    }
}

impl AppState {
    /// Opens the data directory and starts the worker. Blocks on the disk.
    ///
    /// # Errors
    /// [`OpenError`] where any part could not be started.
    pub fn open(config: ServiceConfig) -> Result<Self, OpenError> {
        metrics::install();
        let document = |e: &dyn std::fmt::Display| OpenError::Document(e.to_string());
        let document_yaml = openapi::document_yaml().map_err(|e| document(&e))?;
        let document_json = openapi::document_json().map_err(|e| document(&e))?;
        let store = Store::open(&config.data_dir, &config.store)?;
        for line in store.recovery() {
            tracing::warn!(recovered = line, "the data directory was repaired");
        }
        let keys = Keyring::new(store.api_keys()?);
        if auth::needs_a_key_to_start(&config) && keys.is_empty() {
            return Err(OpenError::Unguarded {
                listen: config.listen,
                data: config.data_dir,
            });
        }
        let audit = Audit::open(&config.data_dir).map_err(OpenError::Audit)?;
        if let Some(why) = recovery_mode::reason(&config, &store) {
            store.enter_recovery_mode(why);
        }
        let jobs = match Jobs::start(store.clone(), config.job_options()) {
            // The catalogue is there, or the store had not opened: better that than nothing.
            Err(JobError::Store(error)) if store.recovery_mode().is_none() => {
                store.enter_recovery_mode(format!("the index and the jobs could not be read: {error}"));
                Jobs::start(store.clone(), config.job_options())?
            }
            other => other?,
        };
        let pool = |name| {
            Compute::new(ComputeOptions {
                name,
                threads: config.query_threads,
                queue: config.query_queue,
                wait: config.query_wait,
            })
        };
        let (compute, unpacking) = (pool("query")?, pool("unpack")?);
        let memory = MemoryBudget::new(config.memory_bytes);
        Ok(Self(Arc::new(Parts {
            memory,
            store,
            keys,
            limits: Limits::new(config.key_limits),
            audit,
            connections: Arc::new(Semaphore::new(
                config.max_connections.clamp(1, Semaphore::MAX_PERMITS),
            )),
            jobs,
            compute,
            unpacking,
            catalogue: Mutex::new(()),
            stopping: CancellationToken::new(),
            document_yaml,
            document_json,
            config,
        })))
    }

    /// Runs something that waits for the disk, off tokio's threads.
    ///
    /// # Errors
    /// Its own, and `internal` where it panicked.
    pub async fn blocking<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Parts) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let state = self.clone();
        // Housekeeping, which no request asks for, is no trace.
        let span = match tracing::Span::current() {
            none if none.is_none() => none,
            _ => tracing::info_span!("store"),
        };
        match tokio::task::spawn_blocking(move || span.in_scope(|| work(&state))).await {
            Ok(result) => result,
            Err(error) => {
                metrics::count_panic();
                Err(Problem::internal(error))
            }
        }
    }

    /// Whether the service can answer.
    pub fn readiness(&self) -> Readiness {
        let store = match self.store.health() {
            Health::Ready => None,
            Health::ReadOnly { why } if self.store.recovery_mode().is_some() => Some(why),
            Health::ReadOnly { why } => Some(format!("read-only since a write failed: {why}")),
        };
        let worker = (!self.jobs.is_running()).then(|| "the indexing worker is not running".to_owned());
        let stopping = self
            .stopping
            .is_cancelled()
            .then(|| "the service is shutting down".to_owned());
        Readiness {
            checks: vec![("store", store), ("worker", worker), ("lifecycle", stopping)],
        }
    }
}
