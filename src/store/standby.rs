//! The catalogue without the engine: rebuilt in memory from the catalogue log, to be read only.
//!
//! The engine writes when it opens and sometimes when it reads. Where the disk is full or may not be written, it cannot
//! be used; the catalogue log can still be read. Classes, shapes and API keys come from the log. Jobs, dictionaries and
//! the generation are not in it, and reading them fails with the reason, so that a record that exists is never
//! reported as missing.

use super::backend::{Backend, Batch, Entry};
use super::ordered_map::OrderedMap;
use super::payload::Number;
use super::{StoreError, catalogue_log, entry, event, keys};
use std::path::Path;
use std::sync::{PoisonError, RwLock};

/// What the log gives back.
const IN_LOG: [&[u8]; 10] = [
    keys::CLASS,
    keys::NAME,
    keys::SHAPE,
    keys::OWNER,
    keys::IDENTITY,
    keys::REFERENCE,
    keys::API_KEY,
    keys::META_LAST_GENERATION,
    keys::META_PARAMETERS,
    keys::META_SEQUENCE,
];

/// Records of the catalogue in memory.
pub(super) struct Standby {
    map: RwLock<OrderedMap>,
    why: StoreError,
}

impl Standby {
    /// Reads the log's events up to the number `last`. `why` is what keeps the engine from being used.
    ///
    /// # Errors
    /// `why` where there is no log; a failure of reading it.
    pub fn from_log(log: &Path, last: u64, why: StoreError) -> Result<Self, StoreError> {
        if !log.exists() {
            return Err(why);
        }
        let standby = Self {
            map: RwLock::default(),
            why,
        };
        let scan = catalogue_log::read(log, |number, event| {
            if number <= last {
                let batch = event::stage(&standby, &event)?;
                let mut map = standby.map.write().unwrap_or_else(PoisonError::into_inner);
                map.apply(&batch);
            }
            Ok(())
        })?;
        let mut batch = Batch::default();
        let sequence = Number(scan.last.min(last));
        entry::put(&mut batch, keys::META_SEQUENCE.to_vec(), &sequence)?;
        standby
            .map
            .write()
            .unwrap_or_else(PoisonError::into_inner)
            .apply(&batch);
        for (line, detail) in &scan.damaged {
            tracing::warn!(line, detail, "a line of the catalogue log could not be read");
        }
        Ok(standby)
    }

    fn given_back(&self, prefix: &[u8]) -> Result<(), StoreError> {
        if IN_LOG.iter().any(|family| prefix.starts_with(family)) {
            return Ok(());
        }
        Err(self.why.clone())
    }
}

impl Backend for Standby {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, StoreError> {
        self.given_back(key)?;
        Ok(self.map.read().unwrap_or_else(PoisonError::into_inner).get(key))
    }

    fn scan(&self, prefix: &[u8], after: Option<&[u8]>, limit: usize) -> Result<Vec<Entry>, StoreError> {
        self.given_back(prefix)?;
        let map = self.map.read().unwrap_or_else(PoisonError::into_inner);
        Ok(map.scan(prefix, after, limit))
    }

    fn scan_back(
        &self,
        prefix: &[u8],
        before: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Entry>, StoreError> {
        self.given_back(prefix)?;
        let map = self.map.read().unwrap_or_else(PoisonError::into_inner);
        Ok(map.scan_back(prefix, before, limit))
    }

    fn apply(&self, _: &Batch) -> Result<(), StoreError> {
        Err(self.why.clone())
    }

    fn flush(&self) -> Result<(), StoreError> {
        Err(self.why.clone())
    }

    fn reopen(&self, _: &mut dyn FnMut() -> Result<(), StoreError>) -> Result<(), StoreError> {
        Err(self.why.clone())
    }
}
