//! What every handler shares.

use super::admission::{Compute, ComputeOptions};
use super::audit::Audit;
use super::auth;
use super::config::ServiceConfig;
use super::connections::Connections;
use super::keyring::Keyring;
use super::limits::Limits;
use super::local_access::LocalToken;
use super::problem::Problem;
use super::{audit, metrics, openapi, problem_from, recovery_mode};
use crate::jobs::{JobError, Jobs};
use crate::store::{Damage, Health, Store, StoreError};
use shapelex_core::memory::MemoryBudget;
use std::net::SocketAddr;
use std::ops::Deref;
use std::sync::{Arc, Mutex};
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
    /// The system gives no threads for answering.
    #[error("the service's threads could not be started: {0}")]
    Runtime(std::io::Error),
    /// The system gives no threads for queries.
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
    /// The system gives no randomness.
    #[error("there is no randomness for the local token: {0}")]
    Randomness(rand::rand_core::OsError),
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
    /// The connections there are.
    pub connections: Arc<Connections>,
    /// Lets the owner of the data directory in while there is no key.
    pub local_token: LocalToken,
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

/// How a part of the service is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Condition {
    /// It works.
    Well,
    /// It works, and an operator should look at it.
    Degraded(String),
    /// It does not work.
    Down(String),
}

/// What the service needs to answer, and whether it has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Readiness {
    /// Every part and how it is.
    pub checks: Vec<(&'static str, Condition)>,
}

impl Readiness {
    /// Whether no part is down.
    pub fn is_ready(&self) -> bool {
        !self.checks.iter().any(|(_, c)| matches!(c, Condition::Down(_)))
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
        let store = match Store::open(&config.data_dir, &config.store) {
            // What cannot be written can still be shown.
            Err(denied @ StoreError::Denied { .. }) => {
                let store = Store::open_read_only(&config.data_dir, denied)?;
                tracing::error!(
                    why = store.recovery_mode(),
                    "recovery mode: only the catalogue is served"
                );
                store
            }
            opened => opened?,
        };
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
        let audit = match Audit::open(&config.data_dir) {
            // Nothing is changed for now; the file is opened at the first entry.
            Err(error) if store.health() != Health::Ready => {
                tracing::warn!(%error, "the audit log cannot be opened yet");
                Audit::later(&config.data_dir)
            }
            opened => opened.map_err(|error| {
                let path = config.data_dir.join(audit::FILE);
                StoreError::io(format!("open the audit log {}", path.display()), &error)
            })?,
        };
        if store.recovery_mode().is_none()
            && let Some(why) = recovery_mode::reason(&config, &store)
        {
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
            connections: Arc::new(Connections::new(config.connection_limits())),
            local_token: LocalToken::new().map_err(OpenError::Randomness)?,
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

    /// Refuses a query where the index is not loaded, so that it is never taken for an empty one.
    ///
    /// # Errors
    /// `recovery_mode`, or `storage_full` where the disk was too full to read the index.
    pub fn require_index(&self) -> Result<(), Problem> {
        if self.store.recovery_mode().is_some() {
            return Err(problem_from::recovery_mode());
        }
        if self.jobs.is_unread() {
            return Err(problem_from::index_unread());
        }
        Ok(())
    }

    /// Whether the service can answer.
    pub fn readiness(&self) -> Readiness {
        let store = match self.store.health() {
            Health::Ready if self.jobs.is_behind() => Condition::Down(
                "the disk has space again; what it kept from being done is being done".to_owned(),
            ),
            Health::Ready => Condition::Well,
            Health::ReadOnly { why } if self.store.recovery_mode().is_some() => Condition::Down(why),
            Health::ReadOnly { why } => Condition::Down(format!("read-only since a write failed: {why}")),
        };
        let worker = match self.jobs.is_running() {
            true => Condition::Well,
            false => Condition::Down("the indexing worker is not running".to_owned()),
        };
        let lifecycle = match self.stopping.is_cancelled() {
            true => Condition::Down("the service is shutting down".to_owned()),
            false => Condition::Well,
        };
        Readiness {
            checks: vec![
                ("store", store),
                ("worker", worker),
                ("lifecycle", lifecycle),
                ("integrity", integrity(&self.store.damage())),
            ],
        }
    }
}

/// Whether what is stored is what was stored. Damage keeps nothing else from working.
fn integrity(damage: &Damage) -> Condition {
    if damage.is_empty() {
        return Condition::Well;
    }
    let mut found = Vec::new();
    if !damage.originals.is_empty() {
        found.push(format!(
            "{} uploaded files are damaged or gone; upload them again",
            damage.originals.len()
        ));
    }
    if !damage.records.is_empty() {
        found.push(format!(
            "{} records are damaged; a restart rebuilds them",
            damage.records.len()
        ));
    }
    Condition::Degraded(format!("{}; the log names each", found.join("; ")))
}
