//! The records as the store uses them: in the engine or, for as long as a full disk keeps that from being opened, in
//! memory as the catalogue log has them.

use super::backend::{Backend, Batch, Entry};
use super::failure::Failure;
use super::layout::LOG;
use super::sled_backend::SledBackend;
use super::standby::Standby;
use super::{StoreError, StoreOptions, rebuild};
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};

#[derive(Clone)]
enum Current {
    Engine(Arc<SledBackend>),
    Standby(Arc<Standby>),
}

impl Current {
    fn backend(&self) -> &dyn Backend {
        match self {
            Self::Engine(engine) => &**engine,
            Self::Standby(standby) => &**standby,
        }
    }
}

/// See the module.
pub(super) struct Records {
    data: PathBuf,
    options: StoreOptions,
    failure: Arc<Failure>,
    current: RwLock<Current>,
}

impl Records {
    /// Opens the records of a data directory and rebuilds them where they are damaged.
    ///
    /// # Errors
    /// What keeps them from being opened. A full disk only where there is no log to read instead.
    pub fn open(
        data: &Path,
        options: &StoreOptions,
        failure: &Arc<Failure>,
        recovery: &mut Vec<String>,
    ) -> Result<Self, StoreError> {
        let current = match rebuild::open_records(data, options, failure, recovery) {
            Ok(engine) => Current::Engine(Arc::new(engine)),
            Err(full @ StoreError::Full { .. }) => {
                tracing::warn!(%full, "the records cannot be opened; the catalogue is read from its log");
                failure.remember(full.clone());
                Current::Standby(Arc::new(Standby::from_log(&data.join(LOG), u64::MAX, full)?))
            }
            Err(other) => return Err(other),
        };
        Ok(Self {
            data: data.to_owned(),
            options: options.clone(),
            failure: Arc::clone(failure),
            current: RwLock::new(current),
        })
    }

    /// Reads the whole log in the engine's place, where the engine could not be brought to the state of the log.
    ///
    /// # Errors
    /// `why` where there is no log; a failure of reading it.
    pub fn read_log_instead(&self, why: StoreError) -> Result<(), StoreError> {
        let standby = Standby::from_log(&self.data.join(LOG), u64::MAX, why)?;
        let mut place = self.current.write().unwrap_or_else(PoisonError::into_inner);
        *place = Current::Standby(Arc::new(standby));
        Ok(())
    }

    fn current(&self) -> Current {
        self.current
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// An engine that cannot read for want of space, not even opened anew, gives way to the log.
    fn read<T>(&self, work: impl Fn(&dyn Backend) -> Result<T, StoreError>) -> Result<T, StoreError> {
        let current = self.current();
        let full = match (work(current.backend()), &current) {
            (Err(full @ StoreError::Full { .. }), Current::Engine(_)) => full,
            (done, _) => return done,
        };
        drop(current);
        self.failure.remember(full.clone());
        let mut place = self.current.write().unwrap_or_else(PoisonError::into_inner);
        if let Current::Engine(_) = &*place {
            self.stand_by(&mut place, full)?;
        }
        let now = place.clone();
        drop(place);
        work(now.backend())
    }

    /// Reads the log in the engine's place: what was acknowledged, without a change that is being refused.
    fn stand_by(&self, place: &mut Current, why: StoreError) -> Result<(), StoreError> {
        tracing::warn!(%why, "the records cannot be read; the catalogue is read from its log");
        let standby = Standby::from_log(&self.data.join(LOG), self.failure.acknowledged(), why)?;
        *place = Current::Standby(Arc::new(standby));
        Ok(())
    }
}

impl Backend for Records {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, StoreError> {
        self.read(|backend| backend.get(key))
    }

    fn scan(&self, prefix: &[u8], after: Option<&[u8]>, limit: usize) -> Result<Vec<Entry>, StoreError> {
        self.read(|backend| backend.scan(prefix, after, limit))
    }

    fn scan_back(
        &self,
        prefix: &[u8],
        before: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Entry>, StoreError> {
        self.read(|backend| backend.scan_back(prefix, before, limit))
    }

    fn apply(&self, batch: &Batch) -> Result<(), StoreError> {
        self.current().backend().apply(batch)
    }

    fn flush(&self) -> Result<(), StoreError> {
        self.current().backend().flush()
    }

    fn reopen(&self, meanwhile: &mut dyn FnMut() -> Result<(), StoreError>) -> Result<(), StoreError> {
        let mut place = self.current.write().unwrap_or_else(PoisonError::into_inner);
        if let Current::Engine(engine) = place.clone() {
            return match engine.reopen(meanwhile) {
                Err(full @ StoreError::Full { .. }) if !engine.is_open() => {
                    drop(engine);
                    self.stand_by(&mut place, full.clone())?;
                    Err(full)
                }
                done => done,
            };
        }
        meanwhile()?;
        let mut notes = Vec::new();
        let engine = rebuild::open_records(&self.data, &self.options, &self.failure, &mut notes)?;
        for line in notes {
            tracing::warn!(line, "recovered");
        }
        *place = Current::Engine(Arc::new(engine));
        Ok(())
    }
}
