//! From read-only back to writable, without opening the store anew.

use super::open::settle;
use super::{Store, StoreError, snapshot};
use std::sync::PoisonError;

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
        let failure = &self.inner.failure;
        failure.take_reserve()?;
        let _files = self.inner.files.write().unwrap_or_else(PoisonError::into_inner);
        let mut writer = self.inner.writer();
        let mut notes = Vec::new();
        // A switch to a snapshot may be what met the full disk.
        let settled = (self.inner.backend)
            .reopen(&mut || snapshot::go_on(self.path()))
            .and_then(|()| settle(self.path(), &*self.inner.backend, &mut notes));
        *writer = settled.map_err(|error| failure.remember(error))?;
        failure.acknowledge(writer.sequence);
        // A read that met the full disk meanwhile has given the reserve up; one that meets it later says so itself.
        let _space = failure.hold_space();
        if !failure.has_reserve() {
            return Err(StoreError::Full {
                detail: "keep the reserve of disk space".to_owned(),
            });
        }
        for line in notes {
            tracing::warn!(line, "recovered");
        }
        failure.replace(None);
        tracing::warn!("there is space again; the store takes writes");
        Ok(())
    }
}
