//! The service put together: every part is opened and started here.

use super::admission::{Compute, ComputeOptions};
use super::audit::Audit;
use super::auth;
use super::config::ServiceConfig;
use super::connections::Connections;
use super::keyring::Keyring;
use super::limits::Limits;
use super::local_access::LocalToken;
use super::route::operations;
use super::routes::routes;
use super::state::{AppState, Parts};
use super::{audit, metrics, openapi, recovery_mode};
use crate::jobs::{JobError, Jobs};
use crate::store::{Health, Store, StoreError};
use shapelex_core::memory::MemoryBudget;
use std::net::SocketAddr;
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

impl AppState {
    /// Opens the data directory and starts the worker. Blocks on the disk.
    ///
    /// # Errors
    /// [`OpenError`] where any part could not be started.
    pub fn open(config: ServiceConfig) -> Result<Self, OpenError> {
        let table = routes();
        metrics::install(&operations(&table));
        let document = |e: &dyn std::fmt::Display| OpenError::Document(e.to_string());
        let description = openapi::document(table);
        let document_yaml = description.to_yaml().map_err(|e| document(&e))?;
        let document_json = description.to_pretty_json().map_err(|e| document(&e))?;
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
        Ok(Self::new(Parts {
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
        }))
    }
}
