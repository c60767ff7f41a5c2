//! From read-only back to writable, without opening the store anew.
//!
//! A reserve file holds a few megabytes of the disk. It is given up when the disk turns out to be full, since the engine
//! may have to write in order to read: it finishes the splits of its pages, and closes and opens in good order, only if
//! there is space. Taking the reserve again is how a store finds out that there is space.

use super::open::settle;
use super::{Store, StoreError, files, snapshot};
use std::path::Path;
use std::sync::PoisonError;

const RESERVE: &str = "reserve";
/// More than the engine and the log take at once.
const RESERVE_BYTES: usize = 4 << 20;

/// Takes the reserve, where it is not there already.
pub(super) fn take_reserve(data: &Path) -> Result<(), StoreError> {
    let path = data.join(RESERVE);
    if std::fs::metadata(&path).is_ok_and(|file| file.len() == RESERVE_BYTES as u64) {
        return Ok(());
    }
    // Not zeros, which a file system may keep without taking space.
    files::write_durably(&path, &vec![0x5a; RESERVE_BYTES])
}

/// Gives the reserve up.
pub(super) fn release_reserve(data: &Path) {
    if let Err(error) = files::remove(&data.join(RESERVE)) {
        tracing::error!(%error, "the reserve of disk space was not given up");
    }
}

impl Store {
    /// Makes a store writable again that is read-only because the disk was full: looks whether there is space, lets
    /// go of everything in memory, and brings records and log to the same state as a start does. Reads wait
    /// meanwhile. A store that takes writes is left alone.
    ///
    /// # Errors
    /// [`StoreError::Full`] where there is no space yet; [`StoreError::ReadOnly`] after any other failure, since what
    /// the system holds in memory may not be what the disk holds, and only a start afresh tells;
    /// [`StoreError::RecoveryMode`], which only ends with the process; a failure of opening.
    pub fn recover(&self) -> Result<(), StoreError> {
        match self.inner.writable() {
            Ok(()) => return Ok(()),
            Err(StoreError::Full { .. }) => {}
            Err(other) => return Err(other),
        }
        take_reserve(self.path())?;
        let _files = self.inner.files.write().unwrap_or_else(PoisonError::into_inner);
        let mut writer = self.inner.writer();
        // A switch to a snapshot may be what met the full disk.
        self.inner.backend.reopen(&mut || snapshot::go_on(self.path()))?;
        let mut notes = Vec::new();
        *writer = settle(self.path(), &*self.inner.backend, &mut notes)?;
        for line in notes {
            tracing::warn!(line, "recovered");
        }
        *self.inner.failure() = None;
        tracing::warn!("there is space again; the store takes writes");
        Ok(())
    }
}
