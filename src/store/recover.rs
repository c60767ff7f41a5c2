//! From read-only back to writable, without opening the store anew.

use super::open::settle;
use super::{Store, StoreError, files, snapshot};
use std::path::Path;
use std::sync::PoisonError;

/// Written and removed again to see whether there is space: more than the engine and the log take at once.
const PROBE_BYTES: usize = 4 << 20;

impl Store {
    /// Makes a store writable again that is read-only because the disk was full: looks whether there is space, lets
    /// go of everything in memory, and brings records and log to the same state as a start does. Reads wait
    /// meanwhile. A store that takes writes is left alone.
    ///
    /// # Errors
    /// [`StoreError::Full`] where there is no space yet; [`StoreError::ReadOnly`] after any other failure, since what
    /// the system holds in memory may not be what the disk holds, and only a start afresh tells; a failure of opening.
    pub fn recover(&self) -> Result<(), StoreError> {
        match self.inner.writable() {
            Ok(()) => return Ok(()),
            Err(StoreError::Full { .. }) => {}
            Err(other) => return Err(other),
        }
        probe(self.path())?;
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

/// Whether a few megabytes can be written.
fn probe(data: &Path) -> Result<(), StoreError> {
    let path = data.join(".writing-probe");
    let written = files::write_durably(&path, &vec![0x5a; PROBE_BYTES]);
    files::remove(&path)?;
    written
}
