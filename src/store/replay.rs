//! Applying the catalogue log to the records.

use super::backend::Backend;
use super::catalogue_log::{self, LogScan};
use super::entry::{get, put};
use super::event;
use super::payload::Number;
use super::{StoreError, keys};
use std::path::Path;

/// Replayed events between two flushes.
const REPLAY_FLUSH: u64 = 256;

/// The number of the last event the records have seen.
pub(super) fn sequence(backend: &dyn Backend) -> Result<u64, StoreError> {
    let sequence: Option<Number> = get(backend, keys::META_SEQUENCE)?;
    Ok(sequence.map_or(0, |n| n.0))
}

/// Applies the events of the log the records have not seen. Returns what the log holds and how many were applied.
pub(super) fn replay(backend: &dyn Backend, log: &Path) -> Result<(LogScan, u64), StoreError> {
    let applied = sequence(backend)?;
    let mut replayed = 0;
    let scan = catalogue_log::read(log, |number, event| {
        if number > applied {
            let mut batch = event::stage(backend, &event)?;
            put(&mut batch, keys::META_SEQUENCE.to_vec(), &Number(number))?;
            backend.apply(&batch)?;
            replayed += 1;
            if replayed % REPLAY_FLUSH == 0 {
                backend.flush()?;
            }
        }
        Ok(())
    })?;
    if replayed > 0 {
        backend.flush()?;
    }
    Ok((scan, replayed))
}
