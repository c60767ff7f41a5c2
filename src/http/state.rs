//! What every handler shares.

use super::admission::Compute;
use super::audit::Audit;
use super::config::ServiceConfig;
use super::connections::Connections;
use super::keyring::Keyring;
use super::limits::Limits;
use super::local_access::LocalToken;
use super::problem::Problem;
use super::{metrics, problem_from};
use crate::jobs::Jobs;
use crate::store::{Damage, Health, Store};
use shapelex_core::memory::MemoryBudget;
use std::ops::Deref;
use std::sync::{Arc, Mutex};
use tokio_util::sync::CancellationToken;

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
    /// The service made of these parts.
    pub(super) fn new(parts: Parts) -> Self {
        Self(Arc::new(parts))
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
